//! From registered pixels to one observation a cell and view.

use super::noise_samples::NoiseSamples;
use super::photographs::Photographs;
use super::registration::{NO_CELL, Registration};
use super::sequence::Sequence;
use super::{
    CaptureError, ChannelMeasurements, LeftOut, Measurements, NoiseModel, NoiseSource, Why,
};
use crate::progress::Progress;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::path::Path;

/// Camera pixels that a cell must keep: one could be a defect of the sensor.
const MIN_PIXELS: u32 = 2;

/// Share of a cell's pixels that may be saturated. These are not used, but more
/// of them mean that the rest is close to saturation too.
const SATURATED_PIXELS: f64 = 0.1;

/// Share of the cells that may be saturated before the capture is refused.
const SATURATED_CELLS: f64 = 0.05;

/// Share of the cells that must be found.
const LEAST_LIVE: f64 = 0.1;

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
    /// under white. `manifest` and `flood` are only for errors.
    ///
    /// # Errors
    /// [`CaptureError::Overexposed`] and [`CaptureError::NothingRegistered`].
    pub(super) fn choose(
        registration: &Registration,
        saturated: &[bool],
        manifest: &Path,
        flood: &Path,
    ) -> Result<Self, CaptureError> {
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
        check_live(&left_out, cells, manifest, flood)?;
        let mut begin = vec![0];
        let mut pixels = Vec::new();
        for (cell, of_cell) in of_cell.iter().enumerate() {
            if live[cell] {
                pixels.extend(of_cell);
            }
            begin.push(pixels.len());
        }
        Ok(Self {
            pixels,
            begin,
            live,
            left_out,
        })
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

/// Refuses a capture in which too many cells are saturated or missing.
fn check_live(
    left_out: &[LeftOut],
    cells: usize,
    manifest: &Path,
    flood: &Path,
) -> Result<(), CaptureError> {
    let is_saturated = |out: &&LeftOut| matches!(out.why, Why::Saturated { .. });
    let saturated = left_out.iter().filter(is_saturated).count();
    let live = cells - left_out.len();
    if saturated as f64 > SATURATED_CELLS * (live + saturated) as f64 {
        return Err(CaptureError::Overexposed {
            path: flood.to_owned(),
            saturated,
            seen: live + saturated,
            of: "cells",
        });
    }
    if (live as f64) < (LEAST_LIVE * cells as f64).max(1.0) {
        return Err(CaptureError::NothingRegistered {
            path: manifest.to_owned(),
            live,
            cells,
        });
    }
    Ok(())
}

/// Everything that a pass over all photographs yields.
pub(super) struct Observed {
    pub(super) channels: Vec<ChannelMeasurements>,
    pub(super) noise: NoiseSource,
}

/// Averages every photograph over the pixels of each cell, subtracts `black`
/// (one plane a channel) and estimates the noise.
///
/// # Errors
/// A photograph's own error.
pub(super) fn observe(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    cells: &CellPixels,
    black: &[Vec<f32>],
    progress: &dyn Progress,
) -> Result<Observed, CaptureError> {
    let channels = photographs.format.channels;
    let shots: Vec<usize> = sequence
        .views
        .iter()
        .flat_map(|v| v.shots.clone())
        .collect();
    let columns: Vec<usize> = (0..)
        .zip(&sequence.views)
        .flat_map(|(at, v)| vec![at; v.shots.len()])
        .collect();
    let mut samples = NoiseSamples::new(sequence, cells);
    let mut light = vec![DMatrix::zeros(cells.cells(), sequence.views.len()); channels];
    let mut done = 0;
    photographs.for_batches(&shots, progress, |photos| {
        let means: Vec<Vec<Vec<f64>>> = photos
            .par_iter()
            .map(|(_, photo)| photo.planes.iter().map(|plane| cells.mean(plane)).collect())
            .collect();
        for ((shot, photo), means) in photos.iter().zip(means) {
            let column = columns[done];
            done += 1;
            let share = 1.0 / sequence.views[column].shots.len() as f64;
            for (light, mean) in light.iter_mut().zip(means) {
                for (cell, mean) in mean.into_iter().enumerate() {
                    light[(cell, column)] += share * mean;
                }
            }
            samples.keep(*shot, photo);
        }
    })?;
    let source = NoiseSamples::source(sequence);
    let counts = cells.counts();
    let channels = light
        .into_iter()
        .enumerate()
        .map(|(channel, mut observations)| {
            let ambient = cells.mean(&black[channel]);
            for mut column in observations.column_iter_mut() {
                for (light, ambient) in column.iter_mut().zip(&ambient) {
                    *light -= ambient;
                }
            }
            let noise_model = samples.fit(sequence, source, channel);
            let noise = white_noise(sequence, &observations, &ambient, &counts, noise_model);
            ChannelMeasurements {
                observations,
                ambient,
                noise,
                noise_model,
            }
        });
    Ok(Observed {
        channels: channels.collect(),
        noise: source,
    })
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

/// How far each Gray code pattern and its inverse together exceed white, summed
/// over all cells and relative to white; the median over pairs and channels.
/// Summing first makes noise harmless, while a curved response or an exposure
/// that follows the picture pushes all cells the same way.
pub(super) fn superposition(sequence: &Sequence, channels: &[ChannelMeasurements]) -> Option<f64> {
    let pairs = sequence.code_pairs();
    let excess = |channel: &ChannelMeasurements, (a, b): (usize, usize)| {
        let total = |view: usize| channel.observations.column(view).sum();
        let white = total(Measurements::WHITE);
        (total(a) + total(b) - white) / white
    };
    let mut excesses: Vec<f64> = channels
        .iter()
        .flat_map(|channel| pairs.iter().map(move |&pair| excess(channel, pair)))
        .filter(|excess| excess.is_finite())
        .collect();
    excesses.sort_by(f64::total_cmp);
    excesses.get(excesses.len() / 2).copied()
}
