//! Interreflection operator `K`, sparse, in the Haar domain.
//!
//! With `S` the integer basis of [`haar`](crate::haar), `K d' = S M (S^T d')`
//! where `M` is sparse. The input coefficients `S^T d'` arrive rounded to
//! [`InputCoefficient`], each by its own power of two; the rows of `M` are `i16`
//! with a power of two each; so
//!
//! ```text
//! z_i = (scale * sum_j v_ij y_j)  >>  shift_i      [Correction]
//! ```
//!
//! and `S z` is the light to take away. The sum is an `i32`; [`Bounds`] is the
//! proof, for every frame there can be, that neither it nor anything computed
//! from it leaves its type.
//!
//! Entries are grouped in segments. Each tier has its own, complete: a frame of
//! tier `t` reads the segments of tier `t` and no others. That stores an entry once
//! for every tier that uses it, about twice as much in all as the top tier alone,
//! and in return a row is visited once and its values use all bits of their type. A
//! segment belongs to all channels, which share one geometry, or to one, for what
//! its own colour adds.
//!
//! Rounding happens in two named places: the input coefficients
//! ([`Coefficient`](crate::haar::Coefficient)) to nearest, and the end of
//! each row ([`Operator::apply`]) downwards, which no detail function passes on to
//! the mean of a frame.
//!
//! Coefficients of several channels lie one channel after the other, `N` each.

mod bounds;
mod error;
pub mod layout;
mod reference;
mod segment;

pub use bounds::Bounds;
pub use error::OperatorError;
pub use segment::{Channels, Group, Groups, Pair, Row, Rows, Segment};

use crate::Grid;
use crate::features::Stage;
use crate::haar::Basis;
use crate::kernel::{self, Sums};
use crate::units::InputCoefficient;
use crate::yield_budget::{YieldBudget, cost};
use fixed::types::{I2F30, U1F15};
use heapless::Vec;
use layout::MAX_SEGMENTS;

/// An operator whose entries are well-formed and cannot overflow.
#[derive(Clone, Debug)]
pub struct Operator<'a> {
    cells: usize,
    inputs: usize,
    segments: Vec<Segment<'a>, MAX_SEGMENTS>,
    channel_scales: [U1F15; 3],
    bounds: Bounds,
}

impl<'a> Operator<'a> {
    /// Checks segments against the grid of `basis` and proves the bounds.
    ///
    /// `inputs` are the input coefficients of a channel: those of the grid, and any behind them.
    /// `channel_scales` multiply the result of each channel (1 for a projector whose
    /// channels are equally bright) and are at most 1.
    ///
    /// # Errors
    /// [`OperatorError`] with the segment and row at fault.
    pub fn new(
        basis: &Basis,
        inputs: usize,
        segments: Vec<Segment<'a>, MAX_SEGMENTS>,
        channel_scales: [U1F15; 3],
    ) -> Result<Self, OperatorError> {
        let grid = basis.grid();
        let mut operator = Self::stated(grid, inputs, segments, channel_scales, Bounds::default());
        operator.bounds = operator.prove(grid, &mut YieldBudget::new(&mut || {}))?;
        Ok(operator)
    }

    /// An operator whose bounds have been proved before, or will be.
    pub(crate) const fn stated(
        grid: Grid,
        inputs: usize,
        segments: Vec<Segment<'a>, MAX_SEGMENTS>,
        channel_scales: [U1F15; 3],
        bounds: Bounds,
    ) -> Self {
        Self {
            cells: grid.cells(),
            inputs,
            segments,
            channel_scales,
            bounds,
        }
    }

    /// Checks the segments, and computes the bounds from them.
    pub(crate) fn prove(
        &self,
        grid: Grid,
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<Bounds, OperatorError> {
        if self.channel_scales.iter().any(|scale| *scale > U1F15::ONE) {
            return Err(OperatorError::ChannelScale);
        }
        let mut top = 0;
        for (index, segment) in self.segments.iter().enumerate() {
            segment.check(index, (grid.cells(), self.inputs()), budget)?;
            top = segment.tier.max(top);
        }
        let basis = Basis::new(grid);
        let mut bounds = Bounds::default();
        for tier in 1..=top {
            bounds = bounds.max(Bounds::prove(&basis, &self.segments, tier, budget)?);
        }
        Ok(bounds)
    }

    /// Input coefficients of a channel.
    const fn inputs(&self) -> usize {
        if Stage::Neighbours.is_built() {
            self.inputs
        } else {
            self.cells
        }
    }

    /// The proved bounds.
    #[must_use]
    pub const fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// What multiplies the result of each channel.
    #[must_use]
    pub const fn channel_scales(&self) -> [U1F15; 3] {
        self.channel_scales
    }

    /// Its segments, in the order in which they are applied.
    #[must_use]
    pub fn segments(&self) -> &[Segment<'a>] {
        &self.segments
    }

    /// Entries that a frame of `tier` reads, and multiplications by them that it
    /// does in a table of `channels` channels: those by the zero in a pair count.
    #[must_use]
    pub fn cost(&self, tier: u8, channels: u8) -> (u32, u32) {
        self.cost_yielding(tier, channels, &mut YieldBudget::new(&mut || {}))
    }

    /// [`cost`](Self::cost) in short pieces.
    pub(crate) fn cost_yielding(
        &self,
        tier: u8,
        channels: u8,
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> (u32, u32) {
        let mut total = (0_u32, 0_u32);
        for segment in self.of_tier(tier) {
            let shared_by = match segment.channels {
                Channels::All => u32::from(channels),
                Channels::One(_) => 1,
            };
            for row in segment.rows() {
                let values = 2 * u32::from(row.pairs());
                total.0 = total.0.saturating_add(row.entries_yielding(budget) as u32);
                total.1 = total.1.saturating_add(values.saturating_mul(shared_by));
                budget.spend(1, cost::ROW);
            }
        }
        total
    }

    fn of_tier(&self, tier: u8) -> impl Iterator<Item = &Segment<'a>> {
        self.segments.iter().filter(move |s| s.tier == tier)
    }

    /// Computes `z` from `y` for a table of `channels` channels, the coefficients of one channel
    /// after those of the other.
    ///
    /// `sums` receives [`Correction`](crate::units::Correction) bits. Where a slice
    /// is too short, `sums` is all zero.
    pub fn apply(&self, tier: u8, channels: u8, inputs: &[InputCoefficient], sums: &mut [i32]) {
        let needed = usize::from(channels).saturating_mul(self.cells);
        let given = sums.len();
        let sums = sums.get_mut(..needed.min(given)).unwrap_or_default();
        if !kernel::gather::clear(sums) {
            sums.fill(0);
        }
        let mut scales = [I2F30::ZERO; 3];
        for (wide, scale) in scales.iter_mut().zip(self.channel_scales) {
            *wide = I2F30::from(scale);
        }
        for (index, segment) in self.of_tier(tier).enumerate() {
            let fresh = index == 0;
            let first = match segment.channels {
                Channels::All => 0,
                Channels::One(channel) => usize::from(channel),
            };
            let count = match segment.channels {
                Channels::All => usize::from(channels),
                Channels::One(_) => 1,
            };
            let scales = scales.get(first..).unwrap_or_default();
            let inputs = inputs.get(first * self.inputs()..);
            let sums = sums.get_mut(first * self.cells..);
            let (Some(inputs), Some(sums)) = (inputs, sums) else {
                continue;
            };
            let mut sums = Sums {
                cells: self.cells,
                of_channel: self.inputs(),
                inputs,
                outputs: sums,
            };
            add(
                segment,
                scales.get(..count).unwrap_or_default(),
                fresh,
                &mut sums,
            );
        }
    }
}

/// Adds a segment, scaled by channel, to the sums of as many channels, one or three. The segment was
/// checked against a grid of `sums.cells` cells and `sums.of_channel` inputs; too short slices
/// stay as they are.
///
/// `fresh` says that the sums are all zero: a row is then stored, not added.
fn add(segment: &Segment<'_>, scales: &[I2F30], fresh: bool, sums: &mut Sums<'_>) {
    let inputs = scales.len().saturating_mul(sums.of_channel);
    let outputs = scales.len().saturating_mul(sums.cells);
    if sums.inputs.len() < inputs || sums.outputs.len() < outputs {
        return;
    }
    let rows = segment.groups().map(|group| kernel::GroupRows {
        pairs: group.pairs.unwrap_or(0),
        words: group.words(),
    });
    // A tier's segment for all channels is its first, so the assembler has a loop for
    // every segment of a checked table.
    if kernel::gather::gather(rows, scales, fresh, sums) || !kernel::IS_PLAIN {
        return;
    }
    for group in segment.groups() {
        match scales {
            [red, green, blue] => reference::add(&group, &[*red, *green, *blue], sums),
            [scale] => reference::add(&group, &[*scale], sums),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests;
