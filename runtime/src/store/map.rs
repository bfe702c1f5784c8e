//! Flash map: where slots, commit records and identity lie.

use super::Slot;
use core::fmt;
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Most bytes of the unit in which a flash is written.
pub(super) const MAX_WRITE: usize = 32;

/// Most bytes of a chunk: with a message around it, it fits a frame.
pub const MAX_CHUNK: usize = 512;

/// Most sectors of a slot, as [`Map::sector`] counts them.
pub(super) const MAX_SECTORS: usize = 512;

/// Parts of a flash, in bytes from its start. Each is a whole number of the flash's
/// sectors.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Map {
    slots: [Part; 2],
    records: [Part; 2],
    identity: Part,
    sector: u32,
    chunk: u16,
}

/// Offset of the first byte, and length.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Part {
    pub(super) start: u32,
    pub(super) length: u32,
}

impl Part {
    fn of(range: &Range<u32>) -> Self {
        let length = range.end.saturating_sub(range.start);
        let start = range.start;
        Self { start, length }
    }

    pub(super) const fn end(self) -> u32 {
        self.start.saturating_add(self.length)
    }
}

/// Why a flash cannot be parted so.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MapError {
    /// A part is empty, or not a whole number of sectors.
    Sectors {
        /// Where it starts.
        start: u32,
    },
    /// A part is beyond the end, or overlaps another.
    Place {
        /// Where it starts.
        start: u32,
    },
    /// The slots differ in length.
    Slots,
    /// The flash writes or reads in units that are not supported.
    Unit,
}

impl fmt::Display for MapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sectors { start } => {
                write!(
                    f,
                    "the part at byte {start} is not a whole number of sectors"
                )
            }
            Self::Place { start } => {
                write!(
                    f,
                    "the part at byte {start} is not in the flash, or overlaps another"
                )
            }
            Self::Slots => f.write_str("the two slots differ in length"),
            Self::Unit => write!(
                f,
                "flash is written in units of 1 to {MAX_WRITE} bytes, a power of two, and erased in sectors of at least 64"
            ),
        }
    }
}

impl core::error::Error for MapError {}

impl Map {
    /// Parts the flash into two slots, two parts for commit records and one for the
    /// device's identity.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn new<F: NorFlash>(
        flash: &F,
        slots: [Range<u32>; 2],
        records: [Range<u32>; 2],
        identity: Range<u32>,
    ) -> Result<Self, MapError> {
        let unit = F::WRITE_SIZE;
        let supported = |unit: usize| unit.is_power_of_two() && unit <= MAX_WRITE;
        let erase = u32::try_from(F::ERASE_SIZE).unwrap_or(u32::MAX);
        if !supported(unit) || !supported(F::READ_SIZE) || erase < 64 || erase % 64 != 0 {
            return Err(MapError::Unit);
        }
        let slots = slots.map(|range| Part::of(&range));
        let records = records.map(|range| Part::of(&range));
        let identity = Part::of(&identity);
        let [a, b] = slots;
        let [first, second] = records;
        let all = [a, b, first, second, identity];
        for (index, part) in all.iter().enumerate() {
            let start = part.start;
            if part.length == 0 || start % erase != 0 || part.length % erase != 0 {
                return Err(MapError::Sectors { start });
            }
            let mut others = all.iter().take(index);
            let overlaps = others.any(|other| start < other.end() && other.start < part.end());
            if part.end() as usize > flash.capacity() || overlaps {
                return Err(MapError::Place { start });
            }
        }
        if a.length != b.length {
            return Err(MapError::Slots);
        }
        // A table of flags holds one bit a sector: parts with many small ones are
        // erased several at a time.
        let most = MAX_SECTORS as u32;
        let sector = (a.length / most).max(1).div_ceil(erase) * erase;
        let halves = 1_u32 << sector.trailing_zeros();
        Ok(Self {
            slots,
            records,
            identity,
            sector,
            chunk: halves.min(MAX_CHUNK as u32) as u16,
        })
    }

    pub(super) const fn slot(&self, slot: Slot) -> Part {
        *slot.of(&self.slots)
    }

    pub(super) const fn records(&self) -> [Part; 2] {
        self.records
    }

    pub(super) const fn identity(&self) -> Part {
        self.identity
    }

    /// Bytes of a slot.
    #[must_use]
    pub const fn slot_bytes(&self) -> u32 {
        let [a, _] = self.slots;
        a.length
    }

    /// Bytes that are compared, erased and sent as one: one sector of the flash or
    /// several.
    #[must_use]
    pub const fn sector(&self) -> u32 {
        self.sector
    }

    /// Bytes of a chunk.
    #[must_use]
    pub const fn chunk(&self) -> u16 {
        self.chunk
    }
}
