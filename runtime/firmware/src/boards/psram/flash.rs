//! PSRAM as NOR flash: table slots and records.

use crate::board::TableFlash;
use core::ops::Range;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use iltm_runtime::frame_buffers::psram;
use iltm_runtime::store::{Map, MapError, Slot};

/// The part of the PSRAM that stands for flash. Like flash, it is erased to ones in
/// sectors, and writing only clears bits.
pub struct PsramFlash(());

impl PsramFlash {
    pub(super) const fn new() -> Self {
        Self(())
    }
}

impl ErrorType for PsramFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for PsramFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        for (offset, byte) in (offset as usize..).zip(bytes) {
            *byte = super::load(offset);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        psram::FLASH.end
    }
}

impl NorFlash for PsramFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = psram::SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        for offset in from as usize..to as usize {
            super::store(offset, 0xFF);
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        for (offset, byte) in (offset as usize..).zip(bytes) {
            super::store(offset, super::load(offset) & byte);
        }
        Ok(())
    }
}

/// Offsets in the PSRAM as the store counts them.
fn offsets(range: Range<usize>) -> Range<u32> {
    range.start as u32..range.end as u32
}

impl TableFlash for PsramFlash {
    // A sector of 4 KiB takes some hundred thousand instructions.
    const LONGEST_MS: u32 = 50;

    fn map(&self) -> Result<Map, MapError> {
        Map::new(
            self,
            [psram::SLOT_A, psram::SLOT_B].map(offsets),
            psram::RECORDS.map(offsets),
            offsets(psram::IDENTITY),
        )
    }

    fn slot(&self, slot: Slot) -> &'static [u8] {
        super::bytes(slot.of(&[psram::SLOT_A, psram::SLOT_B]).clone())
    }
}
