//! Layout of a frame memory: header, descriptors, pixels, and how its words are reached.
//!
//! ```text
//! byte 0     header, see `word`
//! byte 64    four descriptors of 16 bytes, see `descriptor`: inputs, then outputs
//! byte 256   four frames in the same order, each from a multiple of 32 bytes
//! ```
//!
//! Where the device is one of several projectors', the light that is wanted of its neighbours'
//! cells ([`Neighbours`](crate::image::Neighbours)) follows the pixels of an input, from a multiple
//! of 4 bytes. A source that has none for a frame hands it over with the length of the pixels alone.

use super::AttachError;
use crate::features::Stage;
use crate::pipeline::Encoding;
use crate::units::Halfword;
use crate::{FrameSize, Grid};
use core::fmt;
use core::ops::Range;
use core::sync::atomic::{AtomicU32, Ordering};

/// `ILTF` in memory order.
pub const MAGIC: u32 = u32::from_le_bytes(*b"ILTF");

/// Version of the layout described here.
pub const VERSION: u32 = 2;

/// Bytes of the header and descriptors.
pub const CONTROL_BYTES: usize = 256;

/// The same in words.
pub const CONTROL_WORDS: usize = CONTROL_BYTES / 4;

/// Input buffers, and output buffers.
pub const BUFFERS: usize = 2;

/// Frames start at multiples of this: a cache line of the largest Cortex-M, so
/// that cleaning one buffer never touches another.
const ALIGNMENT: usize = 32;

/// Words of the header, `u32` each. The source writes them, except for
/// [`ATTACHED`](word::ATTACHED).
pub mod word {
    /// [`MAGIC`](super::MAGIC) once the header is whole.
    pub const MAGIC: usize = 0;
    /// [`VERSION`](super::VERSION).
    pub const VERSION: usize = 1;
    /// Width in the low half, height in the high half.
    pub const GEOMETRY: usize = 2;
    /// Channels in the lowest byte; in the next, 0 for video, 1 for linear light.
    pub const SAMPLES: usize = 3;
    /// Microseconds from frame to frame.
    pub const PERIOD: usize = 4;
    /// Changes with every announcement.
    pub const EPOCH: usize = 5;
    /// The [`EPOCH`] that the device works with; the device writes it.
    pub const ATTACHED: usize = 6;
    /// Rows of the neighbours' cells in the low half, columns in the high half; 0 if no light of
    /// theirs comes.
    pub const NEIGHBOURS: usize = 7;
}

/// Words of a descriptor, counted from its first.
pub mod descriptor {
    /// Who may touch the buffer.
    pub const OWNER: usize = 0;
    /// Sequence number, written before the first pixel.
    pub const START: usize = 1;
    /// Sequence number, written after the last pixel.
    pub const END: usize = 2;
    /// Bytes of the frame: its pixels, and the neighbours' light if that came.
    pub const LENGTH: usize = 3;
    /// Words of a descriptor.
    pub const SIZE: usize = 4;

    /// The first word of input `buffer`'s descriptor.
    #[must_use]
    pub const fn input(buffer: usize) -> usize {
        16 + buffer * SIZE
    }

    /// The first word of output `buffer`'s descriptor.
    #[must_use]
    pub const fn output(buffer: usize) -> usize {
        16 + (super::BUFFERS + buffer) * SIZE
    }
}

/// Values of an owner word. A value that is none of them owns nothing.
pub mod owner {
    /// The other side: the source of an input, the display of an output.
    pub const OUTSIDE: u32 = 0;
    /// The device.
    pub const DEVICE: u32 = 1;
}

/// Where the pixels of a format lie in a region.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Layout {
    frame: usize,
    stride: usize,
    /// Bytes of the neighbours' light.
    light: usize,
    input_stride: usize,
}

impl Layout {
    /// The layout of `format` in a region of `region` bytes.
    ///
    /// # Errors
    /// [`RegionError`] if four frames do not fit.
    pub const fn new(format: Format, region: usize) -> Result<Self, RegionError> {
        let (frame, light) = (format.bytes(), format.light_bytes());
        let given = region;
        let Some(stride) = frame.checked_next_multiple_of(ALIGNMENT) else {
            let needed = usize::MAX;
            return Err(RegionError { needed, given });
        };
        let input_stride = if light == 0 {
            stride
        } else {
            (light_start(frame).saturating_add(light)).next_multiple_of(ALIGNMENT)
        };
        let needed = stride
            .saturating_add(input_stride)
            .saturating_mul(BUFFERS)
            .saturating_add(CONTROL_BYTES);
        if needed > region {
            return Err(RegionError { needed, given });
        }
        Ok(Self {
            frame,
            stride,
            light,
            input_stride,
        })
    }

    /// The pixels of input `buffer` in the region.
    #[must_use]
    pub const fn input(&self, buffer: usize) -> Range<usize> {
        let start = CONTROL_BYTES + buffer % BUFFERS * self.input_stride;
        start..start + self.frame
    }

    /// The neighbours' light of input `buffer`; empty if the format has none.
    #[must_use]
    pub const fn light(&self, buffer: usize) -> Range<usize> {
        let start = light_start(self.input(buffer).end);
        start..start + self.light
    }

    /// Bytes of output `buffer` in the region.
    #[must_use]
    pub const fn output(&self, buffer: usize) -> Range<usize> {
        let start = CONTROL_BYTES + BUFFERS * self.input_stride;
        let start = start + buffer % BUFFERS * self.stride;
        start..start + self.frame
    }

    /// Bytes of the largest frame that a region of `region` bytes can exchange.
    #[must_use]
    pub const fn capacity(region: usize) -> usize {
        let each = region.saturating_sub(CONTROL_BYTES) / (2 * BUFFERS);
        each - each % ALIGNMENT
    }

    /// Bytes of a frame's pixels.
    #[must_use]
    pub const fn frame_bytes(&self) -> usize {
        self.frame
    }

    /// Bytes of an input with the neighbours' light, or without.
    #[must_use]
    pub const fn input_bytes(&self, with_light: bool) -> usize {
        self.frame + if with_light { self.light } else { 0 }
    }
}

/// Where the light behind pixels begins that end here.
const fn light_start(end: usize) -> usize {
    end.saturating_add(3) & !3
}

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

/// Frames of 8-bit samples, channels of a pixel side by side, rows one after the
/// other without gaps.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Format {
    size: FrameSize,
    channels: u8,
    encoding: Encoding,
    period_us: u32,
    neighbours: Option<Grid>,
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
            neighbours: None,
        })
    }

    /// The same with light of the neighbours' cells.
    #[must_use]
    pub const fn with_neighbours(self, neighbours: Option<Grid>) -> Self {
        Self { neighbours, ..self }
    }

    /// The neighbours' cells whose light comes with the frames.
    #[must_use]
    pub const fn neighbours(self) -> Option<Grid> {
        if Stage::Neighbours.is_built() {
            self.neighbours
        } else {
            None
        }
    }

    /// Bytes of that light.
    #[must_use]
    pub const fn light_bytes(self) -> usize {
        match self.neighbours() {
            Some(grid) => grid.cells() * self.channels as usize * size_of::<Halfword>(),
            None => 0,
        }
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

    /// Bytes of a frame's pixels.
    #[must_use]
    pub const fn bytes(self) -> usize {
        // At most 65,535 * 65,535 * 3, which a 32-bit `usize` does not hold.
        self.size
            .width()
            .saturating_mul(self.size.height())
            .saturating_mul(self.channels as usize)
    }

    /// Reads the header.
    pub(super) fn parse(words: &impl ControlWords) -> Result<Self, AttachError> {
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
        let neighbours = words.load(word::NEIGHBOURS);
        let neighbours = match neighbours {
            0 => None,
            // Firmware without the stage would look for the pixels in the wrong place.
            _ if !Stage::Neighbours.is_built() => return Err(AttachError::Format),
            sides => match Grid::new(sides as u16, (sides >> 16) as u16) {
                Ok(grid) => Some(grid),
                Err(_) => return Err(AttachError::Format),
            },
        };
        size.and_then(|size| Self::new(size, channels, encoding, words.load(word::PERIOD)))
            .map(|format| format.with_neighbours(neighbours))
            .ok_or(AttachError::Format)
    }

    /// Writes the header except for the magic number.
    pub(super) fn emit(self, words: &impl ControlWords) {
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
        let neighbours = self
            .neighbours()
            .map_or(0, |grid| grid.rows() as u32 | ((grid.cols() as u32) << 16));
        words.store(word::NEIGHBOURS, neighbours);
    }
}

/// The control words of a frame memory, as one side reaches them.
///
/// A device has them as atomics ([`NativeWords`]); a host may read and write the
/// file behind an emulator's memory.
pub trait ControlWords {
    /// The word at `index`, with acquire ordering: what the other side wrote
    /// before it stored this value can be read afterwards. Zero outside.
    fn load(&self, index: usize) -> u32;

    /// Stores the word at `index` with release ordering: what this side wrote
    /// before can be read by whoever loads this value. Nothing outside.
    fn store(&self, index: usize, value: u32);
}

impl<W: ControlWords + ?Sized> ControlWords for &W {
    fn load(&self, index: usize) -> u32 {
        (**self).load(index)
    }

    fn store(&self, index: usize, value: u32) {
        (**self).store(index, value);
    }
}

/// Control words in memory that this processor shares with the other side.
#[derive(Clone, Copy, Debug)]
pub struct NativeWords<'m>(pub &'m [AtomicU32]);

impl ControlWords for NativeWords<'_> {
    fn load(&self, index: usize) -> u32 {
        let word = self.0.get(index);
        u32::from_le(word.map_or(0, |word| word.load(Ordering::Acquire)))
    }

    fn store(&self, index: usize, value: u32) {
        if let Some(word) = self.0.get(index) {
            word.store(value.to_le(), Ordering::Release);
        }
    }
}
