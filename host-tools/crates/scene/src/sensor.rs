//! Camera sensor: from light to the values in a photograph, by exposure, noise, converter and
//! response.

use super::description::Camera;
use iltm_picture::Response;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal, Poisson};
use rand_pcg::Pcg64Mcg;

/// Electrons above which shot noise is taken to be normal.
const MANY: f64 = 1e4;

/// What is simulated of the camera's sensor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Readout {
    /// Whether photographs are noisy.
    pub noise: bool,
    /// Whether they are rounded to the converter's bits.
    pub quantisation: bool,
    /// Whether the response is other than linear.
    pub response: bool,
}

/// A sensor with its exposure.
#[derive(Clone, Copy, Debug)]
pub struct Sensor<'c> {
    camera: &'c Camera,
    readout: Readout,
    /// Share of full scale for each unit of light.
    exposure: f64,
    /// From light to values, if that is simulated.
    response: Response,
}

impl<'c> Sensor<'c> {
    /// Share of the brightest pixels that may be brighter than `Camera::white`.
    const BRIGHTEST: f64 = 0.005;

    /// A sensor exposed such that the bright parts of `flood`, one plane a channel,
    /// come to the camera's `white`.
    #[must_use]
    pub fn exposed(camera: &'c Camera, readout: Readout, flood: &[Vec<f32>]) -> Self {
        let bright = flood.iter().map(|plane| {
            let mut light = plane.clone();
            let at = ((1.0 - Self::BRIGHTEST) * (light.len() - 1) as f64) as usize;
            let (_, value, _) = light.select_nth_unstable_by(at, f32::total_cmp);
            f64::from(*value)
        });
        let brightest = bright.fold(0.0, f64::max);
        Self {
            camera,
            readout,
            exposure: if brightest > 0.0 {
                camera.white / brightest
            } else {
                1.0
            },
            response: if readout.response {
                camera.response
            } else {
                Response::Linear
            },
        }
    }

    /// The same with another response than the camera's.
    #[must_use]
    pub fn responding(self, response: Response) -> Self {
        Self { response, ..self }
    }

    /// Share of full scale for each unit of light.
    #[must_use]
    pub fn exposure(&self) -> f64 {
        self.exposure
    }

    /// Full scale of the file's values.
    #[must_use]
    pub fn file_scale(&self) -> u16 {
        match self.camera.bits {
            Some(bits) if bits <= 8 && self.readout.quantisation => 255,
            _ => u16::MAX,
        }
    }

    /// Values of a photograph, 0 to [`Sensor::file_scale`]. The same `seed` repeats
    /// the noise.
    #[must_use]
    pub fn values(&self, light: &[f32], seed: u64) -> Vec<u16> {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let scale = f64::from(self.file_scale());
        let value = |light: &f32| {
            let mut seen = f64::from(*light) * self.exposure;
            if self.readout.noise {
                seen = self.noisy(seen, &mut random);
            }
            let mut value = self.response.value(seen.clamp(0.0, 1.0));
            if let (true, Some(bits)) = (self.readout.quantisation, self.camera.bits) {
                let steps = f64::from((1_u32 << bits) - 1);
                value = (value * steps).round() / steps;
            }
            (value * scale).round() as u16
        };
        light.iter().map(value).collect()
    }

    fn noisy(&self, seen: f64, random: &mut Pcg64Mcg) -> f64 {
        let Some(full_well) = self.camera.full_well else {
            return seen;
        };
        let electrons = (seen * full_well).max(0.0);
        let shot = if electrons > MANY {
            normal(electrons, electrons.sqrt(), random)
        } else {
            Poisson::new(electrons).map_or(electrons, |shot| shot.sample(random))
        };
        (shot + normal(0.0, self.camera.read_noise, random)) / full_well
    }

    /// Standard deviation of one pixel that sees `white` of full scale, relative to
    /// it: shot, reading and rounding.
    #[must_use]
    pub fn noise_at_white(camera: &Camera) -> f64 {
        let white = camera.white.min(1.0);
        let electrons = camera.full_well.map_or(0.0, |full_well| {
            (white * full_well + camera.read_noise.powi(2)) / full_well.powi(2)
        });
        let step = camera
            .bits
            .map_or(0.0, |bits| 1.0 / f64::from((1_u32 << bits) - 1));
        (electrons + step * step / 12.0).sqrt() / white
    }
}

fn normal(mean: f64, deviation: f64, random: &mut Pcg64Mcg) -> f64 {
    Normal::new(mean, deviation).map_or(mean, |normal| normal.sample(random))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pinhole;
    use nalgebra::Vector3;

    fn camera() -> Camera {
        Camera {
            view: Pinhole::new(Vector3::zeros(), Vector3::x(), Vector3::y(), 40.0, 1.0).unwrap(),
            size: (1, 1),
            distortion: [0.0; 2],
            white: 0.8,
            full_well: Some(20_000.0),
            read_noise: 5.0,
            bits: Some(12),
            response: Response::Linear,
        }
    }

    const ALL: Readout = Readout {
        noise: true,
        quantisation: true,
        response: true,
    };

    #[test]
    fn noise_has_the_deviation_of_shot_and_reading_noise() {
        let camera = camera();
        for light in [0.001_f32, 0.1, 1.0] {
            let flood = vec![vec![1.0_f32; 100]];
            let sensor = Sensor::exposed(&camera, ALL, &flood);
            let values = sensor.values(&vec![light; 40_000], 3);
            let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / 4e4;
            let variance = values
                .iter()
                .map(|v| (f64::from(*v) - mean).powi(2))
                .sum::<f64>()
                / 4e4;
            let electrons = 0.8 * f64::from(light) * 20_000.0;
            // 12-bit steps of 16 values of the file, uniform: a twelfth of their square.
            let step = 65_535.0 / 4_095.0;
            let expected =
                (electrons + 25.0) * (65_535.0_f64 / 20_000.0).powi(2) + step * step / 12.0;
            assert!(
                (variance / expected - 1.0).abs() < 0.05,
                "{light}: {variance} {expected}"
            );
        }
    }

    #[test]
    fn what_is_too_bright_is_full_scale_and_eight_bits_are_an_eight_bit_file() {
        let mut camera = camera();
        camera.bits = Some(8);
        camera.response = Response::Srgb;
        let flood = vec![vec![1.0_f32; 10]];
        let readout = Readout {
            noise: false,
            ..ALL
        };
        let sensor = Sensor::exposed(&camera, readout, &flood);
        assert_eq!(sensor.file_scale(), 255);
        // sRGB of 0.8 x 0.2 and of beyond white, by the standard's formula.
        assert_eq!(sensor.values(&[0.25, 2.0], 0), [124, 255]);
    }
}
