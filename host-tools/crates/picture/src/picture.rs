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

    /// A picture of three channels with 8-bit samples, `3 * size.pixels()` of them.
    #[must_use]
    pub const fn of_colours(size: FrameSize, samples: Vec<u8>) -> Self {
        Self {
            size,
            channels: 3,
            samples: Samples::Eight(samples),
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

    /// A picture of 1 or 3 channels with 8-bit samples, each from its pixel, row by row,
    /// and its channel.
    ///
    /// # Panics
    /// If it has another number of channels.
    #[must_use]
    pub fn of_codes(size: FrameSize, channels: usize, code: impl Fn(usize, usize) -> u8) -> Self {
        assert!(matches!(channels, 1 | 3), "{channels} channels");
        let samples = 0..size.pixels() * channels;
        let samples = samples.map(|at| code(at / channels, at % channels));
        Self {
            size,
            channels,
            samples: Samples::Eight(samples.collect()),
        }
    }

    /// Each pixel as a square of `factor` x `factor`; the picture as it is where that would
    /// be larger than a frame.
    #[must_use]
    pub fn enlarged(&self, factor: usize) -> Self {
        let (width, height) = (self.size.width(), self.size.height());
        let side = |length: usize| u16::try_from(length * factor).ok();
        let size = side(width).zip(side(height));
        let Some(size) = size.and_then(|(width, height)| FrameSize::new(width, height)) else {
            return self.clone();
        };
        let row = width * self.channels;
        let samples = match &self.samples {
            Samples::Eight(codes) => Samples::Eight(squares(codes, row, self.channels, factor)),
            Samples::Sixteen(codes) => Samples::Sixteen(squares(codes, row, self.channels, factor)),
        };
        Self {
            size,
            channels: self.channels,
            samples,
        }
    }

    /// What is left of it without `border` pixels on every side; `None` if nothing is.
    #[must_use]
    pub fn without_border(&self, border: u16) -> Option<Self> {
        let border = usize::from(border);
        let left = |side: usize| u16::try_from(side.checked_sub(2 * border)?).ok();
        let size = FrameSize::new(left(self.size.width())?, left(self.size.height())?)?;
        self.part([border; 2], size)
    }

    /// The part of this size with its upper left pixel at `x` and `y`; `None` if the picture does
    /// not have all of it.
    #[must_use]
    pub fn part(&self, [x, y]: [usize; 2], size: FrameSize) -> Option<Self> {
        let fits = |from: usize, part: usize, whole: usize| {
            from.checked_add(part).is_some_and(|to| to <= whole)
        };
        if !fits(x, size.width(), self.size.width()) || !fits(y, size.height(), self.size.height())
        {
            return None;
        }
        let (line, channels) = (self.size.width() * self.channels, self.channels);
        let parts = (y..y + size.height()).map(|y| {
            let begin = y * line + x * channels;
            begin..begin + size.width() * channels
        });
        let samples = match &self.samples {
            Samples::Eight(codes) => {
                Samples::Eight(parts.flat_map(|part| codes[part].iter().copied()).collect())
            }
            Samples::Sixteen(codes) => {
                Samples::Sixteen(parts.flat_map(|part| codes[part].iter().copied()).collect())
            }
        };
        Some(Self {
            size,
            channels,
            samples,
        })
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

/// Samples with each pixel `factor` times in its row, and each row as often.
fn squares<T: Copy>(samples: &[T], row: usize, channels: usize, factor: usize) -> Vec<T> {
    let line = |row: &[T]| -> Vec<T> {
        let pixels = row.chunks(channels);
        pixels.flat_map(|pixel| pixel.repeat(factor)).collect()
    };
    let rows = samples.chunks(row);
    rows.flat_map(|row| line(row).repeat(factor)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn enlarged_pixels_are_squares() {
        let size = FrameSize::new(2, 1).unwrap();
        let picture = Picture::of_codes(size, 3, |pixel, channel| (10 * pixel + channel) as u8);
        let large = picture.enlarged(2);
        assert_eq!(large.size(), FrameSize::new(4, 2).unwrap());
        let row = [0, 1, 2, 0, 1, 2, 10, 11, 12, 10, 11, 12];
        assert_eq!(large.samples(), &Samples::Eight([row, row].concat()));
        assert_eq!(picture.enlarged(usize::from(u16::MAX)), picture);
    }
}
