//! A still picture, or one frame, in memory.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

use super::bands::{Band, Bands, STRIP};
use super::curves::Code;
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
    pub(super) const fn of_colours(size: FrameSize, samples: Samples) -> Self {
        Self {
            size,
            channels: 3,
            samples,
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
    pub(super) fn samples_mut(&mut self) -> &mut Samples {
        &mut self.samples
    }
}

/// Samples of a picture, to be worked on in bands.
#[derive(Debug)]
pub(super) struct Interleaved<'p, S> {
    pub(super) width: usize,
    pub(super) channels: usize,
    pub(super) samples: &'p mut [S],
}

impl<S: Code> Bands for Interleaved<'_, S> {
    type Code = S;
    type Band<'b>
        = Interleaved<'b, S>
    where
        Self: 'b;
    type Memory = ();

    fn bands(&mut self, rows: usize) -> Vec<Interleaved<'_, S>> {
        let (width, channels) = (self.width, self.channels);
        let bands = self.samples.chunks_mut(rows * width * channels);
        let band = |samples| Interleaved {
            width,
            channels,
            samples,
        };
        bands.map(band).collect()
    }
}

impl<S: Code> Band for Interleaved<'_, S> {
    type Code = S;
    type Memory = ();

    fn rows(&self) -> usize {
        self.samples.len() / (self.width * self.channels)
    }

    #[inline(always)]
    fn unpack(&self, strip: usize, _memory: &mut (), colours: &mut [S]) {
        let row = self.width * self.channels;
        let rows = self.samples[STRIP * strip * row..].chunks_exact(row);
        for (row, colours) in rows.zip(colours.chunks_exact_mut(row)) {
            for (channel, colour) in colours.chunks_exact_mut(self.width).enumerate() {
                let samples = row.iter().skip(channel).step_by(self.channels);
                for (sample, code) in samples.zip(colour) {
                    *code = *sample;
                }
            }
        }
    }

    #[inline(always)]
    fn pack(&mut self, strip: usize, _memory: &mut (), colours: &[S]) {
        let row = self.width * self.channels;
        let rows = self.samples[STRIP * strip * row..].chunks_exact_mut(row);
        for (row, colours) in rows.zip(colours.chunks_exact(row)) {
            for (channel, colour) in colours.chunks_exact(self.width).enumerate() {
                let samples = row.iter_mut().skip(channel).step_by(self.channels);
                for (sample, code) in samples.zip(colour) {
                    *sample = *code;
                }
            }
        }
    }
}
