//! Evening sky, sun and clouds.

use super::WATERLINE;
use super::colour::Colour;
use super::noise::{Noise, step};

/// Where the sun stands.
const SUN: (f32, f32) = (0.40, 0.135);

const ZENITH: Colour = Colour::new(0.035, 0.13, 0.42);
const MIDDLE: Colour = Colour::new(0.24, 0.42, 0.72);
const HORIZON: Colour = Colour::new(1.25, 0.66, 0.34);
const SUNLIGHT: Colour = Colour::new(1.0, 0.62, 0.28);

/// The sky at one moment.
pub(super) struct Sky {
    noise: Noise,
    time: f32,
}

impl Sky {
    pub(super) const fn new(noise: Noise, time: f32) -> Self {
        Self {
            noise: noise.other(100),
            time,
        }
    }

    /// Haze that takes the place of what is far away.
    pub(super) fn haze(u: f32) -> Colour {
        let near_sun = 1.0 / (1.0 + 4.0 * (u - SUN.0) * (u - SUN.0));
        Colour::new(0.42, 0.45, 0.60).mix(Colour::new(1.15, 0.62, 0.36), near_sun)
    }

    /// Light of the sky at a place.
    pub(super) fn light(&self, u: f32, v: f32) -> Colour {
        let height = (v - WATERLINE).max(0.0);
        let clear = HORIZON
            .mix(MIDDLE, step(0.02, 0.30, height))
            .mix(ZENITH, step(0.18, 0.72, height));
        let (away_u, away_v) = (u - SUN.0, v - SUN.1);
        let distance = away_u * away_u + away_v * away_v;
        let glow = 0.9 / (1.0 + distance / 0.012) + 0.35 / (1.0 + distance / 0.15);
        let disc = 9.0 * (1.0 - step(0.030, 0.036, distance.sqrt()));
        let light = clear + SUNLIGHT * glow + Colour::new(1.0, 0.86, 0.6) * disc;
        self.clouds(u, v, height, distance, light)
    }

    /// The clouds before a light.
    fn clouds(&self, u: f32, v: f32, height: f32, sun: f32, behind: Colour) -> Colour {
        // A flat layer seen from below: the nearer to the horizon, the farther.
        let scale = 0.5 / (height + 0.16);
        let (x, y) = (
            u * scale * 2.2 + 0.045 * self.time,
            scale * 4.2 + 0.012 * self.time,
        );
        // Bent by a slow noise, which gives wisps instead of blots.
        let bend = self
            .noise
            .other(1)
            .smooth(x * 0.7, y * 0.7 + 0.03 * self.time)
            - 0.5;
        let (x, y) = (x + 0.9 * bend, y + 0.5 * bend);
        let amount = self.noise.rough(x, y, 6);
        let cover = step(0.47, 0.72, amount) * step(0.02, 0.16, height);
        if cover <= 0.0 {
            return behind;
        }
        // Thinner on the side of the sun means that the light comes through.
        let towards = self
            .noise
            .rough(x + 0.22 * (SUN.0 - u), y + 0.22 * (v - SUN.1), 3);
        let lit = (0.5 + 2.6 * (amount - towards)).clamp(0.0, 1.0);
        let near_sun = 1.0 / (1.0 + sun / 0.10);
        let shade = Colour::new(0.30, 0.29, 0.40).mix(Colour::new(0.62, 0.36, 0.30), near_sun);
        let bright = Colour::new(1.05, 0.80, 0.68).mix(Colour::new(1.9, 1.15, 0.6), near_sun);
        behind.mix(shade.mix(bright, lit), 0.92 * cover)
    }
}
