//! Late frames: counts those that do not come when they should.

/// Counts the periods in which a source owed a frame and none came.
///
/// A frame may come half a period later than the rate says; what comes later
/// than that is late, and each further period without one counts again. A source
/// silent for [`Lateness::GONE`] periods is gone rather than late, and counts no
/// more until it is back.
#[derive(Clone, Debug)]
pub struct Lateness {
    period: u64,
    due: Option<u64>,
    in_a_row: u32,
    late: u32,
}

impl Lateness {
    /// Periods without a frame after which there is no source any more.
    pub const GONE: u32 = 30;

    /// For frames every `period` ticks of a clock.
    #[must_use]
    pub const fn new(period: u64) -> Self {
        Self {
            period,
            due: None,
            in_a_row: 0,
            late: 0,
        }
    }

    /// A frame was there at `now`.
    pub const fn arrived(&mut self, now: u64) {
        self.due = Some(now.saturating_add(self.period + self.period / 2));
        self.in_a_row = 0;
    }

    /// No frame is there at `now`; returns whether that is one more late one.
    pub const fn waiting(&mut self, now: u64) -> bool {
        let Some(due) = self.due else {
            return false;
        };
        if now <= due {
            return false;
        }
        self.late = self.late.saturating_add(1);
        self.in_a_row += 1;
        self.due = if self.in_a_row < Self::GONE {
            Some(due.saturating_add(self.period))
        } else {
            None
        };
        true
    }

    /// Late frames so far.
    #[must_use]
    pub const fn late(&self) -> u32 {
        self.late
    }

    /// Whether frames are coming.
    #[must_use]
    pub const fn has_source(&self) -> bool {
        self.due.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_on_time_are_never_late() {
        let mut lateness = Lateness::new(100);
        for frame in 0..1_000_u64 {
            // Jitter of up to half a period each way.
            let now = frame * 100 + (frame * 37 % 50);
            assert!(!lateness.waiting(now));
            lateness.arrived(now);
        }
        assert_eq!(lateness.late(), 0);
    }

    #[test]
    fn every_missed_period_counts_once() {
        let mut lateness = Lateness::new(100);
        lateness.arrived(0);
        for now in 1..=550 {
            lateness.waiting(now);
        }
        // Due at 150, 250, 350, 450 and 550; the last is not over yet.
        assert_eq!(lateness.late(), 4);
    }

    #[test]
    fn a_source_that_went_away_is_not_late_for_ever() {
        let mut lateness = Lateness::new(100);
        lateness.waiting(1_000);
        assert_eq!(lateness.late(), 0, "there was no source yet");
        lateness.arrived(0);
        for now in 0..100_000 {
            lateness.waiting(now);
        }
        assert_eq!(lateness.late(), Lateness::GONE);
        assert!(!lateness.has_source());
        lateness.arrived(100_000);
        assert!(lateness.has_source());
    }
}
