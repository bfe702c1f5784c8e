//! `A`: the exact mean of the light over each cell.
//!
//! Along an axis of `length` pixels and `cells` cells, a pixel is `cells` units
//! long and a cell `length` units, so every overlap is an integer.

#![allow(
    clippy::inline_always,
    reason = "a host compiles rows for its widest vectors, which a call would leave"
)]

use crate::units::Light;
use crate::{FrameSize, Grid};

/// Adds up the light of a frame by cells, one row of pixels at a time.
#[derive(Clone, Copy, Debug)]
pub struct AreaAverage {
    grid: Grid,
    frame: FrameSize,
}

impl AreaAverage {
    /// For frames of this size; `None` if some cell would cover no pixel.
    #[must_use]
    pub fn new(grid: Grid, frame: FrameSize) -> Option<Self> {
        frame.holds(grid).then_some(Self { grid, frame })
    }

    /// Adds row `y` of one channel to the `sums` of the cells that it crosses.
    ///
    /// `sums` has one element a cell; `light` one a pixel of the row. The order
    /// of rows does not matter, and sums of different rows may be added up
    /// afterwards, so rows can be spread over threads.
    #[inline(always)]
    pub fn add_row<const C: usize>(
        &self,
        y: usize,
        light: &[Light],
        channel: usize,
        sums: &mut [[u64; C]],
    ) {
        let (rows, height) = (self.grid.rows(), self.frame.height());
        if y >= height {
            return;
        }
        let (start, end) = (y * rows, (y + 1) * rows);
        let row = start / height;
        let split = ((row + 1) * height).min(end);
        let cols = self.grid.cols();
        let mut lines = sums.chunks_exact_mut(cols).skip(row);
        let first = lines.next().unwrap_or_default();
        // Rows are at least as many as cells, so a row of pixels crosses into
        // one more row of cells at most.
        let second = if end > split {
            lines.next().unwrap_or_default()
        } else {
            &mut []
        };
        let weights = ((split - start) as u64, (end - split) as u64);
        let mut second = second.iter_mut();
        for (sum, light) in first.iter_mut().zip(self.row_sums(light)) {
            if let Some(sum) = sum.get_mut(channel) {
                *sum = sum.wrapping_add(weights.0 * u64::from(light));
            }
            if let Some(sum) = second.next().and_then(|sum| sum.get_mut(channel)) {
                *sum = sum.wrapping_add(weights.1 * u64::from(light));
            }
        }
    }

    /// For each cell along a row, the light of its pixels times their overlaps.
    /// At most `width * 2^15`, which a `u32` holds for any width.
    #[inline(always)]
    fn row_sums(self, light: &[Light]) -> impl Iterator<Item = u32> + use<'_> {
        let (cols, width) = (self.grid.cols(), self.frame.width());
        let (whole, part) = (width / cols, width % cols);
        let (mut pixel, mut cut) = (0, 0);
        (0..cols).map(move |_| {
            let (first, first_cut) = (pixel, cut);
            pixel += whole;
            cut += part;
            if cut >= cols {
                cut -= cols;
                pixel += 1;
            }
            let at = |x: usize| light.get(x).map_or(0, |light| u32::from(light.to_bits()));
            let inner = light.get(first..pixel).unwrap_or_default();
            let inner: u32 = inner.iter().map(|light| u32::from(light.to_bits())).sum();
            // All pixels from the one where the cell starts, without the part of
            // it before the cell, and the part of the one where it ends.
            (inner * cols as u32) - at(first) * first_cut as u32 + at(pixel) * cut as u32
        })
    }

    /// The mean light of a cell from its sum, to nearest.
    #[must_use]
    pub fn mean(&self, sum: u64) -> Light {
        let area = self.frame.width() as u64 * self.frame.height() as u64;
        let mean = (sum + area / 2) / area.max(1);
        Light::from_bits(mean.min(u64::from(Light::ONE.to_bits())) as u16)
    }
}
