//! A light of the board.

use super::Registers;
use core::convert::Infallible;
use embedded_hal::digital::{ErrorType, OutputPin};

/// Offset of the lights in the board's own registers.
const LIGHTS: usize = 0x0;

/// The first user light.
pub struct Lamp {
    registers: Registers,
}

impl Lamp {
    pub(super) const fn new(registers: Registers) -> Self {
        Self { registers }
    }
}

impl ErrorType for Lamp {
    type Error = Infallible;
}

impl OutputPin for Lamp {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.registers.write(LIGHTS, 0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.registers.write(LIGHTS, 1);
        Ok(())
    }
}
