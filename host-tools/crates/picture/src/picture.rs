//! Pictures in memory: 8- or 16-bit codes of one or three channels.

use iltm_runtime::FrameSize;

/// A picture of one (grey) or three (red, green, blue) channels.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Picture {
    size: FrameSize,
    channels: usize,
    samples: Samples,
}

/// The samples of a picture, row by row, the channels of a pixel side by side.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Samples {
    /// Full scale 255.
    Eight(Vec<u8>),
    /// Full scale 65,535.
    Sixteen(Vec<u16>),
}

impl Samples {
    /// How many there are.
    #[must_use]
    pub const fn len(&self) -> usize {
        match self {
            Self::Eight(samples) => samples.len(),
            Self::Sixteen(samples) => samples.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Picture {
    /// A picture of these samples; `None` unless there is one for each pixel, or
    /// three.
    #[must_use]
    pub fn new(size: FrameSize, samples: Samples) -> Option<Self> {
        let channels = if samples.len() == size.pixels() {
            1
        } else if samples.len() == 3 * size.pixels() {
            3
        } else {
            return None;
        };
        Some(Self {
            size,
            channels,
            samples,
        })
    }

    /// A picture of three channels, `3 * size.pixels()` samples.
    #[must_use]
    pub const fn of_colours(size: FrameSize, samples: Samples) -> Self {
        Self {
            size,
            channels: 3,
            samples,
        }
    }

    /// A picture of `N` channels with 8-bit samples, each pixel's from its column and
    /// row.
    #[must_use]
    pub fn from_fn<const N: usize>(
        size: FrameSize,
        pixel: impl Fn(usize, usize) -> [u8; N],
    ) -> Self {
        const { assert!(N == 1 || N == 3, "a picture has one channel or three") };
        let (width, height) = (size.width(), size.height());
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Self {
            size,
            channels: N,
            samples: Samples::Eight(pixels.flat_map(|(x, y)| pixel(x, y)).collect()),
        }
    }

    /// Its size.
    #[must_use]
    pub const fn size(&self) -> FrameSize {
        self.size
    }

    /// Channels of a pixel: 1 or 3.
    #[must_use]
    pub const fn channels(&self) -> usize {
        self.channels
    }

    /// Its samples.
    #[must_use]
    pub const fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Its samples, to be changed in place.
    pub fn samples_mut(&mut self) -> &mut Samples {
        &mut self.samples
    }
}
