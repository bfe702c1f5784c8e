//! YUV of more than 8 bits to RGB codes of 16 bits and back, in integers.
//!
//! The formulas are those of [`super`], with 65,535 in the place of 255 and the widths of as many
//! bits. Sums of products with coefficients of 13 fraction bits are rounded to nearest, halves
//! upwards; back, the coefficients have as many as 32 bits can hold. A mean of codes is rounded to
//! nearest before. A sample larger than its bits can be, which only a damaged stream has, is taken
//! for the largest.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

use super::super::y4m::CodeRange;
use super::{Convert, PlaneCode, Standard, fixed};

/// Fraction bits of coefficients to RGB.
const BITS: u32 = 13;

/// The largest code of a colour.
const WHITE: i32 = 65_535;

/// The coefficients of one standard, range and number of bits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DeepConversion {
    luma_scale: i32,
    /// Of v in red, u in green, v in green, u in blue.
    chroma: [i32; 4],
    /// Of red, green, blue in luma, u and v.
    back: [[i32; 3]; 3],
    /// Fraction bits of those.
    back_bits: u32,
    black: i32,
    /// The code of no chroma.
    middle: i32,
    /// The largest code of a plane.
    most: i32,
}

impl DeepConversion {
    /// Luma in units of a colour's code, [`BITS`] fraction bits, the half of rounding included.
    #[inline(always)]
    fn luma_term(&self, code: u16) -> i32 {
        (i32::from(code).min(self.most) - self.black) * self.luma_scale + (1 << (BITS - 1))
    }

    /// A plane's code from a sum of products.
    #[inline(always)]
    fn code(&self, sum: i32, zero: i32) -> u16 {
        let offset = (zero << self.back_bits) + (1 << (self.back_bits - 1));
        ((sum + offset) >> self.back_bits).clamp(0, self.most) as u16
    }
}

impl PlaneCode for u16 {
    type Conversion = DeepConversion;
    type Term = i32;
    type Sum = u32;

    fn of_bytes(bytes: Vec<u8>) -> Vec<Self> {
        let (samples, _) = bytes.as_chunks();
        samples.iter().copied().map(Self::from_le_bytes).collect()
    }

    fn to_bytes(samples: Vec<Self>) -> Vec<u8> {
        samples.into_iter().flat_map(Self::to_le_bytes).collect()
    }
}

impl Convert<u16> for DeepConversion {
    fn of(standard: Standard, range: CodeRange, bits: u32) -> Self {
        let widths @ [black, luma, _] = range.widths(bits);
        let white = f64::from(WHITE);
        let back_bits = 30 - bits;
        Self {
            luma_scale: fixed(white / luma, BITS),
            chroma: standard.to_colours(white, widths, BITS),
            back: standard.to_planes(white, widths, back_bits),
            back_bits,
            black: black as i32,
            middle: 1 << (bits - 1),
            most: (1 << bits) - 1,
        }
    }

    #[inline(always)]
    fn chroma_terms(&self, u: &[u16], v: &[u16], terms: [&mut [i32]; 3]) {
        let [v_red, u_green, v_green, u_blue] = self.chroma;
        let [red, green, blue] = terms;
        let centred = |code: u16| i32::from(code).min(self.most) - self.middle;
        let slots = red.iter_mut().zip(green).zip(blue);
        for ((u, v), ((red, green), blue)) in u.iter().zip(v).zip(slots) {
            let (u, v) = (centred(*u), centred(*v));
            *red = v_red * v;
            *green = u_green * u + v_green * v;
            *blue = u_blue * u;
        }
    }

    #[inline(always)]
    fn colour_row(&self, luma: &[u16], terms: &[i32], colour: &mut [u16]) {
        for ((luma, term), colour) in luma.iter().zip(terms).zip(colour) {
            let sum = self.luma_term(*luma) + *term;
            *colour = (sum >> BITS).clamp(0, WHITE) as u16;
        }
    }

    #[inline(always)]
    fn grey_row(&self, luma: &[u16], grey: &mut [u16]) {
        for (luma, grey) in luma.iter().zip(grey) {
            *grey = (self.luma_term(*luma) >> BITS).clamp(0, WHITE) as u16;
        }
    }

    #[inline(always)]
    fn luma_row(&self, [red, green, blue]: [&[u16]; 3], luma: &mut [u16]) {
        let [[of_red, of_green, of_blue], ..] = self.back;
        let colours = red.iter().zip(green).zip(blue);
        for (((red, green), blue), luma) in colours.zip(luma) {
            let sum = of_red * i32::from(*red)
                + of_green * i32::from(*green)
                + of_blue * i32::from(*blue);
            *luma = self.code(sum, self.black);
        }
    }

    #[inline(always)]
    fn grey_luma_row(&self, grey: &[u16], luma: &mut [u16]) {
        let [of_luma, ..] = self.back;
        let scale: i32 = of_luma.into_iter().sum();
        for (grey, luma) in grey.iter().zip(luma) {
            *luma = self.code(scale * i32::from(*grey), self.black);
        }
    }

    #[inline(always)]
    fn chroma_row(&self, [red, green, blue]: [&[u32]; 3], bits: u32, u: &mut [u16], v: &mut [u16]) {
        let [_, of_u, of_v] = self.back;
        let half = (1 << bits) >> 1;
        let colours = red.iter().zip(green).zip(blue);
        for (((red, green), blue), (u, v)) in colours.zip(u.iter_mut().zip(v)) {
            let colour = [red, green, blue].map(|sum| ((sum + half) >> bits) as i32);
            let sum = |of: [i32; 3]| of[0] * colour[0] + of[1] * colour[1] + of[2] * colour[2];
            *u = self.code(sum(of_u), self.middle);
            *v = self.code(sum(of_v), self.middle);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_colours_come_back_within_one_and_are_those_of_the_standards() {
        for (bits, standard, range) in [10, 12].into_iter().flat_map(|bits| {
            [Standard::Bt601, Standard::Bt709]
                .into_iter()
                .flat_map(move |standard| {
                    [CodeRange::Limited, CodeRange::Full].map(|range| (bits, standard, range))
                })
        }) {
            let conversion = DeepConversion::of(standard, range, bits);
            let yuv = |[red, green, blue]: [u16; 3]| {
                let (mut y, mut u, mut v) = ([0], [0], [0]);
                conversion.luma_row([&[red], &[green], &[blue]], &mut y);
                let sums = [red, green, blue].map(|code| [u32::from(code)]);
                conversion.chroma_row(sums.each_ref().map(|s| &s[..]), 0, &mut u, &mut v);
                [y[0], u[0], v[0]]
            };
            let rgb = |[y, u, v]: [u16; 3]| {
                let (mut red, mut green, mut blue) = ([0], [0], [0]);
                conversion.chroma_terms(&[u], &[v], [&mut red, &mut green, &mut blue]);
                [red, green, blue].map(|term| {
                    let mut code = [0];
                    conversion.colour_row(&[y], &term, &mut code);
                    code[0]
                })
            };
            let (red, blue) = standard.red_and_blue();
            let unit = f64::from(1_u32 << (bits - 8));
            let most = f64::from((1_u32 << bits) - 1);
            let (black, luma, chroma) = match range {
                CodeRange::Limited => (16.0 * unit, 219.0 * unit, 224.0 * unit),
                CodeRange::Full => (0.0, most, most),
            };
            let steps = || (0..=15).map(|step| (step * 4369) as u16);
            for colour in
                steps().flat_map(|r| steps().flat_map(move |g| steps().map(move |b| [r, g, b])))
            {
                let codes = yuv(colour);
                let [r, g, b] = colour.map(|code| f64::from(code) / 65_535.0);
                let y = red * r + (1.0 - red - blue) * g + blue * b;
                let exact = [
                    black + luma * y,
                    128.0 * unit + chroma * (b - y) / (2.0 * (1.0 - blue)),
                    128.0 * unit + chroma * (r - y) / (2.0 * (1.0 - red)),
                ];
                for (code, exact) in codes.iter().zip(exact) {
                    let off = (f64::from(*code) - exact.min(most)).abs();
                    assert!(off < 0.75, "{bits} bits {colour:?}: {code}, {exact}");
                }
                let back = yuv(rgb(codes));
                for (code, back) in codes.into_iter().zip(back) {
                    assert!(
                        code.abs_diff(back) <= 1,
                        "{bits} bits {colour:?} {codes:?} {back}"
                    );
                }
            }
            // Whatever stands in a stream, nothing overflows.
            for codes in [
                [u16::MAX; 3],
                [0; 3],
                [u16::MAX, 0, u16::MAX],
                [0, u16::MAX, 0],
            ] {
                let _ = yuv(rgb(codes));
            }
        }
    }
}
