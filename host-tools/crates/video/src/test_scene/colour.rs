//! Linear light and the codes it is shown by.

use iltm_runtime::pipeline::srgb;
use std::ops::{Add, Mul};

/// Linear light: red, green, blue.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Colour(pub(super) [f32; 3]);

impl Colour {
    pub(super) const fn new(red: f32, green: f32, blue: f32) -> Self {
        Self([red, green, blue])
    }

    /// `share` of `other` and the rest of this.
    pub(super) fn mix(self, other: Self, share: f32) -> Self {
        self * (1.0 - share) + other * share
    }

    /// Each colour by its own factor.
    pub(super) fn filter(self, by: Self) -> Self {
        Self(std::array::from_fn(|index| self.0[index] * by.0[index]))
    }
}

impl Add for Colour {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|index| self.0[index] + other.0[index]))
    }
}

impl Mul<f32> for Colour {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self(self.0.map(|light| light * factor))
    }
}

/// From light to sRGB codes.
#[derive(Clone, Debug)]
pub(super) struct Tone {
    /// Code, with a fraction, of every 4096th of full light.
    codes: Vec<f32>,
}

/// Steps of a tone curve.
const STEPS: usize = 1 << 12;

impl Tone {
    pub(super) fn new() -> Self {
        let light = |code: u8| srgb::decode(code).to_num::<f32>();
        let mut below = 0_u8;
        let code = |step: usize| {
            let wanted = step as f32 / STEPS as f32;
            while below < 254 && light(below + 1) <= wanted {
                below += 1;
            }
            let (lower, upper) = (light(below), light(below + 1));
            f32::from(below) + (wanted - lower) / (upper - lower)
        };
        Self {
            codes: (0..=STEPS).map(code).collect(),
        }
    }

    /// Codes of a light; `grain`, 0 to 1, decides where it lies between two, so
    /// that smooth gradients have no bands.
    pub(super) fn codes(&self, light: Colour, grain: f32) -> [u8; 3] {
        light.0.map(|light| {
            // The darkest and the brightest light are compressed, as film does.
            let light = light * light / (light + 0.012);
            let shown = light * (1.0 + 0.12 * light) / (1.0 + 0.62 * light);
            let at = shown.clamp(0.0, 1.0) * STEPS as f32;
            let step = (at as usize).min(STEPS - 1);
            let (below, above) = (self.codes[step], self.codes[step + 1]);
            (below + (above - below) * (at - step as f32) + grain) as u8
        })
    }
}
