//! What is known of projector and camera, declared or measured.

use super::{CameraFit, Mixing, Probe, Ramp, Unmix};
use crate::Settings;
use iltm_picture::{Declared, DeviceResponse, ProjectorResponse, Response};

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
            ramp: None,
            unmixed: false,
            blur: settings.projector.blur.unwrap_or(0.0),
            probe: None,
            calibration: (0, 0),
        }
    }

    /// Takes what the ramp says where nothing is declared.
    pub(crate) fn take_ramp(&mut self, ramp: Option<Ramp>) {
        let measured = ramp.as_ref().and_then(|ramp| ramp.response.clone());
        if let (None, Some(measured)) = (self.declared_projector.known(), measured) {
            self.projector = measured;
        }
        self.ramp = ramp;
    }

    /// Takes what the probe says where nothing is declared.
    pub(crate) fn take_probe(&mut self, probe: Option<Probe>, declared: Option<f64>) {
        if let (None, Some(probe)) = (declared, probe) {
            self.blur = probe.blur;
        }
        self.probe = probe;
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

    /// The mixing of the projector's channels in the camera's.
    #[must_use]
    pub fn mixing(&self) -> Option<&Mixing> {
        self.ramp.as_ref()?.mixing.as_ref()
    }

    /// What turns the camera's channels into the projector's, if photographs were
    /// turned so.
    pub(crate) fn unmix(&self) -> Option<Unmix> {
        self.mixing().filter(|_| self.unmixed)?.unmix()
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
        let (listed, taken) = self.calibration;
        if taken < listed {
            words.push(format!(
                "{taken} of {listed} calibration photographs were taken; the devices are measured \
                 from these, or taken as declared"
            ));
        }
        words
    }

    fn projector_words(&self) -> Option<String> {
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
