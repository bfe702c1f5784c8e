//! Mountains and wooded hills, one behind the other.

use super::colour::Colour;
use super::noise::{Noise, step};
use super::sky::Sky;
use super::{PAN, WATERLINE};

/// One range of hills.
struct Range {
    /// Least and additional height above the waterline.
    heights: (f32, f32),
    /// Crests a height of the picture.
    crests: f32,
    /// How much of it haze hides.
    haze: f32,
    /// How much slower it moves by than what is near.
    distance: f32,
    colour: Colour,
}

const RANGES: [Range; 4] = [
    Range {
        heights: (0.10, 0.24),
        crests: 1.25,
        haze: 0.44,
        distance: 12.0,
        colour: Colour::new(0.16, 0.17, 0.25),
    },
    Range {
        heights: (0.05, 0.17),
        crests: 1.7,
        haze: 0.27,
        distance: 7.0,
        colour: Colour::new(0.075, 0.105, 0.145),
    },
    Range {
        heights: (0.025, 0.10),
        crests: 2.1,
        haze: 0.13,
        distance: 4.0,
        colour: Colour::new(0.055, 0.095, 0.075),
    },
    Range {
        heights: (0.004, 0.045),
        crests: 1.6,
        haze: 0.04,
        distance: 2.5,
        colour: Colour::new(0.028, 0.060, 0.030),
    },
];

/// Trees a height of the picture, on the nearest hills.
const TREES: f32 = 46.0;

/// The land at one moment.
pub(super) struct Land {
    noise: Noise,
    time: f32,
}

impl Land {
    pub(super) const fn new(noise: Noise, time: f32) -> Self {
        Self {
            noise: noise.other(200),
            time,
        }
    }

    /// The land before a light.
    pub(super) fn cover(&self, u: f32, v: f32, pixel: f32, behind: Colour) -> Colour {
        let mut light = behind;
        for (index, range) in RANGES.iter().enumerate() {
            let noise = self.noise.other(index as u32);
            let x = u + PAN * self.time / range.distance;
            let mut top = crest(noise, range, x);
            if index == RANGES.len() - 1 {
                top += trees(noise, x);
            }
            let covered = ((top - v) / pixel + 0.5).clamp(0.0, 1.0);
            if covered > 0.0 {
                light = light.mix(surface(noise, range, index, (x, u, v), top), covered);
            }
        }
        light
    }
}

fn crest(noise: Noise, range: &Range, x: f32) -> f32 {
    let (least, more) = range.heights;
    WATERLINE + least + more * noise.ridged(x * range.crests, 6)
}

/// Light of a range's surface.
fn surface(
    noise: Noise,
    range: &Range,
    index: usize,
    (x, u, v): (f32, f32, f32),
    top: f32,
) -> Colour {
    // Light comes from the right: what rises to the left of a place shades it.
    let fine = 7.0 * range.distance.sqrt();
    let relief = noise.other(50);
    let at = |x: f32| {
        // Spurs run down from the crest, bent by the same noise.
        let bend = 0.35 * relief.smooth(x * fine * 0.4, v * fine * 0.5);
        relief.rough(
            (x + 0.5 * (top - v) * (bend - 0.17)) * fine,
            v * fine * 0.8,
            6,
        )
    };
    let (bump, slope) = (at(x), (at(x - 0.006) - at(x + 0.006)) * 7.0);
    // Woods soften the nearer hills.
    let rock = [1.0, 0.55, 0.42, 0.30][index];
    let facing = (0.5 + rock * (1.25 * slope + 0.8 * (bump - 0.48))).clamp(0.06, 1.6);
    let mut colour = range.colour * (0.5 + 1.3 * facing)
        + Colour::new(0.30, 0.19, 0.07) * (facing * 0.25 * rock);
    if index == 0 {
        // Snow lies high, lower on the bumps that the wind fills.
        let height = v - WATERLINE + 0.20 * (bump - 0.5) + 0.015 * slope;
        let snow = step(0.185, 0.205, height);
        let white =
            Colour::new(0.30, 0.36, 0.56).mix(Colour::new(1.45, 0.98, 0.74), facing.min(1.0));
        colour = colour.mix(white, snow);
    }
    // Haze gathers in the valleys.
    let depth = ((top - v) * 6.0).clamp(0.0, 1.0);
    colour.mix(Sky::haze(u), (range.haze * (0.45 + 0.9 * depth)).min(0.92))
}

/// Height of the trees above the ground.
fn trees(noise: Noise, x: f32) -> f32 {
    let at = x * TREES;
    let middle = at.floor();
    let mut top = 0.0_f32;
    for cell in [middle - 1.0, middle, middle + 1.0] {
        let random = noise.cell(cell as i32, 77);
        let wood = step(0.38, 0.62, noise.smooth(cell * 0.05, 3.0));
        let height = (0.014 + 0.034 * random) * wood;
        let aside = (at - cell - 0.2 - 0.6 * noise.cell(cell as i32, 78)).abs();
        // A cone with branches.
        let branches = 0.16 * (noise.smooth(at * 7.0, cell) - 0.5);
        top = top.max(height * (1.0 - (aside + branches) * 1.5));
    }
    top
}
