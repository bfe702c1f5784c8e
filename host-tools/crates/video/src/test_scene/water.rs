//! The lake.

use super::colour::Colour;
use super::{Moment, PAN, WATERLINE};

const DEEP: Colour = Colour::new(0.012, 0.035, 0.05);

impl Moment {
    /// Light of the lake at a place below the waterline.
    pub(super) fn water(&self, u: f32, v: f32) -> Colour {
        let below = WATERLINE - v;
        // The surface is flat: what is lower in the picture is nearer, and moves by
        // faster.
        let distance = 0.10 / (below + 0.012);
        let x = u * distance + PAN * 0.5 * self.time;
        let noise = self.noise.other(300);
        let ripple = |number: u32, fine: f32| {
            let noise = noise.other(number);
            noise.rough(
                x * fine * 0.9 + 0.2 * self.time,
                distance * fine * 2.6 + 0.35 * self.time,
                4,
            ) - 0.47
        };
        let (along, across) = (ripple(0, 5.0), ripple(1, 7.0));
        let calm = 0.25 + 1.6 * below;
        let mirrored_v = WATERLINE + below * 0.96 + 0.11 * calm * across;
        let mirrored_u = u + 0.05 * calm * along;
        let mirrored = self.above(mirrored_u, mirrored_v.max(WATERLINE), self.pixel * 2.0);
        // The steeper one looks, the more one sees of the water itself.
        let seen = (0.84 - 0.75 * below + 0.5 * across).clamp(0.2, 0.95);
        let light = DEEP.mix(mirrored.filter(Colour::new(0.88, 0.94, 1.0)), seen);
        // Mist where the far shore begins.
        let mist = 0.22 / (1.0 + (below / 0.012) * (below / 0.012));
        light.mix(super::sky::Sky::haze(u), mist)
    }
}
