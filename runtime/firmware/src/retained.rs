//! Retained memory: a few words of RAM that outlive a restart, because the start-up code
//! leaves them alone.

use core::sync::atomic::{AtomicU32, Ordering};

unsafe extern "C" {
    /// The retained words: a symbol of `memory.x`, which keeps 256 bytes there.
    static __retained_start: [AtomicU32; word::COUNT];
}

/// In the first word once the others mean something.
const MAGIC: u32 = u32::from_le_bytes(*b"kept");

mod word {
    pub(super) const MAGIC: usize = 0;
    pub(super) const CAUSE: usize = 1;
    pub(super) const PLACE: usize = 2;
    pub(super) const WATCHDOG_RESETS: usize = 3;
    pub(super) const CRASHES: usize = 4;
    pub(super) const COUNT: usize = 5;
}

/// Why the device starts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, defmt::Format)]
#[repr(u32)]
pub enum Cause {
    /// It was switched on, or somebody pressed its button.
    Outside = 0,
    /// The frame loop hung.
    Watchdog = 1,
    /// A panic. None is known to be possible.
    Panic = 2,
    /// A fault of the processor.
    HardFault = 3,
}

/// The retained words.
#[derive(Clone, Copy)]
pub struct Retained {
    words: &'static [AtomicU32],
}

/// The last restart.
#[derive(Clone, Copy, Debug, defmt::Format)]
pub struct Restart {
    /// Why.
    pub cause: Cause,
    /// Where the program was: an address or a line, 0 if unknown.
    pub place: u32,
    /// Watchdog restarts since the device was switched on.
    pub watchdog_resets: u32,
    /// Restarts in a row that nobody asked for, with less than a minute between them.
    pub crashes: u32,
}

impl Retained {
    /// The words, from wherever they are needed.
    #[must_use]
    pub fn get() -> Self {
        // SAFETY: memory.x keeps aligned memory for this, which nothing else uses;
        // any value is a value of an atomic.
        let words = unsafe { &__retained_start };
        Self { words }
    }

    /// Notes why the device is about to restart.
    pub fn set_cause(self, cause: Cause, place: u32) {
        self.set(word::PLACE, place);
        self.set(word::CAUSE, cause as u32);
    }

    /// Reads why the device started, once, and keeps count.
    #[must_use]
    pub fn begin(self) -> Restart {
        if self.word(word::MAGIC) != MAGIC {
            for at in 0..word::COUNT {
                self.set(at, 0);
            }
            self.set(word::MAGIC, MAGIC);
        }
        let cause = match self.word(word::CAUSE) {
            1 => Cause::Watchdog,
            2 => Cause::Panic,
            3 => Cause::HardFault,
            _ => Cause::Outside,
        };
        let place = self.word(word::PLACE);
        self.set_cause(Cause::Outside, 0);
        if cause == Cause::Watchdog {
            self.count(word::WATCHDOG_RESETS);
        }
        if cause == Cause::Outside {
            self.forget_crashes();
        } else {
            self.count(word::CRASHES);
        }
        Restart {
            cause,
            place,
            watchdog_resets: self.word(word::WATCHDOG_RESETS),
            crashes: self.word(word::CRASHES),
        }
    }

    /// The device runs well: crashes in a row are counted anew.
    pub fn forget_crashes(self) {
        self.set(word::CRASHES, 0);
    }

    fn count(self, at: usize) {
        self.set(at, self.word(at).saturating_add(1));
    }

    fn word(self, at: usize) -> u32 {
        let word = self.words.get(at);
        word.map_or(0, |word| word.load(Ordering::Relaxed))
    }

    fn set(self, at: usize, value: u32) {
        if let Some(word) = self.words.get(at) {
            word.store(value, Ordering::Relaxed);
        }
    }
}
