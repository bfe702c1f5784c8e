//! Overflow proof: no frame can make the operator overflow.
//!
//! Every input coefficient is at most [`INPUT_COEFFICIENT_MAX`] in magnitude, so
//! the sum of a row is at most that times the sum of the magnitudes of its
//! values. Shifted, that bounds the row's coefficient `z_i`; the functions of one
//! level do not overlap between nodes, so a correction is at most the sum over
//! the levels of the largest node's `sum_i z_i * peak_i`.

use super::layout::MAX_SHORT;
use super::{Channels, OperatorError, Rows, Segment};
use crate::haar::Basis;
use crate::units::INPUT_COEFFICIENT_MAX;
use crate::yield_budget::{YieldBudget, cost};
use heapless::Vec;

/// Largest magnitudes that any frame can lead to, at any tier.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Bounds {
    /// Of a row's sum, before its shift.
    pub accumulator: u32,
    /// Of a correction, in [`Correction`](crate::units::Correction) bits.
    pub correction: u32,
}

impl Bounds {
    /// Largest accumulator.
    pub const MAX_ACCUMULATOR: u64 = i32::MAX as u64;

    /// Largest correction: half the type, so that the difference of two
    /// corrections, which interpolation takes, still fits it.
    pub const MAX_CORRECTION: u64 = (1 << 30) - 1;

    /// Proves one tier. `segments` are all of the operator's, in their order.
    pub(super) fn prove(
        basis: &Basis,
        segments: &[Segment<'_>],
        tier: u8,
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<Self, OperatorError> {
        let of_tier = segments.iter().enumerate();
        let of_tier = of_tier.filter(|(_, segment)| segment.tier == tier);
        // A tier has one segment for all channels and one for each at most.
        let mut cursors: Vec<Cursor<'_>, 4> = Vec::new();
        for (index, segment) in of_tier {
            let cursor = Cursor::new(index, segment);
            cursors.push(cursor).map_err(|_| OperatorError::Segments)?;
        }
        let mut accumulator = 0;
        let mut levels = LevelMaxima::default();
        for (row, function) in basis.functions().enumerate() {
            let mut shared = 0;
            let mut widest = 0;
            budget.spend(1, cost::FUNCTION);
            for cursor in &mut cursors {
                let Some((sum, coefficient)) = cursor.bounds_of(row, budget)? else {
                    continue;
                };
                if sum > Self::MAX_ACCUMULATOR {
                    return Err(OperatorError::AccumulatorOverflow { row, bound: sum });
                }
                accumulator = accumulator.max(sum);
                match cursor.channels {
                    Channels::All => shared += coefficient,
                    Channels::One(_) => widest = coefficient.max(widest),
                }
            }
            let place = (function.level, function.row, function.col);
            levels.add(place, (shared + widest).saturating_mul(function.peak()));
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

    /// The larger of each.
    pub(super) fn max(self, other: Self) -> Self {
        Self {
            accumulator: self.accumulator.max(other.accumulator),
            correction: self.correction.max(other.correction),
        }
    }
}

/// A segment's groups, each read in step with the rows of the operator.
struct Cursor<'a> {
    segment: usize,
    channels: Channels,
    groups: Vec<Rows<'a>, { MAX_SHORT + 1 }>,
}

impl<'a> Cursor<'a> {
    fn new(index: usize, segment: &Segment<'a>) -> Self {
        let mut groups = Vec::new();
        for group in segment.groups() {
            // Others there are none; collecting would have code for a panic.
            let _ = groups.push(group.rows());
        }
        Self {
            segment: index,
            channels: segment.channels,
            groups,
        }
    }

    /// Bounds of the row's sum and of its coefficient, if the segment has it.
    fn bounds_of(
        &mut self,
        row: usize,
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<Option<(u64, u64)>, OperatorError> {
        let mut found = None;
        budget.spend(1, cost::FUNCTION);
        for rows in &mut self.groups {
            if rows
                .next_index()
                .is_none_or(|next| usize::from(next) != row)
            {
                continue;
            }
            let Some(next) = rows.next() else { continue };
            if found.is_some() {
                let segment = self.segment;
                return Err(OperatorError::Row { segment, row });
            }
            let sum = next
                .magnitude(budget)
                .saturating_mul(INPUT_COEFFICIENT_MAX.into());
            // Rounding down can add one to the magnitude.
            found = Some((sum, (sum >> next.shift) + 1));
        }
        Ok(found)
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
