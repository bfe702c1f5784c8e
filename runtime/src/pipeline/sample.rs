//! Samples of a frame: from codes to light, and from drive to codes.

use super::light_curve::{LightCurve, plain, raised};
use super::pixels::Pixels;
use super::srgb;
use super::stages::{clip, drive};
use crate::image::Table;
use crate::kernel::{Block, pixels};
use crate::response::{CODES, INDEX_SHIFT, ResponseCurve, code_at, linear_code, linear_code_8};
use crate::units::{ClippedSamples, Halfword, InputCoefficient, Light};
use core::fmt;

/// What the codes of a frame mean.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Encoding {
    /// Video: sRGB codes in, codes for the projector's response out.
    Display,
    /// Codes in proportion to light in, in proportion to drive out.
    Linear,
}

/// One sample of a frame: `u8`, or `u16` with full scale 65,535.
///
/// Both conversions are named rounding places: to nearest.
pub trait Sample: Copy + Default + fmt::Debug + 'static {
    /// What the samples of one channel go through.
    type Curves<'a>: Copy + fmt::Debug;

    /// The curves of a channel of a table.
    fn curves<'a>(table: &'a Table<'_>, encoding: Encoding, channel: usize) -> Self::Curves<'a>;

    /// Light of a code.
    fn light(self, curves: Self::Curves<'_>) -> Light;

    /// Code of a drive in units of [`Drive`](crate::units::Drive) that may lie outside 0 to 1.
    fn code(wanted: i32, curves: Self::Curves<'_>) -> Self;

    /// [`CellSource::merge`](crate::haar::CellSource::merge) of pixels.
    #[inline]
    fn merge<const C: usize>(
        pixels: &Pixels<'_, Self, C>,
        block: Block,
        shift: u32,
        sums: &mut [i32],
        details: &mut [[InputCoefficient; 3]],
    ) -> bool {
        let _ = (pixels, block, shift, sums, details);
        false
    }

    /// Adds the light of a row of pixels, times a weight, to columns.
    fn add_light<const C: usize>(pixels: &Pixels<'_, Self, C>, weight: u32, columns: &mut [u32]) {
        add_plainly(pixels, weight, columns);
    }

    /// Gain, correction, clip and code of one channel of as many pixels as there are
    /// corrections; returns how many were clipped.
    fn finish<const C: usize>(
        wanted: &Pixels<'_, Self, C>,
        gain_fraction: u32,
        gains: &[[Halfword; C]],
        corrections: &[i32],
        input: &mut [[Self; C]],
    ) -> ClippedSamples {
        finish_plainly(wanted, gain_fraction, gains, corrections, input)
    }
}

/// [`Sample::add_light`] sample by sample.
fn add_plainly<S: Sample, const C: usize>(
    pixels: &Pixels<'_, S, C>,
    weight: u32,
    columns: &mut [u32],
) {
    for (index, column) in columns.iter_mut().enumerate() {
        let light = u32::from(Light::to_bits(pixels.light(index)));
        *column = column.wrapping_add(weight.wrapping_mul(light));
    }
}

/// [`Sample::finish`] sample by sample.
fn finish_plainly<S: Sample, const C: usize>(
    wanted: &Pixels<'_, S, C>,
    gain_fraction: u32,
    gains: &[[Halfword; C]],
    corrections: &[i32],
    input: &mut [[S; C]],
) -> ClippedSamples {
    let mut clipped = ClippedSamples::default();
    let pixels = input.iter_mut().zip(gains).zip(corrections);
    for (index, ((pixel, gain), correction)) in pixels.enumerate() {
        let gain = gain.get(wanted.plane.channel).copied().unwrap_or_default();
        let light = wanted.light(index);
        let wanted_drive = drive(light, u16::from_le_bytes(gain), gain_fraction, *correction);
        if let Some(sample) = pixel.get_mut(wanted.plane.channel) {
            *sample = S::code(wanted_drive, wanted.curves);
        }
        clipped.count(wanted_drive);
    }
    clipped
}

/// Curves of 8-bit samples.
#[derive(Clone, Copy, Debug)]
pub struct Curves<'a> {
    light: &'a LightCurve,
    /// `None` if codes are in proportion to drives.
    codes: Option<&'a [u8; CODES]>,
}

impl Sample for u8 {
    type Curves<'a> = Curves<'a>;

    fn curves<'a>(table: &'a Table<'_>, encoding: Encoding, channel: usize) -> Curves<'a> {
        let [display, linear] = table.light_curves().unwrap_or(plain());
        match encoding {
            Encoding::Display => Curves {
                light: display,
                codes: table.codes(channel),
            },
            Encoding::Linear => Curves {
                light: linear,
                codes: None,
            },
        }
    }

    #[inline]
    fn light(self, curves: Curves<'_>) -> Light {
        // A `u8` indexes 256 elements: the compiler sees that it cannot fail.
        #[allow(clippy::indexing_slicing)]
        Light::from_bits(u16::from_le_bytes(curves.light[usize::from(self)]))
    }

    #[inline]
    fn code(wanted: i32, curves: Curves<'_>) -> Self {
        let Some(codes) = curves.codes else {
            return linear_code_8(clip(wanted));
        };
        // Negative drives become the largest indices.
        let index = (wanted.cast_unsigned() >> INDEX_SHIFT) as usize;
        if let Some(code) = codes.get(index) {
            return *code;
        }
        code_at(codes, clip(wanted))
    }

    #[inline]
    fn merge<const C: usize>(
        pixels: &Pixels<'_, Self, C>,
        block: Block,
        shift: u32,
        sums: &mut [i32],
        details: &mut [[InputCoefficient; 3]],
    ) -> bool {
        pixels::merge(
            &pixels.plane,
            pixels.curves.light,
            block,
            shift,
            sums,
            details,
        )
    }

    fn add_light<const C: usize>(pixels: &Pixels<'_, Self, C>, weight: u32, columns: &mut [u32]) {
        if !pixels::add_light(&pixels.plane, pixels.curves.light, weight, columns) {
            add_plainly(pixels, weight, columns);
        }
    }

    fn finish<const C: usize>(
        wanted: &Pixels<'_, Self, C>,
        gain_fraction: u32,
        gains: &[[Halfword; C]],
        corrections: &[i32],
        input: &mut [[Self; C]],
    ) -> ClippedSamples {
        let Curves { light, codes } = wanted.curves;
        let plane = &wanted.plane;
        let done = pixels::finish(
            plane,
            light,
            codes,
            gain_fraction,
            gains,
            corrections,
            input,
        );
        done.unwrap_or_else(|| finish_plainly(wanted, gain_fraction, gains, corrections, input))
    }
}

/// Curves of 16-bit samples.
#[derive(Clone, Copy, Debug)]
pub struct WideCurves<'a> {
    encoding: Encoding,
    /// Light that code 0 asks for.
    black: Light,
    response: ResponseCurve<'a>,
}

impl Sample for u16 {
    type Curves<'a> = WideCurves<'a>;

    fn curves<'a>(table: &'a Table<'_>, encoding: Encoding, channel: usize) -> WideCurves<'a> {
        WideCurves {
            encoding,
            black: table.black(),
            response: table.response(channel),
        }
    }

    #[inline]
    fn light(self, curves: WideCurves<'_>) -> Light {
        let light = match curves.encoding {
            Encoding::Linear => {
                Light::from_bits(((u32::from(self) * 32_768 + 32_767) / 65_535) as Self)
            }
            Encoding::Display => {
                let (below, rest) = ((self / 257) as u8, u32::from(self % 257));
                let lower = u32::from(srgb::decode(below).to_bits());
                let upper = u32::from(srgb::decode(below.saturating_add(1)).to_bits());
                Light::from_bits((lower + ((upper - lower) * rest + 128) / 257) as Self)
            }
        };
        raised(light, curves.black)
    }

    #[inline]
    fn code(wanted: i32, curves: WideCurves<'_>) -> Self {
        match curves.encoding {
            Encoding::Display => curves.response.fine_code(clip(wanted)),
            Encoding::Linear => linear_code(clip(wanted)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::response::code_of_index;

    #[test]
    fn what_is_clipped_is_what_lies_outside() {
        let of_response: [u8; CODES] =
            core::array::from_fn(|index| code_of_index(index, ResponseCurve::new(&[])));
        for codes in [None, Some(&of_response)] {
            let curves = Curves {
                light: plain()[1],
                codes,
            };
            for (wanted, code, black, white) in [
                (i32::MIN, 0, 1, 0),
                (-1, 0, 1, 0),
                (0, 0, 0, 0),
                (32_768, 255, 0, 0),
                (32_769, 255, 0, 1),
                (i32::MAX, 255, 0, 1),
            ] {
                assert_eq!(u8::code(wanted, curves), code, "{wanted}");
                let mut clipped = ClippedSamples::default();
                clipped.count(wanted);
                assert_eq!(clipped, ClippedSamples { black, white }, "{wanted}");
            }
        }
    }
}
