//! From a folder of photographs to [`Measurements`], in phases that each return evidence.
//!
//! | phase | what it finds out |
//! |---|---|
//! | `format` | which picture each photograph shows, checked against roles and each other |
//! | `photographs` | linear light, what white clips, which patterns the photographs show |
//! | `devices` | responses, colour mixing and blur of projector and camera |
//! | `registration` | which camera pixels belong to which cell, and whether anything moved |
//! | `cells` | one observation a cell and pattern, noise, drift, whether light adds up |
//! | `gates` | judge what the phases found; they measure nothing |
//!
//! `evidence` calls them in this order. [`LinearPhotograph`] is one photograph to look at,
//! [`remeasure`] the cells in pictures that are no patterns.
//!
//! A capture may come from a stranger: paths stay inside the folder, sizes are
//! checked before memory is taken, and whatever is wrong is a [`CaptureError`]
//! with its place.

// Test captures are shared with the tests outside of the crate, by its name.
#[cfg(test)]
extern crate self as iltm_capture;

mod blending;
mod camera_places;
mod cells;
mod crossing_light;
mod devices;
mod evidence;
mod format;
mod gate;
#[cfg(test)]
mod gate_tests;
mod gates;
mod linear_photograph;
mod photographs;
mod poses;
#[cfg(test)]
mod refusal_tests;
mod registration;
mod remeasure;
mod several;
#[cfg(test)]
mod test_capture;
#[cfg(test)]
mod tests;
mod wide_frame;

pub use camera_places::{CameraPlaces, camera_places};
pub use cells::cell_pixels::{LeftOut, Why};
pub use cells::even_light::{EvenChannel, EvenLight};
pub use cells::fine_flood::{EvenFlood, FineFlood};
pub use cells::measurements::{ChannelMeasurements, Diagnostics, Measurements};
pub use cells::noise::{NoiseModel, NoiseSource};
pub use cells::nonlinearity::Nonlinearity;
pub use cells::pixel_light::PixelLight;
pub use cells::pixel_views::{PixelView, PixelViews};
pub use crossing_light::{CrossingLight, ProjectorAreas};
pub use devices::{
    CameraFit, CameraSource, ColourMixingMatrix, Devices, Fall, Probe, Ramp, RampPoint,
};
pub use evidence::WhitePhotograph;
pub use format::calibration_role::{
    CalibrationManifest, CalibrationRole, CalibrationShot, RampChannel,
};
pub use format::code::Code;
pub use format::error::CaptureError;
pub use format::manifest::{
    CALIBRATION_FILE, ListedRole, MANIFEST_FILE, Manifest, ManifestOf, RoleName, Shot, ShotOf,
    VERIFY_FILE, listed, numbered, projector_file, projector_stripes_file,
};
pub use format::pattern::Pattern;
pub use format::pattern_set::{columns, pattern_set};
pub use format::photo_files::{find_photo, pictures_of_stem};
pub use format::picture_file::FileFormat;
pub use format::reference::{REFERENCE_FILE, ReferenceError, parse_reference, read_reference};
pub use format::role::{CodeAxis, Role};
pub use format::sequence::{CaptureOptions, MIN_BERNOULLI};
pub use format::settings::{
    CameraSettings, ProjectorSettings, SETTINGS_FILE, SceneSettings, Settings,
};
pub use format::still::read_still;
pub use format::stripe_role::{STRIPES_FILE, StripeManifest, StripeRole, StripeShot, WAVE};
pub use gate::{Evidence, Gate, GateName, Verdict};
pub use linear_photograph::LinearPhotograph;
pub use photographs::grey_view::grey_view;
pub use photographs::photo_stats::PhotoStats;
pub use poses::{JoinedPoses, PoseError, PosePhotographs, join_poses};
pub use registration::cell_map::{NO_CELL, Registration};
pub use registration::correspondence::{Correspondence, PictureShift};
pub use registration::map_file::{MapFormat, exr};
pub use registration::projector_map::{MapError, MapSource, ProjectorMap};
pub use registration::{MIN_REGRESSION, PixelCount, RegistrationMethod};
pub use remeasure::{
    CellPlanes, CellReadings, PixelReadings, Remeasured, RemeasuredSeveral, remeasure,
    remeasure_several,
};
pub use several::{ExaminedSeveral, OneOfSeveral, SeveralCaptures, examine_several, read_several};

use cells::drift::Drift;
use cells::images;
use devices::Unmixing;
use evidence::CaptureEvidence;
use format::sequence::{Selection, Sequence};
use iltm_picture::progress::Progress;
use photographs::linearise::LinearPhotographs;
use std::path::Path;

/// What the gates say of a capture, and what was measured in it.
#[derive(Clone, Debug)]
pub struct Examined {
    /// All gates that could be judged, what explains others first.
    pub gates: Vec<Gate>,
    /// The photograph of white; `None` if the photographs could not be compared.
    pub white: Option<WhitePhotograph>,
    /// What was measured; `None` if the photographs do not allow it.
    pub measurements: Option<Measurements>,
}

/// Reads a capture folder and measures every cell under every pattern.
///
/// # Errors
/// A [`CaptureError`] for whatever is missing, contradictory or unusable;
/// [`CaptureError::Refused`] if gates fail that `options` do not ignore.
pub fn read(
    folder: &Path,
    options: &CaptureOptions,
    progress: &dyn Progress,
) -> Result<Measurements, CaptureError> {
    let (mut measurements, (sequence, mut linear, drift)) =
        read_keeping(folder, options, Unmixing::Measured, progress)?;
    let shown = (&sequence, &mut linear, &drift);
    measurements.even = EvenLight::add_up(&measurements, shown, progress)?;
    Ok(measurements)
}

/// What was shown, its photographs, and how their light changed.
type Kept<'f> = (Sequence, LinearPhotographs<'f>, Drift);

/// The same, with what was shown and its photographs, for those who go on with them.
pub(crate) fn read_keeping<'f>(
    folder: &'f Path,
    options: &CaptureOptions,
    unmixing: Unmixing<'_>,
    progress: &dyn Progress,
) -> Result<(Measurements, Kept<'f>), CaptureError> {
    let (examined, kept) = examine_keeping(folder, options, unmixing, progress)?;
    let failed = examined.gates.iter().filter(|gate| options.refuses(gate));
    let failed: Vec<Gate> = failed.cloned().collect();
    match (examined.measurements, kept) {
        (Some(mut measurements), Some(kept)) if failed.is_empty() => {
            measurements.diagnostics.gates = examined.gates;
            Ok((measurements, kept))
        }
        // Without cells there is nothing to go on with, whatever is ignored.
        _ => Err(CaptureError::Refused {
            path: folder.to_owned(),
            gates: if failed.is_empty() {
                let failed = examined.gates.into_iter().filter(Gate::fails);
                failed.collect()
            } else {
                failed
            },
        }),
    }
}

/// Looks at a capture as closely as [`read`] and says what every gate says of it.
///
/// # Errors
/// A [`CaptureError`] for what is not a well-formed capture. Files are looked at in
/// this order: `capture.csv`, `capture.toml`, patterns, photographs.
pub fn examine(
    folder: &Path,
    options: &CaptureOptions,
    progress: &dyn Progress,
) -> Result<Examined, CaptureError> {
    Ok(examine_keeping(folder, options, Unmixing::Measured, progress)?.0)
}

fn examine_keeping<'f>(
    folder: &'f Path,
    options: &CaptureOptions,
    unmixing: Unmixing<'_>,
    progress: &dyn Progress,
) -> Result<(Examined, Option<Kept<'f>>), CaptureError> {
    let manifest = Manifest::read(folder)?;
    let settings = Settings::read(folder)?;
    let mut selection = Selection::new(folder, &manifest.shots, options)?;
    let files = selection.find_photographs(folder)?;
    let mut examined = Examined {
        gates: vec![gates::files::judge(&files)],
        white: None,
        measurements: None,
    };
    // What is there says more, if it is enough to go on with.
    let sequence = match Sequence::read(folder, selection) {
        Err(_) if examined.gates[0].fails() => return Ok((examined, None)),
        sequence => sequence?,
    };
    let (mut cause, mut kept) = (None, None);
    match CaptureEvidence::collect(folder, &sequence, (&settings, unmixing), progress) {
        Err(error @ CaptureError::Unlike { .. }) => {
            examined.gates.push(gates::files::refuse_format(&error));
        }
        found => {
            let (mut found, linear) = found?;
            let cells = found.cells.as_ref();
            let drift = cells.map(|cells| cells.steadiness.drift.clone());
            kept = Some((linear, drift.unwrap_or_default()));
            cause = cells.and_then(|cells| cells.nonlinearity);
            examined.gates.extend(gates::judge(&sequence, &found));
            examined.white = Some(found.white.clone());
            let of_patterns = found.order.take();
            examined.measurements = found.into_measurements(folder, &sequence, &settings)?;
            let of_images = examined.measurements.as_ref().and_then(images::order);
            let order = (examined.gates.iter_mut()).find(|gate| gate.name == GateName::Order);
            if let (Some(gate), Some(of_images)) = (order, of_images) {
                *gate = gates::order::judge_all(&sequence, of_patterns, of_images);
            }
        }
    }
    gates::settle(&mut examined.gates, cause);
    if let Some(measurements) = &mut examined.measurements {
        let bernoulli = manifest
            .shots
            .iter()
            .filter(|shot| shot.role == Role::Bernoulli);
        measurements.diagnostics.bernoulli_taken = bernoulli.count();
    }
    let kept = kept.map(|(linear, drift)| (sequence, linear, drift));
    Ok((examined, kept))
}
