//! Rows of still pictures, to be worked on in bands: the channels of a pixel stand side
//! by side.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

use super::bands::{Band, Bands, STRIP};
use super::curves::Code;

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
