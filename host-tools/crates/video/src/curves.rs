//! Lookup tables from codes to light and from drives to codes.
//!
//! Both kinds of table have an element for every value of a `u16`, though not all
//! can occur: looking up then needs no check. A table of codes by knot of the
//! response would be eight times smaller, but finding the knots costs what the
//! smaller table saves (measured equal), and codes without a response would need
//! a way of their own.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

use iltm_runtime::{
    image::Table,
    pipeline::{Encoding, Sample},
    units::{Drive, Light},
};
use pulp::bytemuck::Pod;

/// Elements of a table.
const VALUES: usize = 1 << 16;

/// A [`Sample`] that indexes a table.
pub(super) trait Code:
    Sample + Pod + Into<usize> + PartialEq + Send + Sync + 'static
{
    /// Every code there is, in ascending order.
    fn all() -> impl Iterator<Item = Self>;
}

impl Code for u8 {
    fn all() -> impl Iterator<Item = Self> {
        Self::MIN..=Self::MAX
    }
}

impl Code for u16 {
    fn all() -> impl Iterator<Item = Self> {
        Self::MIN..=Self::MAX
    }
}

/// What every sample goes through.
#[derive(Clone, Debug)]
pub(super) struct Curves<S> {
    /// Light by code.
    light: Vec<Light>,
    /// Codes by the bits of the drive: of each channel, or one for all where they
    /// are the same, which leaves more of the caches to the frame.
    codes: Vec<Vec<S>>,
}

impl<S: Code> Curves<S> {
    pub(super) fn new(table: &Table<'_>, encoding: Encoding) -> Self {
        let mut light = vec![Light::ZERO; VALUES];
        for (slot, code) in light.iter_mut().zip(S::all()) {
            *slot = code.light(S::curves(table, encoding, 0));
        }
        let mut codes: Vec<_> = (0..usize::from(table.channels()))
            .map(|channel| {
                let curves = S::curves(table, encoding, channel);
                let mut codes = vec![S::default(); VALUES];
                for (code, bits) in codes.iter_mut().zip(0..=Drive::ONE.to_bits()) {
                    *code = S::code(bits.into(), curves);
                }
                codes
            })
            .collect();
        if codes.iter().all(|curve| *curve == codes[0]) {
            codes.truncate(1);
        }
        Self { light, codes }
    }

    /// [`Sample::light`] of every code.
    #[inline(always)]
    pub(super) fn decode(&self, codes: &[S], light: &mut [Light]) {
        // The length is known to the compiler from here on.
        let Some(by_code) = self.light.first_chunk::<VALUES>() else {
            return;
        };
        for (code, light) in codes.iter().zip(light) {
            *light = by_code[(*code).into() % VALUES];
        }
    }

    /// [`Sample::code`] of every drive of a channel.
    #[inline(always)]
    pub(super) fn encode(&self, channel: usize, drives: &[Drive], codes: &mut [S]) {
        let curve = &self.codes[channel.min(self.codes.len() - 1)];
        let Some(by_drive) = curve.first_chunk::<VALUES>() else {
            return;
        };
        for (drive, code) in drives.iter().zip(codes) {
            *code = by_drive[usize::from(drive.to_bits())];
        }
    }

    /// Bits of the light of every code.
    #[cfg(feature = "gpu")]
    pub(super) fn light_words(&self) -> Vec<u32> {
        let lights = self.light.iter().zip(S::all());
        lights.map(|(light, _)| light.to_bits().into()).collect()
    }

    /// Codes of every drive, one curve after the other, and how many curves there are.
    #[cfg(feature = "gpu")]
    pub(super) fn code_words(&self) -> (Vec<u32>, usize) {
        let drives = usize::from(Drive::ONE.to_bits()) + 1;
        let codes = self.codes.iter().flat_map(|codes| &codes[..drives]);
        let words = codes.map(|code| (*code).into() as u32).collect();
        (words, self.codes.len())
    }
}
