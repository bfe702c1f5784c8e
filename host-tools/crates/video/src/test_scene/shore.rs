//! The near shore: grass and flowers.

use super::PAN;
use super::colour::Colour;
use super::noise::{Noise, step};

const FLOWERS: [Colour; 4] = [
    Colour::new(0.95, 0.10, 0.07),
    Colour::new(1.05, 0.78, 0.08),
    Colour::new(0.95, 0.90, 0.86),
    Colour::new(0.45, 0.16, 0.85),
];

/// The near shore at one moment.
pub(super) struct Shore {
    noise: Noise,
    pan: f32,
    time: f32,
}

impl Shore {
    pub(super) fn new(noise: Noise, time: f32) -> Self {
        Self {
            noise: noise.other(400),
            pan: PAN * time,
            time,
        }
    }

    /// The shore before a light.
    pub(super) fn cover(&self, u: f32, v: f32, pixel: f32, behind: Colour) -> Colour {
        if v > -0.20 {
            return behind;
        }
        let x = u + self.pan;
        let bank = -0.475
            + 0.13 * self.noise.smooth(x * 0.9, 1.0)
            + 0.02 * self.noise.rough(x * 6.0, 2.0, 3);
        let light = self.blades(x, v, bank, pixel, behind);
        self.flowers(x, v, bank, pixel, light)
    }

    /// Grass: three rows of blades, the nearest last.
    fn blades(&self, x: f32, v: f32, bank: f32, pixel: f32, behind: Colour) -> Colour {
        let mut light = behind;
        for row in 0..3 {
            let noise = self.noise.other(10 + row);
            let nearer = row as f32;
            let ground = bank - 0.035 * nearer;
            // The wind bends the blades where they are high.
            let high = ((v - ground) / 0.05).clamp(0.0, 1.0);
            let wind = noise.smooth(x * 2.0 - 0.8 * self.time, 5.0) - 0.4;
            let bent = x - 0.022 * wind * high * high;
            let at = bent * (150.0 - 25.0 * nearer);
            let cell = at.floor();
            let random = noise.cell(cell as i32, 1);
            let blade = 1.0 - (2.0 * (at - cell) - 1.0).abs();
            let top = ground + (0.012 + 0.045 * random) * blade;
            let covered = ((top - v) / pixel + 0.5).clamp(0.0, 1.0);
            if covered > 0.0 {
                let texture = noise.rough(x * 30.0, v * 45.0, 4);
                let sunny = 0.35 + 0.9 * texture + 1.1 * high * random;
                let green = Colour::new(0.055, 0.125, 0.018)
                    .mix(Colour::new(0.30, 0.26, 0.05), 0.6 * random * high);
                light = light.mix(green * (sunny * (1.0 - 0.22 * nearer)), covered);
            }
        }
        light
    }

    /// Flowers here and there in the grass.
    fn flowers(&self, x: f32, v: f32, bank: f32, pixel: f32, behind: Colour) -> Colour {
        let mut light = behind;
        let cells = 24.0;
        let (column, row) = ((x * cells).floor(), (v * cells).floor());
        for (across, up) in (-1..=1).flat_map(|across| (-1..=1).map(move |up| (across, up))) {
            let cell = (column as i32 + across, row as i32 + up);
            let random = |number: u32| self.noise.other(30 + number).cell(cell.0, cell.1);
            let here = (
                (cell.0 as f32 + 0.15 + 0.7 * random(0)) / cells,
                (cell.1 as f32 + 0.15 + 0.7 * random(1)) / cells,
            );
            // In patches, and on the bank only.
            let patch = self.noise.smooth(here.0 * 2.6, 9.0);
            if random(2) > step(0.30, 0.70, patch) * 0.95 || here.1 > bank + 0.012 {
                continue;
            }
            let radius = 0.0065 + 0.0065 * random(3);
            let (aside, above) = (x - here.0, (v - here.1) * 1.25);
            let distance = (aside * aside + above * above).sqrt();
            let covered = ((radius - distance) / pixel + 0.5).clamp(0.0, 1.0);
            if covered > 0.0 {
                let petal = FLOWERS[(random(4) * 3.999) as usize];
                let shade = 0.45 + 0.75 * (0.5 + 0.5 * (aside + above) / radius);
                let heart = step(0.28 * radius, 0.42 * radius, distance);
                let middle = Colour::new(0.35, 0.20, 0.02);
                light = light.mix(middle.mix(petal, heart) * shade, covered);
            }
        }
        light
    }
}
