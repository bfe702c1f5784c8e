//! Photographs that measure the devices rather than the scene: `calibration.csv`.
//!
//! | what | from | file |
//! |---|---|---|
//! | which pictures | `calibration.csv` | [`role`] |
//! | their light | photographs, as far as taken | `taken` |
//! | the camera's response | pairs or brackets that must add up | [`camera`], `balance` |
//! | the projector's response | the ramp | [`ramp`] |
//! | camera channels by projector channels | the ramp's full levels | [`mixing`] |
//! | the projector's blur | the probe | [`probe`] |
//! | all of it | | [`devices`] |
//!
//! A ramp of even light in each channel tells how projector and camera respond; a
//! few lit cells far apart tell how the projector blurs. A capture may do without:
//! then the devices are what `capture.toml` says.

mod balance;
pub mod camera;
pub mod devices;
pub mod mixing;
pub mod probe;
pub mod ramp;
pub mod role;
pub(super) mod samples;
pub(super) mod taken;

pub use camera::{CameraFit, CameraSource};
pub use devices::Devices;
pub use mixing::Mixing;
pub(super) use mixing::Unmix;
pub use probe::Probe;
pub use ramp::{Fall, Ramp, RampPoint};
pub use role::{CALIBRATION_FILE, CalibrationRole, RampChannel};

use super::manifest::{ManifestOf, ShotOf};

/// All lines of a `calibration.csv`, ordered by index.
pub type CalibrationManifest = ManifestOf<CalibrationRole>;

/// One line of `calibration.csv`.
pub type CalibrationShot = ShotOf<CalibrationRole>;
