//! Light curve: the light that each 8-bit code asks for.
//!
//! Where projectors overlap, their black adds up: a dark picture shows the overlap. A table may
//! raise black, so that it is as bright everywhere: code 0 asks for the light of black,
//! and the other codes for what is left of that up to white.

use super::srgb;
use crate::units::{Halfword, Light};

/// Light of the 256 codes of a sample, [`Light`] bits.
pub type LightCurve = [Halfword; 256];

/// A curve that a processor reads at even addresses.
#[repr(align(4))]
struct Aligned(LightCurve);

/// Of sRGB codes, black not raised.
static DISPLAY: Aligned = Aligned(bytes(&srgb::LIGHT));

/// Of codes in proportion to light, to nearest, black not raised.
static LINEAR: Aligned = Aligned(bytes(&PROPORTIONAL));

/// Of sRGB codes, and of codes in proportion to light, black not raised.
pub(crate) const fn plain() -> [&'static LightCurve; 2] {
    [&DISPLAY.0, &LINEAR.0]
}

const PROPORTIONAL: [u16; 256] = {
    let mut light = [0; 256];
    let mut code = 0;
    while code < 256 {
        #[allow(clippy::indexing_slicing, reason = "evaluated when compiled")]
        {
            light[code] = ((code as u32 * 32_768 + 127) / 255) as u16;
        }
        code += 1;
    }
    light
};

#[allow(clippy::indexing_slicing, reason = "evaluated when compiled")]
const fn bytes(light: &[u16; 256]) -> LightCurve {
    let mut bytes = [[0; 2]; 256];
    let mut code = 0;
    while code < 256 {
        bytes[code] = light[code].to_le_bytes();
        code += 1;
    }
    bytes
}

/// The light asked for where black is raised to `black`: `black + (1 - black) light`, to nearest.
/// White stays white.
#[must_use]
pub fn raised(light: Light, black: Light) -> Light {
    let one = u32::from(Light::ONE.to_bits());
    let black = u32::from(black.to_bits()).min(one);
    let rest = ((one - black) * u32::from(light.to_bits()) + one / 2) / one;
    Light::from_bits((black + rest) as u16)
}

/// The curves of a table that raises black: of sRGB codes, and of codes in proportion to light.
#[must_use]
pub fn raised_curves(black: Light) -> [LightCurve; 2] {
    plain().map(|curve| {
        curve.map(|light| {
            let light = Light::from_bits(u16::from_le_bytes(light));
            raised(light, black).to_bits().to_le_bytes()
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(curve: &LightCurve, code: u8) -> u16 {
        u16::from_le_bytes(curve[usize::from(code)])
    }

    #[test]
    fn codes_in_proportion_round_to_the_nearest_light() {
        for code in 0..=255 {
            let exact = f64::from(code) / 255.0 * 32_768.0;
            let found = f64::from(light(&LINEAR.0, code));
            assert!((found - exact).abs() <= 0.5, "{code}");
        }
    }

    #[test]
    fn raised_curves_rise_from_black_to_white() {
        for black in [0, 1, 131, 3_000, 32_768] {
            for curve in raised_curves(Light::from_bits(black)) {
                assert_eq!((light(&curve, 0), light(&curve, 255)), (black, 32_768));
                let rises = |code: u8| light(&curve, code - 1) <= light(&curve, code);
                assert!((1..=255).all(rises), "{black}");
            }
        }
        let [display, linear] = raised_curves(Light::ZERO);
        assert_eq!([&display, &linear], plain());
    }
}
