//! Yield budget: long work in short pieces.
//!
//! A table is checked while frames arrive. So whoever asks for the check passes
//! `yield_now`: work of his own, done whenever the check has worked for a while. The
//! check counts its work here instead of calling at every step, so that calls are
//! neither far apart nor many, whatever the shape of the table.

/// What work costs, in instructions of a Cortex-M7, rounded up. Counted in the
/// emulator; they need not be exact, only not far too low.
pub(crate) mod cost {
    /// A byte through CRC-32.
    pub(crate) const CRC_BYTE: usize = 16;
    /// A byte through SHA-512.
    pub(crate) const HASH_BYTE: usize = 95;
    /// A sum of two points of the curve.
    pub(crate) const POINT: usize = 8_000;
    /// A square root or an inverse modulo `2^255 - 19`; cannot be interrupted.
    pub(crate) const ROOT: usize = 135_000;
    /// One value looked at.
    pub(crate) const VALUE: usize = 25;
    /// A code made from a response.
    pub(crate) const CODE: usize = 50;
    /// A pair of operator entries.
    pub(crate) const PAIR: usize = 30;
    /// A row of an operator, beside its pairs.
    pub(crate) const ROW: usize = 120;
    /// A function of the basis.
    pub(crate) const FUNCTION: usize = 200;
}

/// Counts work and yields when there was enough.
pub(crate) struct YieldBudget<'p, Y: ?Sized> {
    yield_now: &'p mut Y,
    worked: usize,
}

/// Work between two calls, in instructions. Frames are tens of milliseconds
/// apart, so this could be longer; it is short enough that nobody has to ask.
pub(crate) const STRIDE: usize = 10_000;

impl<'p, Y: FnMut() + ?Sized> YieldBudget<'p, Y> {
    /// Starts counting.
    pub(crate) fn new(yield_now: &'p mut Y) -> Self {
        Self {
            yield_now,
            worked: 0,
        }
    }

    /// `count` pieces of work of `cost` instructions are done.
    #[inline]
    pub(crate) fn spend(&mut self, count: usize, cost: usize) {
        let work = count.saturating_mul(cost);
        self.worked = self.worked.saturating_add(work);
        if self.worked >= STRIDE {
            self.yield_anew();
        }
    }

    #[inline(never)]
    fn yield_anew(&mut self) {
        self.worked = 0;
        (self.yield_now)();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_comes_after_a_stride_of_work_and_not_before() {
        let mut calls = 0;
        let mut yield_now = || calls += 1;
        let mut budget = YieldBudget::new(&mut yield_now);
        for _ in 0..3 * STRIDE {
            budget.spend(1, 1);
        }
        budget.spend(usize::MAX, usize::MAX);
        assert_eq!(calls, 4);
    }
}
