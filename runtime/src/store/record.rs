//! Records of 64 bytes that count only when they are whole.

use super::flash::{self, ERASED, PIECE};
use super::map::Part;
use super::{Slot, StoreError};
use crate::image::{crc32, put};
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Bytes of a record, whatever the unit in which the flash is written.
pub const RECORD: usize = PIECE;

/// Where the fields of every record are.
mod field {
    use super::Range;
    /// What kind of record it is.
    pub(super) const MAGIC: Range<usize> = 0..4;
    /// CRC-32 of the bytes before it.
    pub(super) const CRC: Range<usize> = 60..64;
}

/// The fields of a commit record.
mod commit {
    use super::Range;
    pub(super) const SEQUENCE: Range<usize> = 4..8;
    /// 0 or 1; anything else is none.
    pub(super) const SLOT: Range<usize> = 8..12;
    pub(super) const ID: Range<usize> = 12..16;
    pub(super) const FLOOR: Range<usize> = 16..20;
    pub(super) const ERASES_A: Range<usize> = 20..24;
    pub(super) const ERASES_B: Range<usize> = 24..28;
    pub(super) const ERASES_RECORDS: Range<usize> = 28..32;
    pub(super) const LENGTH_A: Range<usize> = 32..36;
    pub(super) const LENGTH_B: Range<usize> = 36..40;
    pub(super) const OTHER: Range<usize> = 40..44;
    /// 1 if there is such a table; anything else is none.
    pub(super) const HAS_OTHER: Range<usize> = 44..48;
    /// 1 if the device has a key; anything else is none.
    pub(super) const HAS_KEY: Range<usize> = 48..52;
    pub(super) const NEWEST: Range<usize> = 52..56;
}

/// The fields of an identity record.
mod identity {
    use super::Range;
    pub(super) const KEY: Range<usize> = 4..36;
    pub(super) const DEVICE: Range<usize> = 36..44;
}

/// The table that counts, and what goes with it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Commit {
    /// The record with the highest one counts.
    pub(super) sequence: u32,
    /// The slot whose table is to be used, and the table's id.
    pub(super) table: Option<(Slot, u32)>,
    /// Id of the table in the other slot, if it has counted before: the one to go back
    /// to. One that nobody ever confirmed is none.
    pub(super) other: Option<u32>,
    /// Bytes of the file in slot A and in slot B, 0 if unknown.
    pub(super) lengths: [u32; 2],
    /// Tables of a lower version are refused.
    pub(super) floor: u32,
    /// Times that sectors of slot A, slot B and the records were erased.
    pub(super) erases: [u32; 3],
    /// Whether the device has a key.
    pub(super) has_key: bool,
    /// The highest version that was ever confirmed under the key.
    pub(super) newest: u32,
}

impl Commit {
    /// Whether `next` says the same and was written right after it.
    pub(super) fn is_duplicate(&self, next: &Self) -> bool {
        let duplicate = Self {
            sequence: self.sequence.saturating_add(1),
            ..*self
        };
        duplicate == *next
    }
}

/// Who the device is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Identity {
    pub(super) key: [u8; 32],
    pub(super) device: u64,
}

/// What can be written as a record.
pub(super) trait Record: Sized {
    const MAGIC: [u8; 4];
    fn parse(bytes: &[u8; RECORD]) -> Self;
    fn emit(&self, bytes: &mut [u8; RECORD]);
}

fn u32_at(bytes: &[u8; RECORD], field: Range<usize>) -> u32 {
    let bytes = bytes.get(field).and_then(|field| field.try_into().ok());
    bytes.map_or(0, u32::from_le_bytes)
}

impl Record for Commit {
    const MAGIC: [u8; 4] = *b"ILTC";

    fn parse(bytes: &[u8; RECORD]) -> Self {
        let slot = match u32_at(bytes, commit::SLOT) {
            0 => Some(Slot::A),
            1 => Some(Slot::B),
            _ => None,
        };
        let erases = [commit::ERASES_A, commit::ERASES_B, commit::ERASES_RECORDS];
        let lengths = [commit::LENGTH_A, commit::LENGTH_B];
        Self {
            sequence: u32_at(bytes, commit::SEQUENCE),
            table: slot.map(|slot| (slot, u32_at(bytes, commit::ID))),
            other: (u32_at(bytes, commit::HAS_OTHER) == 1).then(|| u32_at(bytes, commit::OTHER)),
            floor: u32_at(bytes, commit::FLOOR),
            lengths: lengths.map(|field| u32_at(bytes, field)),
            erases: erases.map(|field| u32_at(bytes, field)),
            has_key: u32_at(bytes, commit::HAS_KEY) == 1,
            newest: u32_at(bytes, commit::NEWEST),
        }
    }

    fn emit(&self, bytes: &mut [u8; RECORD]) {
        let slot = self.table.map_or(u32::MAX, |(slot, _)| slot as u32);
        let id = self.table.map_or(0, |(_, id)| id);
        let [a, b, records] = self.erases;
        let [length_a, length_b] = self.lengths;
        for (field, value) in [
            (commit::SEQUENCE, self.sequence),
            (commit::SLOT, slot),
            (commit::ID, id),
            (commit::FLOOR, self.floor),
            (commit::ERASES_A, a),
            (commit::ERASES_B, b),
            (commit::ERASES_RECORDS, records),
            (commit::LENGTH_A, length_a),
            (commit::LENGTH_B, length_b),
            (commit::OTHER, self.other.unwrap_or(0)),
            (commit::HAS_OTHER, self.other.is_some().into()),
            (commit::HAS_KEY, self.has_key.into()),
            (commit::NEWEST, self.newest),
        ] {
            put(bytes, field, &value.to_le_bytes());
        }
    }
}

impl Record for Identity {
    const MAGIC: [u8; 4] = *b"ILTI";

    fn parse(bytes: &[u8; RECORD]) -> Self {
        let key = bytes.get(identity::KEY).and_then(|key| key.try_into().ok());
        let device = bytes.get(identity::DEVICE);
        let device = device.and_then(|device| device.try_into().ok());
        Self {
            key: key.unwrap_or_default(),
            device: device.map_or(0, u64::from_le_bytes),
        }
    }

    fn emit(&self, bytes: &mut [u8; RECORD]) {
        put(bytes, identity::KEY, &self.key);
        put(bytes, identity::DEVICE, &self.device.to_le_bytes());
    }
}

/// What is at a record's place.
#[derive(Debug)]
pub(super) enum Contents<R> {
    /// Erased bytes.
    Blank,
    /// A whole record.
    Record(R),
    /// Something else, such as a record that was cut.
    Corrupt,
}

/// Looks at place `index` of a part.
pub(super) fn look<F: NorFlash, R: Record>(
    flash: &mut F,
    part: Part,
    index: u32,
) -> Result<Contents<R>, StoreError> {
    let mut bytes = [0; RECORD];
    flash::read(flash, part, place(index), RECORD as u32, |piece| {
        if let Ok(piece) = piece.try_into() {
            bytes = piece;
        }
        true
    })?;
    if bytes.iter().all(|byte| *byte == ERASED) {
        return Ok(Contents::Blank);
    }
    let covered = bytes.get(..field::CRC.start).unwrap_or_default();
    let whole = u32_at(&bytes, field::CRC) == crc32(&[covered]);
    let ours = bytes.get(field::MAGIC) == Some(&R::MAGIC);
    Ok(if whole && ours {
        Contents::Record(R::parse(&bytes))
    } else {
        Contents::Corrupt
    })
}

/// Writes a record to a blank place of a part.
pub(super) fn write<F: NorFlash, R: Record>(
    flash: &mut F,
    part: Part,
    index: u32,
    record: &R,
) -> Result<(), StoreError> {
    // A worn sector may have bits that no erase brings back. Flash with ECC must not be written
    // there: it may lose the whole unit, or fault where it is read.
    if !flash::is_blank(flash, part, place(index), RECORD as u32)? {
        let offset = part.start.saturating_add(place(index));
        return Err(StoreError::Flash { offset });
    }
    flash::write(flash, part, place(index), &bytes(record))
}

/// A record as it is in the flash.
pub(super) fn bytes<R: Record>(record: &R) -> [u8; RECORD] {
    let mut bytes = [0; RECORD];
    put(&mut bytes, field::MAGIC, &R::MAGIC);
    record.emit(&mut bytes);
    let covered = bytes.get(..field::CRC.start).unwrap_or_default();
    let crc = crc32(&[covered]);
    put(&mut bytes, field::CRC, &crc.to_le_bytes());
    bytes
}

/// Records that a part has places for.
pub(super) const fn places(part: Part) -> u32 {
    part.length / RECORD as u32
}

const fn place(index: u32) -> u32 {
    index.saturating_mul(RECORD as u32)
}
