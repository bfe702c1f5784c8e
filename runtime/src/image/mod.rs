//! The `.iltm` table image: its layout, and the check that turns bytes into a
//! [`Table`].
//!
//! [`Table::check`] is the only way to a [`Table`]. It reads every byte once,
//! trusts no length, and proves that no frame can overflow; after it, no
//! accessor can fail and none looks at a length again. The bytes stay where they
//! are (flash, a file in memory): a table holds references only.
//!
//! A file is an image, or an image and the [`Seal`] of who signed it.

mod bytes;
mod check;
mod crc32;
mod error;
mod label;
pub mod layout;
#[cfg(test)]
pub(crate) mod made_up;
mod meta;
mod neighbours;
mod recheck;
pub mod seal;
mod sections;
mod table;

pub use check::Checked;
pub(crate) use crc32::Crc32;
pub use error::{ImageError, SealError, SectionProblem};
pub use label::Label;
pub use meta::{Meta, TierInfo};
pub use neighbours::Neighbours;
pub use recheck::Recheck;
pub use seal::{Seal, content, unseal};
pub(crate) use sections::Whole;
pub use table::{FineGain, Table};

pub(crate) use bytes::put;

use crate::yield_budget::{YieldBudget, cost};

/// CRC-32 as the layout uses it.
#[must_use]
pub fn crc32(bytes: &[&[u8]]) -> u32 {
    let mut digest = Crc32::new();
    for part in bytes {
        digest.update(part);
    }
    digest.finish()
}

/// The same of bytes that may be many.
fn checksum(bytes: &[&[u8]], budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>) -> u32 {
    const PIECE: usize = 256;
    let mut digest = Crc32::new();
    for piece in bytes.iter().flat_map(|part| part.chunks(PIECE)) {
        digest.update(piece);
        budget.spend(piece.len(), cost::CRC_BYTE);
    }
    digest.finish()
}
