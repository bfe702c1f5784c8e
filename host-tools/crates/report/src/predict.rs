//! Photograph prediction: what the camera would see of a projection.
//!
//! The model is the pipeline's own, read backwards. The pipeline makes
//! `p(x) = g(x) d'(x) - (U K A d')(x)` of the wanted light `d' = d - a`; the light
//! that an input `p` makes is therefore the `l'` with
//!
//! ```text
//! l'(x) = (p(x) + (U K A l')(x)) / g(x),        photograph = l' + a
//! ```
//!
//! which is what iterating it converges to: each round adds one bounce. So the
//! prediction shows everything that happens between a wanted image and the
//! projector (clipping, 8-bit codes, what a tier leaves out) at full resolution,
//! and nothing that the photographs did not show. How wrong the learned
//! transport itself is, only photographs can say: `SolveReport::prediction`.

use crate::ladder::FrameMemory;
use iltm_picture::{Lattice, LightPicture};
use iltm_runtime::{
    FrameSize,
    image::Table,
    pipeline::prepare_pixels,
    units::{Halfword, Light},
};
use iltm_solve::{Interreflection, InverseTransport};
use nalgebra::DVector;

/// Bounces after which the rest is below rounding for any scene that reflects
/// less than 97 % of what it receives.
const MOST_BOUNCES: usize = 1_200;

/// A cell's light that changes less than this between two bounces, relative to
/// the brightest cell's, has settled.
const SETTLED: f64 = 1e-9;

/// The scene as a table and its inverse transport describe it, lit with frames of
/// one size.
#[derive(Clone, Debug)]
pub struct Projection {
    size: FrameSize,
    lattice: Lattice,
    channels: Vec<Channel>,
}

#[derive(Clone, Debug)]
struct Channel {
    /// `g`, drive per reference light, one a pixel.
    gain: Vec<f32>,
    /// `K`, drive per reference light, `N x N`.
    operator: Interreflection,
    /// `a`, relative to reference white, one a pixel.
    ambient: Vec<f32>,
}

impl Projection {
    /// The scene that `table` was compiled for from `inverse`, in frames of
    /// `size`; `white` is the light of reference white in camera units.
    ///
    /// Gains are those that the pipeline uses, the operator is the solved one, so
    /// that what a tier leaves out shows.
    ///
    /// `None` if the frame is smaller than the grid or table and inverse do not
    /// belong together.
    #[must_use]
    pub fn new(
        table: &Table<'_>,
        inverse: &InverseTransport,
        white: f64,
        size: FrameSize,
    ) -> Option<Self> {
        let lattice = Lattice::new(inverse.grid, size)?;
        let of_one_scene =
            table.grid() == inverse.grid && usize::from(table.channels()) == inverse.channels.len();
        if !of_one_scene {
            return None;
        }
        let pixels = PixelPlanes::of(table, size)?;
        let planes = pixels.gain.into_iter().zip(pixels.ambient);
        let channel = |(index, (gain, ambient))| Channel {
            gain,
            operator: &inverse.channel(index).operator * white,
            ambient,
        };
        Some(Self {
            size,
            lattice,
            channels: planes.enumerate().map(channel).collect(),
        })
    }

    /// The photograph, relative to reference white, of a projector input (linear,
    /// relative to the projector's white), both with the table's channels.
    ///
    /// # Panics
    /// If the input has another size or number of channels.
    #[must_use]
    pub fn photograph(&self, input: &LightPicture) -> LightPicture {
        self.map(input, |channel, input| {
            let mut cells = vec![0.0; self.lattice.cells()];
            let mut light = channel.reflect(input, None);
            for _ in 0..MOST_BOUNCES {
                let means = self.lattice.average(&light);
                let brightest = means.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                let changes = means.iter().zip(&cells).map(|(new, old)| (new - old).abs());
                let change = changes.fold(0.0, f64::max);
                cells = means;
                light = channel.reflect(input, Some(&self.received(channel, &cells)));
                if change <= SETTLED * brightest {
                    break;
                }
            }
            let lit = light.iter().zip(&channel.ambient);
            lit.map(|(light, ambient)| light + ambient).collect()
        })
    }

    /// The part of a photograph that arrives by way of other cells, relative to
    /// reference white: what the pipeline takes away.
    ///
    /// # Panics
    /// If the photograph has another size or number of channels.
    #[must_use]
    pub fn bounced(&self, photograph: &LightPicture) -> LightPicture {
        self.map(photograph, |channel, photograph| {
            let lit = photograph.iter().zip(&channel.ambient);
            let projected: Vec<f32> = lit.map(|(light, a)| (light - a).max(0.0)).collect();
            let cells = self.lattice.average(&projected);
            let dark = vec![0.0; self.size.pixels()];
            channel.reflect(&dark, Some(&self.received(channel, &cells)))
        })
    }

    /// `U K l` of the cells' light.
    fn received(&self, channel: &Channel, cells: &[f64]) -> Vec<f32> {
        let received = &channel.operator * &DVector::from_column_slice(cells);
        self.lattice.expand(received.as_slice())
    }

    fn map(
        &self,
        picture: &LightPicture,
        plane: impl Fn(&Channel, &[f32]) -> Vec<f32>,
    ) -> LightPicture {
        let same = picture.size() == self.size && picture.planes().len() == self.channels.len();
        assert!(same, "the picture has another size or number of channels");
        picture.with_planes(|channel, given| plane(&self.channels[channel], given))
    }
}

impl Channel {
    /// `(input + received) / g`; dark where the camera sees nothing.
    fn reflect(&self, input: &[f32], received: Option<&[f32]>) -> Vec<f32> {
        let pixels = self.gain.iter().zip(input).enumerate();
        let light = pixels.map(|(at, (gain, input))| {
            let received = received.map_or(0.0, |received| received[at]);
            if *gain > 0.0 {
                (input + received) / gain
            } else {
                0.0
            }
        });
        light.collect()
    }
}

/// Gain and ambient light of each pixel as the pipeline has them, one plane a channel.
struct PixelPlanes {
    /// Drive per reference light.
    gain: Vec<Vec<f32>>,
    /// Relative to reference white.
    ambient: Vec<Vec<f32>>,
}

impl PixelPlanes {
    /// Those of frames of `size`; `None` if that is smaller than the grid.
    fn of(table: &Table<'_>, size: FrameSize) -> Option<Self> {
        let mut memory = FrameMemory::new(table, size);
        for row in 0..size.height() {
            prepare_pixels(table, size, row, &mut memory.lent()).ok()?;
        }
        let channels = usize::from(table.channels());
        let planes = |values: &[Halfword], unit: f32| {
            let plane = |channel| {
                let own = values.iter().skip(channel).step_by(channels);
                own.map(|bits| f32::from(u16::from_le_bytes(*bits)) / unit)
                    .collect()
            };
            (0..channels).map(plane).collect()
        };
        Some(Self {
            gain: planes(&memory.gains, f32::from(table.gain_fraction()).exp2()),
            ambient: planes(&memory.ambient, f32::from(Light::ONE.to_bits())),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::scene;
    use iltm_compile::{CompileOptions, FineGains, compile};
    use iltm_picture::{Picture, Response, Samples};
    use iltm_solve::ChannelInverse;
    use iltm_video::{CompensateOptions, Compensator};

    /// Gains twice as fine as the cells, with texture inside of them.
    fn fine(inverse: &InverseTransport) -> FineGains {
        let size = FrameSize::new(16, 10).unwrap();
        let gain = |gain: &[f64], at: usize| {
            let (row, col) = (at / 16, at % 16);
            gain[row / 2 * 8 + col / 2] * (1.0 + 0.1 * ((row + 2 * col) as f64).cos())
        };
        let plane = |channel: &ChannelInverse| {
            (0..size.pixels())
                .map(|at| gain(&channel.gain, at))
                .collect()
        };
        FineGains {
            size,
            channels: inverse.channels.iter().map(plane).collect(),
        }
    }

    /// A smooth image, bright and even enough not to be clipped: 16-bit codes.
    fn wanted(size: FrameSize, channels: usize) -> Picture {
        let code = |at: usize| {
            let (pixel, channel) = (at / channels, at % channels);
            let (row, col) = (pixel / size.width(), pixel % size.width());
            let wave = ((row as f64) * 0.21 + (col as f64) * 0.13 + channel as f64).sin();
            (42_000.0 + 4_000.0 * wave) as u16
        };
        let samples = (0..size.pixels() * channels).map(code).collect();
        Picture::new(size, Samples::Sixteen(samples)).unwrap()
    }

    fn largest_difference(a: &LightPicture, b: &LightPicture) -> f32 {
        let planes = a.planes().iter().zip(b.planes());
        let pixels = planes.flat_map(|(a, b)| a.iter().zip(b));
        pixels.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn compensating_a_frame_that_is_not_clipped_gives_the_wanted_image() {
        for channels in [1, 3] {
            let inverse = scene(channels);
            let options = CompileOptions {
                projector: Response::Linear.into(),
                ..CompileOptions::default()
            };
            for fine in [None, Some(fine(&inverse))] {
                let compiled = compile(&inverse, fine.as_ref(), &options).unwrap();
                // A tenth darker, since fine gains reach above those of the cells.
                let white = 0.9 * compiled.white;
                let options = CompileOptions {
                    reference_white: Some(white),
                    ..options.clone()
                };
                let compiled = compile(&inverse, fine.as_ref(), &options).unwrap();
                let table = Table::check(&compiled.image).unwrap();
                for (width, height) in [(16, 10), (43, 29)] {
                    let size = FrameSize::new(width, height).unwrap();
                    let wanted = wanted(size, channels);
                    let mut input = wanted.clone();
                    let compensator =
                        Compensator::new(&table, CompensateOptions::default()).unwrap();
                    let summary = compensator.picture(&mut input).unwrap();
                    assert_eq!(summary.clipped, 0);
                    let projection = Projection::new(&table, &inverse, white, size).unwrap();
                    let drive = LightPicture::decode(&input, Response::Linear);
                    let photograph = projection.photograph(&drive);
                    let light = LightPicture::decode(&wanted, Response::Srgb);
                    // The top tier leaves out 1/4096 on average; the rest is
                    // rounding of drives and gains.
                    let difference = largest_difference(&photograph, &light);
                    assert!(difference < 2e-3, "{channels} {size}: {difference}");
                    // Without the operator the difference is not small.
                    let settings = CompensateOptions {
                        tier: Some(0),
                        ..CompensateOptions::default()
                    };
                    let mut input = wanted.clone();
                    Compensator::new(&table, settings)
                        .unwrap()
                        .picture(&mut input)
                        .unwrap();
                    let drive = LightPicture::decode(&input, Response::Linear);
                    let difference = largest_difference(&projection.photograph(&drive), &light);
                    assert!(difference > 0.05, "{channels} {size}: {difference}");
                }
            }
        }
    }

    #[test]
    fn what_bounces_is_what_gain_alone_adds_too_much_in_its_first_bounce() {
        let inverse = scene(1);
        let compiled = compile(&inverse, None, &CompileOptions::default()).unwrap();
        let table = Table::check(&compiled.image).unwrap();
        let size = FrameSize::of_grid(inverse.grid);
        let projection = Projection::new(&table, &inverse, compiled.white, size).unwrap();
        let ambient = 0.004 / compiled.white;
        let grey = LightPicture::new(size, vec![vec![0.5; size.pixels()]]).unwrap();
        let bounced = projection.bounced(&grey);
        // At the grid's own size U and A do nothing: the sum of a row of K, over g.
        let row: f64 = inverse.shared.dense().row(11).iter().sum();
        let expected = row * (0.5 - ambient) / inverse.channels[0].gain[11];
        assert!((f64::from(bounced.planes()[0][11]) - expected).abs() < 1e-4);
    }

    #[test]
    fn tables_and_inverses_of_different_scenes_are_refused() {
        let inverse = scene(1);
        let compiled = compile(&inverse, None, &CompileOptions::default()).unwrap();
        let table = Table::check(&compiled.image).unwrap();
        let size = FrameSize::new(16, 10).unwrap();
        assert!(Projection::new(&table, &scene(3), 1.0, size).is_none());
        let small = FrameSize::new(7, 10).unwrap();
        assert!(Projection::new(&table, &inverse, 1.0, small).is_none());
    }
}
