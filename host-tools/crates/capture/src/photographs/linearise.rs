//! Linear photographs: all photographs in light that means the projector's, and white and
//! black, which all others are seen against.

use super::{Photographs, channel_sum};
use crate::cells::noise::NoiseModel;
use crate::format::bracket::Bracket;
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::format::settings::Reading;
use iltm_picture::DeviceResponse;
use iltm_picture::progress::{Progress, Silent};
use iltm_picture::statistics::quantile;
use nalgebra::Matrix3;
use std::path::Path;

/// Flood light of a pixel, as a share of the 95th percentile of all pixels, from which the
/// projector lights it: below, it only sees light from elsewhere.
const LIT_SHARE: f32 = 0.05;

/// Flood light, of full scale, that an 8-bit camera could just tell from black.
const LEAST_LIGHT: f32 = 1.0 / 255.0;

/// Share by which patterns and their inverses may be off white's light and still tell it.
const MOST_APART: f64 = 0.03;

/// Photographs and the two that all others are seen against.
pub(crate) struct LinearPhotographs<'a> {
    pub(crate) photographs: Photographs<'a>,
    /// Mean of the photographs of white, one plane a channel.
    pub(crate) flood: Vec<Vec<f32>>,
    /// Mean of the photographs of black.
    pub(crate) black: Vec<Vec<f32>>,
    /// Pixels whose light under white is not known.
    pub(crate) saturated: Vec<bool>,
}

/// What the projector adds to every pixel under white.
pub(crate) struct FloodLight {
    /// White minus black, summed over the channels.
    pub(crate) pixels: Vec<f32>,
    /// Its 95th percentile.
    pub(crate) bright: f32,
}

impl FloodLight {
    /// Whether the projector lights a pixel.
    pub(crate) fn is_lit(&self, pixel: usize) -> bool {
        self.pixels[pixel] > LIT_SHARE * self.bright
    }

    /// All pixels that the projector lights.
    pub(crate) fn lit(&self) -> Vec<usize> {
        let all = 0..self.pixels.len();
        all.filter(|&pixel| self.is_lit(pixel)).collect()
    }
}

impl<'a> LinearPhotographs<'a> {
    /// Reads all photographs and averages white and black.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(crate) fn read(
        folder: &'a Path,
        sequence: &Sequence,
        reading: &Reading,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        let brackets = sequence.brackets.clone();
        let mut photographs = Photographs::of_brackets(folder, brackets, reading)?;
        photographs.prefetch(progress)?;
        let mut linear = Self {
            photographs,
            flood: Vec::new(),
            black: Vec::new(),
            saturated: Vec::new(),
        };
        linear.average_white_black(sequence, progress)?;
        Ok(linear)
    }

    /// Averages white and black. Pixels that were saturated before stay so.
    fn average_white_black(
        &mut self,
        sequence: &Sequence,
        progress: &dyn Progress,
    ) -> Result<(), CaptureError> {
        let white = &sequence.white().shots;
        let known = std::mem::take(&mut self.saturated);
        let count = white.len() + sequence.black.len();
        progress.begin("comparing white and black", count as u64);
        (self.flood, self.saturated) = self.photographs.mean(white, progress)?;
        (self.black, _) = self.photographs.mean(&sequence.black, progress)?;
        progress.end();
        self.keep_saturated(&known);
        if self.photographs.bracketed() {
            // White may have a short exposure where others have none.
            let others = sequence.views.iter().flat_map(|view| view.shots.clone());
            let others: Vec<usize> = others.collect();
            let (_, saturated) = self.photographs.mean(&others, &Silent)?;
            self.keep_saturated(&saturated);
        }
        Ok(())
    }

    /// Marks the pixels that are known to be saturated.
    fn keep_saturated(&mut self, known: &[bool]) {
        for (saturated, known) in self.saturated.iter_mut().zip(known) {
            *saturated |= known;
        }
    }

    /// Reads all photographs again, as a camera of this response took them.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(crate) fn read_again(
        &mut self,
        sequence: &Sequence,
        response: DeviceResponse,
        progress: &dyn Progress,
    ) -> Result<(), CaptureError> {
        let reading = Reading {
            response,
            ..self.photographs.format.reading.clone()
        };
        let known = std::mem::take(&mut self.saturated);
        // Their room is needed for the new ones.
        self.photographs.forget();
        *self = Self::read(self.photographs.folder, sequence, &reading, progress)?;
        self.keep_saturated(&known);
        Ok(())
    }

    /// Turns the photographs into the projector's channels by the inverse of the colour
    /// mixing.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(crate) fn unmix(
        &mut self,
        inverse: [[f32; 3]; 3],
        sequence: &Sequence,
        progress: &dyn Progress,
    ) -> Result<(), CaptureError> {
        self.photographs.unmix(inverse);
        self.average_white_black(sequence, progress)
    }

    /// Opens photographs of another list of the folder, which are read as these are.
    ///
    /// # Errors
    /// A photograph's own error; [`CaptureError::Unlike`] if they are not of the capture's kind.
    pub(crate) fn others<'f>(
        &self,
        folder: &'f Path,
        brackets: Vec<Bracket>,
    ) -> Result<Photographs<'f>, CaptureError> {
        let reading = &self.photographs.format.reading;
        let others = Photographs::of_brackets(folder, brackets, reading)?;
        let mut others = others.beside(&self.photographs);
        self.photographs.format.check_like(&others.format)?;
        others.unmixing.clone_from(&self.photographs.unmixing);
        Ok(others)
    }

    /// Black in the camera's own channels, summed over them.
    pub(crate) fn black_as_seen(&self) -> Vec<f32> {
        let mixing = (self.photographs.unmixing)
            .and_then(|inverse| Matrix3::from(inverse).transpose().try_inverse());
        let Some(mixing) = mixing else {
            return channel_sum(&self.black);
        };
        let mut sum = vec![0.0; self.black[0].len()];
        for (plane, column) in self.black.iter().zip(mixing.column_iter()) {
            for (sum, light) in sum.iter_mut().zip(plane) {
                *sum += column.sum() * light;
            }
        }
        sum
    }

    /// The middle of white and black in every pixel, summed over the channels.
    pub(crate) fn middle(&self) -> Vec<f32> {
        let (white, black) = (channel_sum(&self.flood), channel_sum(&self.black));
        let middle = white.iter().zip(&black).map(|(w, b)| 0.5 * (w + b));
        middle.collect()
    }

    /// What the projector adds to every pixel under white.
    pub(crate) fn flood_light(&self) -> FloodLight {
        let (white, black) = (channel_sum(&self.flood), channel_sum(&self.black));
        let pixels: Vec<f32> = white.iter().zip(&black).map(|(w, b)| w - b).collect();
        let bright = quantile(&mut pixels.clone(), 0.95).unwrap_or(0.0);
        FloodLight { pixels, bright }
    }

    /// The same.
    ///
    /// # Errors
    /// [`CaptureError::NoLight`] if white and black are the same.
    pub(crate) fn enough_flood_light(
        &self,
        sequence: &Sequence,
    ) -> Result<FloodLight, CaptureError> {
        let flood = self.flood_light();
        if flood.bright < LEAST_LIGHT {
            return Err(CaptureError::NoLight {
                path: self.photographs.path(sequence.white().shots[0]),
            });
        }
        Ok(flood)
    }

    /// White minus black, one plane a channel.
    pub(crate) fn flood_without_black(&self) -> Vec<Vec<f32>> {
        let planes = self.flood.iter().zip(&self.black);
        planes
            .map(|(flood, black)| flood.iter().zip(black).map(|(w, b)| w - b).collect())
            .collect()
    }

    /// The same from white and from each pattern that was photographed together with its inverse:
    /// both together show white's light, and black twice. They count by the noise that each
    /// channel has. Says how many photographs of white it is as good as. Where the sums are not
    /// white's light by [`MOST_APART`], white has its say alone.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(crate) fn flood_of_pairs(
        &mut self,
        sequence: &Sequence,
        noise: &[NoiseModel],
        progress: &dyn Progress,
    ) -> Result<(Vec<Vec<f32>>, usize), CaptureError> {
        let mut flood = self.flood_without_black();
        let whites = sequence.white().shots.len();
        let pairs = sequence.code_pairs();
        let first = |view: usize| sequence.views[view].shots.first().copied();
        let both = pairs.iter().flat_map(|(a, b)| [*a, *b]);
        let all: Vec<usize> = both.filter_map(first).collect();
        if pairs.is_empty() {
            return Ok((flood, whites));
        }
        let (mean, _) = self.photographs.mean(&all, progress)?;
        let mut as_good_as = f64::INFINITY;
        for (channel, flood) in flood.iter_mut().enumerate() {
            let black = &self.black[channel];
            let sums = mean[channel].iter().zip(black);
            let sums: Vec<f32> = sums.map(|(mean, black)| 2.0 * (mean - black)).collect();
            let total = |plane: &[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>();
            let brighter = total(&sums) / total(flood);
            let light = quantile(&mut flood.clone(), 0.9).map_or(0.0, f64::from);
            let model = noise.get(channel).copied().unwrap_or_default();
            let counts = [whites, pairs.len(), sequence.black.len()];
            let (share, good) = share_of_pairs(model, light, counts);
            // Written so that what is not a number is left out.
            if (brighter - 1.0).abs() <= MOST_APART {
                as_good_as = as_good_as.min(good);
                for (flood, sum) in flood.iter_mut().zip(sums) {
                    *flood += share * (sum / brighter as f32 - *flood);
                }
            } else {
                as_good_as = 0.0;
            }
        }
        Ok((flood, whites.max(as_good_as as usize)))
    }
}

/// Share of pairs of patterns in white's light that leaves the least noise, and how many
/// photographs of white the result is as good as. `counts` are photographs of white, pairs, and
/// photographs of black.
///
/// White has the noise of one photograph and of one black, a pair that of two dimmer ones and of
/// two blacks, which all pairs share: with a share `s`, `(1 - s)^2 w + s^2 p + (1 + s)^2 b`.
fn share_of_pairs(model: NoiseModel, light: f64, counts: [usize; 3]) -> (f32, f64) {
    let [whites, pairs, blacks] = counts.map(|count| count.max(1) as f64);
    let white = model.variance(light) / whites;
    let pair = (model.variance(light) + model.floor) / pairs;
    let black = model.floor / blacks;
    let all = white + pair + black;
    if all.is_nan() || all <= 0.0 {
        return ((pairs / (pairs + whites)) as f32, pairs + whites);
    }
    let share = ((white - black) / all).max(0.0);
    let left = (1.0 - share).powi(2) * white + share.powi(2) * pair + (1.0 + share).powi(2) * black;
    (share as f32, whites * (white + black) / left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::sequence::{CaptureOptions, Selection};
    use crate::test_capture::TestCapture;
    use crate::{Manifest, Settings};

    #[test]
    fn pairs_count_where_the_dark_has_little_noise() {
        let shot = NoiseModel {
            shot: 1e-4,
            floor: 0.0,
        };
        let (share, good) = share_of_pairs(shot, 0.8, [1, 9, 1]);
        assert!((share - 0.9).abs() < 1e-6 && (good - 10.0).abs() < 1e-6);
        // Noise that is the same in the dark: two blacks are worse than one.
        let floor = NoiseModel {
            shot: 0.0,
            floor: 1e-4,
        };
        assert_eq!(share_of_pairs(floor, 0.8, [1, 9, 1]).0.to_bits(), 0);
        let (share, good) = share_of_pairs(floor, 0.8, [1, 9, 9]);
        assert!(share > 0.5 && good > 1.8, "{share} {good}");
        assert!(share_of_pairs(NoiseModel::default(), 0.8, [1, 9, 1]).0 > 0.8);
    }

    #[test]
    fn a_pixel_that_was_saturated_once_stays_so() {
        let folder = tempfile::tempdir().unwrap();
        TestCapture::default().write(folder.path());
        let shots = Manifest::read(folder.path()).unwrap().shots;
        let options = CaptureOptions::default();
        let mut chosen = Selection::new(folder.path(), &shots, &options).unwrap();
        chosen.find_photographs(folder.path()).unwrap();
        let sequence = Sequence::read(folder.path(), chosen).unwrap();
        let reading = Settings::default().camera.reading();
        let read = LinearPhotographs::read(folder.path(), &sequence, &reading, &Silent);
        let mut linear = read.unwrap();
        assert!(!linear.saturated[3]);
        linear.saturated[3] = true;
        linear.average_white_black(&sequence, &Silent).unwrap();
        assert!(linear.saturated[3] && !linear.saturated[4]);
    }
}
