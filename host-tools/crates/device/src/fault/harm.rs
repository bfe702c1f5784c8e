//! What is done to frames, how often, and how often it was.

use std::time::Duration;

/// How often frames of one way come to harm, in parts of 1,000.
///
/// A frame comes to one kind of harm at most, so the rates add up to the share that
/// is harmed. Where they add up to more than 1,000, the first named come first.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Harm {
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

/// What happens to a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Fate {
    Drop,
    Duplicate,
    Corrupt,
    Reorder,
    Delay,
    Cut,
    Pass,
}

impl Harm {
    /// So many parts of 1,000 come to harm, dropped, duplicated, corrupted, reordered
    /// and cut alike often.
    #[must_use]
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

    /// Nothing arrives.
    #[must_use]
    pub fn silence() -> Self {
        Self {
            drop: 1_000,
            ..Self::default()
        }
    }

    pub(super) fn fate(&self, random: &mut fastrand::Rng) -> Fate {
        let mut draw = random.u32(..1_000);
        for (rate, fate) in [
            (self.drop, Fate::Drop),
            (self.duplicate, Fate::Duplicate),
            (self.corrupt, Fate::Corrupt),
            (self.reorder, Fate::Reorder),
            (self.delay, Fate::Delay),
            (self.cut, Fate::Cut),
        ] {
            match draw.checked_sub(rate.into()) {
                Some(rest) => draw = rest,
                None => return fate,
            }
        }
        Fate::Pass
    }
}

/// All that goes wrong on a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Faults {
    /// To frames from host to device.
    pub to_device: Harm,
    /// To frames from device to host.
    pub to_host: Harm,
    /// The line is unplugged after so many frames, both ways together.
    pub unplug_after: Option<u64>,
    /// What is random follows from this.
    pub seed: u64,
}

impl Faults {
    /// The same harm both ways.
    #[must_use]
    pub const fn both_ways(harm: Harm, seed: u64) -> Self {
        Self {
            to_device: harm,
            to_host: harm,
            unplug_after: None,
            seed,
        }
    }

    /// Unplugs the line as well, after so many frames.
    #[must_use]
    pub const fn unplugged_after(mut self, frames: u64) -> Self {
        self.unplug_after = Some(frames);
        self
    }
}

/// How many frames of one way met which fate.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Tally {
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

impl Tally {
    /// Frames that came to harm.
    #[must_use]
    pub const fn harmed(&self) -> u64 {
        self.dropped + self.duplicated + self.corrupted + self.reordered + self.delayed + self.cut
    }

    pub(super) const fn count(&mut self, fate: Fate) {
        self.frames += 1;
        match fate {
            Fate::Drop => self.dropped += 1,
            Fate::Duplicate => self.duplicated += 1,
            Fate::Corrupt => self.corrupted += 1,
            Fate::Reorder => self.reordered += 1,
            Fate::Delay => self.delayed += 1,
            Fate::Cut => self.cut += 1,
            Fate::Pass => {}
        }
    }
}
