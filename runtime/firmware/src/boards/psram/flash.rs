//! Table slots and records.

use crate::board::TableFlash;
use core::ops::Range;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use iltm_runtime::exchange::psram;
use iltm_runtime::store::{Map, MapError, Slot};

/// The part of the PSRAM that stands for flash. Like flash, it is erased to ones in
/// sectors, and writing only clears bits.
pub struct PsramFlash(());

/// A read, write or erase beyond the end, or not of whole units.
#[derive(Clone, Copy, Debug)]
pub enum Misplaced {
    /// Beyond the end.
    OutOfBounds,
    /// Not of whole units.
    NotAligned,
}

impl NorFlashError for Misplaced {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
        }
    }
}

impl PsramFlash {
    pub(super) const fn new() -> Self {
        Self(())
    }
}

/// A range in the flash, of whole units.
fn range(from: u32, length: usize, unit: usize) -> Result<Range<usize>, Misplaced> {
    let start = from as usize;
    if !start.is_multiple_of(unit) || !length.is_multiple_of(unit) {
        return Err(Misplaced::NotAligned);
    }
    let end = start.checked_add(length).ok_or(Misplaced::OutOfBounds)?;
    if end > psram::FLASH.end {
        return Err(Misplaced::OutOfBounds);
    }
    Ok(start..end)
}

impl ErrorType for PsramFlash {
    type Error = Misplaced;
}

impl ReadNorFlash for PsramFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Misplaced> {
        let range = range(offset, bytes.len(), Self::READ_SIZE)?;
        for (offset, byte) in range.zip(bytes) {
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

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Misplaced> {
        let length = to.checked_sub(from).ok_or(Misplaced::OutOfBounds)?;
        for offset in range(from, length as usize, Self::ERASE_SIZE)? {
            super::store(offset, 0xFF);
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Misplaced> {
        let range = range(offset, bytes.len(), Self::WRITE_SIZE)?;
        for (offset, byte) in range.zip(bytes) {
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
