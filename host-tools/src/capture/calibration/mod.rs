//! Photographs that measure the devices rather than the scene: `calibration.csv`.
//!
//! A ramp of even light in each channel tells how projector and camera respond; a
//! few lit cells far apart tell how the projector blurs. A capture may do without:
//! then the devices are what `capture.toml` says.

mod role;

pub use role::{CALIBRATION_FILE, CalibrationRole, RampChannel};

use super::manifest::{ManifestOf, ShotOf};

/// All lines of a `calibration.csv`, ordered by index.
pub type CalibrationManifest = ManifestOf<CalibrationRole>;

/// One line of `calibration.csv`.
pub type CalibrationShot = ShotOf<CalibrationRole>;
