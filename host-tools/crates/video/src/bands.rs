//! Bands of rows, which can be spread over threads and turned into separate colours:
//! what frames of all layouts have in common, and that of pictures.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

use super::curves::Code;

/// Rows that are turned into colours together: a row of 4:2:0 chroma has two.
pub(super) const STRIP: usize = 2;

/// A frame whose rows can be worked on by several threads.
pub(super) trait Bands: Send {
    /// Its samples.
    type Code: Code;
    /// Some adjacent rows.
    type Band<'b>: Band<Code = Self::Code, Memory = Self::Memory>
    where
        Self: 'b;
    /// What a thread needs to convert rows.
    type Memory: Default + Send;

    /// Cuts the frame into bands of `rows` rows, the last one shorter; `rows` is a
    /// multiple of [`STRIP`].
    fn bands(&mut self, rows: usize) -> Vec<Self::Band<'_>>;
}

/// Some adjacent rows of a frame, from an even one on.
pub(super) trait Band: Send + Sync {
    /// Its samples.
    type Code: Code;
    /// What a thread needs to convert rows.
    type Memory: Default + Send;

    /// How many rows there are.
    fn rows(&self) -> usize;

    /// Separates the colours of one strip. `colours` has one row of codes after
    /// the other: the first row's colours, then the second's.
    fn unpack(&self, strip: usize, memory: &mut Self::Memory, colours: &mut [Self::Code]);

    /// Puts the colours of one strip, in the same order, back into the frame.
    fn pack(&mut self, strip: usize, memory: &mut Self::Memory, colours: &[Self::Code]);
}

/// Samples of a picture, the channels of a pixel side by side.
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
