//! What is known of projector and camera, declared or measured.

use crate::capture::{DeviceResponse, ProjectorResponse, Response, Settings};

/// Projector and camera of a capture.
#[derive(Clone, PartialEq, Debug)]
pub struct Devices {
    /// The camera's response that the photographs were read with.
    pub camera: DeviceResponse,
    /// The projector's response that a table is made for.
    pub projector: ProjectorResponse,
    /// Standard deviation of the projector's blur on the scene, in cells, that a
    /// solve reckons with; 0 for none.
    pub blur: f64,
}

impl Devices {
    /// What `capture.toml` declares, and its defaults.
    #[must_use]
    pub fn declared(settings: &Settings) -> Self {
        let projector = settings.projector.response.known();
        Self {
            camera: settings.camera.reading().response,
            projector: projector.unwrap_or(Response::Srgb).into(),
            blur: settings.projector.blur.unwrap_or(0.0),
        }
    }
}
