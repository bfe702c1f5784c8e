//! What is done to a row of samples of one channel, and to the grid.
//!
//! Each stage is one function over slices; slices of different lengths are
//! worked up to the shortest. The grid path and the full-resolution path are
//! both made of these.

#![allow(
    clippy::inline_always,
    reason = "a host compiles rows for its widest vectors, which a call would leave"
)]

use crate::haar::{ShortSlice, analyse_rounded, synthesise};
use crate::image::Table;
use crate::units::{CORRECTION_GUARD_BITS, Drive, InputCoefficient, Light};

/// Takes the ambient light away; light below it becomes none, since no projector
/// input can reach it.
#[inline(always)]
pub fn subtract_ambient(light: &mut [Light], ambient: &[Light]) {
    for (light, ambient) in light.iter_mut().zip(ambient) {
        *light = light.saturating_sub(*ambient);
    }
}

/// `gain * light - correction`, between 0 and 1; says whether it was clipped.
///
/// A named rounding place: the product and the correction are each rounded to
/// the nearest 2^-15.
#[inline(always)]
#[must_use]
pub fn drive(light: Light, gain: u16, gain_fraction: u32, correction: i32) -> (Drive, bool) {
    const CORRECTION_HALF: i32 = 1 << (CORRECTION_GUARD_BITS - 1);
    const ONE: i32 = Drive::ONE.to_bits() as i32;
    // At most 2^31 - 1: light is at most 2^15.
    let product = u32::from(gain) * u32::from(light.to_bits());
    let half = (1_u32 << gain_fraction) >> 1;
    let direct = (product.wrapping_add(half) >> gain_fraction) as i32;
    let taken = correction.wrapping_add(CORRECTION_HALF) >> CORRECTION_GUARD_BITS;
    let wanted = direct.wrapping_sub(taken);
    let reached = wanted.clamp(0, ONE);
    (Drive::from_bits(reached as u16), wanted != reached)
}

/// A row of [`drive`]s; returns how many were clipped.
#[inline(always)]
pub fn drive_row(
    light: &[Light],
    gain: &[u16],
    gain_fraction: u32,
    corrections: &[i32],
    drives: &mut [Drive],
) -> u32 {
    let inputs = light.iter().zip(gain).zip(corrections);
    let mut clipped = 0;
    for (slot, ((light, gain), correction)) in drives.iter_mut().zip(inputs) {
        let (reached, was_clipped) = drive(*light, *gain, gain_fraction, *correction);
        *slot = reached;
        clipped += u32::from(was_clipped);
    }
    clipped
}

/// Memory for the operator on one grid: `N` cells and `C` channels.
#[derive(Debug)]
pub struct Workspace<'w, const C: usize> {
    /// `N` elements.
    pub cells: &'w mut [i32],
    /// [`Basis::scratch_len`](crate::haar::Basis::scratch_len) elements, at most
    /// `N`.
    pub scratch: &'w mut [i32],
    /// `N` elements.
    pub inputs: &'w mut [[InputCoefficient; C]],
    /// `N` elements: light on the way in, corrections on the way out.
    pub values: &'w mut [[i32; C]],
}

/// Replaces the light of every cell in `workspace.values` (bits of [`Light`]) by
/// its correction `K d'` (bits of [`Correction`](crate::units::Correction)).
///
/// # Errors
/// [`ShortSlice`] if a part of the workspace is too short.
pub fn correct<const C: usize>(
    table: &Table<'_>,
    tier: u8,
    workspace: &mut Workspace<'_, C>,
) -> Result<(), ShortSlice> {
    let Some(operator) = table.operator().filter(|_| tier > 0) else {
        workspace.values.fill([0; C]);
        return Ok(());
    };
    let basis = table.basis();
    for channel in 0..C {
        let light = workspace.values.iter().map(|cell| cell.get(channel));
        for (cell, light) in workspace.cells.iter_mut().zip(light) {
            *cell = light.copied().unwrap_or(0);
        }
        analyse_rounded(
            basis,
            workspace.cells,
            workspace.scratch,
            workspace.inputs,
            channel,
        )?;
    }
    operator.apply(tier, workspace.inputs, workspace.values);
    for channel in 0..C {
        synthesise(
            basis,
            workspace.values,
            channel,
            workspace.cells,
            workspace.scratch,
        )?;
        let slots = workspace.values.iter_mut();
        for (slot, cell) in slots.zip(workspace.cells.iter()) {
            if let Some(slot) = slot.get_mut(channel) {
                *slot = *cell;
            }
        }
    }
    Ok(())
}
