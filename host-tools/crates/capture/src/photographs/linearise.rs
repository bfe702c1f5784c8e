//! Linear photographs: all photographs in light that means the projector's, and white and
//! black, which all others are seen against.

use super::{Photographs, channel_sum};
use crate::format::bracket::Bracket;
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::format::settings::Reading;
use iltm_picture::DeviceResponse;
use iltm_picture::progress::{Progress, Silent};
use iltm_picture::statistics::quantile;
use std::path::Path;

/// Flood light of a pixel, as a share of the 95th percentile of all pixels, from which the
/// projector lights it: below, it only sees light from elsewhere.
const LIT_SHARE: f32 = 0.05;

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
        // Their memory is needed for the new ones.
        self.photographs.kept.clear();
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
        let mut others = Photographs::of_brackets(folder, brackets, reading)?;
        self.photographs.format.check_like(&others.format)?;
        others.unmixing.clone_from(&self.photographs.unmixing);
        Ok(others)
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

    /// White minus black, one plane a channel.
    pub(crate) fn flood_without_black(&self) -> Vec<Vec<f32>> {
        let planes = self.flood.iter().zip(&self.black);
        planes
            .map(|(flood, black)| flood.iter().zip(black).map(|(w, b)| w - b).collect())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::sequence::{CaptureOptions, Selection};
    use crate::test_capture::TestCapture;
    use crate::{Manifest, Settings};

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
