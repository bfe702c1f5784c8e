//! Layout of a table image: where every byte is.
//!
//! An image is little-endian and can be used where it lies, in flash:
//!
//! ```text
//! header          16 bytes, see `header`
//! section table   16 bytes a section, see `entry`
//! sections        in the order of the section table, each padded with zeros to
//!                 a multiple of 4 bytes; the image ends with the last one
//! ```
//!
//! The CRC-32 (ISO-HDLC, as in zip and Ethernet) of the header covers the header
//! and the section table; each section has its own. Nothing lies outside them,
//! so no byte of an image can change unnoticed.
//!
//! Reader and writer share this file and nothing else.

use core::ops::Range;

/// First bytes of every image.
pub const MAGIC: [u8; 4] = *b"ILTM";

/// Version of the layout described here.
pub const FORMAT_VERSION: u16 = 1;

/// Sections start at multiples of this many bytes.
pub const ALIGNMENT: usize = 4;

/// Most sections an image may have.
pub const MAX_SECTIONS: usize = 64;

/// Most tiers, tier 0 (gain only) included.
pub const MAX_TIERS: usize = 16;

/// Longest provenance text, bytes.
pub const MAX_PROVENANCE: usize = 1 << 16;

/// The header, 16 bytes.
pub mod header {
    use super::Range;
    /// [`MAGIC`](super::MAGIC).
    pub const MAGIC: Range<usize> = 0..4;
    /// [`FORMAT_VERSION`](super::FORMAT_VERSION), `u16`.
    pub const VERSION: Range<usize> = 4..6;
    /// Number of sections, `u16`.
    pub const SECTIONS: Range<usize> = 6..8;
    /// Length of the whole image in bytes, `u32`.
    pub const LENGTH: Range<usize> = 8..12;
    /// CRC-32 of the bytes before this field and of the section table, `u32`.
    pub const CRC: Range<usize> = 12..16;
    /// Length of the header.
    pub const SIZE: usize = 16;
}

/// One entry of the section table, 16 bytes.
pub mod entry {
    use super::Range;
    /// [`SectionKind`](super::SectionKind), `u16`.
    pub const KIND: Range<usize> = 0..2;
    /// What the section applies to, `u16`; see [`SectionKind`](super::SectionKind).
    pub const SELECTOR: Range<usize> = 2..4;
    /// Offset from the start of the image, `u32`.
    pub const OFFSET: Range<usize> = 4..8;
    /// Length in bytes without padding, `u32`.
    pub const LENGTH: Range<usize> = 8..12;
    /// CRC-32 of the section without padding, `u32`.
    pub const CRC: Range<usize> = 12..16;
    /// Length of an entry.
    pub const SIZE: usize = 16;
}

/// What a section holds. The numbers are the format: do not reorder.
///
/// Sections stand in the order of their kinds. Except for
/// [`Operator`](Self::Operator), a kind occurs once at most and its selector is
/// zero.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[repr(u16)]
pub enum SectionKind {
    /// Sizes, units and proved bounds; see [`meta`]. Required.
    Meta = 1,
    /// What each tier promises and costs; see [`tier`]. Required.
    Tiers = 2,
    /// Gain `g` of every cell and channel, `u16`, channels of a cell side by
    /// side; unit: `2^-gain_fraction` of drive per light. Required.
    Gain = 3,
    /// Ambient light of every cell and channel, `u16`
    /// [`Light`](crate::units::Light), channels of a cell side by side.
    Ambient = 4,
    /// Projector codes by drive, [`RESPONSE_KNOTS`](crate::response::RESPONSE_KNOTS)
    /// `u16` for all channels, or that many for each.
    Response = 5,
    /// 8-bit projector codes by drive, [`CODES`](crate::response::CODES) `u8` for
    /// all channels, or that many for each: what [`Response`](Self::Response) says
    /// at those drives. The two occur together or not at all.
    Codes = 6,
    /// Gain on a grid finer than the cells; see [`fine_gain`].
    FineGain = 7,
    /// All operator entries of one tier; the selector is the tier plus 256 times
    /// the channel number (0: all channels, 1: the first, ...). Selectors ascend.
    /// See [`operator::layout`](crate::operator::layout).
    Operator = 8,
    /// Where the table comes from: UTF-8 text for people and host tools.
    Provenance = 9,
    /// The projector that the photographs were taken with; see [`projector`].
    Projector = 10,
    /// Cells of the other projectors' frames; see [`neighbours`].
    Neighbours = 11,
    /// Light that 8-bit codes ask for where black is raised, `u16`
    /// [`Light`](crate::units::Light): of 256 sRGB codes, then of 256 in proportion to light.
    /// See [`raised`](crate::pipeline::raised).
    Light = 12,
}

impl SectionKind {
    /// The kind with this number.
    #[must_use]
    pub const fn from_number(number: u16) -> Option<Self> {
        Some(match number {
            1 => Self::Meta,
            2 => Self::Tiers,
            3 => Self::Gain,
            4 => Self::Ambient,
            5 => Self::Response,
            6 => Self::Codes,
            7 => Self::FineGain,
            8 => Self::Operator,
            9 => Self::Provenance,
            10 => Self::Projector,
            11 => Self::Neighbours,
            12 => Self::Light,
            _ => return None,
        })
    }

    /// Its name in messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Meta => "meta",
            Self::Tiers => "tiers",
            Self::Gain => "gain",
            Self::Ambient => "ambient",
            Self::Response => "response",
            Self::Codes => "codes",
            Self::FineGain => "fine gain",
            Self::Operator => "operator",
            Self::Provenance => "provenance",
            Self::Projector => "projector",
            Self::Neighbours => "neighbours",
            Self::Light => "light",
        }
    }
}

/// The meta section, 68 bytes.
pub mod meta {
    use super::Range;
    /// Rows of the grid, `u16`.
    pub const ROWS: Range<usize> = 0..2;
    /// Columns of the grid, `u16`.
    pub const COLS: Range<usize> = 2..4;
    /// Colour channels, 1 or 3, `u8`.
    pub const CHANNELS: usize = 4;
    /// Fraction bits of the gains, 1 to 15, `u8`.
    pub const GAIN_FRACTION: usize = 5;
    /// Zero.
    pub const RESERVED: Range<usize> = 6..8;
    /// Camera units of reference white, `u32` with 24 fraction bits.
    pub const REFERENCE_WHITE: Range<usize> = 8..12;
    /// Largest magnitude that a row's sum can reach, `u32`.
    pub const ACCUMULATOR_BOUND: Range<usize> = 12..16;
    /// Largest magnitude of a correction, `u32`
    /// [`Correction`](crate::units::Correction) bits.
    pub const CORRECTION_BOUND: Range<usize> = 16..20;
    /// Scale of the operator in each channel, three `u16` with 15 fraction bits;
    /// zero for channels that the table does not have.
    pub const CHANNEL_SCALES: Range<usize> = 20..26;
    /// Zero.
    pub const RESERVED_END: Range<usize> = 26..28;
    /// Predicted closed-loop error of the inverse itself, before any tier leaves
    /// entries out, `u32` with 32 fraction bits.
    pub const INVERSE_ERROR: Range<usize> = 28..32;
    /// Name and date; see [`label`](super::label).
    pub const LABEL: Range<usize> = 32..68;
    /// Length of the section.
    pub const SIZE: usize = 68;
}

/// What people call a table, 36 bytes at the end of the meta section.
pub mod label {
    use super::Range;
    /// Longest name, bytes.
    pub const NAME_BYTES: usize = 32;
    /// The name, UTF-8, filled up with zeros.
    pub const NAME: Range<usize> = 0..NAME_BYTES;
    /// The day when the table was made as a decimal number, `u32`: 20261123 for
    /// 2026-11-23; 0 if unknown.
    pub const DATE: Range<usize> = 32..36;
    /// Length of the label.
    pub const SIZE: usize = 36;
}

/// One entry of the tiers section, 12 bytes.
pub mod tier {
    use super::Range;
    /// Predicted error of what the tier leaves out, `u32` with 32 fraction bits.
    pub const PREDICTED_ERROR: Range<usize> = 0..4;
    /// Operator entries read a frame, `u32`.
    pub const ENTRIES: Range<usize> = 4..8;
    /// Multiplications by operator entries a frame, `u32`.
    pub const MULTIPLICATIONS: Range<usize> = 8..12;
    /// Length of an entry.
    pub const SIZE: usize = 12;
}

/// The projector section, 8 bytes.
pub mod projector {
    use super::Range;
    /// Pixels of its rows, `u16`.
    pub const WIDTH: Range<usize> = 0..2;
    /// Its rows, `u16`.
    pub const HEIGHT: Range<usize> = 2..4;
    /// Pixels on every side that no cell covers, `u16`.
    pub const BORDER: Range<usize> = 4..6;
    /// Zero.
    pub const RESERVED: Range<usize> = 6..8;
    /// Length of the section.
    pub const SIZE: usize = 8;
}

/// The head of the neighbours section, 8 bytes. In a table with an ambient section, the ambient
/// light of the neighbours' cells follows as there.
pub mod neighbours {
    use super::Range;
    /// Rows of their cells, `u16`.
    pub const ROWS: Range<usize> = 0..2;
    /// Columns of the cells of all of them side by side, `u16`.
    pub const COLS: Range<usize> = 2..4;
    /// How many of them are on the left of this projector, `u8`.
    pub const BEFORE: usize = 4;
    /// How many are on its right, `u8`.
    pub const AFTER: usize = 5;
    /// Zero.
    pub const RESERVED: Range<usize> = 6..8;
    /// Length of the head.
    pub const SIZE: usize = 8;
}

/// The head of the fine gain section, 4 bytes; the gains follow as in
/// [`SectionKind::Gain`].
pub mod fine_gain {
    use super::Range;
    /// Rows of the fine grid, `u16`.
    pub const ROWS: Range<usize> = 0..2;
    /// Columns of the fine grid, `u16`.
    pub const COLS: Range<usize> = 2..4;
    /// Length of the head.
    pub const SIZE: usize = 4;
}
