//! Noise samples: which photographs of a capture show the noise, and some of their pixels.

use super::cell_pixels::CellPixels;
use super::noise::{self, NoiseModel, NoiseSource};
use crate::format::sequence::Sequence;
use crate::photographs::photo::Photo;

/// Camera pixels that the noise is estimated from.
const NOISE_PIXELS: usize = 16_384;

/// Values of some pixels in the photographs that noise is estimated from.
pub(crate) struct NoiseSamples {
    pixels: Vec<u32>,
    /// Of those pixels, which have their right neighbour in the same cell.
    neighbours: Vec<(u32, u32)>,
    /// By shot and channel; empty for shots that are not needed.
    values: Vec<Vec<Vec<f32>>>,
    /// Light of `neighbours` in the first photograph of white, by channel.
    texture: Vec<Vec<(f32, f32)>>,
    wanted: Vec<bool>,
    white: usize,
}

impl NoiseSamples {
    /// Chooses the pixels, evenly over all live cells.
    pub(crate) fn new(sequence: &Sequence, cells: &CellPixels) -> Self {
        let all: Vec<u32> = cells.of_cells().flatten().copied().collect();
        let step = all.len().div_ceil(NOISE_PIXELS).max(1);
        let mut wanted = vec![false; sequence.shots.len()];
        for view in &sequence.views[..sequence.coded().end] {
            for &shot in &view.shots {
                wanted[shot] = true;
            }
        }
        let neighbours = cells.of_cells().flat_map(|pixels| {
            let pairs = pixels.windows(2).filter(|w| w[1] == w[0] + 1);
            pairs.map(|w| (w[0], w[1]))
        });
        Self {
            pixels: all.into_iter().step_by(step).collect(),
            neighbours: neighbours.step_by(step).collect(),
            values: vec![Vec::new(); sequence.shots.len()],
            texture: Vec::new(),
            wanted,
            white: sequence.white().shots[0],
        }
    }

    /// Takes what is needed of a photograph.
    pub(crate) fn keep(&mut self, shot: usize, photo: &Photo) {
        if self.wanted[shot] {
            let values =
                |plane: &Vec<f32>| self.pixels.iter().map(|&p| plane[p as usize]).collect();
            self.values[shot] = photo.planes.iter().map(values).collect();
        }
        if shot == self.white {
            let pairs = |plane: &Vec<f32>| {
                let pair = |&(a, b): &(u32, u32)| (plane[a as usize], plane[b as usize]);
                self.neighbours.iter().map(pair).collect()
            };
            self.texture = photo.planes.iter().map(pairs).collect();
        }
    }

    /// The best source of noise that the sequence offers.
    pub(crate) fn source(sequence: &Sequence) -> NoiseSource {
        let pairs = sequence.code_pairs().len();
        let photographs = sequence.white().shots.len();
        if pairs >= 2 {
            NoiseSource::Pairs { pairs }
        } else if photographs >= 2 {
            NoiseSource::Repeats { photographs }
        } else {
            NoiseSource::Texture
        }
    }

    /// Fits the noise of one channel; the light of a photograph is divided by its
    /// `gain` first.
    pub(crate) fn fit(
        &self,
        sequence: &Sequence,
        source: NoiseSource,
        channel: usize,
        gain: impl Fn(usize) -> f64,
    ) -> NoiseModel {
        let of_shot = |shot: usize| -> Vec<f32> {
            let share = (1.0 / gain(shot)) as f32;
            let values = &self.values[shot][channel];
            values.iter().map(|value| share * value).collect()
        };
        let (photographs, summed): (Vec<Vec<f32>>, usize) = match source {
            NoiseSource::Pairs { .. } => {
                let first = |view: usize| of_shot(sequence.views[view].shots[0]);
                let sum = |(a, b): (usize, usize)| {
                    first(a).iter().zip(&first(b)).map(|(a, b)| a + b).collect()
                };
                (sequence.code_pairs().into_iter().map(sum).collect(), 2)
            }
            NoiseSource::Repeats { .. } => {
                let white = &sequence.white().shots;
                (white.iter().map(|&shot| of_shot(shot)).collect(), 1)
            }
            NoiseSource::Texture => {
                return noise::fit_neighbours(self.texture[channel].iter().copied());
            }
        };
        noise::fit(&photographs, summed)
    }
}
