//! Flash access in pieces of any length.

use super::StoreError;
use super::map::{MAX_WRITE, Part};
use crate::image::Crc32;
use embedded_storage::nor_flash::NorFlash;

/// Bytes that are read at once: a multiple of every unit.
pub(super) const PIECE: usize = 64;

/// A byte that was erased.
pub(super) const ERASED: u8 = 0xFF;

/// Reads `length` bytes of a part from `start` on, in pieces of at most [`PIECE`]
/// bytes, until `take` says that it has seen enough; returns whether it never did.
/// What lies beyond the part is not read.
pub(super) fn read<F: NorFlash>(
    flash: &mut F,
    part: Part,
    start: u32,
    length: u32,
    mut take: impl FnMut(&[u8]) -> bool,
) -> Result<bool, StoreError> {
    let mut piece = [0; PIECE];
    let length = length.min(part.length.saturating_sub(start));
    let mut done = 0;
    while done < length {
        let offset = part.start.saturating_add(start).saturating_add(done);
        // A part is a multiple of a piece, and so is every place that is read from.
        flash
            .read(offset, &mut piece)
            .map_err(|_| StoreError::Flash { offset })?;
        let wanted = (length - done).min(PIECE as u32);
        if !take(piece.get(..wanted as usize).unwrap_or_default()) {
            return Ok(false);
        }
        done += wanted;
    }
    Ok(true)
}

/// CRC-32 of the same bytes.
pub(super) fn crc<F: NorFlash>(
    flash: &mut F,
    part: Part,
    start: u32,
    length: u32,
) -> Result<u32, StoreError> {
    let mut digest = Crc32::new();
    read(flash, part, start, length, |piece| {
        digest.update(piece);
        true
    })?;
    Ok(digest.finish())
}

/// Whether a part holds these bytes from `start` on.
pub(super) fn holds<F: NorFlash>(
    flash: &mut F,
    part: Part,
    start: u32,
    bytes: &[u8],
) -> Result<bool, StoreError> {
    let mut rest = bytes;
    read(flash, part, start, bytes.len() as u32, |piece| {
        let (same, left) = rest.split_at_checked(piece.len()).unwrap_or((&[], &[]));
        rest = left;
        same == piece
    })
}

/// Whether `length` bytes of a part from `start` on read as erased.
pub(super) fn is_blank<F: NorFlash>(
    flash: &mut F,
    part: Part,
    start: u32,
    length: u32,
) -> Result<bool, StoreError> {
    read(flash, part, start, length, |piece| {
        piece.iter().all(|byte| *byte == ERASED)
    })
}

/// Writes bytes to an erased place of a part, the last unit filled up with erased
/// bytes, and reads them back.
pub(super) fn write<F: NorFlash>(
    flash: &mut F,
    part: Part,
    start: u32,
    bytes: &[u8],
) -> Result<(), StoreError> {
    let offset = part.start.saturating_add(start);
    let failed = |_| StoreError::Flash { offset };
    let whole = bytes.len() / F::WRITE_SIZE * F::WRITE_SIZE;
    let (units, rest) = bytes.split_at_checked(whole).unwrap_or((bytes, &[]));
    if !units.is_empty() {
        flash.write(offset, units).map_err(failed)?;
    }
    if !rest.is_empty() {
        let mut unit = [ERASED; MAX_WRITE];
        for (byte, wanted) in unit.iter_mut().zip(rest) {
            *byte = *wanted;
        }
        let unit = unit.get(..F::WRITE_SIZE).unwrap_or_default();
        let offset = offset.saturating_add(units.len() as u32);
        flash.write(offset, unit).map_err(failed)?;
    }
    if holds(flash, part, start, bytes)? {
        Ok(())
    } else {
        Err(StoreError::Flash { offset })
    }
}

/// Erases `length` bytes of a part from `start` on.
pub(super) fn erase<F: NorFlash>(
    flash: &mut F,
    part: Part,
    start: u32,
    length: u32,
) -> Result<(), StoreError> {
    let from = part.start.saturating_add(start);
    let to = from.saturating_add(length).min(part.end());
    let erased = flash.erase(from, to);
    erased.map_err(|_| StoreError::Flash { offset: from })
}
