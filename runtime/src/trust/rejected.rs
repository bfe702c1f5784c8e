//! Rejections: why a table may not run here.

use crate::features::Stage;
use crate::image::{ImageError, SealError, SectionProblem};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Why a file is refused. Its numbers go over the wire: do not reorder.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Rejected {
    /// It does not start as a table does.
    NotATable,
    /// It ends before what it should hold.
    Truncated,
    /// Its layout, or its seal's, is of another version than this runtime reads.
    Format,
    /// It does not match its checksums, or bytes follow it that belong to nothing.
    Damaged,
    /// It is whole, but its contents are not those of a table that can run.
    Contents,
    /// It is not signed.
    Unsigned,
    /// It names another key than the device's.
    WrongKey,
    /// Its signature is not the key's over these bytes.
    Signature,
    /// It is older than what may still run.
    Older {
        /// Version of the table.
        version: u32,
        /// Oldest version that is taken.
        floor: u32,
    },
    /// It is for another device.
    OtherDevice {
        /// The device that it is for.
        device: u64,
    },
    /// It lists a stage that this firmware was built without.
    NotBuilt {
        /// The stage.
        stage: Stage,
    },
}

impl From<ImageError> for Rejected {
    fn from(error: ImageError) -> Self {
        match error {
            ImageError::NotATable => Self::NotATable,
            ImageError::Truncated { .. } => Self::Truncated,
            ImageError::Version { .. } | ImageError::Seal(SealError::Version { .. }) => {
                Self::Format
            }
            ImageError::Length { .. }
            | ImageError::HeaderChecksum
            | ImageError::SectionChecksum { .. }
            | ImageError::Section {
                problem: SectionProblem::Padding,
                ..
            } => Self::Damaged,
            ImageError::UnknownSection { .. }
            | ImageError::Section { .. }
            | ImageError::Grid(_)
            | ImageError::Field { .. }
            | ImageError::Operator(_)
            | ImageError::Seal(_) => Self::Contents,
            ImageError::NotBuilt(stage) => Self::NotBuilt { stage },
        }
    }
}

impl fmt::Display for Rejected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotATable => f.write_str("this is not an .iltm table"),
            Self::Truncated => f.write_str("the table is cut short"),
            Self::Format => f.write_str("the table is of a format that the firmware cannot read"),
            Self::Damaged => f.write_str("the table does not match its checksums"),
            Self::Contents => f.write_str("the table's contents cannot be used"),
            Self::Unsigned => {
                f.write_str("the table is not signed, and the device takes signed ones only")
            }
            Self::WrongKey => f.write_str("the table is signed with another key than the device's"),
            Self::Signature => f.write_str("the table's signature is false"),
            Self::Older { version, floor } => write!(
                f,
                "the table has version {version}; none below {floor} is taken"
            ),
            Self::OtherDevice { device } => {
                write!(f, "the table is for the device {device}")
            }
            Self::NotBuilt { stage } => write!(
                f,
                "the table lists {stage}, which the firmware was built without"
            ),
        }
    }
}

impl core::error::Error for Rejected {}
