//! The photographs of a capture in light that means the projector's, and what
//! they and the calibration say of the devices.

use super::calibration::samples::{fit, used_pixels};
use super::calibration::taken::{Seen, Taken, mean_of};
use super::calibration::{CameraFit, Devices, Ramp, Unmix};
use super::gates::saturation::{self, Clipped};
use super::photo::Reading;
use super::photographs::Photographs;
use super::sequence::Sequence;
use super::{CaptureError, SETTINGS_FILE, Settings};
use iltm_picture::{
    Declared,
    progress::{Progress, Silent},
};
use std::path::Path;

/// Photographs and the two that all others are seen against.
pub(super) struct Light<'a> {
    pub(super) photographs: Photographs<'a>,
    /// Mean of the photographs of white, one plane a channel.
    pub(super) flood: Vec<Vec<f32>>,
    /// Mean of the photographs of black.
    pub(super) black: Vec<Vec<f32>>,
    /// Pixels whose light under white is not known.
    pub(super) saturated: Vec<bool>,
    /// The photographs of `calibration.csv`.
    pub(super) taken: Taken,
    reading: Reading,
}

impl<'a> Light<'a> {
    /// Reads all photographs as `capture.toml` says.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(super) fn read(
        folder: &'a Path,
        sequence: &Sequence,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        Self::read_with(folder, sequence, settings.camera.reading(), progress)
    }

    fn read_with(
        folder: &'a Path,
        sequence: &Sequence,
        reading: Reading,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        let frames = sequence.frames.clone();
        let mut photographs = Photographs::of_frames(folder, frames, &reading)?;
        photographs.prefetch(progress)?;
        let mut light = Self {
            photographs,
            flood: Vec::new(),
            black: Vec::new(),
            saturated: Vec::new(),
            taken: Taken::default(),
            reading,
        };
        light.look(sequence, progress)?;
        Ok(light)
    }

    /// Averages white and black.
    fn look(&mut self, sequence: &Sequence, progress: &dyn Progress) -> Result<(), CaptureError> {
        let white = &sequence.white().shots;
        let count = white.len() + sequence.black.len();
        progress.begin("comparing white and black", count as u64);
        (self.flood, self.saturated) = self.photographs.mean(white, progress)?;
        (self.black, _) = self.photographs.mean(&sequence.black, progress)?;
        progress.end();
        if self.photographs.bracketed() {
            // White may have a short exposure where others have none.
            let others = sequence.views.iter().flat_map(|view| view.shots.clone());
            let (_, saturated) = self
                .photographs
                .mean(&others.collect::<Vec<_>>(), &Silent)?;
            for (known, other) in self.saturated.iter_mut().zip(saturated) {
                *known |= other;
            }
        }
        Ok(())
    }

    /// Marks the pixels that are known to be saturated.
    fn keep_saturated(&mut self, known: &[bool]) {
        for (saturated, known) in self.saturated.iter_mut().zip(known) {
            *saturated |= known;
        }
    }

    /// Marks pixels that are cut off below full scale as saturated, and counts.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(super) fn find_clipped(
        &mut self,
        sequence: &Sequence,
        progress: &dyn Progress,
    ) -> Result<Clipped, CaptureError> {
        saturation::find(
            sequence,
            &mut self.photographs,
            &self.flood,
            &self.black,
            &mut self.saturated,
            progress,
        )
    }

    /// Measures the devices; afterwards the photographs are in the light that they
    /// say: of the measured camera response where that is asked for, and of the
    /// projector's channels where the camera mixes them.
    ///
    /// # Errors
    /// [`CaptureError::ResponseUnknown`] if a response shall be measured and the
    /// photographs do not tell it; a photograph's own error.
    pub(super) fn measure_devices(
        &mut self,
        folder: &'a Path,
        sequence: &Sequence,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Devices, CaptureError> {
        let mut devices = Devices::declared(settings);
        let used = used_pixels(&self.flood, &self.black, &self.saturated);
        let mut camera = fit(sequence, &mut self.photographs, &used, &self.reading)?;
        if settings.camera.response == Declared::Measure {
            let told = camera.filter(CameraFit::tells).map(CameraFit::adopted);
            let Some(found) = told else {
                return Err(unknown(folder, "camera"));
            };
            let reading = Reading {
                response: found.best.clone(),
                ..self.reading.clone()
            };
            devices.camera = found.best.clone();
            camera = Some(found);
            let known = std::mem::take(&mut self.saturated);
            *self = Self::read_with(folder, sequence, reading, progress)?;
            self.keep_saturated(&known);
        }
        devices.camera_fit = camera;
        self.read_calibration(folder, sequence, progress)?;
        devices.calibration = (self.taken.listed, self.taken.found);
        devices.take_ramp(Ramp::new(self.taken.ramp.clone()));
        let measured = devices
            .ramp
            .as_ref()
            .and_then(|ramp| ramp.response.as_ref());
        if settings.projector.response == Declared::Measure && measured.is_none() {
            return Err(unknown(folder, "projector"));
        }
        if let Some(unmix) = devices.mixing().and_then(super::calibration::Mixing::unmix) {
            self.unmix(unmix, sequence, progress)?;
            devices.unmixed = true;
        }
        Ok(devices)
    }

    /// Turns the photographs into the projector's channels.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(super) fn unmix(
        &mut self,
        unmix: Unmix,
        sequence: &Sequence,
        progress: &dyn Progress,
    ) -> Result<(), CaptureError> {
        self.photographs.unmix(unmix);
        let known = std::mem::take(&mut self.saturated);
        self.look(sequence, progress)?;
        self.keep_saturated(&known);
        Ok(())
    }

    fn read_calibration(
        &mut self,
        folder: &Path,
        sequence: &Sequence,
        progress: &dyn Progress,
    ) -> Result<(), CaptureError> {
        let used = used_pixels(&self.flood, &self.black, &self.saturated);
        let mut whites = Vec::new();
        let shots = &sequence.white().shots;
        let black: f64 = mean_of(&self.black, &used).iter().sum();
        self.photographs.for_batches(shots, &Silent, |photos| {
            for &(at, photo) in photos {
                let light = mean_of(&photo.planes, &used).iter().sum::<f64>() - black;
                whites.push((sequence.shots[at].index, light));
            }
        })?;
        let format = &self.photographs.format;
        let seen = Seen {
            flood: &self.flood,
            black: &self.black,
            used: &used,
            whites: &whites,
            size: (format.width, format.height),
            longest: sequence.longest,
        };
        self.taken = Taken::read(folder, sequence.grid, &self.reading, &seen, progress)?;
        Ok(())
    }
}

fn unknown(folder: &Path, device: &'static str) -> CaptureError {
    CaptureError::ResponseUnknown {
        path: folder.join(SETTINGS_FILE),
        device,
    }
}
