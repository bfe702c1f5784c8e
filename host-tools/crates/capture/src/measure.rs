//! From registered pixels to one observation a cell and view.

use super::drift::Drift;
use super::noise_samples::NoiseSamples;
use super::photographs::Photographs;
use super::registration::{NO_CELL, Registration};
use super::sequence::Sequence;
use super::{
    CaptureError, ChannelMeasurements, LeftOut, Measurements, NoiseModel, NoiseSource, Why,
};
use iltm_picture::progress::Progress;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Camera pixels that a cell must keep: one could be a defect of the sensor.
const MIN_PIXELS: u32 = 2;

/// Share of a cell's pixels that may be saturated. These are not used, but more
/// of them mean that the rest is close to saturation too.
const SATURATED_PIXELS: f64 = 0.1;

/// The cells that can be measured, and their pixels.
pub(super) struct CellPixels {
    /// Pixels of all live cells, cell after cell.
    pixels: Vec<u32>,
    /// Where each cell's pixels begin in `pixels`, length `N + 1`.
    begin: Vec<usize>,
    pub(super) live: Vec<bool>,
    pub(super) left_out: Vec<LeftOut>,
}

impl CellPixels {
    /// Chooses the pixels to average: registered ones that are not `saturated`
    /// under white.
    pub(super) fn choose(registration: &Registration, saturated: &[bool]) -> Self {
        let cells = registration.centre.len();
        let mut of_cell: Vec<Vec<u32>> = vec![Vec::new(); cells];
        let mut lost = vec![0_u32; cells];
        for (pixel, &cell) in (0_u32..).zip(&registration.cell_of_pixel) {
            if cell == NO_CELL {
                continue;
            }
            if saturated[pixel as usize] {
                lost[cell as usize] += 1;
            } else {
                of_cell[cell as usize].push(pixel);
            }
        }
        let why = |cell: usize| {
            let (pixels, saturated) = (of_cell[cell].len() as u32, lost[cell]);
            let all = pixels + saturated;
            if f64::from(saturated) > SATURATED_PIXELS * f64::from(all) {
                return Some(Why::Saturated {
                    saturated,
                    pixels: all,
                });
            }
            (pixels < MIN_PIXELS).then_some(Why::TooFewPixels { pixels })
        };
        let left_out: Vec<LeftOut> = (0..cells)
            .filter_map(|cell| why(cell).map(|why| LeftOut { cell, why }))
            .collect();
        let mut live = vec![true; cells];
        for out in &left_out {
            live[out.cell] = false;
        }
        let mut begin = vec![0];
        let mut pixels = Vec::new();
        for (cell, of_cell) in of_cell.iter().enumerate() {
            if live[cell] {
                pixels.extend(of_cell);
            }
            begin.push(pixels.len());
        }
        Self {
            pixels,
            begin,
            live,
            left_out,
        }
    }

    /// Number of cells.
    fn cells(&self) -> usize {
        self.live.len()
    }

    /// Pixels of each cell, `N` slices; empty for a cell that is not live.
    pub(super) fn of_cells(&self) -> impl Iterator<Item = &[u32]> {
        let range = |range: &[usize]| &self.pixels[range[0]..range[1]];
        self.begin.windows(2).map(range)
    }

    /// Number of pixels of each cell, length `N`.
    pub(super) fn counts(&self) -> Vec<u32> {
        self.of_cells().map(|pixels| pixels.len() as u32).collect()
    }

    /// Mean of a plane over each cell; 0 for a cell that is not live.
    pub(super) fn mean(&self, plane: &[f32]) -> Vec<f64> {
        let mean = |pixels: &[u32]| {
            let sum: f64 = pixels.iter().map(|&p| f64::from(plane[p as usize])).sum();
            sum / pixels.len().max(1) as f64
        };
        self.of_cells().map(mean).collect()
    }
}

/// Light of every cell in every photograph, before black is subtracted.
pub(super) struct CellLight {
    /// One entry a channel: `N x shots`, camera units, 0 where a cell is not live.
    pub(super) channels: Vec<DMatrix<f64>>,
    samples: NoiseSamples,
}

/// Averages every photograph over the pixels of each cell.
///
/// # Errors
/// A photograph's own error.
pub(super) fn observe(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    cells: &CellPixels,
    progress: &dyn Progress,
) -> Result<CellLight, CaptureError> {
    let shots: Vec<usize> = (0..sequence.shots.len()).collect();
    let empty = DMatrix::zeros(cells.cells(), shots.len());
    let mut channels = vec![empty; photographs.format.channels];
    let mut samples = NoiseSamples::new(sequence, cells);
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
        }
    })?;
    Ok(CellLight { channels, samples })
}

/// Everything that the photographs yield.
pub(super) struct Observed {
    pub(super) channels: Vec<ChannelMeasurements>,
    pub(super) noise: NoiseSource,
}

/// Divides slow changes out, subtracts black, averages the photographs of each
/// view and estimates the noise.
pub(super) fn average(
    sequence: &Sequence,
    light: &CellLight,
    cells: &CellPixels,
    drift: &Drift,
) -> Observed {
    let source = NoiseSamples::source(sequence);
    let samples = &light.samples;
    let counts = cells.counts();
    let of_channel = |(channel, light): (usize, &DMatrix<f64>)| {
        let ambient = black(sequence, light);
        let mut observations = DMatrix::zeros(light.nrows(), sequence.views.len());
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
        let gains = |shot: usize| drift.gain(channel, shot);
        let noise_model = samples.fit(sequence, source, channel, gains);
        let noise = white_noise(sequence, &observations, &ambient, &counts, noise_model);
        ChannelMeasurements {
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

/// Mean of the photographs of black in each cell, length `N`.
pub(super) fn black(sequence: &Sequence, light: &DMatrix<f64>) -> Vec<f64> {
    let share = 1.0 / sequence.black.len() as f64;
    let of_cell = |cell: usize| -> f64 {
        let black = sequence.black.iter().map(|&shot| light[(cell, shot)]);
        share * black.sum::<f64>()
    };
    (0..light.nrows()).map(of_cell).collect()
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
