//! Full-resolution frames, whole and on one thread: what a device does.
//!
//! The result is that of the rows of [`FullPipeline`], bit for bit, by a way that
//! suits a small processor: gains and ambient light of all pixels are computed once
//! for a table; light is added up by columns of pixels first, which makes a row of
//! pixels one plain loop, and by cells once for every row of cells.

use super::FrameError;
use super::full::{FullPipeline, RowBuffers};
use super::pixels::Pixels;
use super::sample::{Encoding, Sample};
use super::stages::Workspace;
use crate::haar::ShortSlice;
use crate::kernel::Plane;
use crate::units::{ClippedSamples, Halfword};
use core::array::from_fn;

/// Memory for frames of `W x H` pixels of `C` channels over `N` cells.
#[derive(Debug)]
pub struct FullMemory<'m> {
    /// Gains of the pixels that cells cover, channels of a pixel side by side,
    /// `W * H * C` elements.
    pub gains: &'m mut [Halfword],
    /// Ambient light of the pixels in the same way; unused in a dark room.
    pub ambient: &'m mut [Halfword],
    /// Sums of the light of the cells, `C * N` elements.
    pub sums: &'m mut [u64],
    /// Corrections of the cells, `C * N` elements.
    pub corrections: &'m mut [i32],
    /// Light of the pixels of one channel, added up by columns: two rows of cells,
    /// `2 * W` elements for each channel.
    pub columns: &'m mut [u32],
    /// For one row, as wide as the frame.
    pub row: RowBuffers<'m>,
    /// One row of values of one channel, `W` elements.
    pub values: &'m mut [u16],
}

impl<const C: usize> FullPipeline<'_, '_, C> {
    fn check(&self, memory: &FullMemory<'_>) -> Result<(), ShortSlice> {
        let (cells, width) = (C * self.table().grid().cells(), self.frame().width());
        let samples = C * self.frame().pixels();
        let ambient = if self.table().ambient().is_some() {
            samples
        } else {
            0
        };
        for (what, needed, given) in [
            ("gains", samples, memory.gains.len()),
            ("ambient light", ambient, memory.ambient.len()),
            ("sums", cells, memory.sums.len()),
            ("corrections", cells, memory.corrections.len()),
            ("columns", 2 * C * width, memory.columns.len()),
            ("line", self.line_len(), memory.row.line.len()),
            ("spread", width, memory.row.spread.len()),
            ("values", width, memory.values.len()),
        ] {
            ShortSlice::check(what, needed, given)?;
        }
        Ok(())
    }

    /// Computes gains and ambient light of all pixels: once for a table and a size
    /// of frames.
    ///
    /// # Errors
    /// [`FrameError::Short`] if a slice is too short.
    pub fn prepare(&self, memory: &mut FullMemory<'_>) -> Result<(), FrameError> {
        (0..self.frame().height()).try_for_each(|y| self.prepare_row(y, memory))
    }

    /// [`prepare`](Self::prepare) for one row of pixels.
    ///
    /// # Errors
    /// [`FrameError::Short`] if a slice is too short.
    pub fn prepare_row(&self, y: usize, memory: &mut FullMemory<'_>) -> Result<(), FrameError> {
        self.check(memory)?;
        self.prepare_row_of(C, y, memory);
        Ok(())
    }

    /// [`prepare_row`](Self::prepare_row) for `channels` channels, whatever `C` is: code
    /// for one serves all.
    pub(super) fn prepare_row_of(&self, channels: usize, y: usize, memory: &mut FullMemory<'_>) {
        let width = self.frame().width() * channels;
        for channel in 0..channels {
            if let Some(line) = memory.gains.chunks_exact_mut(width.max(1)).nth(y) {
                self.gain_row(y, channel, &mut memory.row, memory.values);
                store(line, channel, channels, memory.values);
            }
            if self.table().ambient().is_some()
                && self.ambient_row(y, channel, &mut memory.row, memory.values)
                && let Some(line) = memory.ambient.chunks_exact_mut(width.max(1)).nth(y)
            {
                store(line, channel, channels, memory.values);
            }
        }
    }

    /// Compensates one frame at `tier` with memory that was
    /// [prepared](Self::prepare); returns how many samples were clipped.
    ///
    /// # Errors
    /// [`FrameError`] if the tier does not exist or a slice is too short; `input` is
    /// left as it was then.
    pub fn compensate<S: Sample>(
        &self,
        tier: u8,
        encoding: Encoding,
        wanted: &[[S; C]],
        input: &mut [[S; C]],
        memory: &mut FullMemory<'_>,
        workspace: &mut Workspace<'_>,
    ) -> Result<ClippedSamples, FrameError> {
        self.check_tier(tier)?;
        self.check_pixels("input", input.len())?;
        if self.operates(tier) {
            self.average_frame(encoding, wanted, memory)?;
            self.correct(tier, memory.sums, memory.corrections, workspace)?;
        }
        self.finish_frame(tier, encoding, wanted, input, memory)
    }

    /// First stage: adds up the light of a frame by cells.
    ///
    /// # Errors
    /// [`FrameError::Short`] if a slice is too short.
    pub fn average_frame<S: Sample>(
        &self,
        encoding: Encoding,
        wanted: &[[S; C]],
        memory: &mut FullMemory<'_>,
    ) -> Result<(), FrameError> {
        self.check(memory)?;
        self.check_pixels("wanted", wanted.len())?;
        let (cells, width) = (self.table().grid().cells(), self.frame().width());
        memory.sums.fill(0);
        let (ambient, _) = memory.ambient.as_chunks();
        let sums = memory.sums.chunks_exact_mut(cells.max(1));
        let columns = memory.columns.chunks_exact_mut((2 * width).max(1));
        for (channel, (sums, columns)) in sums.zip(columns).enumerate().take(C) {
            let curves = S::curves(self.table(), encoding, channel);
            self.average(columns, sums, |y, weight, columns| {
                let pixels = self.pixels(wanted, ambient, y, channel, curves);
                S::add_light(&pixels, weight, columns);
            });
        }
        Ok(())
    }

    /// Last stage: gain, interpolated corrections, clip and code; returns how many
    /// samples were clipped. At a tier without operator there are no corrections.
    ///
    /// # Errors
    /// [`FrameError::Short`] if a slice is too short.
    pub fn finish_frame<S: Sample>(
        &self,
        tier: u8,
        encoding: Encoding,
        wanted: &[[S; C]],
        input: &mut [[S; C]],
        memory: &mut FullMemory<'_>,
    ) -> Result<ClippedSamples, FrameError> {
        self.check(memory)?;
        self.check_pixels("wanted", wanted.len())?;
        self.check_pixels("input", input.len())?;
        let (cells, width) = (self.table().grid().cells(), self.frame().width());
        let operates = self.operates(tier);
        if !operates {
            memory.row.spread.fill(0);
        }
        let fraction = u32::from(self.table().gain_fraction());
        let curves: [_; C] = from_fn(|channel| S::curves(self.table(), encoding, channel));
        let mut clipped = ClippedSamples::default();
        if self.frame() != self.whole() {
            // What no cell covers stays black.
            input.as_flattened_mut().fill(S::default());
        }
        let input = input.get_mut(self.start()..).unwrap_or_default();
        let lines = input.chunks_mut(self.whole().width());
        let lines = lines.take(self.frame().height());
        let (gains, _) = memory.gains.as_chunks();
        let (ambient, _) = memory.ambient.as_chunks();
        for (y, (line, gains)) in lines.zip(gains.chunks_exact(width.max(1))).enumerate() {
            let corrections = memory.corrections.chunks_exact(cells.max(1));
            for (channel, (corrections, curves)) in corrections.zip(curves).enumerate() {
                if operates {
                    self.correct_row(y, corrections, &mut memory.row);
                }
                let spread = memory.row.spread.get(..width).unwrap_or_default();
                let pixels = self.pixels(wanted, ambient, y, channel, curves);
                clipped += S::finish(&pixels, fraction, gains, spread, line);
            }
        }
        Ok(clipped)
    }

    fn check_pixels(&self, what: &'static str, given: usize) -> Result<(), ShortSlice> {
        let needed = self.whole().pixels();
        ShortSlice::check(what, needed, given)
    }

    /// The first pixel that a cell covers.
    const fn start(&self) -> usize {
        let area = self.area();
        area.top * self.whole().width() + area.left
    }

    /// One channel of the pixels from row `y` on.
    fn pixels<'f, S: Sample>(
        &'f self,
        wanted: &'f [[S; C]],
        ambient: &'f [[Halfword; C]],
        y: usize,
        channel: usize,
        curves: S::Curves<'f>,
    ) -> Pixels<'f, S, C> {
        let width = self.frame().width();
        let start = self.start() + y * self.whole().width();
        let ambient = self
            .table()
            .ambient()
            .map(|_| ambient.get(y * width..).unwrap_or_default());
        Pixels {
            plane: Plane {
                codes: wanted.get(start..).unwrap_or_default(),
                ambient,
                cols: width,
                channel,
            },
            curves,
        }
    }
}

/// Stores a row of one channel.
fn store(line: &mut [Halfword], channel: usize, channels: usize, values: &[u16]) {
    let line = line.iter_mut().skip(channel).step_by(channels.max(1));
    for (slot, value) in line.zip(values) {
        *slot = value.to_le_bytes();
    }
}
