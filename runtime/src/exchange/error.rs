//! What can be wrong with a frame memory and with a frame.

use core::fmt;

/// The region is too small for its frames.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RegionError {
    /// Bytes that the control words and four frames take.
    pub needed: usize,
    /// Bytes of the region.
    pub given: usize,
}

impl fmt::Display for RegionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the frames need {} bytes of frame memory and there are {}",
            self.needed, self.given
        )
    }
}

impl core::error::Error for RegionError {}

/// Why a device cannot take frames from a frame memory.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum AttachError {
    /// No source has announced itself.
    NoSource,
    /// The source speaks another version.
    Version {
        /// What the header says.
        found: u32,
    },
    /// The header describes no possible frame.
    Format,
    /// The frames do not fit.
    Region(RegionError),
}

impl fmt::Display for AttachError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSource => f.write_str("no source has announced frames"),
            Self::Version { found } => write!(
                f,
                "the source has version {found} of the frame memory; this device has {}",
                super::layout::VERSION
            ),
            Self::Format => f.write_str("the source announces frames that there cannot be"),
            Self::Region(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for AttachError {}

/// Why a frame is not shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Broken {
    /// The sequence numbers around the pixels differ, or changed while the frame
    /// was worked on.
    Torn,
    /// It has not as many bytes as the format says.
    Short,
    /// It is not newer than the frame before it.
    Stale,
    /// The source announced another format while the frame was worked on.
    Superseded,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Torn => "the frame changed while it was read",
            Self::Short => "the frame is incomplete",
            Self::Stale => "the frame is not newer than the last",
            Self::Superseded => "the source changed its format",
        })
    }
}

impl core::error::Error for Broken {}
