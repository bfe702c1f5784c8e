//! Area average `A`: the exact mean of the light over each cell.
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

    /// The cell that has the largest part of a pixel, `row * cols + col`; of two that
    /// share it evenly, the later one. `None` outside of the frame.
    ///
    /// A picture of the cells that is drawn by this rule is lit where the averages
    /// look, but for the pixels that a border cuts.
    #[must_use]
    pub fn owner(&self, x: usize, y: usize) -> Option<usize> {
        // Cells are a pixel wide or wider, so no more than one border cuts a pixel,
        // and whose its centre is, of that it is the larger part.
        let along = |pixel: usize, cells: usize, length: usize| {
            let (twice, cells) = (2 * pixel as u64 + 1, cells as u64);
            (pixel < length).then(|| (twice * cells / (2 * length as u64)) as usize)
        };
        let row = along(y, self.grid.rows(), self.frame.height())?;
        let col = along(x, self.grid.cols(), self.frame.width())?;
        Some(row * self.grid.cols() + col)
    }

    /// Adds row `y` of one channel to the `sums` of the cells that it crosses.
    ///
    /// `sums` has one element a cell; `light` one a pixel of the row. The order
    /// of rows does not matter, and sums of different rows may be added up
    /// afterwards, so rows can be spread over threads.
    #[inline(always)]
    pub fn add_row(&self, y: usize, light: &[Light], sums: &mut [u64]) {
        let (rows, height) = (self.grid.rows(), self.frame.height());
        if y >= height {
            return;
        }
        let (start, end) = (y * rows, (y + 1) * rows);
        let row = start / height;
        let split = ((row + 1) * height).min(end);
        let cols = self.grid.cols();
        let mut lines = sums.chunks_exact_mut(cols.max(1)).skip(row);
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
            *sum = sum.wrapping_add(weights.0 * u64::from(light));
            if let Some(sum) = second.next() {
                *sum = sum.wrapping_add(weights.1 * u64::from(light));
            }
        }
    }

    /// Adds a whole frame of one channel, with the same result as
    /// [`add_row`](Self::add_row) row by row.
    ///
    /// `add(y, weight, columns)` adds the light of row `y` times `weight` to the
    /// columns. `columns` has two elements a pixel of a row: a row of pixels may
    /// belong to two rows of cells.
    pub fn add_frame(
        &self,
        columns: &mut [u32],
        sums: &mut [u64],
        add: impl Fn(usize, u32, &mut [u32]),
    ) {
        let (rows, height, width) = (self.grid.rows(), self.frame.height(), self.frame.width());
        let half = columns.len() / 2;
        let (mut columns, mut next) = columns.split_at_mut(half);
        columns.fill(0);
        next.fill(0);
        let mut lines = sums.chunks_exact_mut(self.grid.cols().max(1));
        let mut end = height;
        for y in 0..height {
            // Row y of pixels is `rows` units high, a row of cells `height` units.
            let past = ((y + 1) * rows).saturating_sub(end);
            add(
                y,
                (rows - past) as u32,
                columns.get_mut(..width).unwrap_or_default(),
            );
            if (y + 1) * rows < end {
                continue;
            }
            if past > 0 {
                add(y, past as u32, next.get_mut(..width).unwrap_or_default());
            }
            let line = lines.next().unwrap_or_default();
            self.add_columns(columns, line);
            columns.fill(0);
            core::mem::swap(&mut columns, &mut next);
            end += height;
        }
    }

    /// Adds columns to the sums of a row of cells.
    fn add_columns(self, columns: &[u32], line: &mut [u64]) {
        for (sum, light) in line.iter_mut().zip(self.row_sums(columns)) {
            *sum = sum.wrapping_add(light);
        }
    }

    /// For each cell along a row, the light of its pixels times their overlaps.
    #[inline(always)]
    fn row_sums<T: Amount>(self, light: &[T]) -> impl Iterator<Item = T::Sum> + use<'_, T> {
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
            let inner = light.get(first..pixel).unwrap_or_default();
            let (start, end) = (light.get(first), light.get(pixel));
            // All pixels from the one where the cell starts, without the part of
            // it before the cell, and the part of the one where it ends.
            T::total(
                inner,
                cols as u32,
                (start, first_cut as u32),
                (end, cut as u32),
            )
        })
    }

    /// The mean light of a cell from its sum, to nearest.
    #[must_use]
    pub fn mean(&self, sum: u64) -> Light {
        let area = self.frame.width() as u64 * self.frame.height() as u64;
        let rounded = sum + area / 2;
        // Most frames are small enough for a division of 32 bits, which a small
        // processor does in one instruction.
        let mean = match (u32::try_from(rounded), u32::try_from(area)) {
            (Ok(rounded), Ok(area)) => (rounded / area.max(1)).into(),
            _ => rounded / area.max(1),
        };
        Light::from_bits(mean.min(u64::from(Light::ONE.to_bits())) as u16)
    }
}

/// What is added up along a row.
trait Amount: Copy {
    /// Holds the sum of a row of any width.
    type Sum;

    /// `whole` times the sum of `inner`, less the part of the first, and a part of the
    /// one after the last.
    fn total(
        inner: &[Self],
        whole: u32,
        first: (Option<&Self>, u32),
        after: (Option<&Self>, u32),
    ) -> Self::Sum;
}

/// A row of pixels: at most `width * 2^15`, which a `u32` holds for any width.
impl Amount for Light {
    type Sum = u32;

    #[inline(always)]
    fn total(
        inner: &[Self],
        whole: u32,
        (first, before): (Option<&Self>, u32),
        (after, part): (Option<&Self>, u32),
    ) -> u32 {
        let at = |light: Option<&Self>| light.map_or(0, |light| u32::from(light.to_bits()));
        // As many sums side by side as a vector has elements: the compiler's own choice is
        // four vectors at a time, which leaves much of a cell's row for the end.
        let (chunks, rest) = inner.as_chunks::<8>();
        let mut lanes = [0; 8];
        for chunk in chunks {
            for (lane, light) in lanes.iter_mut().zip(chunk) {
                *lane += u32::from(light.to_bits());
            }
        }
        let rest = rest.iter().map(|light| u32::from(light.to_bits()));
        let inner: u32 = rest.chain(lanes).sum();
        (inner * whole) - at(first) * before + at(after) * part
    }
}

/// Columns of a row of cells: at most `height * 2^15` each.
impl Amount for u32 {
    type Sum = u64;

    #[inline(always)]
    fn total(
        inner: &[Self],
        whole: u32,
        (first, before): (Option<&Self>, u32),
        (after, part): (Option<&Self>, u32),
    ) -> u64 {
        let at = |light: Option<&Self>| light.copied().map_or(0, u64::from);
        let inner: u64 = inner.iter().copied().map(u64::from).sum();
        (inner * u64::from(whole)) - at(first) * u64::from(before) + at(after) * u64::from(part)
    }
}
