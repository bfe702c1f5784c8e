//! Lookup tables from codes to light and from drives to codes.
//!
//! Both kinds of table have an element for every value that an index can have, though not
//! all can occur: looking up then needs no check. A response of 8-bit frames has the same
//! code for four drives at a time, so that its table is by the upper bits of the drive and
//! leaves more of the caches to the frame.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

#[cfg(target_arch = "x86_64")]
mod registers;

use iltm_runtime::{
    image::Table,
    pipeline::{Encoding, Sample},
    response::INDEX_SHIFT,
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

    /// The light of every code, if there is a faster way than to look up one after the other;
    /// `false`, and nothing done, if there is none.
    fn decode(_by_code: &[Light; VALUES], _codes: &[Self], _light: &mut [Light]) -> bool {
        false
    }
}

impl Code for u8 {
    fn all() -> impl Iterator<Item = Self> {
        Self::MIN..=Self::MAX
    }

    #[cfg(target_arch = "x86_64")]
    fn decode(by_code: &[Light; VALUES], codes: &[Self], light: &mut [Light]) -> bool {
        let by_code = by_code.first_chunk::<256>();
        by_code.is_some_and(|by_code| registers::decode(by_code, codes, light))
    }
}

impl Code for u16 {
    fn all() -> impl Iterator<Item = Self> {
        Self::MIN..=Self::MAX
    }
}

/// The light of every code, one after the other.
#[inline(always)]
fn look_up<S: Code>(by_code: &[Light; VALUES], codes: &[S], light: &mut [Light]) {
    for (code, light) in codes.iter().zip(light) {
        *light = by_code[(*code).into() % VALUES];
    }
}

/// Elements of a table by the upper bits of a drive.
const COARSE_VALUES: usize = VALUES >> INDEX_SHIFT;

/// What every sample goes through.
#[derive(Clone, Debug)]
pub(super) struct Curves<S> {
    /// Light by code.
    light: Vec<Light>,
    /// Of each channel, or one for all where they are the same, which leaves more of the
    /// caches to the frame.
    codes: Vec<CodeCurve<S>>,
}

/// From drives to codes.
#[derive(Clone, PartialEq, Debug)]
enum CodeCurve<S> {
    /// Codes by the bits of the drive.
    Fine(Vec<S>),
    /// Codes by the bits of the drive without the lowest [`INDEX_SHIFT`].
    Coarse(Vec<S>),
}

impl<S: Code> CodeCurve<S> {
    /// Of these codes, by the bits of the drive.
    fn of(codes: Vec<S>) -> Self {
        let groups = codes.chunks_exact(1 << INDEX_SHIFT);
        let coarse: Option<Vec<S>> = groups
            .map(|group| {
                group
                    .iter()
                    .all(|code| *code == group[0])
                    .then_some(group[0])
            })
            .collect();
        coarse.map_or(Self::Fine(codes), Self::Coarse)
    }
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
                for (code, bits) in codes.iter_mut().zip(0..) {
                    *code = S::code(bits, curves);
                }
                CodeCurve::of(codes)
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
        if !S::decode(by_code, codes, light) {
            look_up(by_code, codes, light);
        }
    }

    /// [`Sample::code`] of every drive of a channel.
    #[inline(always)]
    pub(super) fn encode(&self, channel: usize, drives: &[Drive], codes: &mut [S]) {
        // The lengths are known to the compiler from here on.
        match &self.codes[channel.min(self.codes.len() - 1)] {
            CodeCurve::Fine(by_drive) => {
                let Some(by_drive) = by_drive.first_chunk::<VALUES>() else {
                    return;
                };
                for (drive, code) in drives.iter().zip(codes) {
                    *code = by_drive[usize::from(drive.to_bits())];
                }
            }
            CodeCurve::Coarse(by_drive) => {
                let Some(by_drive) = by_drive.first_chunk::<COARSE_VALUES>() else {
                    return;
                };
                for (drive, code) in drives.iter().zip(codes) {
                    *code = by_drive[usize::from(drive.to_bits() >> INDEX_SHIFT)];
                }
            }
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
        let drives: Vec<_> = (0..=Drive::ONE.to_bits()).map(Drive::from_bits).collect();
        let curves = 0..self.codes.len();
        let words = curves.clone().flat_map(|curve| {
            let mut codes = vec![S::default(); drives.len()];
            self.encode(curve, &drives, &mut codes);
            codes.into_iter().map(|code| code.into() as u32)
        });
        (words.collect(), curves.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::Grid;
    use iltm_tests::made_up::MadeUp;

    /// Compares both tables with what they stand for; of each channel, whether its codes
    /// are by the upper bits of the drive.
    fn coarse<S: Code>(table: &Table<'_>, encoding: Encoding) -> Vec<bool> {
        let curves = Curves::<S>::new(table, encoding);
        let all: Vec<S> = S::all().collect();
        // Whole vectors, and some elements less and more.
        for codes in [&all[..], &all[1..], &all[..7], &all[100..133]] {
            let mut light = vec![Light::ZERO; codes.len()];
            curves.decode(codes, &mut light);
            let mut one_by_one = vec![Light::ZERO; codes.len()];
            look_up(curves.light.first_chunk().unwrap(), codes, &mut one_by_one);
            assert_eq!(light, one_by_one);
            for (code, light) in codes.iter().zip(light) {
                assert_eq!(light, code.light(S::curves(table, encoding, 0)), "{code:?}");
            }
        }
        let drives: Vec<Drive> = (0..=Drive::ONE.to_bits()).map(Drive::from_bits).collect();
        let mut codes = vec![S::default(); drives.len()];
        for channel in 0..usize::from(table.channels()) {
            curves.encode(channel, &drives, &mut codes);
            let of_channel = S::curves(table, encoding, channel);
            for (drive, code) in drives.iter().zip(&codes) {
                assert_eq!(
                    *code,
                    S::code(drive.to_bits().into(), of_channel),
                    "{drive}"
                );
            }
        }
        let codes = curves.codes.iter();
        codes
            .map(|curve| matches!(curve, CodeCurve::Coarse(_)))
            .collect()
    }

    #[test]
    fn tables_are_what_they_stand_for_and_codes_by_upper_bits_only_where_that_is_the_same() {
        let grid = Grid::new(4, 4).unwrap();
        let image = MadeUp::of_all_kinds(grid, 3, 2, 1).image();
        let table = Table::check(&image).unwrap();
        assert!(coarse::<u8>(&table, Encoding::Display).iter().all(|is| *is));
        assert_eq!(coarse::<u8>(&table, Encoding::Linear), [false]);
        assert!(!coarse::<u16>(&table, Encoding::Display).contains(&true));
        assert_eq!(coarse::<u16>(&table, Encoding::Linear), [false]);
    }
}
