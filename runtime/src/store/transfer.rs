//! Transfer of a file into a slot.

use super::flash::{self, PIECE};
use super::map::{MAX_SECTORS, Part};
use super::{Map, StoreError};
use crate::link::{Digest, Refusal};
use embedded_storage::nor_flash::NorFlash;
use sha2::{Digest as _, Sha512};

/// What is known of it, in RAM only.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transfer {
    pub(super) digest: Digest,
    pub(super) length: u32,
    /// A bit for each sector that was erased for it.
    erased: [u32; MAX_SECTORS / 32],
}

impl Transfer {
    pub(super) const fn new(digest: Digest, length: u32) -> Self {
        Self {
            digest,
            length,
            erased: [0; MAX_SECTORS / 32],
        }
    }

    fn flag(&mut self, sector: u32) -> Option<(&mut u32, u32)> {
        let word = self.erased.get_mut(sector as usize / 32)?;
        Some((word, 1 << (sector % 32)))
    }

    /// Whether it is one of the file's chunks.
    pub(super) fn check(&self, map: &Map, offset: u32, bytes: &[u8]) -> Result<(), Refusal> {
        let chunk = u32::from(map.chunk());
        let left = self.length.saturating_sub(offset);
        if !offset.is_multiple_of(chunk) || left == 0 || bytes.len() != left.min(chunk) as usize {
            return Err(Refusal::Chunk);
        }
        Ok(())
    }

    /// Whether the chunk at this offset has its sector erased first.
    pub(super) fn erases(&mut self, map: &Map, offset: u32) -> bool {
        let flag = self.flag(offset / map.sector());
        flag.is_some_and(|(word, bit)| *word & bit == 0)
    }

    /// Has the flash hold a chunk that was [`check`](Self::check)ed. Returns how many sectors were erased for it.
    ///
    /// A sector is erased before the first chunk that goes there, whatever it holds:
    /// what looks like erased flash may have been cut in the middle.
    pub(super) fn write<F: NorFlash>(
        &mut self,
        flash: &mut F,
        map: &Map,
        slot: Part,
        offset: u32,
        bytes: &[u8],
    ) -> Result<u32, Refusal> {
        let sector = offset / map.sector();
        let (word, bit) = self.flag(sector).ok_or(Refusal::Chunk)?;
        let mut erases = 0;
        if *word & bit == 0 {
            let start = sector.saturating_mul(map.sector());
            flash::erase(flash, slot, start, map.sector())
                .map_err(|_| Refusal::Flash { offset: start })?;
            *word |= bit;
            erases = map.sector() / (F::ERASE_SIZE as u32).max(1);
        }
        let written = Self::put(flash, slot, offset, bytes);
        written.map_err(|_| {
            // The whole sector is to come again.
            *word &= !bit;
            Refusal::Flash { offset }
        })?;
        Ok(erases)
    }

    fn put<F: NorFlash>(
        flash: &mut F,
        slot: Part,
        offset: u32,
        bytes: &[u8],
    ) -> Result<(), StoreError> {
        // The same chunk may come twice.
        if flash::holds(flash, slot, offset, bytes)? {
            return Ok(());
        }
        // Another one for the same place must not be written over it.
        if flash::is_blank(flash, slot, offset, bytes.len() as u32)? {
            flash::write(flash, slot, offset, bytes)
        } else {
            Err(StoreError::Flash { offset })
        }
    }

    /// Whether a slot holds the file.
    pub(super) fn is_whole<F: NorFlash>(
        &self,
        flash: &mut F,
        slot: Part,
        mut yield_now: impl FnMut(),
    ) -> Result<bool, StoreError> {
        let mut hash = Sha512::new();
        let mut pieces = 0_usize;
        flash::read(flash, slot, 0, self.length, |piece| {
            hash.update(piece);
            pieces += piece.len();
            // A block of the hash takes some 12,000 instructions.
            if pieces.is_multiple_of(2 * PIECE) {
                yield_now();
            }
            true
        })?;
        Ok(Digest::of(&hash.finalize()) == self.digest)
    }
}
