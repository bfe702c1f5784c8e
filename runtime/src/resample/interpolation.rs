//! Linear interpolation `U` between cell centres.
//!
//! Along an axis of `length` pixels and `cells` cells, the centre of pixel `x`
//! lies `((2 x + 1) cells - length) / (2 length)` cell widths after the centre of
//! the first cell. Before the first centre and after the last, values stay
//! constant. Between two centres the values of a row of pixels are an arithmetic
//! progression, which is how [`Axis::expand`] computes them: no multiplication a
//! pixel.

#![allow(
    clippy::inline_always,
    reason = "a host compiles rows for its widest vectors, which a call would leave"
)]

use crate::kernel::{self, Between, lines};

/// One axis of an interpolation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Axis {
    cells: u32,
    length: u32,
    /// `2^32 cells / length`: what one pixel is of a cell width.
    step: u64,
    /// `2^32 / (2 cells)`.
    half_cell: u64,
}

/// Where one pixel lies between two cell centres.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Place {
    /// Cell whose centre is at or before the pixel's (the first cell for pixels
    /// before all centres).
    pub before: usize,
    /// Cell whose centre is after the pixel's (the last cell after all centres).
    pub after: usize,
    /// Share of `after`, 31 fraction bits.
    pub fraction: u32,
}

/// The pixels of one centre.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Piece {
    /// The first of them.
    pub first: usize,
    /// How far that is after the centre: pixels, 32 fraction bits.
    pub past: u32,
}

impl Axis {
    /// `cells` values over `length` pixels; `None` unless
    /// `1 <= cells <= length <= 65,535`.
    #[must_use]
    pub fn new(cells: usize, length: usize) -> Option<Self> {
        if cells == 0 || length < cells || length > usize::from(u16::MAX) {
            return None;
        }
        let (cells, length) = (cells as u32, length as u32);
        Some(Self {
            cells,
            length,
            step: (u64::from(cells) << 32).checked_div(u64::from(length))?,
            half_cell: (1_u64 << 31).checked_div(u64::from(cells))?,
        })
    }

    /// Where pixel `x` lies.
    #[inline]
    #[must_use]
    pub fn place(&self, x: usize) -> Place {
        let (cells, length) = (u64::from(self.cells), u64::from(self.length));
        let last = self.cells as usize - 1;
        let Some(along) = ((2 * x as u64 + 1) * cells).checked_sub(length) else {
            return Place {
                before: 0,
                after: 0,
                fraction: 0,
            };
        };
        let before = (along / (2 * length)) as usize;
        if before >= last {
            return Place {
                before: last,
                after: last,
                fraction: 0,
            };
        }
        let rest = along % (2 * length);
        Place {
            before,
            after: before + 1,
            fraction: ((rest << 31) / (2 * length)) as u32,
        }
    }

    /// What one pixel is of the distance of two centres, 32 fraction bits.
    #[must_use]
    pub const fn step(&self) -> u64 {
        self.step
    }

    /// Where the pixels of every centre begin: those at or after it and before the next.
    ///
    /// For whoever works on pixels one by one: pixel `x` of a piece is
    /// `value + ((s * past) >> 32) + (x - first) * s`, where `s` is the difference to the
    /// next value times [`step`](Self::step), rounded to the nearest `2^32`th. Pixels
    /// before all pieces have the first value, and those of the last piece the last.
    pub fn pieces(&self) -> impl Iterator<Item = Piece> + use<> {
        let Self {
            cells,
            length,
            half_cell,
            ..
        } = *self;
        let (twice, length) = (2 * u64::from(cells), u64::from(length));
        (0..u64::from(cells)).map(move |cell| {
            let centre = (2 * cell + 1) * length - u64::from(cells);
            let first = centre.div_ceil(twice);
            Piece {
                first: first as usize,
                past: ((first * twice - centre) * half_cell) as u32,
            }
        })
    }

    /// Spreads `cells` values over the pixels of a row.
    ///
    /// Differences of neighbours must fit an `i32`.
    #[inline]
    pub fn expand(&self, values: &[i32], pixels: &mut [i32]) {
        let (cells, length) = (self.cells, self.length);
        let first = values.first().copied().unwrap_or(0);
        // The first pixel at or after the first centre, and how far after it, in
        // units of which a cell width has 2 * length and a pixel 2 * cells.
        let before = length.saturating_sub(cells);
        let start = before.div_ceil(2 * cells);
        let mut past = start * 2 * cells - before;
        let (whole, part) = (length / cells, 2 * (length % cells));
        let mut rest = fill_front(pixels, start as usize, |run| run.fill(first));
        let last = values.last().copied().unwrap_or(0);
        if let (Ok(step), Ok(half_cell)) = (self.step.try_into(), self.half_cell.try_into()) {
            let between = Between {
                step,
                half_cell,
                past,
                part,
                whole,
                cell: 2 * cells,
            };
            if lines::expand(&between, values, rest) {
                // The pixel at or after the last centre: half a cell before the end.
                let after = (2 * length * (cells - 1) + before).div_ceil(2 * cells) - start;
                rest.get_mut(after as usize..)
                    .unwrap_or_default()
                    .fill(last);
                return;
            }
        }
        let pairs = values.iter().zip(values.iter().skip(1));
        for (value, next) in pairs {
            let difference = i64::from(next.wrapping_sub(*value));
            let step = (difference * self.step as i64 + (1 << 31)) >> 32;
            // `past` is below `2 cells`, so this is below 2^32.
            let past_pixels = u64::from(past) * self.half_cell;
            let offset = (step * past_pixels as i64) >> 32;
            let begin = value.wrapping_add(offset as i32);
            // The next centre is `whole` pixels and `part` units further on.
            let mut run = whole;
            if part > past {
                run += 1;
                past += 2 * cells;
            }
            past -= part;
            let fill = |run: &mut [i32]| progression(begin, step as i32, run);
            rest = fill_front(rest, run as usize, fill);
        }
        rest.fill(last);
    }
}

/// Gives the first `count` elements (or all) to `fill` and returns the rest.
#[inline(always)]
fn fill_front(pixels: &mut [i32], count: usize, fill: impl FnOnce(&mut [i32])) -> &mut [i32] {
    let (front, rest) = pixels.split_at_mut(count.min(pixels.len()));
    fill(front);
    rest
}

/// `begin + index * step` for every pixel of a run.
#[inline(always)]
fn progression(begin: i32, step: i32, run: &mut [i32]) {
    for (index, pixel) in (0_i32..).zip(run) {
        *pixel = begin.wrapping_add(step.wrapping_mul(index));
    }
}

/// [`blend`] of every element of two rows into `line`.
pub fn blend_rows(before: &[i32], after: &[i32], fraction: u32, line: &mut [i32]) {
    // The assembler takes every fraction of 31 bits.
    if lines::blend(before, after, fraction, line) || !kernel::IS_PLAIN {
        return;
    }
    for (slot, (before, after)) in line.iter_mut().zip(before.iter().zip(after)) {
        *slot = blend(*before, *after, fraction);
    }
}

/// `before + fraction * (after - before)`, rounded down; `fraction` has 31 bits.
#[inline(always)]
#[must_use]
pub fn blend(before: i32, after: i32, fraction: u32) -> i32 {
    let difference = i64::from(after) - i64::from(before);
    before.wrapping_add((difference.wrapping_mul(i64::from(fraction)) >> 31) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::{vec, vec::Vec};

    proptest! {
        #[test]
        fn pixels_one_by_one_are_those_of_a_row(
            (cells, more) in (1_usize..70, 0_usize..700),
            values in prop::collection::vec(-1_i32 << 30..1 << 30, 70),
        ) {
            let (length, values) = (cells + more, &values[..cells]);
            let axis = Axis::new(cells, length).expect("no fewer pixels than cells");
            let mut row = vec![0; length];
            axis.expand(values, &mut row);
            let pieces: Vec<_> = axis.pieces().collect();
            prop_assert_eq!(pieces.len(), cells);
            for (x, pixel) in row.into_iter().enumerate() {
                let piece = pieces.partition_point(|piece| piece.first <= x);
                let one = if piece == 0 || piece == cells {
                    values[piece.max(1) - 1]
                } else {
                    let (value, next) = (values[piece - 1], values[piece]);
                    let difference = i128::from(next - value) * i128::from(axis.step());
                    let step = (difference + (1 << 31)) >> 32;
                    let Piece { first, past } = pieces[piece - 1];
                    value + ((step * i128::from(past)) >> 32) as i32 + (x - first) as i32 * step as i32
                };
                prop_assert_eq!(one, pixel, "pixel {}", x);
            }
        }
    }
}
