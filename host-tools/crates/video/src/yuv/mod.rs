//! YUV to RGB codes and back, in integers.
//!
//! With `K_r`, `K_b` of the standard, `K_g = 1 - K_r - K_b`, black `y_0` and the
//! widths `Y` of luma and `C` of chroma of the range, in exact numbers
//!
//! ```text
//! R = 255/Y (y - y_0)                                          + 2 (1 - K_r) 255/C (v - 128)
//! G = 255/Y (y - y_0) - 2 (1 - K_b) K_b/K_g 255/C (u - 128) - 2 (1 - K_r) K_r/K_g 255/C (v - 128)
//! B = 255/Y (y - y_0) + 2 (1 - K_b)         255/C (u - 128)
//! ```
//!
//! What is computed: the luma term in 64ths of a code as
//! `floor(257 y A / 2^16) + B` with `A = round(64 * 255 * 255/Y)` and
//! `B = round(32 - 64 * 255/Y y_0)`, the half of rounding included; the chroma
//! terms in 64ths as `floor((sum of coefficient * (c - 128) + 64) / 2^7)` with
//! coefficients of 13 fraction bits; then their sum, held in 16 bits by
//! saturation, over 64, cut to 0 to 255. A code is within .54 of the exact one.
//! Back, sums of products with coefficients of 15 fraction bits are rounded to
//! nearest, halves upwards; those of chroma add up to exactly nothing for grey.
//!
//! A chroma sample of 4:2:0 belongs to its four pixels alike, one of 4:2:2 to its two, both
//! ways: codes are repeated on the way in and averaged on the way out, so that what is not
//! changed in between comes back. For chroma sited left (`420mpeg2`) that leaves
//! the *gain* of a chroma sample a quarter of its width to the right, which the
//! smooth gains do not show; the chroma itself is not moved.
//!
//! There and back, YUV codes of colours that RGB has change by one code at most;
//! others (footroom, headroom, chroma that is too strong for the luma of one of
//! its four pixels) are cut to what RGB can show. The test
//! `video_that_is_not_changed_comes_back_as_good_as_it_was` measures both.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

mod deep;

use super::curves::Code;
use super::y4m::CodeRange;
use iltm_runtime::FrameSize;
use std::fmt;
use std::ops::Add;

/// A sample of a plane and of a colour: `u8` of 8 bits; `u16` of more, whose colours have 16 bits.
pub(super) trait PlaneCode: Code {
    /// Coefficients.
    type Conversion: Convert<Self>;
    /// What chroma adds to a colour.
    type Term: Copy + Default + fmt::Debug + Send + Sync;
    /// A sum of four codes.
    type Sum: Copy + Default + fmt::Debug + Send + Sync + From<Self> + Add<Output = Self::Sum>;

    /// Samples of a frame.
    fn of_bytes(bytes: Vec<u8>) -> Vec<Self>;

    /// The bytes of a frame's samples.
    fn to_bytes(samples: Vec<Self>) -> Vec<u8>;
}

impl PlaneCode for u8 {
    type Conversion = Conversion;
    type Term = i16;
    type Sum = u16;

    fn of_bytes(bytes: Vec<u8>) -> Vec<Self> {
        bytes
    }

    fn to_bytes(samples: Vec<Self>) -> Vec<u8> {
        samples
    }
}

/// Rows of planes to rows of colours and back.
pub(super) trait Convert<S: PlaneCode>: Copy + fmt::Debug + Send + Sync {
    /// The coefficients for so many bits of a plane's sample.
    fn of(standard: Standard, range: CodeRange, bits: u32) -> Self;

    /// What chroma adds to red, green and blue; all of one length.
    fn chroma_terms(&self, u: &[S], v: &[S], terms: [&mut [S::Term]; 3]);

    /// One colour of a row from its luma and what chroma adds to the colour.
    fn colour_row(&self, luma: &[S], terms: &[S::Term], colour: &mut [S]);

    /// Grey codes of a row of luma.
    fn grey_row(&self, luma: &[S], grey: &mut [S]);

    /// Luma of a row of colours.
    fn luma_row(&self, colours: [&[S]; 3], luma: &mut [S]);

    /// Luma of a row of grey codes.
    fn grey_luma_row(&self, grey: &[S], luma: &mut [S]);

    /// Chroma of colours that are each the sum of `2^bits` codes.
    fn chroma_row(&self, sums: [&[S::Sum]; 3], bits: u32, u: &mut [S], v: &mut [S]);
}

/// What weighs the colours in luma.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Standard {
    /// ITU-R BT.601, of standard definition.
    Bt601,
    /// ITU-R BT.709, of high definition.
    Bt709,
}

impl Standard {
    /// What frames of this size are taken to use, since Y4M does not say: BT.709
    /// above 576 rows, as players do.
    #[must_use]
    pub const fn of(size: FrameSize) -> Self {
        if size.height() > 576 {
            Self::Bt709
        } else {
            Self::Bt601
        }
    }

    const fn red_and_blue(self) -> (f64, f64) {
        match self {
            Self::Bt601 => (0.299, 0.114),
            Self::Bt709 => (0.2126, 0.0722),
        }
    }

    /// What v adds to red, u and v to green, and u to blue, whose codes end at `white`: coefficients of
    /// so many fraction bits.
    fn to_colours(self, white: f64, [_, _, chroma]: [f64; 3], bits: u32) -> [i32; 4] {
        let (red, blue) = self.red_and_blue();
        let green = 1.0 - red - blue;
        let (of_v, of_u) = (2.0 * (1.0 - red), 2.0 * (1.0 - blue));
        let exact = [of_v, -of_u * blue / green, -of_v * red / green, of_u];
        exact.map(|coefficient| fixed(coefficient * white / chroma, bits))
    }

    /// Of red, green, blue, whose codes end at `white`, in luma, u and v: coefficients of so many
    /// fraction bits. Those of chroma add up to nothing.
    fn to_planes(self, white: f64, [_, luma, chroma]: [f64; 3], bits: u32) -> [[i32; 3]; 3] {
        let (red, blue) = self.red_and_blue();
        let whole = fixed(luma / white, bits);
        let [from_red, from_blue] = [red, blue].map(|part| fixed(part * luma / white, bits));
        let half = fixed(0.5 * chroma / white, bits);
        let share = |part: f64, of: f64| fixed(-part * chroma / white / (2.0 * (1.0 - of)), bits);
        let (red_in_u, blue_in_v) = (share(red, blue), share(blue, red));
        [
            [from_red, whole - from_red - from_blue, from_blue],
            [red_in_u, -half - red_in_u, half],
            [half, -half - blue_in_v, blue_in_v],
        ]
    }
}

impl CodeRange {
    /// Black, and the widths of luma and of chroma, in codes of so many bits.
    fn widths(self, bits: u32) -> [f64; 3] {
        let unit = f64::from(bits - 8).exp2();
        let most = f64::from(bits).exp2() - 1.0;
        match self {
            Self::Limited => [16.0 * unit, 219.0 * unit, 224.0 * unit],
            Self::Full => [0.0, most, most],
        }
    }
}

fn fixed(value: f64, bits: u32) -> i32 {
    (value * f64::from(bits).exp2()).round() as i32
}

/// Fraction bits of a row of terms.
const TERM_BITS: u32 = 6;

/// Fraction bits that the coefficients of chroma have beyond a term.
const CHROMA_BITS: u32 = 7;

/// Fraction bits of the coefficients from RGB.
const BACK_BITS: u32 = 15;

/// The coefficients of one standard and range.
#[derive(Clone, Copy, Debug)]
pub struct Conversion {
    luma_scale: u16,
    luma_bias: i16,
    /// Of v in red, u in green, v in green, u in blue.
    chroma: [i16; 4],
    /// Of red, green, blue in luma, u and v.
    back: [[i32; 3]; 3],
    black: i32,
}

impl Conversion {
    /// The coefficients for frames of this standard and range.
    #[must_use]
    pub fn new(standard: Standard, range: CodeRange) -> Self {
        let widths @ [black, luma, _] = range.widths(8);
        let scale = 255.0 / luma;
        let chroma = standard.to_colours(255.0, widths, TERM_BITS + CHROMA_BITS);
        Self {
            luma_scale: (64.0 * 255.0 * scale).round() as u16,
            luma_bias: (32.0 - 64.0 * scale * black).round() as i16,
            chroma: chroma.map(|coefficient| coefficient as i16),
            back: standard.to_planes(255.0, widths, BACK_BITS),
            black: black as i32,
        }
    }

    /// Luma of a pixel.
    #[must_use]
    pub fn luma(&self, [red, green, blue]: [u8; 3]) -> u8 {
        let mut luma = [0];
        self.luma_row([&[red], &[green], &[blue]], &mut luma);
        luma[0]
    }

    #[inline(always)]
    fn luma_term(&self, code: u8) -> i16 {
        let scaled = u32::from(u16::from(code) * 257) * u32::from(self.luma_scale);
        ((scaled >> 16) as i16).wrapping_add(self.luma_bias)
    }
}

impl Convert<u8> for Conversion {
    fn of(standard: Standard, range: CodeRange, _bits: u32) -> Self {
        Self::new(standard, range)
    }

    // In 64ths of a code.
    #[inline(always)]
    fn chroma_terms(&self, u: &[u8], v: &[u8], terms: [&mut [i16]; 3]) {
        const HALF: i32 = 1 << (CHROMA_BITS - 1);
        let [v_red, u_green, v_green, u_blue] = self.chroma.map(i32::from);
        let [red, green, blue] = terms;
        let codes = u.iter().zip(v);
        let slots = red.iter_mut().zip(green).zip(blue);
        for ((u, v), ((red, green), blue)) in codes.zip(slots) {
            let (u, v) = (i32::from(*u) - 128, i32::from(*v) - 128);
            *red = ((v_red * v + HALF) >> CHROMA_BITS) as i16;
            *green = ((u_green * u + v_green * v + HALF) >> CHROMA_BITS) as i16;
            *blue = ((u_blue * u + HALF) >> CHROMA_BITS) as i16;
        }
    }

    #[inline(always)]
    fn colour_row(&self, luma: &[u8], terms: &[i16], colour: &mut [u8]) {
        for ((luma, term), colour) in luma.iter().zip(terms).zip(colour) {
            let sum = self.luma_term(*luma).saturating_add(*term);
            *colour = (sum >> TERM_BITS).clamp(0, 255) as u8;
        }
    }

    #[inline(always)]
    fn grey_row(&self, luma: &[u8], grey: &mut [u8]) {
        for (luma, grey) in luma.iter().zip(grey) {
            *grey = (self.luma_term(*luma) >> TERM_BITS).clamp(0, 255) as u8;
        }
    }

    #[inline(always)]
    fn luma_row(&self, [red, green, blue]: [&[u8]; 3], luma: &mut [u8]) {
        let [[of_red, of_green, of_blue], ..] = self.back;
        let offset = (self.black << BACK_BITS) + (1 << (BACK_BITS - 1));
        let colours = red.iter().zip(green).zip(blue);
        for (((red, green), blue), luma) in colours.zip(luma) {
            let sum = of_red * i32::from(*red)
                + of_green * i32::from(*green)
                + of_blue * i32::from(*blue);
            *luma = ((sum + offset) >> BACK_BITS) as u8;
        }
    }

    #[inline(always)]
    fn grey_luma_row(&self, grey: &[u8], luma: &mut [u8]) {
        let [of_luma, ..] = self.back;
        let scale: i32 = of_luma.into_iter().sum();
        let offset = (self.black << BACK_BITS) + (1 << (BACK_BITS - 1));
        for (grey, luma) in grey.iter().zip(luma) {
            *luma = ((scale * i32::from(*grey) + offset) >> BACK_BITS) as u8;
        }
    }

    #[inline(always)]
    fn chroma_row(&self, [red, green, blue]: [&[u16]; 3], bits: u32, u: &mut [u8], v: &mut [u8]) {
        let [_, of_u, of_v] = self.back;
        let shift = BACK_BITS + bits;
        let offset = (128 << shift) + (1 << (shift - 1));
        let colours = red.iter().zip(green).zip(blue);
        for (((red, green), blue), (u, v)) in colours.zip(u.iter_mut().zip(v)) {
            let colour = [red, green, blue].map(|sum| i32::from(*sum));
            let sum = |of: [i32; 3]| of[0] * colour[0] + of[1] * colour[1] + of[2] * colour[2];
            *u = ((sum(of_u) + offset) >> shift).clamp(0, 255) as u8;
            *v = ((sum(of_v) + offset) >> shift).clamp(0, 255) as u8;
        }
    }
}

/// Repeats every term for the two pixels that it belongs to; an odd last pixel
/// has one of its own.
#[inline(always)]
pub(super) fn repeat_pairs<T: Copy>(terms: &[T], pixels: &mut [T]) {
    let (pairs, rest) = pixels.as_chunks_mut::<2>();
    for (pair, term) in pairs.iter_mut().zip(terms) {
        *pair = [*term, *term];
    }
    if let (Some(pixel), Some(term)) = (rest.first_mut(), terms.last()) {
        *pixel = *term;
    }
}

/// Sums of the codes of two pixels side by side; an odd last pixel counts twice.
#[inline(always)]
pub(super) fn sum_pairs<S: PlaneCode>(row: &[S], sums: &mut [S::Sum]) {
    let (pairs, rest) = row.as_chunks::<2>();
    for (pair, sum) in pairs.iter().zip(sums.iter_mut()) {
        let [a, b] = pair.map(S::Sum::from);
        *sum = a + b;
    }
    if let ([a], Some(sum)) = (rest, sums.last_mut()) {
        let a = S::Sum::from(*a);
        *sum = a + a;
    }
}

/// Sums of the codes in squares of 2 x 2 pixels; an odd last pixel counts twice,
/// and so does a row given as both `top` and `bottom`.
#[inline(always)]
pub(super) fn sum_squares<S: PlaneCode>(top: &[S], bottom: &[S], sums: &mut [S::Sum]) {
    let ((top_pairs, top_rest), (bottom_pairs, bottom_rest)) =
        (top.as_chunks::<2>(), bottom.as_chunks::<2>());
    for ((top, bottom), sum) in top_pairs.iter().zip(bottom_pairs).zip(sums.iter_mut()) {
        let [a, b] = top.map(S::Sum::from);
        let [c, d] = bottom.map(S::Sum::from);
        *sum = a + b + c + d;
    }
    if let ([a], [c], Some(sum)) = (top_rest, bottom_rest, sums.last_mut()) {
        let column = S::Sum::from(*a) + S::Sum::from(*c);
        *sum = column + column;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The formulas of the module's documentation, in `f64`.
    fn exact(standard: Standard, range: CodeRange, [y, u, v]: [u8; 3]) -> [f64; 3] {
        let (red, blue) = match standard {
            Standard::Bt601 => (0.299, 0.114),
            Standard::Bt709 => (0.2126, 0.0722),
        };
        let (black, luma, chroma) = match range {
            CodeRange::Limited => (16.0, 219.0, 224.0),
            CodeRange::Full => (0.0, 255.0, 255.0),
        };
        let y = (f64::from(y) - black) * 255.0 / luma;
        let u = (f64::from(u) - 128.0) * 255.0 / chroma * 2.0 * (1.0 - blue);
        let v = (f64::from(v) - 128.0) * 255.0 / chroma * 2.0 * (1.0 - red);
        let green = 1.0 - red - blue;
        let colours = [y + v, y - u * blue / green - v * red / green, y + u];
        colours.map(|code| code.clamp(0.0, 255.0))
    }

    fn all() -> impl Iterator<Item = (Standard, CodeRange)> {
        [Standard::Bt601, Standard::Bt709]
            .into_iter()
            .flat_map(|standard| [(standard, CodeRange::Limited), (standard, CodeRange::Full)])
    }

    fn rgb(conversion: &Conversion, [y, u, v]: [u8; 3]) -> [u8; 3] {
        let (mut red, mut green, mut blue) = ([0], [0], [0]);
        conversion.chroma_terms(&[u], &[v], [&mut red, &mut green, &mut blue]);
        [red, green, blue].map(|term| {
            let mut code = [0];
            conversion.colour_row(&[y], &term, &mut code);
            code[0]
        })
    }

    fn yuv(conversion: &Conversion, colour: [u8; 3]) -> [u8; 3] {
        let [red, green, blue] = colour.map(|code| [code]);
        let (mut y, mut u, mut v) = ([0], [0], [0]);
        conversion.luma_row([&red, &green, &blue], &mut y);
        let [red, green, blue] = colour.map(|code| [u16::from(code)]);
        conversion.chroma_row([&red, &green, &blue], 0, &mut u, &mut v);
        [y[0], u[0], v[0]]
    }

    #[test]
    fn colours_are_the_standards_formula_within_54_hundredths_of_a_code() {
        for (standard, range) in all() {
            let conversion = Conversion::new(standard, range);
            let mut worst = 0.0_f64;
            for y in 0..=255 {
                for u in (0..=255).step_by(3) {
                    for v in (0..=255).step_by(3) {
                        let exact = exact(standard, range, [y, u, v]);
                        for (code, exact) in rgb(&conversion, [y, u, v]).iter().zip(exact) {
                            worst = worst.max((f64::from(*code) - exact).abs());
                        }
                    }
                }
            }
            assert!(worst <= 0.54, "{standard:?} {range:?}: {worst}");
        }
    }

    #[test]
    fn codes_of_colours_that_rgb_has_come_back_within_one() {
        for (standard, range) in all() {
            let conversion = Conversion::new(standard, range);
            for colour in (0..=255_u8).step_by(5).flat_map(|red| {
                (0..=255_u8)
                    .step_by(5)
                    .flat_map(move |green| [[red, green, 0], [red, green, 90], [red, green, 255]])
            }) {
                let codes = yuv(&conversion, colour);
                let back = yuv(&conversion, rgb(&conversion, codes));
                for (code, back) in codes.into_iter().zip(back) {
                    assert!(code.abs_diff(back) <= 1, "{colour:?} {codes:?} {back}");
                }
            }
        }
    }

    #[test]
    fn grey_has_no_chroma_and_full_range_luma_is_the_grey_code() {
        for (standard, range) in all() {
            let conversion = Conversion::new(standard, range);
            for code in 0..=255 {
                let [y, u, v] = yuv(&conversion, [code; 3]);
                assert_eq!([u, v], [128, 128]);
                let mut grey = [0];
                conversion.grey_row(&[y], &mut grey);
                assert!(grey[0].abs_diff(code) <= u8::from(range == CodeRange::Limited));
                assert_eq!(rgb(&conversion, [y, 128, 128]), grey.repeat(3)[..]);
            }
        }
    }

    #[test]
    fn the_codes_of_black_white_and_the_primaries_are_those_of_the_standards() {
        // BT.709 and BT.601, 8 bit, rounded from the formulas of table 4 of the one
        // and 2.5 of the other.
        let bt709 = Conversion::new(Standard::Bt709, CodeRange::Limited);
        assert_eq!(yuv(&bt709, [0, 0, 0]), [16, 128, 128]);
        assert_eq!(yuv(&bt709, [255, 255, 255]), [235, 128, 128]);
        assert_eq!(yuv(&bt709, [255, 0, 0]), [63, 102, 240]);
        assert_eq!(yuv(&bt709, [0, 255, 0]), [173, 42, 26]);
        assert_eq!(yuv(&bt709, [0, 0, 255]), [32, 240, 118]);
        let bt601 = Conversion::new(Standard::Bt601, CodeRange::Limited);
        assert_eq!(yuv(&bt601, [255, 0, 0]), [81, 90, 240]);
        assert_eq!(yuv(&bt601, [0, 255, 0]), [145, 54, 34]);
        assert_eq!(yuv(&bt601, [0, 0, 255]), [41, 240, 110]);
    }
}
