//! The watchdog.
//!
//! It counts down twice: the first time ends in a non-maskable interrupt, which
//! leaves a note of where the program was; the second time in a reset.

use super::{HERTZ, Registers};
use crate::board::Watchdog;
use crate::retained::{Cause, Retained};
use cortex_m_rt::exception;

mod register {
    pub(super) const LOAD: usize = 0x0;
    pub(super) const CONTROL: usize = 0x8;
    pub(super) const INTERRUPT_CLEAR: usize = 0xC;
    pub(super) const LOCK: usize = 0xC00;
}

/// Written to [`register::LOCK`], lets the other registers be written.
const UNLOCK: u32 = 0x1ACC_E551;

/// Count, interrupt at the first end, reset at the second.
const RUN: u32 = 0b11;

/// The watchdog.
pub struct WatchdogTimer {
    registers: Registers,
}

impl WatchdogTimer {
    pub(super) const fn new(registers: Registers) -> Self {
        Self { registers }
    }

    fn unlocked(&self, work: impl FnOnce(Registers)) {
        self.registers.write(register::LOCK, UNLOCK);
        work(self.registers);
        self.registers.write(register::LOCK, 0);
    }
}

impl Watchdog for WatchdogTimer {
    fn start(&mut self, milliseconds: u32) {
        let ticks = milliseconds.saturating_mul(HERTZ / 1_000);
        self.unlocked(|registers| {
            registers.write(register::LOAD, ticks);
            registers.write(register::CONTROL, RUN);
        });
    }

    fn pet(&mut self) {
        self.unlocked(|registers| registers.write(register::INTERRUPT_CLEAR, 1));
    }
}

/// The watchdog has not been petted for one of its two rounds.
#[exception]
unsafe fn NonMaskableInt() {
    // The loop will not come back by itself: whatever pets the watchdog now would
    // only hide that. The second round resets the board.
    Retained::get().set_cause(Cause::Watchdog, 0);
    loop {
        cortex_m::asm::nop();
    }
}
