//! A moving landscape made by arithmetic: evening sky and clouds, mountains, a
//! lake that mirrors them, balloons that drift by, flowers on the near shore.
//!
//! It has what natural video has and a compensation must cope with: large smooth
//! gradients, a bright spot, texture at every scale, hard edges, saturated colours,
//! motion. It is a function of size, time and seed alone, in operations that
//! IEEE 754 defines to the last bit, so it is the same on every machine.
//!
//! Places are in units of the picture's height: `u` to the right from the middle,
//! `v` up from the middle. Light is linear, 1 about what white paper would be.

mod balloon;
mod colour;
mod land;
mod noise;
mod shore;
mod sky;
mod water;

use balloon::Balloon;
use colour::{Colour, Tone};
use iltm_picture::{Picture, Samples};
use iltm_runtime::FrameSize;
use land::Land;
use noise::Noise;
use rayon::prelude::*;
use shore::Shore;
use sky::Sky;

/// Height of the far shore: what is above it is mirrored below it.
const WATERLINE: f32 = -0.14;

/// How fast the view moves to the right, heights of the picture a second, for what
/// is right before the camera.
const PAN: f32 = 0.06;

/// A scene of one size, frame rate and seed.
#[derive(Clone, Debug)]
pub struct TestScene {
    size: FrameSize,
    rate: f32,
    noise: Noise,
    tone: Tone,
}

/// The scene at one moment.
struct Moment {
    noise: Noise,
    /// Seconds since the start.
    time: f32,
    /// Height of a pixel.
    pixel: f32,
    sky: Sky,
    land: Land,
    balloons: Vec<Balloon>,
    shore: Shore,
}

impl TestScene {
    /// A scene of frames of this size, `rate` a second.
    #[must_use]
    pub fn new(size: FrameSize, rate: f32, seed: u64) -> Self {
        Self {
            size,
            rate,
            noise: Noise::new(seed),
            tone: Tone::new(),
        }
    }

    /// Frame `number`, the first is 0: sRGB, 8 bits, three channels.
    #[must_use]
    pub fn frame(&self, number: u64) -> Picture {
        let (width, height) = (self.size.width(), self.size.height());
        let moment = Moment::new(self.noise, number as f32 / self.rate, 1.0 / height as f32);
        let grains = self.noise.other(number as u32);
        let mut samples = vec![0; 3 * self.size.pixels()];
        let rows = samples.par_chunks_exact_mut(3 * width).enumerate();
        rows.for_each(|(y, row)| {
            let v = 0.5 - (y as f32 + 0.5) * moment.pixel;
            for (x, pixel) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let u = (x as f32 + 0.5 - 0.5 * width as f32) * moment.pixel;
                let grain = grains.cell(x as i32, y as i32);
                *pixel = self.tone.codes(moment.light(u, v), grain);
            }
        });
        // Three samples a pixel have been made.
        Picture::of_colours(self.size, Samples::Eight(samples))
    }
}

impl Moment {
    fn new(noise: Noise, time: f32, pixel: f32) -> Self {
        Self {
            noise,
            time,
            pixel,
            sky: Sky::new(noise, time),
            land: Land::new(noise, time),
            balloons: balloon::all(time),
            shore: Shore::new(noise, time),
        }
    }

    /// Light at a place of the picture.
    fn light(&self, u: f32, v: f32) -> Colour {
        let light = if v < WATERLINE {
            self.water(u, v)
        } else {
            self.above(u, v, self.pixel)
        };
        self.shore.cover(u, v, self.pixel, light)
    }

    /// Light of what is above the waterline; edges are as soft as `pixel`.
    fn above(&self, u: f32, v: f32, pixel: f32) -> Colour {
        let light = self.sky.light(u, v);
        let light = self.land.cover(u, v, pixel, light);
        let over = |light, balloon: &Balloon| balloon.cover(u, v, pixel, light);
        self.balloons.iter().fold(light, over)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(size: (u16, u16), number: u64, seed: u64) -> Vec<u8> {
        let size = FrameSize::new(size.0, size.1).expect("not empty");
        match TestScene::new(size, 30.0, seed).frame(number).samples() {
            Samples::Eight(samples) => samples.clone(),
            Samples::Sixteen(_) => panic!("a picture of bytes"),
        }
    }

    #[test]
    fn frames_are_the_same_every_time_and_differ_by_moment_and_seed() {
        let frame = samples((64, 36), 30, 1);
        assert_eq!(frame, samples((64, 36), 30, 1));
        assert_ne!(frame, samples((64, 36), 31, 1));
        assert_ne!(frame, samples((64, 36), 30, 2));
    }

    #[test]
    fn frames_use_the_whole_range_and_every_colour() {
        let frame = samples((320, 180), 90, 1);
        for channel in 0..3 {
            let of_channel = || frame.iter().skip(channel).step_by(3);
            assert!(of_channel().min() < Some(&20));
            assert!(of_channel().max() > Some(&240));
        }
        let saturated = frame.as_chunks::<3>().0.iter().filter(|pixel| {
            let most = pixel.iter().max().copied().unwrap_or(0);
            let least = pixel.iter().min().copied().unwrap_or(0);
            most > 150 && least < 70
        });
        assert!(saturated.count() > 500);
    }

    #[test]
    fn any_size_can_be_made() {
        for size in [(1, 1), (1, 50), (300, 2), (33, 77)] {
            let pixels = usize::from(size.0) * usize::from(size.1);
            assert_eq!(samples(size, 1_000_000, 3).len(), 3 * pixels);
        }
    }
}
