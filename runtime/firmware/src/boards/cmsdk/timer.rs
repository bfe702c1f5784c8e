//! Timer 0 as the clock.

use super::{HERTZ, Registers};
use crate::board::Clock;
use core::cell::Cell;

mod register {
    pub(super) const CONTROL: usize = 0x0;
    pub(super) const VALUE: usize = 0x4;
    pub(super) const RELOAD: usize = 0x8;
}

/// The timer counts down through 32 bits, in 171 seconds. It must be read more
/// often than that, or a round is lost.
pub struct Timer {
    registers: Registers,
    last: Cell<u64>,
}

impl Timer {
    pub(super) fn new(registers: Registers) -> Self {
        registers.write(register::RELOAD, u32::MAX);
        registers.write(register::VALUE, u32::MAX);
        registers.write(register::CONTROL, 1);
        Self {
            registers,
            last: Cell::new(0),
        }
    }
}

impl Clock for Timer {
    const HERTZ: u32 = HERTZ;

    fn ticks(&self) -> u64 {
        let last = self.last.get();
        let low = !self.registers.read(register::VALUE);
        // The low halves alone tell how far it has come since.
        let now = last + u64::from(low.wrapping_sub(last as u32));
        self.last.set(now);
        now
    }
}
