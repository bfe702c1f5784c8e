//! The sparse interreflection operator `K`, in the Haar domain.
//!
//! With `S` the integer basis of [`haar`](crate::haar), `K d' = S M (S^T d')`
//! where `M` is sparse. The input coefficients `S^T d'` arrive rounded to
//! [`InputCoefficient`], each by its own power of two; the rows of `M` are `i16`
//! with a power of two each; so
//!
//! ```text
//! z_i = (sum_j  v_ij y_j  +  2^(shift_i - 1))  >>  shift_i      [Correction]
//! ```
//!
//! and `S z` is the light to take away. The sum is an `i32`; [`Bounds`] is the
//! proof, for every frame there can be, that neither it nor anything computed
//! from it leaves its type.
//!
//! Entries are grouped in segments, one a tier, so that a frame of tier `t` reads
//! the segments 1 to `t` one after the other. A segment belongs to all channels,
//! which share one geometry, or to one, for what its own colour adds.
//!
//! Rounding happens in two named places: the input coefficients
//! ([`analyse_rounded`](crate::haar::analyse_rounded)) and the end of each row
//! ([`Operator::apply`]).

mod bounds;
mod error;
mod segment;

pub use bounds::Bounds;
pub use error::OperatorError;
pub use segment::{Channels, Entry, Row, Rows, Segment};

use crate::haar::Basis;
use crate::image::layout::MAX_SEGMENTS;
use crate::units::InputCoefficient;
use fixed::types::U1F15;
use heapless::Vec;

/// An operator whose entries are well-formed and cannot overflow.
#[derive(Clone, Debug)]
pub struct Operator<'a> {
    segments: Vec<Segment<'a>, MAX_SEGMENTS>,
    row_shifts: &'a [u8],
    channel_scales: [U1F15; 3],
    bounds: Bounds,
}

impl<'a> Operator<'a> {
    /// Largest shift of a row: the bits of an accumulator.
    pub const MAX_ROW_SHIFT: u8 = 31;

    /// Checks segments against the grid of `basis` and proves the bounds.
    ///
    /// `row_shifts` has one entry a cell. `channel_scales` multiply the result of
    /// each channel (1 for a projector whose channels are equally bright) and are
    /// at most 1.
    ///
    /// # Errors
    /// [`OperatorError`] with the segment and row at fault.
    pub fn new(
        basis: &Basis,
        segments: Vec<Segment<'a>, MAX_SEGMENTS>,
        row_shifts: &'a [u8],
        channel_scales: [U1F15; 3],
    ) -> Result<Self, OperatorError> {
        let cells = basis.grid().cells();
        if row_shifts.len() != cells {
            return Err(OperatorError::RowShiftCount {
                needed: cells,
                given: row_shifts.len(),
            });
        }
        if let Some(row) = row_shifts.iter().position(|s| *s > Self::MAX_ROW_SHIFT) {
            return Err(OperatorError::RowShift { row });
        }
        if channel_scales.iter().any(|scale| *scale > U1F15::ONE) {
            return Err(OperatorError::ChannelScale);
        }
        for (index, segment) in segments.iter().enumerate() {
            segment.check(index, cells)?;
        }
        let bounds = Bounds::prove(basis, &segments, row_shifts)?;
        Ok(Self {
            segments,
            row_shifts,
            channel_scales,
            bounds,
        })
    }

    /// The proved bounds.
    #[must_use]
    pub const fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Its segments, in the order in which they are applied.
    #[must_use]
    pub fn segments(&self) -> &[Segment<'a>] {
        &self.segments
    }

    /// Shift of every row, length `N`.
    #[must_use]
    pub const fn row_shifts(&self) -> &'a [u8] {
        self.row_shifts
    }

    /// Scale of a channel; zero for a channel there cannot be.
    #[must_use]
    pub fn channel_scale(&self, channel: usize) -> U1F15 {
        self.channel_scales
            .get(channel)
            .copied()
            .unwrap_or(U1F15::ZERO)
    }

    /// Entries that a frame of `tier` reads, and multiplications it does in a
    /// table of `channels` channels.
    #[must_use]
    pub fn cost(&self, tier: u8, channels: u8) -> (u32, u32) {
        let mut cost = (0_u32, 0_u32);
        for segment in self.segments.iter().filter(|s| s.tier <= tier) {
            let entries = segment.rows().map(|row| row.entries().len() as u32);
            let entries = entries.fold(0, u32::saturating_add);
            let shared_by = match segment.channels {
                Channels::All => u32::from(channels),
                Channels::One(_) => 1,
            };
            cost.0 = cost.0.saturating_add(entries);
            cost.1 = cost.1.saturating_add(entries.saturating_mul(shared_by));
        }
        cost
    }

    /// Computes `z` from `y`, both with the channels of a coefficient side by
    /// side.
    ///
    /// `sums` receives [`Correction`](crate::units::Correction) bits. Elements
    /// that a slice is short of are left out.
    pub fn apply<const C: usize>(
        &self,
        tier: u8,
        inputs: &[[InputCoefficient; C]],
        sums: &mut [[i32; C]],
    ) {
        sums.fill([0; C]);
        for segment in self.segments.iter().filter(|s| s.tier <= tier) {
            match segment.channels {
                Channels::All => segment.accumulate(inputs, sums),
                Channels::One(channel) => {
                    segment.accumulate_one(inputs, sums, usize::from(channel));
                }
            }
        }
        for (row, shift) in sums.iter_mut().zip(self.row_shifts) {
            for sum in row {
                *sum = round_shift(*sum, u32::from(*shift));
            }
        }
        for channel in 0..C {
            let scale = self.channel_scale(channel);
            if scale != U1F15::ONE {
                let scaled = sums.iter_mut().filter_map(|row| row.get_mut(channel));
                scaled.for_each(|sum| *sum = scaled_by(*sum, scale));
            }
        }
    }
}

/// `value / 2^shift` to nearest, halves upwards. The bound on accumulators leaves
/// room for the half.
#[inline]
fn round_shift(value: i32, shift: u32) -> i32 {
    let half = 1_i32.wrapping_shl(shift) >> 1;
    value.wrapping_add(half).wrapping_shr(shift)
}

/// `value * scale` to nearest, halves upwards.
#[inline]
fn scaled_by(value: i32, scale: U1F15) -> i32 {
    const HALF: i64 = 1 << (U1F15::FRAC_NBITS - 1);
    let product = i64::from(value).wrapping_mul(i64::from(scale.to_bits()));
    (product.wrapping_add(HALF) >> U1F15::FRAC_NBITS) as i32
}

#[cfg(test)]
mod tests;
