//! Cells: one observation of each cell in each photograph, its noise, and what all of them
//! show of the session.
//!
//! | what | module |
//! |---|---|
//! | which pixels are averaged for a cell | `cell_pixels` |
//! | one number a cell and view | `measure`, `measurements` |
//! | noise of a pixel | `noise`, `noise_samples` |
//! | brightness of a photograph against all others | `leave_one_out`, `drift`, `mains_banding` |
//! | whether light adds up, and why not | `superposition`, `nonlinearity` |
//! | between the cells and within one | `cell_interpolation`, `fine_flood`, `wiener_filter` |
//! | pixel by pixel, some of them | `pixel_light` |
//! | pixel by pixel, under an even light | `even_light` |
//! | what pictures that are no patterns throw on cells and pixels | `images` |
//! | what each pixel sees of a grid | `pixel_views` |

mod cell_interpolation;
pub(crate) mod cell_pixels;
pub(crate) mod drift;
pub(crate) mod even_light;
pub(crate) mod fine_flood;
pub(crate) mod images;
mod leave_one_out;
pub(crate) mod mains_banding;
mod measure;
pub(crate) mod measurements;
pub(crate) mod noise;
mod noise_samples;
pub(crate) mod nonlinearity;
pub(crate) mod pixel_light;
pub(crate) mod pixel_views;
pub(crate) mod superposition;
mod wiener_filter;

use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::photographs::Photographs;
use crate::photographs::sampled::Sampled;
use crate::registration::cell_map::Registration;
use cell_pixels::CellPixels;
use drift::{Drift, Steadiness};
use iltm_picture::progress::Progress;
use mains_banding::MainsBanding;
use measure::ImageLight;
use measurements::ChannelMeasurements;
use nalgebra::DMatrix;
use noise::NoiseSource;
use nonlinearity::Nonlinearity;
use pixel_light::PixelLight;
use superposition::Sums;

/// Light of all cells, and what it shows of the session.
pub(crate) struct CellEvidence {
    pub(crate) channels: Vec<ChannelMeasurements>,
    pub(crate) pixel_light: PixelLight,
    pub(crate) noise: NoiseSource,
    pub(crate) steadiness: Steadiness,
    pub(crate) banding: Option<MainsBanding>,
    /// Both once more by the light that single pixels tell, where they contradict the declared
    /// response: a curve looks like flicker. Changes are those of the light as read.
    pub(crate) straightened: Option<(Steadiness, Option<MainsBanding>)>,
    /// How well light adds up; `None` without inverses.
    pub(crate) sums: Option<Sums>,
    /// Why light does not add up, where it does not.
    pub(crate) nonlinearity: Option<Nonlinearity>,
}

impl CellEvidence {
    /// Measures all cells in all photographs. With `power`, light would add up if it were raised
    /// to this.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(crate) fn measure(
        sequence: &Sequence,
        (photographs, images): (&mut Photographs<'_>, Option<&mut Photographs<'_>>),
        registration: &Registration,
        (pixels, saturated): (&CellPixels, &[bool]),
        sampled: &Sampled,
        power: Option<f64>,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        progress.begin("measuring cells", sequence.shots.len() as u64);
        let mut light = measure::observe(sequence, photographs, pixels, sampled, progress)?;
        if let Some(images) = images {
            let all: Vec<usize> = (0..sequence.images.len()).collect();
            images.for_batches(&all, progress, |photos| {
                light.images.extend(photos.iter().map(|(_, photo)| {
                    ImageLight {
                        cells: photo
                            .planes
                            .iter()
                            .map(|plane| pixels.mean(plane))
                            .collect(),
                        pixels: light.pixels.taken(photo),
                    }
                }));
            })?;
        }
        progress.end();
        let live = &pixels.live;
        let bands = |steadiness: &Steadiness, light: &[DMatrix<f64>]| {
            mains_banding::find(sequence, registration, live, &steadiness.models, light)
        };
        let steadiness = drift::assess(sequence, live, &light.channels);
        let straighten = |power: f64| {
            let raised = |light: &DMatrix<f64>| light.map(|light| light.max(0.0).powf(power));
            let light: Vec<DMatrix<f64>> = light.channels.iter().map(raised).collect();
            let steadiness = drift::assess(sequence, live, &light);
            let banding = bands(&steadiness, &light);
            // A power makes small changes as many times as large.
            let banding = banding.map(|bands| bands.scaled(1.0 / power));
            (steadiness.scaled(1.0 / power), banding)
        };
        let observed = measure::average(sequence, &light, pixels, &steadiness.drift);
        // Before one white there is nothing to follow the light by: what bends it would be
        // taken for drift, and the sums for sound.
        let single = sequence.white().shots.len() == 1;
        let plain = single.then(|| measure::average(sequence, &light, pixels, &Drift::default()));
        let summed = &plain.as_ref().unwrap_or(&observed).channels;
        let sums = Sums::new(sequence, summed, live);
        let off = sums.as_ref().is_some_and(Sums::off);
        let find = || nonlinearity::find(sequence, live, &light.channels, sampled);
        let nonlinearity = off.then(find);
        let banding = bands(&steadiness, &light.channels);
        let (samples, images) = (light.pixels, &light.images);
        let pixel_light = samples.average(sequence, images, &steadiness.drift, saturated);
        Ok(Self {
            nonlinearity,
            sums,
            banding,
            straightened: power.map(straighten),
            steadiness,
            channels: observed.channels,
            noise: observed.noise,
            pixel_light,
        })
    }
}
