//! Devices: response, colour mixing and blur of projector and camera, declared or measured.
//!
//! | what | from | module |
//! |---|---|---|
//! | light of calibration photographs | `calibration.csv`, as far as taken | `calibration_photos` |
//! | the camera's response | pairs or brackets that must add up | `response`, `balance`, `samples` |
//! | the projector's response | the ramp | `ramp` |
//! | camera channels by projector channels | the ramp's full levels | `colour_mixing` |
//! | the projector's blur | the probe | `blur_probe` |
//!
//! A ramp of even light in each channel tells how projector and camera respond; a
//! few lit cells far apart tell how the projector blurs. A capture may do without:
//! then the devices are what `capture.toml` says.

mod balance;
mod blur_probe;
mod calibration_photos;
mod colour_mixing;
mod ramp;
mod response;
mod samples;

pub use blur_probe::Probe;
pub use colour_mixing::ColourMixingMatrix;
pub(crate) use colour_mixing::Unmixing;
pub use ramp::{Fall, Ramp, RampPoint};
pub use response::{CameraFit, CameraSource};

use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::format::settings::{SETTINGS_FILE, Settings};
use crate::photographs::channel_sum;
use crate::photographs::linearise::LinearPhotographs;
use crate::registration::cell_map::Registration;
use calibration_photos::{CalibrationPhotos, ProbeLight};
use iltm_picture::progress::Progress;
use iltm_picture::{Declared, DeviceResponse, ProjectorResponse, Response};
use iltm_runtime::Grid;
use std::path::Path;

/// Projector and camera of a capture.
#[derive(Clone, PartialEq, Debug)]
pub struct Devices {
    /// The camera's response that the photographs were read with.
    pub camera: DeviceResponse,
    /// How well the photographs add up with it, and with which they would best;
    /// `None` where there is nothing to add up.
    pub camera_fit: Option<CameraFit>,
    /// The projector's response that a table is made for.
    pub projector: ProjectorResponse,
    /// What `capture.toml` says of it.
    pub declared_projector: Declared,
    /// The projector's response by photographs of images, where neither `capture.toml` nor a ramp
    /// tells it.
    pub by_images: Option<Response>,
    /// The projector's ramp, if it was photographed.
    pub ramp: Option<Ramp>,
    /// Whether photographs were turned into the projector's primaries: then all
    /// observations are of those and not of the camera's channels.
    pub unmixed: bool,
    /// Standard deviation of the projector's blur on the scene, in cells, that a
    /// solve reckons with; 0 for none.
    pub blur: f64,
    /// The blur that was measured.
    pub probe: Option<Probe>,
    /// Lines of `calibration.csv`, and those whose photographs are there.
    pub calibration: (usize, usize),
}

impl Devices {
    /// What `capture.toml` declares, and its defaults.
    #[must_use]
    pub fn declared(settings: &Settings) -> Self {
        let projector = settings.projector.response.known();
        Self {
            camera: settings.camera.reading().response,
            camera_fit: None,
            projector: projector.unwrap_or(Response::Srgb).into(),
            declared_projector: settings.projector.response,
            by_images: None,
            ramp: None,
            unmixed: false,
            blur: settings.projector.blur.unwrap_or(0.0),
            probe: None,
            calibration: (0, 0),
        }
    }

    /// How far the projector's measured response is from the declared one, in
    /// steps of its 8-bit input, in the worst channel; `None` unless there are
    /// both.
    #[must_use]
    pub fn projector_steps(&self) -> Option<f64> {
        let declared = DeviceResponse::from(self.declared_projector.known()?);
        let measured = self.ramp.as_ref()?.response.as_ref()?;
        let steps = measured.channels().iter().map(|m| declared.steps_from(m));
        steps.reduce(f64::max)
    }

    /// The projector's response, if it was declared or measured: nothing else tells it from the
    /// default.
    pub(crate) fn known_projector(&self) -> Option<&ProjectorResponse> {
        let measured = self
            .ramp
            .as_ref()
            .is_some_and(|ramp| ramp.response.is_some());
        let known =
            measured || self.by_images.is_some() || self.declared_projector.known().is_some();
        known.then_some(&self.projector)
    }

    /// The mixing of the projector's channels in the camera's.
    #[must_use]
    pub fn mixing(&self) -> Option<&ColourMixingMatrix> {
        self.ramp.as_ref()?.mixing.as_ref()
    }

    /// What turns the camera's channels into the projector's, if photographs were
    /// turned so.
    pub(crate) fn unmixing(&self) -> Option<[[f32; 3]; 3]> {
        self.mixing().filter(|_| self.unmixed)?.inverse()
    }

    /// Whether photographs mean another light than `capture.toml` alone says.
    #[must_use]
    pub fn change_light(&self, settings: &Settings) -> bool {
        self.unmixed || self.camera != settings.camera.reading().response
    }

    /// What there is to know, a sentence a line, for people.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let mut words = Vec::new();
        words.extend(self.camera_fit.as_ref().map(CameraFit::words));
        words.extend(self.projector_words());
        if let Some(ramp) = &self.ramp {
            words.extend(ramp.complaints());
        }
        if let Some(mixing) = self.mixing() {
            let share = 100.0 * mixing.largest();
            words.push(if self.unmixed {
                format!(
                    "the camera sees up to {share:.1} % of a projector colour in another: undone, \
                     so that the table's colours are the projector's"
                )
            } else {
                format!("the camera sees at most {share:.1} % of a projector colour in another")
            });
        }
        if let Some(probe) = self.probe {
            words.push(if probe.blur > 0.0 {
                format!(
                    "the projector blurs by {:.2} of a cell (standard deviation)",
                    probe.blur
                )
            } else {
                "the projector is in focus: less blur than a tenth of a cell".to_owned()
            });
        }
        words.extend(self.uncalibrated());
        words
    }

    /// How many calibration photographs are missing, for people; `None` if none is.
    #[must_use]
    pub fn uncalibrated(&self) -> Option<String> {
        let (listed, taken) = self.calibration;
        (taken < listed).then(|| {
            format!(
                "{} of {listed} calibration photographs are missing: the devices are measured from \
                 the others, or taken as declared; `iltm capture` goes on where it stopped",
                listed - taken
            )
        })
    }

    fn projector_words(&self) -> Option<String> {
        if let Some(response) = self.by_images {
            let response = DeviceResponse::from(response);
            return Some(format!(
                "nothing states the projector's response: the images fit {response} best"
            ));
        }
        let measured = self.ramp.as_ref()?.response.as_ref()?;
        let channels: Vec<String> = measured
            .channels()
            .iter()
            .map(ToString::to_string)
            .collect();
        let measured = channels.join("; ");
        Some(
            match (self.declared_projector.known(), self.projector_steps()) {
                (Some(declared), Some(steps)) => format!(
                    "the projector's response is declared as {} and {measured}: {steps:.1} steps of \
                 255 apart at most",
                    DeviceResponse::from(declared)
                ),
                _ => format!("the projector's response is {measured}"),
            },
        )
    }
}

/// The devices, and what measures the projector's blur once cells are found.
pub(crate) struct MeasuredDevices {
    pub(crate) devices: Devices,
    probe: Option<ProbeLight>,
}

impl MeasuredDevices {
    /// Measures the devices; afterwards the photographs are in the light that they
    /// say: of the measured camera response where that is asked for, and of the
    /// projector's channels where the camera mixes them, as `unmixing` says.
    ///
    /// # Errors
    /// [`CaptureError::ResponseUnknown`] if a response shall be measured and the
    /// photographs do not tell it; a photograph's own error.
    pub(crate) fn measure(
        folder: &Path,
        sequence: &Sequence,
        (settings, unmixing): (&Settings, Unmixing<'_>),
        linear: &mut LinearPhotographs<'_>,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        let unknown = |device| CaptureError::ResponseUnknown {
            path: folder.join(SETTINGS_FILE),
            device,
        };
        let mut devices = Devices::declared(settings);
        devices.camera_fit = samples::fit(sequence, linear)?;
        if settings.camera.response == Declared::Measure {
            let fit = devices.camera_fit.take().filter(CameraFit::tells);
            let fit = fit.ok_or_else(|| unknown("camera"))?.adopted();
            devices.camera = fit.best.clone();
            linear.read_again(sequence, fit.best.clone(), progress)?;
            devices.camera_fit = Some(fit);
        }
        let photos = CalibrationPhotos::read(folder, sequence, linear, progress)?;
        devices.calibration = (photos.listed, photos.found);
        devices.ramp = Ramp::new(photos.ramp);
        let measured = devices.ramp.as_ref().and_then(|ramp| ramp.response.clone());
        if devices.declared_projector.known().is_none() {
            match measured {
                Some(measured) => devices.projector = measured,
                None if devices.declared_projector == Declared::Measure => {
                    return Err(unknown("projector"));
                }
                None => {}
            }
        }
        let mixing = match unmixing {
            Unmixing::Measured => devices.mixing(),
            Unmixing::As(mixing) => mixing,
        };
        if let Some(inverse) = mixing.and_then(ColourMixingMatrix::inverse) {
            linear.unmix(inverse, sequence, progress)?;
            devices.unmixed = true;
        }
        let probe = photos.probe;
        Ok(Self { devices, probe })
    }

    /// Whether nothing tells the projector's response.
    pub(crate) fn projector_unknown(&self) -> bool {
        let measured = self
            .devices
            .ramp
            .as_ref()
            .and_then(|ramp| ramp.response.as_ref());
        self.devices.declared_projector == Declared::Unsaid && measured.is_none()
    }

    /// Takes the projector's response that images tell.
    pub(crate) fn take_response(&mut self, response: Response) {
        self.devices.projector = response.into();
        self.devices.by_images = Some(response);
    }

    /// The devices with the projector's blur as the probe says, unless it is `declared`.
    /// `flood` is the flood photograph, black subtracted.
    pub(crate) fn with_blur(
        self,
        grid: Grid,
        registration: &Registration,
        flood: &[Vec<f32>],
        declared: Option<f64>,
    ) -> Devices {
        let Self { mut devices, probe } = self;
        if let Some((light, lit)) = probe {
            let flood = channel_sum(flood);
            devices.probe = Probe::measure(grid, &lit, registration, &light, &flood);
            if let (None, Some(probe)) = (declared, devices.probe) {
                devices.blur = probe.blur;
            }
        }
        devices
    }
}
