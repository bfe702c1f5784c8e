//! What the frames in a frame memory look like.

use super::layout::{MAGIC, VERSION, word};
use super::{AttachError, ControlWords};
use crate::FrameSize;
use crate::pipeline::Encoding;

/// Frames of 8-bit samples, channels of a pixel side by side, rows one after the
/// other without gaps.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Format {
    size: FrameSize,
    channels: u8,
    encoding: Encoding,
    period_us: u32,
}

impl Format {
    /// Frames of this size, `channels` (1 or 3) and meaning, one every
    /// `period_us` microseconds; `None` if there is no such frame.
    #[must_use]
    pub const fn new(
        size: FrameSize,
        channels: u8,
        encoding: Encoding,
        period_us: u32,
    ) -> Option<Self> {
        if !matches!(channels, 1 | 3) || period_us == 0 {
            return None;
        }
        Some(Self {
            size,
            channels,
            encoding,
            period_us,
        })
    }

    /// Pixels of a frame.
    #[must_use]
    pub const fn size(self) -> FrameSize {
        self.size
    }

    /// Samples of a pixel, 1 or 3.
    #[must_use]
    pub const fn channels(self) -> u8 {
        self.channels
    }

    /// What the samples mean.
    #[must_use]
    pub const fn encoding(self) -> Encoding {
        self.encoding
    }

    /// Microseconds from frame to frame.
    #[must_use]
    pub const fn period_us(self) -> u32 {
        self.period_us
    }

    /// Bytes of a frame.
    #[must_use]
    pub const fn bytes(self) -> usize {
        // At most 65,535 * 65,535 * 3, which a 32-bit `usize` does not hold.
        self.size
            .width()
            .saturating_mul(self.size.height())
            .saturating_mul(self.channels as usize)
    }

    /// Reads the header.
    pub(super) fn read(words: &impl ControlWords) -> Result<Self, AttachError> {
        if words.load(word::MAGIC) != MAGIC {
            return Err(AttachError::NoSource);
        }
        let found = words.load(word::VERSION);
        if found != VERSION {
            return Err(AttachError::Version { found });
        }
        let geometry = words.load(word::GEOMETRY);
        let size = FrameSize::new(geometry as u16, (geometry >> 16) as u16);
        let [channels, encoding, 0, 0] = words.load(word::SAMPLES).to_le_bytes() else {
            return Err(AttachError::Format);
        };
        let encoding = match encoding {
            0 => Encoding::Display,
            1 => Encoding::Linear,
            _ => return Err(AttachError::Format),
        };
        size.and_then(|size| Self::new(size, channels, encoding, words.load(word::PERIOD)))
            .ok_or(AttachError::Format)
    }

    /// Writes the header except for the magic number.
    pub(super) fn write(self, words: &impl ControlWords) {
        let (width, height) = (self.size.width() as u32, self.size.height() as u32);
        let encoding = match self.encoding {
            Encoding::Display => 0,
            Encoding::Linear => 1,
        };
        let samples = u32::from_le_bytes([self.channels, encoding, 0, 0]);
        words.store(word::VERSION, VERSION);
        words.store(word::GEOMETRY, width | (height << 16));
        words.store(word::SAMPLES, samples);
        words.store(word::PERIOD, self.period_us);
    }
}
