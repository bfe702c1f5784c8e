//! Where everything in a frame memory is.
//!
//! ```text
//! byte 0     header, see `word`
//! byte 64    four descriptors of 16 bytes, see `descriptor`: inputs, then outputs
//! byte 256   four frames in the same order, each from a multiple of 32 bytes
//! ```

use super::{Format, RegionError};
use core::ops::Range;

/// `ILTF` in memory order.
pub const MAGIC: u32 = u32::from_le_bytes(*b"ILTF");

/// Version of the layout described here.
pub const VERSION: u32 = 1;

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
}

/// Words of a descriptor, counted from its first.
pub mod descriptor {
    /// Who may touch the buffer.
    pub const OWNER: usize = 0;
    /// Sequence number, written before the first pixel.
    pub const START: usize = 1;
    /// Sequence number, written after the last pixel.
    pub const END: usize = 2;
    /// Bytes of the frame.
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
}

impl Layout {
    /// The layout of `format` in a region of `region` bytes.
    ///
    /// # Errors
    /// [`RegionError`] if four frames do not fit.
    pub const fn new(format: Format, region: usize) -> Result<Self, RegionError> {
        let frame = format.bytes();
        let needed = match frame.checked_next_multiple_of(ALIGNMENT) {
            Some(stride) => {
                let needed = stride
                    .saturating_mul(2 * BUFFERS)
                    .saturating_add(CONTROL_BYTES);
                if needed <= region {
                    return Ok(Self { frame, stride });
                }
                needed
            }
            None => usize::MAX,
        };
        Err(RegionError {
            needed,
            given: region,
        })
    }

    /// Bytes of input `buffer` in the region.
    #[must_use]
    pub const fn input(&self, buffer: usize) -> Range<usize> {
        self.frame(buffer % BUFFERS)
    }

    /// Bytes of output `buffer` in the region.
    #[must_use]
    pub const fn output(&self, buffer: usize) -> Range<usize> {
        self.frame(BUFFERS + buffer % BUFFERS)
    }

    /// Bytes of the largest frame that a region of `region` bytes can exchange.
    #[must_use]
    pub const fn capacity(region: usize) -> usize {
        let each = region.saturating_sub(CONTROL_BYTES) / (2 * BUFFERS);
        each - each % ALIGNMENT
    }

    /// Bytes of a frame.
    #[must_use]
    pub const fn frame_bytes(&self) -> usize {
        self.frame
    }

    const fn frame(&self, index: usize) -> Range<usize> {
        let start = CONTROL_BYTES + index * self.stride;
        start..start + self.frame
    }
}
