//! The interrupt vectors of the MPS2 boards.

use super::{nap, uart};
use cortex_m::interrupt::InterruptNumber;

/// Interrupts that the firmware uses.
#[derive(Clone, Copy)]
#[repr(u16)]
pub(super) enum Interrupt {
    /// UART 0 has received a byte.
    Receive = 0,
    /// UART 0 has sent a byte.
    Transmit = 1,
    /// Timer 1 has come to its end.
    Wake = 9,
}

// SAFETY: the numbers are those of application notes 386 and 500, each once.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Handlers by interrupt number.
#[used]
// SAFETY: cortex-m-rt wants the vectors behind the exceptions in this section
// under this name; they are functions that take and return nothing.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".vector_table.interrupts")]
static __INTERRUPTS: [unsafe extern "C" fn(); 32] = {
    let mut vectors: [unsafe extern "C" fn(); 32] = [unexpected; 32];
    vectors[Interrupt::Receive as usize] = receive;
    vectors[Interrupt::Transmit as usize] = transmit;
    vectors[Interrupt::Wake as usize] = wake;
    vectors
};

unsafe extern "C" fn receive() {
    uart::received();
}

unsafe extern "C" fn transmit() {
    uart::transmitted();
}

unsafe extern "C" fn wake() {
    nap::woke();
}

/// An interrupt that nobody has unmasked.
unsafe extern "C" fn unexpected() {
    crate::fault::restart();
}
