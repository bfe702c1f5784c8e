//! Image errors: why an image or a seal is refused.

use super::layout::{FORMAT_VERSION, SectionKind};
use super::seal::SEAL_VERSION;
use crate::GridError;
use crate::features::Stage;
use crate::operator::OperatorError;
use core::fmt;

/// Why bytes are not a table that this runtime can use.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum ImageError {
    /// The bytes end before what they should hold.
    Truncated {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// The first bytes are not those of a table.
    NotATable,
    /// The layout is of another version.
    Version {
        /// Version found.
        found: u16,
    },
    /// The length in the header is not the number of bytes given.
    Length {
        /// Length in the header.
        stated: usize,
        /// Bytes given.
        given: usize,
    },
    /// The header or the section table does not match its CRC.
    HeaderChecksum,
    /// A section does not match its CRC.
    SectionChecksum {
        /// The section.
        section: SectionKind,
    },
    /// A section is of a kind that this runtime does not know.
    UnknownSection {
        /// Index in the section table.
        index: usize,
        /// Number of the kind.
        kind: u16,
    },
    /// Sections are missing, doubled, out of order, or not where they should be.
    Section {
        /// The section.
        section: SectionKind,
        /// What is wrong with it.
        problem: SectionProblem,
    },
    /// The grid has no cells or too many.
    Grid(GridError),
    /// A field holds a value that it must not hold.
    Field {
        /// The section.
        section: SectionKind,
        /// The field.
        field: &'static str,
        /// Offset in the section, bytes.
        offset: usize,
    },
    /// The operator is malformed, or could overflow.
    Operator(OperatorError),
    /// What follows the image is not a seal that this runtime can read.
    Seal(SealError),
    /// The table lists a stage that this runtime was built without.
    NotBuilt(Stage),
}

/// What is wrong with a section as a whole.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SectionProblem {
    /// It is required and not there.
    Missing,
    /// It, or the same selector of it, is there twice, or after a later one.
    Order,
    /// It does not start where the one before ends, or leaves the image.
    Place,
    /// The bytes that pad it are not zero.
    Padding,
    /// Its length does not fit the grid.
    Length,
    /// Its selector names a tier or a channel that the table does not have.
    Selector,
}

/// Why the bytes behind an image are not a seal that this runtime can read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum SealError {
    /// It is of another version.
    Version {
        /// Version found.
        found: u16,
    },
    /// Bytes that must be zero are not.
    Reserved,
}

impl fmt::Display for SectionProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing => "is missing",
            Self::Order => "is there twice or out of order",
            Self::Place => "is not where the section table should put it",
            Self::Padding => "is padded with bytes other than zero",
            Self::Length => "has a length that does not fit the grid",
            Self::Selector => "is for a tier or channel that the table does not have",
        })
    }
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated { needed, given } => {
                write!(f, "the table ends after {given} bytes; it needs {needed}")
            }
            Self::NotATable => f.write_str("this is not an .iltm table"),
            Self::Version { found } => write!(
                f,
                "the table has format version {found}; this runtime reads version {FORMAT_VERSION}"
            ),
            Self::Length { stated, given } => {
                write!(f, "the table should have {stated} bytes but has {given}")
            }
            Self::HeaderChecksum => f.write_str("the table's header does not match its checksum"),
            Self::SectionChecksum { section } => write!(
                f,
                "the table's {} section does not match its checksum",
                section.name()
            ),
            Self::UnknownSection { index, kind } => {
                write!(f, "section {index} of the table is of unknown kind {kind}")
            }
            Self::Section { section, problem } => {
                write!(f, "the table's {} section {problem}", section.name())
            }
            Self::Grid(error) => write!(f, "the table is for {error}"),
            Self::Field {
                section,
                field,
                offset,
            } => write!(
                f,
                "the field \"{field}\" at byte {offset} of the table's {} section has an impossible value",
                section.name()
            ),
            Self::Operator(error) => write!(f, "the table's operator is unusable: {error}"),
            Self::Seal(error) => write!(f, "the table's seal {error}"),
            Self::NotBuilt(stage) => {
                write!(
                    f,
                    "the table lists {stage}, which this runtime was built without"
                )
            }
        }
    }
}

impl core::error::Error for ImageError {}

impl fmt::Display for SealError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Version { found } => write!(
                f,
                "has version {found}; this runtime reads version {SEAL_VERSION}"
            ),
            Self::Reserved => f.write_str("has bytes other than zero in a reserved place"),
        }
    }
}
