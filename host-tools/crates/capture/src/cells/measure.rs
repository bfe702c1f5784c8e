//! Observations: from registered pixels to one number a cell and view.

use super::cell_pixels::{CellPixels, black};
use super::drift::Drift;
use super::measurements::{ChannelMeasurements, Measurements};
use super::noise::{NoiseModel, NoiseSource};
use super::noise_samples::NoiseSamples;
use super::pixel_light::PixelSamples;
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::photographs::Photographs;
use crate::photographs::sampled::Sampled;
use iltm_picture::progress::Progress;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Light of every cell in every photograph, before black is subtracted.
pub(crate) struct CellLight {
    /// One entry a channel: `N x shots`, camera units, 0 where a cell is not live.
    pub(crate) channels: Vec<DMatrix<f64>>,
    samples: NoiseSamples,
    pub(crate) pixels: PixelSamples,
    /// By photograph of an image.
    pub(crate) images: Vec<ImageLight>,
}

/// Light in the photograph of an image, before black is subtracted.
pub(crate) struct ImageLight {
    /// By channel and cell.
    pub(crate) cells: Vec<Vec<f64>>,
    /// By channel and sampled pixel.
    pub(crate) pixels: Vec<Vec<f32>>,
}

/// Averages every photograph over the pixels of each cell.
///
/// # Errors
/// A photograph's own error.
pub(crate) fn observe(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    cells: &CellPixels,
    sampled: &Sampled,
    progress: &dyn Progress,
) -> Result<CellLight, CaptureError> {
    let shots: Vec<usize> = (0..sequence.shots.len()).collect();
    let empty = DMatrix::zeros(cells.live.len(), shots.len());
    let mut channels = vec![empty; photographs.format.channels];
    let mut samples = NoiseSamples::new(sequence, cells);
    let mut pixels = PixelSamples::new(&sampled.pixels, shots.len());
    photographs.for_batches(&shots, progress, |photos| {
        let means: Vec<Vec<Vec<f64>>> = photos
            .par_iter()
            .map(|(_, photo)| photo.planes.iter().map(|p| cells.mean(p)).collect())
            .collect();
        for ((shot, photo), means) in photos.iter().zip(means) {
            for (light, mean) in channels.iter_mut().zip(means) {
                light.column_mut(*shot).copy_from_slice(&mean);
            }
            samples.keep(*shot, photo);
            pixels.keep(*shot, photo);
        }
    })?;
    Ok(CellLight {
        channels,
        samples,
        pixels,
        images: Vec::new(),
    })
}

/// Everything that the photographs yield.
pub(crate) struct Observed {
    pub(crate) channels: Vec<ChannelMeasurements>,
    pub(crate) noise: NoiseSource,
}

/// Divides slow changes out, subtracts black, averages the photographs of each
/// view and estimates the noise.
pub(crate) fn average(
    sequence: &Sequence,
    light: &CellLight,
    cells: &CellPixels,
    drift: &Drift,
) -> Observed {
    let source = NoiseSamples::source(sequence);
    let (samples, images) = (&light.samples, &light.images);
    let counts = cells.counts();
    let of_channel = |(channel, light): (usize, &DMatrix<f64>)| {
        let ambient = black(sequence, light);
        let views = sequence.views.len();
        let mut observations = DMatrix::zeros(light.nrows(), views + images.len());
        for (view, mut mean) in sequence.views.iter().zip(observations.column_iter_mut()) {
            let share = 1.0 / view.shots.len() as f64;
            for &shot in &view.shots {
                let gain = drift.gain(channel, shot);
                let dark = drift.dark(channel, shot);
                for ((mean, light), ambient) in
                    mean.iter_mut().zip(light.column(shot).iter()).zip(&ambient)
                {
                    *mean += share * (light - dark * ambient) / gain;
                }
            }
        }
        for (at, (bracket, image)) in sequence.images.iter().zip(images).enumerate() {
            let (gain, dark) = drift.between(sequence, channel, bracket.shots[0].index);
            let mut column = observations.column_mut(views + at);
            for ((mean, light), ambient) in
                column.iter_mut().zip(&image.cells[channel]).zip(&ambient)
            {
                *mean = (light - dark * ambient) / gain;
            }
        }
        let patterns = DMatrix::from_fn(light.nrows(), views, |cell, view| {
            f64::from(sequence.views[view].lit[cell])
        });
        let gains = |shot: usize| drift.gain(channel, shot);
        let noise_model = samples.fit(sequence, source, channel, gains);
        let noise = white_noise(sequence, &observations, &ambient, &counts, noise_model);
        ChannelMeasurements {
            patterns,
            observations,
            ambient,
            noise,
            noise_model,
        }
    };
    Observed {
        channels: light.channels.iter().enumerate().map(of_channel).collect(),
        noise: source,
    }
}

/// Standard deviation of each cell's observation under white: the mean of its
/// pixels in the photographs of white, minus that in those of black.
fn white_noise(
    sequence: &Sequence,
    observations: &DMatrix<f64>,
    ambient: &[f64],
    counts: &[u32],
    model: NoiseModel,
) -> Vec<f64> {
    let (white, black) = (
        sequence.white().shots.len() as f64,
        sequence.black.len() as f64,
    );
    let deviation = |cell: usize| {
        let dark = ambient[cell];
        let lit = dark + observations[(cell, Measurements::WHITE)];
        let variance = model.variance(lit) / white + model.variance(dark) / black;
        (variance / f64::from(counts[cell].max(1))).sqrt()
    };
    (0..counts.len()).map(deviation).collect()
}
