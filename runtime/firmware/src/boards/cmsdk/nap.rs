//! Sleep until the next interrupt, at most a fifth of a millisecond.
//!
//! The host puts frames into the frame memory without an interrupt, so timer 1
//! wakes the processor to look. A board whose frames come with an interrupt needs
//! no such timer.

use super::interrupts::Interrupt;
use super::{HERTZ, Registers};
use crate::board::Rest;
use cortex_m::peripheral::NVIC;

/// Address of timer 1.
pub(super) const TIMER: usize = 0x4000_1000;

/// Looks a second.
const LOOKS: u32 = 5_000;

/// Count, and interrupt at the end of every round.
const RUN: u32 = 0b1001;

mod register {
    pub(super) const CONTROL: usize = 0x0;
    pub(super) const VALUE: usize = 0x4;
    pub(super) const RELOAD: usize = 0x8;
    pub(super) const INTERRUPT_CLEAR: usize = 0xC;
}

/// The handler's view of the timer.
// SAFETY: timer 1 of application notes 386 and 500; clearing its interrupt is all
// that is done after `new`.
const AWAKE: Registers = unsafe { Registers::at(TIMER) };

/// Timer 1.
pub struct Nap(());

impl Nap {
    pub(super) fn new(registers: Registers) -> Self {
        let round = HERTZ / LOOKS - 1;
        registers.write(register::RELOAD, round);
        registers.write(register::VALUE, round);
        registers.write(register::CONTROL, RUN);
        // SAFETY: the handler shares nothing with the loop.
        unsafe { NVIC::unmask(Interrupt::Wake) };
        Self(())
    }
}

impl Rest for Nap {
    fn rest(&mut self) {
        cortex_m::asm::wfi();
    }
}

/// It is time to look.
pub(super) fn woke() {
    AWAKE.write(register::INTERRUPT_CLEAR, 1);
}
