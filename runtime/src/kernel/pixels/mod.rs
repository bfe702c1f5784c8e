//! Between the 8-bit pixels of a grid and the finest level of the transforms.

#[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
#[allow(unsafe_code, reason = "assembler; the file says why each use is sound")]
mod arm;

use crate::haar::Block;
use crate::pipeline::{CODES, Halfword, Pixels};
use crate::units::InputCoefficient;

/// Merges a block of the pixels of one channel: the sum of each node to `sums`, its
/// details to `details`. `light` is by code. `false`, and nothing done, if that has to
/// be done the plain way.
#[inline]
pub(crate) fn merge<const C: usize>(
    pixels: &Pixels<'_, u8, C>,
    light: &[u16; 256],
    (block, shift): (Block, u32),
    sums: &mut [i32],
    details: &mut [[InputCoefficient; 3]],
) -> bool {
    #[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
    return arm::merge(pixels, light, (block, shift), sums, details);
    #[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
    {
        let _ = (pixels, light, block, shift, sums, details);
        false
    }
}

/// Gain, correction, clip and code of one channel of as many pixels as there are
/// corrections; returns how many were clipped, or `None`, and nothing done, if that
/// has to be done the plain way. `light` is by code, `codes` by drive, `None` if they
/// are in proportion to it.
#[inline]
pub(crate) fn finish<const C: usize>(
    wanted: &Pixels<'_, u8, C>,
    (light, codes): (&[u16; 256], Option<&[u8; CODES]>),
    gain_fraction: u32,
    gains: &[[Halfword; C]],
    corrections: &[i32],
    input: &mut [[u8; C]],
) -> Option<u32> {
    #[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
    {
        let curves = (light, codes);
        arm::finish(wanted, curves, gain_fraction, gains, corrections, input)
    }
    #[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
    {
        let _ = (
            wanted,
            light,
            codes,
            gain_fraction,
            gains,
            corrections,
            input,
        );
        None
    }
}

/// Adds the light of one channel of as many pixels as there are columns, times
/// `weight`, to the columns. `false`, and nothing done, if that has to be done the
/// plain way.
#[inline]
pub(crate) fn add_light<const C: usize>(
    pixels: &Pixels<'_, u8, C>,
    light: &[u16; 256],
    weight: u32,
    columns: &mut [u32],
) -> bool {
    #[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
    return arm::add_light(pixels, light, weight, columns);
    #[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
    {
        let _ = (pixels, light, weight, columns);
        false
    }
}
