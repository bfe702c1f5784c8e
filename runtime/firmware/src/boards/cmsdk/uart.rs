//! UART 0, the serial line: bytes in and out through rings that its interrupts fill and empty.
//!
//! A ring that is full masks its interrupt until the loop has made room, so
//! whatever comes in on the line costs at most [`RECEIVED`] bytes of interrupts
//! between two rounds of the loop. What the hardware loses meanwhile is counted.

use super::{HERTZ, Interrupt, Registers};
use core::convert::Infallible;
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::NVIC;
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use iltm_runtime::ring::Ring;

/// Address of UART 0.
pub(super) const UART: usize = 0x4000_4000;

mod register {
    pub(super) const DATA: usize = 0x0;
    pub(super) const STATE: usize = 0x4;
    pub(super) const CONTROL: usize = 0x8;
    pub(super) const INTERRUPT_CLEAR: usize = 0xC;
    pub(super) const BAUD_DIVIDER: usize = 0x10;
}

mod state {
    pub(super) const TRANSMIT_FULL: u32 = 1 << 0;
    pub(super) const RECEIVE_FULL: u32 = 1 << 1;
    pub(super) const RECEIVE_OVERRUN: u32 = 1 << 3;
}

/// Transmit and receive, each with its interrupt.
const ENABLE: u32 = 0b1111;

const BAUD: u32 = 115_200;

/// Bytes received and not yet read: what comes in 178 milliseconds at 115,200 baud,
/// and in a frame's time at 921,600.
const RECEIVED: usize = 2_048;

/// Bytes to be sent.
const TO_SEND: usize = 512;

static FROM_LINE: Ring<RECEIVED> = Ring::new();
static TO_LINE: Ring<TO_SEND> = Ring::new();
static OVERRUNS: AtomicU32 = AtomicU32::new(0);

/// UART 0.
pub struct Uart {
    registers: Registers,
}

/// The interrupt handlers' view of the UART.
// SAFETY: UART 0 of application notes 386 and 500. The handlers read and write the
// data register, the loop does not.
const LINE: Registers = unsafe { Registers::at(UART) };

impl Uart {
    pub(super) fn new(registers: Registers) -> Self {
        registers.write(register::BAUD_DIVIDER, HERTZ / BAUD);
        registers.write(register::CONTROL, ENABLE);
        for interrupt in [Interrupt::Receive, Interrupt::Transmit] {
            // SAFETY: the handlers share nothing with the loop but atomics.
            unsafe { NVIC::unmask(interrupt) };
        }
        Self { registers }
    }

    /// Bytes that the hardware lost because nobody took them in time.
    pub fn overruns(&self) -> u32 {
        OVERRUNS.load(Ordering::Relaxed)
    }
}

/// A byte has come in.
pub(super) fn received() {
    LINE.write(register::INTERRUPT_CLEAR, 0b10);
    let status = LINE.read(register::STATE);
    if status & state::RECEIVE_OVERRUN != 0 {
        LINE.write(register::STATE, state::RECEIVE_OVERRUN);
        OVERRUNS.fetch_add(1, Ordering::Relaxed);
    }
    // Bytes that arrive while the handler runs belong to the same visit, up to
    // what the ring holds.
    while LINE.read(register::STATE) & state::RECEIVE_FULL != 0 {
        if FROM_LINE.is_full() {
            NVIC::mask(Interrupt::Receive);
            return;
        }
        FROM_LINE.push(LINE.read(register::DATA) as u8);
    }
}

/// A byte has gone out.
pub(super) fn transmitted() {
    LINE.write(register::INTERRUPT_CLEAR, 0b01);
    while LINE.read(register::STATE) & state::TRANSMIT_FULL == 0 {
        let Some(byte) = TO_LINE.pop() else {
            return;
        };
        LINE.write(register::DATA, u32::from(byte));
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!FROM_LINE.is_empty())
    }
}

impl Read for Uart {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let mut count = 0;
        for slot in bytes {
            let Some(byte) = FROM_LINE.pop() else {
                break;
            };
            *slot = byte;
            count += 1;
        }
        if count > 0 {
            // There is room again. A byte that came while the interrupt was masked
            // may have raised no new one.
            // SAFETY: as in `new`.
            unsafe { NVIC::unmask(Interrupt::Receive) };
            if self.registers.read(register::STATE) & state::RECEIVE_FULL != 0 {
                NVIC::pend(Interrupt::Receive);
            }
        }
        Ok(count)
    }
}

impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!TO_LINE.is_full())
    }
}

impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let count = bytes.iter().take_while(|byte| TO_LINE.push(**byte)).count();
        if count > 0 {
            // The handler sends the first byte too, so that it alone writes data.
            NVIC::pend(Interrupt::Transmit);
        }
        Ok(count)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        while !TO_LINE.is_empty() {
            cortex_m::asm::nop();
        }
        Ok(())
    }
}
