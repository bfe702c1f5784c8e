//! Why a file could not be brought to a device.

use super::PATIENCE;
use crate::DeviceError;

/// Why a file could not be brought to a device. What arrived stays in the slot, which
/// is not in use: the next transfer goes on from there.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    /// The device, or the line to it.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Chunks are sent and nothing new gets into the flash.
    #[error(
        "nothing new has reached the device's flash for {} s, at {done} of {total} bytes",
        PATIENCE.as_secs()
    )]
    Stalled {
        /// Bytes that the slot holds.
        done: u32,
        /// Bytes of the file.
        total: u32,
    },
    /// A sector does not take what is written to it.
    #[error(
        "sector {sector} of the slot (from byte {offset} on) does not hold what is written to it, after {attempts} attempts"
    )]
    Worn {
        /// Its index.
        sector: u32,
        /// Where it starts.
        offset: u32,
        /// How often it was tried.
        attempts: u32,
    },
    /// Comparing finds differences again and again.
    #[error(
        "the slot does not come to hold the table, after {rounds} rounds; {sectors} sectors still differ"
    )]
    NeverWhole {
        /// Sectors that differ at best.
        sectors: usize,
        /// Comparisons that got no better.
        rounds: u32,
    },
    /// Whoever watched wanted an end.
    #[error("stopped before all of the table had arrived")]
    Stopped,
}

impl UploadError {
    /// What to do about it.
    #[must_use]
    pub fn next_step(&self) -> &'static str {
        match self {
            Self::Device(DeviceError::Gone { .. } | DeviceError::NoAnswer { .. }) => {
                "Check the cable and the device's power, then flash again: it goes on where it stopped."
            }
            Self::Device(error) => error.next_step(),
            Self::Stalled { .. } => {
                "Check cable and power, or give a lower --baud, and flash again: it goes on where it stopped."
            }
            Self::Worn { .. } => {
                "The device's flash is worn out there: a shorter table may still fit before it; else replace the board."
            }
            Self::NeverWhole { .. } => {
                "Check the device's power supply and its log (`iltm monitor`), then flash again."
            }
            Self::Stopped => "Flash again: it goes on where it stopped.",
        }
    }
}
