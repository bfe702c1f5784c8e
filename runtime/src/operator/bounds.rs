//! The proof that no frame can make the operator overflow.
//!
//! Every input coefficient is at most [`INPUT_COEFFICIENT_MAX`] in magnitude, so
//! the sum of a row is at most that times the sum of the magnitudes of its
//! values. Shifted, that bounds the row's coefficient `z_i`; the functions of one
//! level do not overlap between nodes, so a correction is at most the sum over
//! the levels of the largest node's `sum_i z_i * peak_i`.

use super::{Channels, OperatorError, Rows, Segment};
use crate::haar::Basis;
use crate::image::layout::MAX_SEGMENTS;
use crate::units::INPUT_COEFFICIENT_MAX;
use heapless::Vec;

/// Largest magnitudes that any frame can lead to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Bounds {
    /// Of a row's sum, before its shift.
    pub accumulator: u32,
    /// Of a correction, in [`Correction`](crate::units::Correction) bits.
    pub correction: u32,
}

impl Bounds {
    /// Largest accumulator, with the half that rounding adds to it.
    pub const MAX_ACCUMULATOR: u64 = i32::MAX as u64;

    /// Largest correction: half the type, so that the difference of two
    /// corrections, which interpolation takes, still fits it.
    pub const MAX_CORRECTION: u64 = (1 << 30) - 1;

    pub(super) fn prove(
        basis: &Basis,
        segments: &[Segment<'_>],
        row_shifts: &[u8],
    ) -> Result<Self, OperatorError> {
        let mut cursors: Vec<Cursor<'_>, MAX_SEGMENTS> = segments.iter().map(Cursor::new).collect();
        let mut accumulator = 0;
        let mut levels = LevelMaxima::default();
        for (row, (function, shift)) in basis.functions().zip(row_shifts).enumerate() {
            let mut shared = 0_u64;
            let mut own = [0_u64; 3];
            for cursor in &mut cursors {
                let magnitude = cursor.magnitude_of(row);
                match cursor.channels {
                    Channels::All => shared += magnitude,
                    Channels::One(channel) => {
                        if let Some(own) = own.get_mut(usize::from(channel)) {
                            *own += magnitude;
                        }
                    }
                }
            }
            let widest = own.into_iter().max().unwrap_or(0);
            let sum = (shared + widest).saturating_mul(u64::from(INPUT_COEFFICIENT_MAX));
            let half = (1_u64 << shift) >> 1;
            let rounded = sum.saturating_add(half);
            if rounded > Self::MAX_ACCUMULATOR {
                return Err(OperatorError::AccumulatorOverflow {
                    row,
                    bound: rounded,
                });
            }
            accumulator = accumulator.max(sum);
            let coefficient = rounded >> shift;
            let place = (function.level, function.row, function.col);
            levels.add(place, coefficient.saturating_mul(function.peak()));
        }
        let correction = levels.total();
        if correction > Self::MAX_CORRECTION {
            return Err(OperatorError::CorrectionOverflow { bound: correction });
        }
        Ok(Self {
            accumulator: accumulator as u32,
            correction: correction as u32,
        })
    }
}

/// A segment's rows, read in step with the rows of the operator.
struct Cursor<'a> {
    channels: Channels,
    rows: core::iter::Peekable<Rows<'a>>,
}

impl<'a> Cursor<'a> {
    fn new(segment: &Segment<'a>) -> Self {
        Self {
            channels: segment.channels,
            rows: segment.rows().peekable(),
        }
    }

    /// Sum of magnitudes of the row, 0 if the segment does not have it.
    fn magnitude_of(&mut self, row: usize) -> u64 {
        self.rows
            .next_if(|next| usize::from(next.index) == row)
            .map_or(0, |row| row.magnitude())
    }
}

/// Sum over the levels of the largest node's total.
#[derive(Default)]
struct LevelMaxima {
    finished: u64,
    level: u8,
    largest: u64,
    node: (u8, u16, u16),
    in_node: u64,
}

impl LevelMaxima {
    fn add(&mut self, node: (u8, u16, u16), value: u64) {
        if node != self.node {
            self.in_node = 0;
            self.node = node;
        }
        if node.0 != self.level {
            self.finished = self.finished.saturating_add(self.largest);
            self.largest = 0;
            self.level = node.0;
        }
        self.in_node = self.in_node.saturating_add(value);
        self.largest = self.largest.max(self.in_node);
    }

    fn total(&self) -> u64 {
        self.finished.saturating_add(self.largest)
    }
}
