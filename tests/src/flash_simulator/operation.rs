//! Flash operations: what was asked of a simulated flash, and what came of it.

use super::ERASE_STAGES;
use embedded_storage::nor_flash::{NorFlashError, NorFlashErrorKind};
use std::fmt;

/// Why a simulated flash did not do, or not finish, what it was asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NorError {
    /// The power failed during this operation, or is off since an earlier one.
    PowerCut,
    /// A write unit was to be programmed that is not erased. Nothing was changed.
    NotErased {
        /// Where the first such unit begins, bytes.
        unit: u32,
    },
    /// An offset or a length that is no multiple of what the part can do. Nothing
    /// was changed.
    NotAligned,
    /// A range that is not within the part. Nothing was changed.
    OutOfBounds,
    /// The cells could not be read, by order or because their write unit is torn on a part
    /// with ECC.
    Unreadable,
    /// A worn sector took no program or erase. Nothing was changed.
    Worn,
}

impl fmt::Display for NorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PowerCut => f.write_str("the power is off"),
            Self::NotErased { unit } => write!(f, "the write unit at {unit:#x} is not erased"),
            Self::NotAligned => f.write_str("offset or length is not aligned"),
            Self::OutOfBounds => f.write_str("the range is not within the flash"),
            Self::Unreadable => f.write_str("the cells cannot be read"),
            Self::Worn => f.write_str("the sector is worn"),
        }
    }
}

impl std::error::Error for NorError {}

impl NorFlashError for NorError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::PowerCut | Self::NotErased { .. } | Self::Unreadable | Self::Worn => {
                NorFlashErrorKind::Other
            }
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
        }
    }
}

impl From<NorFlashErrorKind> for NorError {
    fn from(kind: NorFlashErrorKind) -> Self {
        match kind {
            NorFlashErrorKind::NotAligned => Self::NotAligned,
            _ => Self::OutOfBounds,
        }
    }
}

/// How often the rules of a part were broken by whoever used it.
///
/// An error can be swallowed on the way up, a count cannot.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Violations {
    /// Programs of a unit that was not erased.
    pub not_erased: u32,
    /// Offsets or lengths that are no multiple of what the part can do.
    pub not_aligned: u32,
    /// Ranges outside the part.
    pub out_of_bounds: u32,
}

impl Violations {
    pub(super) const fn count(&mut self, error: NorError) {
        let count = match error {
            NorError::PowerCut | NorError::Unreadable | NorError::Worn => return,
            NorError::NotErased { .. } => &mut self.not_erased,
            NorError::NotAligned => &mut self.not_aligned,
            NorError::OutOfBounds => &mut self.out_of_bounds,
        };
        *count = count.saturating_add(1);
    }
}

/// What changes a flash.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Work {
    /// One call of `NorFlash::write`.
    Program,
    /// One call of `NorFlash::erase`, of one sector or more.
    Erase,
}

/// One program or erase and what came of it. Its text says where a cut fell.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Operation {
    /// Which of the two.
    pub work: Work,
    /// Where it began, bytes.
    pub offset: u32,
    /// How much was to be done, bytes.
    pub length: usize,
    /// Steps that the flash had done before it, since it was made.
    pub before: u64,
    /// Steps of it that were done whole: bytes of a program, [`ERASE_STAGES`] a
    /// sector of an erase.
    pub done: u64,
    /// What the caller was told.
    pub result: Result<(), NorError>,
}

impl fmt::Display for Operation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let work = match self.work {
            Work::Program => "program",
            Work::Erase => "erase",
        };
        let (length, offset, done) = (self.length, self.offset, self.done);
        write!(f, "{work} of {length} bytes at {offset:#x}")?;
        match (self.result, self.work) {
            (Ok(()), _) => write!(f, ": done in {done} steps"),
            (Err(NorError::PowerCut), Work::Program) => {
                write!(f, ": power cut in byte {done} of {length}")
            }
            (Err(NorError::PowerCut), Work::Erase) => {
                let (sector, stage) = (done / ERASE_STAGES, done % ERASE_STAGES);
                write!(
                    f,
                    ": power cut at stage {stage} of {ERASE_STAGES} of its sector {sector}"
                )
            }
            (Err(error), _) => write!(f, ": {error}"),
        }
    }
}
