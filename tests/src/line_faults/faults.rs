//! Line faults: rates and kinds of line faults, and counts of those that happened.

use std::time::Duration;

/// How often frames of one direction are damaged, in parts of 1,000.
///
/// A frame has one fault at most, so the rates add up to the share of faulty frames.
/// Where they add up to more than 1,000, the first named come first.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct FaultRates {
    /// It never arrives.
    pub drop: u16,
    /// It arrives twice.
    pub duplicate: u16,
    /// One to four bytes in a row have changed, the delimiter among them or not.
    pub corrupt: u16,
    /// It arrives after the frame that follows it, or .02 s late if none does.
    pub reorder: u16,
    /// It arrives late, by [`delay_by`](Self::delay_by); others pass it meanwhile.
    pub delay: u16,
    /// It ends early, delimiter included: what is left runs into the next frame.
    pub cut: u16,
    /// How late the delayed ones are.
    pub delay_by: Duration,
}

/// A fault of one frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum FaultKind {
    Drop,
    Duplicate,
    Corrupt,
    Reorder,
    Delay,
    Cut,
}

impl FaultRates {
    /// So many parts of 1,000 are faulty: dropped, duplicated, corrupted, reordered
    /// and cut alike often.
    pub const fn evenly(parts: u16) -> Self {
        // What five does not divide goes to the first.
        let each = parts / 5;
        Self {
            drop: parts - 4 * each,
            duplicate: each,
            corrupt: each,
            reorder: each,
            delay: 0,
            cut: each,
            delay_by: Duration::ZERO,
        }
    }

    /// No faults but those that are set.
    pub fn only(set: impl FnOnce(&mut Self)) -> Self {
        let mut rates = Self::default();
        set(&mut rates);
        rates
    }

    /// Nothing arrives.
    pub fn silence() -> Self {
        Self::only(|rates| rates.drop = 1_000)
    }

    /// The fault of the next frame, if it has one.
    pub(super) fn draw(&self, random: &mut fastrand::Rng) -> Option<FaultKind> {
        let mut draw = random.u32(..1_000);
        for (rate, kind) in [
            (self.drop, FaultKind::Drop),
            (self.duplicate, FaultKind::Duplicate),
            (self.corrupt, FaultKind::Corrupt),
            (self.reorder, FaultKind::Reorder),
            (self.delay, FaultKind::Delay),
            (self.cut, FaultKind::Cut),
        ] {
            match draw.checked_sub(rate.into()) {
                Some(rest) => draw = rest,
                None => return Some(kind),
            }
        }
        None
    }
}

/// All that goes wrong on a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Faults {
    /// Of frames from host to device.
    pub to_device: FaultRates,
    /// Of frames from device to host.
    pub to_host: FaultRates,
    /// The line is unplugged after so many frames of both directions together.
    pub unplug_after: Option<u64>,
    /// What is random follows from this.
    pub seed: u64,
}

impl Faults {
    /// The same rates in both directions.
    pub const fn both_ways(rates: FaultRates, seed: u64) -> Self {
        Self {
            to_device: rates,
            to_host: rates,
            unplug_after: None,
            seed,
        }
    }

    /// Unplugs the line as well, after so many frames.
    pub const fn unplugged_after(mut self, frames: u64) -> Self {
        self.unplug_after = Some(frames);
        self
    }
}

/// Frames of one direction, and how many of them had which fault.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct FaultCounts {
    /// Came from the sender.
    pub frames: u64,
    /// Of these: never arrived.
    pub dropped: u64,
    /// Arrived twice.
    pub duplicated: u64,
    /// Arrived with other bytes.
    pub corrupted: u64,
    /// Were to arrive after the next.
    pub reordered: u64,
    /// Were to arrive late.
    pub delayed: u64,
    /// Arrived without their end.
    pub cut: u64,
}

impl FaultCounts {
    /// Frames that had a fault.
    pub const fn faulty(&self) -> u64 {
        self.dropped + self.duplicated + self.corrupted + self.reordered + self.delayed + self.cut
    }

    pub(super) const fn count(&mut self, fault: Option<FaultKind>) {
        self.frames += 1;
        match fault {
            Some(FaultKind::Drop) => self.dropped += 1,
            Some(FaultKind::Duplicate) => self.duplicated += 1,
            Some(FaultKind::Corrupt) => self.corrupted += 1,
            Some(FaultKind::Reorder) => self.reordered += 1,
            Some(FaultKind::Delay) => self.delayed += 1,
            Some(FaultKind::Cut) => self.cut += 1,
            None => {}
        }
    }
}
