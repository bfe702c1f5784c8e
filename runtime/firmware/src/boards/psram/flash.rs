//! Table slots.

use crate::board::TableFlash;
use embedded_storage::nor_flash::{ErrorType, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use iltm_runtime::exchange::psram;

/// The part of the PSRAM that stands for flash: both slots and the records.
pub struct PsramFlash(());

/// A read beyond the end.
#[derive(Clone, Copy, Debug)]
pub struct OutOfBounds;

impl NorFlashError for OutOfBounds {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::OutOfBounds
    }
}

impl PsramFlash {
    pub(super) const fn new() -> Self {
        Self(())
    }
}

impl ErrorType for PsramFlash {
    type Error = OutOfBounds;
}

impl ReadNorFlash for PsramFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
        let start = offset as usize;
        let end = start.checked_add(bytes.len()).ok_or(OutOfBounds)?;
        let flash = super::bytes(0..self.capacity());
        bytes.copy_from_slice(flash.get(start..end).ok_or(OutOfBounds)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        psram::RECORDS.end
    }
}

impl TableFlash for PsramFlash {
    fn slot(&self, slot: usize) -> &'static [u8] {
        super::bytes(match slot {
            0 => psram::SLOT_A,
            1 => psram::SLOT_B,
            _ => 0..0,
        })
    }
}
