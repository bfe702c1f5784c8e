//! The `.iltm` table image: its layout, and the check that turns bytes into a
//! [`Table`].
//!
//! [`Table::check`] is the only way to a [`Table`]. It reads every byte once,
//! trusts no length, and proves that no frame can overflow; after it, no
//! accessor can fail and none looks at a length again. The bytes stay where they
//! are (flash, a file in memory): a table holds references only.

mod bytes;
mod check;
mod error;
pub mod layout;
mod table;

pub use error::{ImageError, SectionProblem};
pub use table::{FineGain, Table, TierInfo};

/// CRC-32 (ISO-HDLC), piece by piece.
pub(crate) static CRC_32: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// CRC-32 as the layout uses it.
#[must_use]
pub fn crc32(bytes: &[&[u8]]) -> u32 {
    let mut digest = CRC_32.digest();
    for part in bytes {
        digest.update(part);
    }
    digest.finalize()
}
