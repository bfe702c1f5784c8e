//! Stages of the pipeline over a row of samples of one channel, and over the grid.
//!
//! Each stage is one function over slices; slices of different lengths are
//! worked up to the shortest. The grid path and the full-resolution path are
//! both made of these.

#![allow(
    clippy::inline_always,
    reason = "a host compiles rows for its widest vectors, which a call would leave"
)]

use crate::Grid;
use crate::haar::{Basis, CellSource, Cells, ShortSlice, analyse, synthesise};
use crate::image::{Neighbours, Table};
use crate::units::{
    CORRECTION_GUARD_BITS, ClippedSamples, Drive, Halfword, InputCoefficient, Light,
};

/// Takes the ambient light away; light below it becomes none, since no projector
/// input can reach it.
#[inline(always)]
#[must_use]
pub fn subtract_ambient(light: Light, ambient: Light) -> Light {
    light.saturating_sub(ambient)
}

/// Half of the last place that a drive keeps of a correction. It is added to the
/// constant function's coefficient, hence to every correction, and so costs
/// nothing a pixel.
pub const CORRECTION_HALF: i32 = 1 << (CORRECTION_GUARD_BITS - 1);

/// `gain * light - correction` in units of [`Drive`], not yet between 0 and 1.
///
/// A named rounding place: the product is rounded to the nearest 2^-15, and so is
/// the correction, which [`correct`] has left half a step too large.
#[inline(always)]
#[must_use]
pub fn drive(light: Light, gain: u16, gain_fraction: u32, correction: i32) -> i32 {
    // At most 2^31 - 1: light is at most 2^15.
    let product = u32::from(gain).wrapping_mul(u32::from(light.to_bits()));
    let half = 1_u32.wrapping_shl(gain_fraction) >> 1;
    let direct = product.wrapping_add(half).wrapping_shr(gain_fraction) as i32;
    // Below 2^30 + 2^22: a table's gains have at least one fraction bit.
    direct.wrapping_sub(correction >> CORRECTION_GUARD_BITS)
}

/// The room's light at a cell times its gain, in units of [`Drive`]: what is interpolated between
/// cells. Where the gain is 0 a table has that product itself.
#[inline(always)]
#[must_use]
pub fn driven(ambient: Light, gain: u16, gain_fraction: u32) -> u16 {
    match gain {
        0 => ambient.to_bits(),
        _ => drive(ambient, gain, gain_fraction, 0).min(u16::MAX.into()) as u16,
    }
}

/// A drive between 0 and 1.
#[inline]
#[must_use]
pub(super) fn clip(wanted: i32) -> Drive {
    Drive::from_bits(wanted.clamp(0, i32::from(Drive::ONE.to_bits())) as u16)
}

/// A row of [`drive`]s between 0 and 1; returns how many were clipped.
#[inline(always)]
pub fn drive_row(
    light: &[Light],
    gain: &[u16],
    gain_fraction: u32,
    corrections: &[i32],
    drives: &mut [Drive],
) -> ClippedSamples {
    let inputs = light.iter().zip(gain).zip(corrections);
    let mut clipped = ClippedSamples::default();
    for (slot, ((light, gain), correction)) in drives.iter_mut().zip(inputs) {
        let wanted = drive(*light, *gain, gain_fraction, *correction);
        *slot = clip(wanted);
        clipped.count(wanted);
    }
    clipped
}

/// Memory for the operator on a grid of `N` cells. Channels lie one after the
/// other.
#[derive(Debug)]
pub struct Workspace<'w> {
    /// Values of the levels of a transform,
    /// [`Basis::scratch_len`](crate::haar::Basis::scratch_len) elements each.
    pub buffers: [&'w mut [i32]; 2],
    /// Cells of one channel, `N` elements.
    pub cells: &'w mut [i32],
    /// Input coefficients, [`Table::inputs`] for each channel.
    pub inputs: &'w mut [InputCoefficient],
    /// Coefficients of the corrections, `N` for each channel.
    pub sums: &'w mut [i32],
    /// Light that is wanted of the neighbours' cells, [`Neighbours::samples`] as they describe it;
    /// `None` where the neighbours are silent: they are taken for dark then, and what is left is
    /// the part of the table that is its own. Tables without neighbours do not look at it.
    pub heard: Option<&'w [Halfword]>,
    /// The basis of the neighbours' cells, kept from frame to frame; `None` before the first.
    pub neighbours: &'w mut Option<Basis>,
}

impl Workspace<'_> {
    /// Whether every part is long enough for `table`.
    pub(super) fn check(&self, table: &Table<'_>) -> Result<(), ShortSlice> {
        let (basis, channels) = (table.basis(), usize::from(table.channels()));
        let values = channels * basis.grid().cells();
        let [first, second] = &self.buffers;
        for (what, needed, given) in [
            ("first buffer", basis.scratch_len(), first.len()),
            ("second buffer", basis.scratch_len(), second.len()),
            ("cells", basis.grid().cells(), self.cells.len()),
            ("inputs", channels * table.inputs(), self.inputs.len()),
            ("sums", values, self.sums.len()),
        ] {
            ShortSlice::check(what, needed, given)?;
        }
        Ok(())
    }

    /// Computes the input coefficients of one channel.
    pub(super) fn analyse(
        &mut self,
        table: &Table<'_>,
        channel: usize,
        cells: &impl CellSource,
    ) -> Result<(), ShortSlice> {
        let start = channel * table.inputs();
        let inputs = self.inputs.get_mut(start..).unwrap_or_default();
        let [first, second] = &mut self.buffers;
        analyse(table.basis(), cells, [first, second], inputs)
    }

    /// Computes the input coefficients of the neighbours' cells in all channels.
    fn analyse_neighbours(
        &mut self,
        table: &Table<'_>,
        neighbours: &Neighbours<'_>,
    ) -> Result<(), ShortSlice> {
        if let Some(heard) = self.heard {
            ShortSlice::check("neighbours' light", neighbours.samples(), heard.len())?;
        }
        let grid = neighbours.grid();
        let basis = kept_basis(self.neighbours, grid);
        for channel in 0..usize::from(table.channels()) {
            let start = channel * table.inputs() + table.grid().cells();
            let inputs = self.inputs.get_mut(start..).unwrap_or_default();
            let Some(heard) = self.heard else {
                inputs.get_mut(..grid.cells()).unwrap_or_default().fill(0);
                continue;
            };
            let cells = self.cells.get_mut(..grid.cells()).unwrap_or_default();
            neighbours.fill(heard, channel, cells);
            let values = Cells {
                values: cells,
                cols: grid.cols(),
            };
            let [first, second] = &mut self.buffers;
            analyse(basis, &values, [first, second], inputs)?;
        }
        Ok(())
    }

    /// Computes the corrections' coefficients of all channels at `tier`.
    pub(super) fn operate(&mut self, table: &Table<'_>, tier: u8) -> Result<(), ShortSlice> {
        let Some(operator) = table.operator() else {
            return Ok(());
        };
        if let Some(neighbours) = table.neighbours() {
            self.analyse_neighbours(table, neighbours)?;
        }
        operator.apply(tier, table.channels(), self.inputs, self.sums);
        let cells = table.grid().cells();
        let channels = self.sums.chunks_exact_mut(cells.max(1));
        for sums in channels.take(table.channels().into()) {
            if let Some(constant) = sums.last_mut() {
                *constant = constant.wrapping_add(CORRECTION_HALF);
            }
        }
        Ok(())
    }

    /// Computes the corrections of one channel, which stay in `cells`.
    pub(super) fn synthesise(
        &mut self,
        table: &Table<'_>,
        channel: usize,
    ) -> Result<(), ShortSlice> {
        let start = channel * table.grid().cells();
        let sums = self.sums.get(start..).unwrap_or_default();
        let [first, second] = &mut self.buffers;
        synthesise(table.basis(), sums, [first, second], self.cells)
    }
}

/// The basis of a grid: the one that is kept, or a new one in its place.
///
/// Not inlined: a new one passes over the stack, which the transform need not stand on.
#[inline(never)]
fn kept_basis(kept: &mut Option<Basis>, grid: Grid) -> &Basis {
    if kept.as_ref().is_some_and(|basis| basis.grid() != grid) {
        *kept = None;
    }
    kept.get_or_insert_with(|| Basis::new(grid))
}

/// Replaces the light of every cell (bits of [`Light`], `N` for each channel) by
/// its correction `K d'` (bits of [`Correction`](crate::units::Correction), half a
/// step of a drive too large).
///
/// # Errors
/// [`ShortSlice`] if a slice is too short.
pub fn correct(
    table: &Table<'_>,
    tier: u8,
    cells: &mut [i32],
    workspace: &mut Workspace<'_>,
) -> Result<(), ShortSlice> {
    let (channels, count) = (usize::from(table.channels()), table.grid().cells());
    let given = cells.len();
    let cells = cells.get_mut(..channels * count).ok_or(ShortSlice {
        what: "cells",
        needed: channels * count,
        given,
    })?;
    if tier == 0 || table.operator().is_none() {
        cells.fill(0);
        return Ok(());
    }
    workspace.check(table)?;
    let cols = table.grid().cols();
    for (channel, light) in cells.chunks_exact(count.max(1)).enumerate() {
        let values = Cells {
            values: light,
            cols,
        };
        workspace.analyse(table, channel, &values)?;
    }
    workspace.operate(table, tier)?;
    for (channel, corrections) in cells.chunks_exact_mut(count.max(1)).enumerate() {
        workspace.synthesise(table, channel)?;
        for (slot, correction) in corrections.iter_mut().zip(workspace.cells.iter()) {
            *slot = *correction;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Meta;
    use crate::image::layout::{SectionKind, meta};
    use crate::image::made_up::flat;
    use crate::operator::Bounds;

    #[test]
    fn no_table_that_is_taken_has_a_drive_that_leaves_its_type() {
        let most = Bounds::MAX_CORRECTION as i32;
        let mut taken = 0;
        for fraction in 0..=u8::MAX {
            let mut sections = flat(2, 3);
            let (kind, bytes) = sections.first_mut().expect("there are some");
            assert_eq!(*kind, SectionKind::Meta);
            bytes[meta::GAIN_FRACTION] = fraction;
            let Ok(meta) = Meta::parse(bytes) else {
                continue;
            };
            taken += 1;
            let fraction = u32::from(meta.gain_fraction);
            for light in [0, 1, 1 << 15] {
                for gain in [0, 1, 4_096, u16::MAX] {
                    for correction in [-most, -1, 0, CORRECTION_HALF, most + CORRECTION_HALF] {
                        let wanted = drive(Light::from_bits(light), gain, fraction, correction);
                        let product = f64::from(gain) * f64::from(light);
                        let direct = (product / f64::from(fraction).exp2() + 0.5).floor();
                        let exact = direct - (f64::from(correction) / 256.0).floor();
                        assert_eq!(i64::from(wanted), exact as i64, "{light} {gain} {fraction}");
                    }
                }
            }
        }
        assert_eq!(taken, 15);
    }
}
