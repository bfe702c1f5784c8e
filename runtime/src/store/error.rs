//! Store errors: why flash cannot be used.

use core::fmt;

/// Why something could not be stored.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StoreError {
    /// The flash refuses, or does not hold what was written.
    Flash {
        /// Where, in bytes from the start of the flash.
        offset: u32,
    },
    /// There is no room for another record.
    Full,
}

impl fmt::Display for StoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flash { offset } => {
                write!(
                    f,
                    "the flash does not hold what is written to byte {offset}"
                )
            }
            Self::Full => f.write_str("there is no room for another record"),
        }
    }
}

impl core::error::Error for StoreError {}
