//! Test scene: striped balls of all sizes that drift past an evening sky.
//!
//! It has what natural video has and a compensation must cope with: smooth gradients, a
//! bright spot, hard edges, fine detail, saturated colours, motion. Radii have density
//! `r^-3`, as objects in natural images have (Lee, Mumford and Huang, *Occlusion models
//! for natural images*, 2001).
//!
//! It is a function of size and time alone, in operations that IEEE 754 defines to the
//! last bit, so it is the same on every machine. It repeats every 60 seconds,
//! without a jump.
//!
//! Places are in units of the picture's height: `u` to the right from the middle, `v` up
//! from the middle. Light is linear red, green and blue, 1 is white.

use iltm_picture::Picture;
use iltm_runtime::{FrameSize, pipeline::srgb};
use rayon::prelude::*;

type Colour = [f32; 3];

/// Seconds until the scene repeats.
const LOOP: f64 = 60.0;

/// Width after which the scene repeats to the right.
const PERIOD: f32 = 3.0;

const BALLS: u32 = 400;

/// Smallest and largest radius of a ball.
const RADII: [f32; 2] = [0.012, 0.24];

/// Three are so saturated that bounced light alone may exceed a channel of theirs, which
/// no compensation can show; they are rare, as such colours are in natural video.
const PALETTE: [Colour; 16] = [
    [0.92, 0.90, 0.86],
    [0.86, 0.24, 0.20],
    [0.95, 0.62, 0.22],
    [0.24, 0.36, 0.80],
    [0.24, 0.58, 0.32],
    [0.52, 0.24, 0.66],
    [0.22, 0.58, 0.64],
    [0.95, 0.46, 0.48],
    [0.62, 0.78, 0.30],
    [0.70, 0.46, 0.26],
    [0.34, 0.34, 0.38],
    [0.60, 0.74, 0.92],
    [0.88, 0.80, 0.42],
    [0.90, 0.05, 0.01],
    [0.01, 0.22, 0.85],
    [0.60, 0.01, 0.50],
];

/// A scene of one size and frame rate.
#[derive(Clone, Debug)]
pub struct TestScene {
    size: FrameSize,
    rate: f32,
    /// The nearest first.
    balls: Vec<Ball>,
    /// Brightest light of every code but the last.
    codes: Vec<f32>,
}

#[derive(Clone, Debug)]
struct Ball {
    /// Middle at the start.
    u: f32,
    v: f32,
    radius: f32,
    /// How often it passes in [`LOOP`] seconds: a whole number, more for near balls.
    passes: f32,
    colours: [Colour; 2],
    /// Stripes of both colours across the ball; 0 for a plain one.
    stripes: f32,
    /// Unit vector across the stripes.
    across: [f32; 2],
}

impl TestScene {
    /// A scene of frames of this size, `rate` a second.
    #[must_use]
    pub fn new(size: FrameSize, rate: f32) -> Self {
        let mut balls: Vec<Ball> = (0..BALLS).map(Ball::new).collect();
        balls.sort_by(|a, b| b.radius.total_cmp(&a.radius));
        let light = |code: u8| srgb::decode(code).to_num::<f32>();
        let between = |code: u8| f32::midpoint(light(code), light(code + 1));
        Self {
            size,
            rate,
            balls,
            codes: (0..u8::MAX).map(between).collect(),
        }
    }

    /// Frame `number`, the first is 0: sRGB, 8 bits, three channels.
    #[must_use]
    pub fn frame(&self, number: u64) -> Picture {
        let (width, pixel) = (self.size.width(), 1.0 / self.size.height() as f32);
        let time = (number as f64 / f64::from(self.rate) / LOOP).fract() as f32;
        let mut samples = vec![0; 3 * self.size.pixels()];
        let rows = samples.par_chunks_exact_mut(3 * width).enumerate();
        rows.for_each(|(y, row)| {
            let v = 0.5 - (y as f32 + 0.5) * pixel;
            let meets = |ball: &&Ball| (v - ball.v).abs() < ball.radius + pixel;
            let balls: Vec<&Ball> = self.balls.iter().filter(meets).collect();
            for (x, codes) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let u = (x as f32 + 0.5 - 0.5 * width as f32) * pixel;
                let light = light(&balls, time, [u, v], pixel);
                *codes = light.map(|light| self.codes.partition_point(|most| *most < light) as u8);
            }
        });
        Picture::of_colours(self.size, samples)
    }
}

/// Light at a place, at `time` parts of the loop; edges are as soft as a `pixel`.
fn light(balls: &[&Ball], time: f32, [u, v]: [f32; 2], pixel: f32) -> Colour {
    let (mut light, mut open) = ([0.0; 3], 1.0);
    let mut add = |colour: Colour, share| {
        light = std::array::from_fn(|at| light[at] + share * colour[at]);
    };
    for ball in balls {
        let from_middle = u - ball.u - time * ball.passes * PERIOD;
        let x = (from_middle - (from_middle / PERIOD).round() * PERIOD) / ball.radius;
        let (y, soft) = ((v - ball.v) / ball.radius, pixel / ball.radius);
        if x.abs() > 1.0 + soft {
            continue;
        }
        let square = x * x + y * y;
        let covered = ((1.0 - square.sqrt()) / soft + 0.5).clamp(0.0, 1.0);
        if covered > 0.0 {
            add(ball.light(x, y, square, soft), open * covered);
            open *= 1.0 - covered;
        }
    }
    add(sky(u, v), open);
    light
}

/// Light of the sky, with a glow where the sun is.
fn sky(u: f32, v: f32) -> Colour {
    let gradient = mix([0.95, 0.62, 0.38], [0.22, 0.38, 0.72], v + 0.5);
    let (u, v) = (u - 0.35, v - 0.05);
    let glow = 0.03 / (0.03 + u * u + v * v);
    mix(gradient, [1.0, 0.97, 0.85], glow)
}

impl Ball {
    fn new(number: u32) -> Self {
        let mut draws = (0..).map(|draw| unit(number * 16 + draw));
        let mut draw = || draws.next().unwrap_or_default();
        // Radii of density r^-3 by the inverse of their distribution.
        let [least, most] = RADII.map(|radius| 1.0 / (radius * radius));
        let radius = 1.0 / (most + draw() * (least - most)).sqrt();
        let (x, y) = (draw() - 0.5, draw() - 0.5);
        let length = (x * x + y * y).sqrt().max(0.001);
        let mut colour = || PALETTE[(draw() * PALETTE.len() as f32) as usize];
        Self {
            colours: [colour(), colour()],
            u: draw() * PERIOD,
            v: (draw() - 0.5) * 1.3,
            radius,
            passes: (1.0 + 3.0 * radius / RADII[1]).floor(),
            stripes: (draw() * 5.0).floor(),
            across: [x / length, y / length],
        }
    }

    /// Light of the ball at a place, in radii from its middle, of which `square` is the
    /// squared distance and `soft` a pixel.
    fn light(&self, x: f32, y: f32, square: f32, soft: f32) -> Colour {
        let towards_us = (1.0 - square).max(0.0).sqrt();
        let lit = 0.5 + 0.65 * (0.45 * towards_us - 0.5 * x + 0.65 * y).max(0.0);
        let at = self.stripes * (x * self.across[0] + y * self.across[1]);
        // 0 in the middle of the first colour's stripes, 1/2 in that of the second's.
        let distance = (at - at.round()).abs();
        let share = (distance - 0.25) / (self.stripes * soft).max(0.001) + 0.5;
        let [first, second] = self.colours;
        mix(first, second, share).map(|light| light * lit)
    }
}

/// `share` of `b`, at least 0 and at most 1, and the rest of `a`.
fn mix(a: Colour, b: Colour, share: f32) -> Colour {
    let share = share.clamp(0.0, 1.0);
    std::array::from_fn(|at| a[at] + (b[at] - a[at]) * share)
}

/// 0 to 1 without 1, as different as can be for every number (`lowbias32` of Wellons,
/// *Prospecting for Hash Functions*, 2018).
const fn unit(number: u32) -> f32 {
    let mut hash = number.wrapping_mul(0x9E37_79B9);
    hash ^= hash >> 16;
    hash = hash.wrapping_mul(0x7FEB_352D);
    hash ^= hash >> 15;
    hash = hash.wrapping_mul(0x846C_A68B);
    hash ^= hash >> 16;
    // 24 bits are all that an `f32` holds.
    (hash >> 8) as f32 / 16_777_216.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Samples;

    /// A frame at 30 a second.
    fn samples((width, height): (u16, u16), number: u64) -> Vec<u8> {
        let size = FrameSize::new(width, height).expect("not empty");
        match TestScene::new(size, 30.0).frame(number).samples() {
            Samples::Eight(samples) => samples.clone(),
            Samples::Sixteen(_) => panic!("a picture of bytes"),
        }
    }

    #[test]
    fn frames_are_the_same_every_time_and_every_minute_and_differ_by_moment() {
        let frame = samples((64, 36), 30);
        assert_eq!(frame, samples((64, 36), 30));
        assert_eq!(frame, samples((64, 36), 30 + 60 * 30));
        assert_ne!(frame, samples((64, 36), 31));
    }

    #[test]
    fn frames_use_the_whole_range_and_every_colour() {
        let frame = samples((320, 180), 90);
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
            assert_eq!(samples(size, 1_000_000).len(), 3 * pixels);
        }
    }
}
