//! Provenance: where a table comes from, as the TOML text that it carries.

use crate::brightness::Brightness;
use crate::reference_white::ReferenceWhite;
use crate::viewer_error::ViewerError;
use iltm_capture::{Measurements, Settings};
use iltm_picture::{FramePart, PictureError};
use iltm_runtime::Grid;
use iltm_runtime::image::Label;
use iltm_solve::{Compensation, Recovery, SolveReport};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};
use std::ffi::OsString;
use std::path::Path;

/// What a table says about where it comes from.
///
/// Each part that another version of the program may have written otherwise is read for
/// itself: one that cannot be read is `None`, and so is one that is not there.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Provenance {
    /// The program and its version.
    pub made_by: String,
    /// Name of the scene.
    pub scene: String,
    /// When it was made, UTC.
    pub date: String,
    /// Name of the [`Method`](iltm_solve::Method); empty if unsaid.
    pub method: String,
    /// Photographs that it was made from.
    #[serde(deserialize_with = "if_readable")]
    pub photographs: Option<Photographs>,
    /// Cells that took part in the solve.
    pub live_cells: usize,
    /// Weight of the l1 term.
    pub lambda: f64,
    /// Largest over smallest singular value of the forward transport.
    pub condition: f64,
    /// Whether light that is there without the projector was left as it is.
    #[serde(skip_serializing_if = "is_false")]
    pub ambient_kept: bool,
    /// Whether it is for several projectors whose pictures overlap: two places of its frame are one
    /// place on the wall then.
    #[serde(skip_serializing_if = "is_false")]
    pub overlapping: bool,
    /// Rows and columns of cells of the frame of each projector, from left to right, if it was made from
    /// a capture of each.
    #[serde(
        deserialize_with = "if_readable",
        skip_serializing_if = "Option::is_none"
    )]
    pub frames: Option<Vec<[u16; 2]>>,
    /// Names of the gates that failed and were ignored.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ignored_gates: Vec<String>,
    /// Name of the [`Compensation`](iltm_solve::Compensation).
    pub compensation: String,
    /// What a viewer is predicted to see.
    #[serde(deserialize_with = "if_readable")]
    pub predicted_error: Option<PredictedError>,
    /// Constants of the theorem about the paper's method.
    #[serde(
        deserialize_with = "if_readable",
        skip_serializing_if = "Option::is_none"
    )]
    pub recovery: Option<Recovery>,
    /// The mixing of projector channels in the camera's that the photographs were freed
    /// of, `[camera][projector]`. Before the tables, as TOML wants it.
    #[serde(
        deserialize_with = "if_readable",
        skip_serializing_if = "Option::is_none"
    )]
    pub mixing: Option<[[f64; 3]; 3]>,
    /// The reference white.
    #[serde(deserialize_with = "if_readable")]
    pub white: Option<ReferenceWhite>,
    /// How bright its white is against the scene without it.
    #[serde(
        deserialize_with = "if_readable",
        skip_serializing_if = "Option::is_none"
    )]
    pub brightness: Option<Brightness>,
    /// The `capture.toml` that it was made with.
    #[serde(deserialize_with = "if_readable")]
    pub capture: Option<Settings>,
    /// How it was refined since, the first time first.
    #[serde(
        deserialize_with = "readable_ones",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub refined: Vec<Refinement>,
}

/// A round in which photographs of compensated images were fed back into a table.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Refinement {
    /// When, UTC.
    pub date: String,
    /// Photographs that were fed back.
    pub photographs: usize,
    /// What a viewer saw of the images: relative error at camera pixels, without noise.
    pub before: f64,
    /// The same afterwards, as photographs that a step was not made from have it.
    pub after: f64,
}

/// Photographs by what they show.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Photographs {
    /// Flood photographs.
    pub white: usize,
    /// Gray code, both signs.
    pub gray_code: usize,
    /// Bernoulli patterns.
    pub bernoulli: usize,
    /// Images; left out where there are none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub images: usize,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
const fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Errors that a viewer is predicted to see of natural images, relative to the wanted light, pixel
/// by pixel; by cells where pixels tell nothing.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PredictedError {
    /// With the picture as it is.
    pub uncompensated: f64,
    /// With gain alone.
    pub gain_only: f64,
    /// With the operator.
    pub compensated: f64,
    /// The table's error by cells, as held-out photographs predict it: what a verification by cells
    /// may expect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_cells: Option<f64>,
    /// The table's error in other people's figures; `None` where pixels tell nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub figures: Option<PictureError>,
}

impl PredictedError {
    pub(crate) fn new(report: &SolveReport, viewer: Option<ViewerError>) -> Self {
        let cells = report.prediction;
        let by_cells = Some(report.predicted_error());
        let Some(viewer) = viewer else {
            return Self {
                uncompensated: cells.uncompensated,
                gain_only: cells.gain_only,
                compensated: cells.compensated,
                by_cells,
                figures: None,
            };
        };
        Self {
            uncompensated: viewer.uncompensated.relative,
            gain_only: viewer.gain_only.relative,
            compensated: viewer.compensated.relative,
            by_cells,
            figures: Some(match report.compensation {
                Compensation::Operator => viewer.compensated,
                Compensation::GainOnly => viewer.gain_only,
                Compensation::Nothing => viewer.uncompensated,
            }),
        }
    }

    /// Error of one way to project.
    #[must_use]
    pub const fn of(&self, compensation: Compensation) -> f64 {
        match compensation {
            Compensation::Operator => self.compensated,
            Compensation::GainOnly => self.gain_only,
            Compensation::Nothing => self.uncompensated,
        }
    }
}

impl Provenance {
    /// That of a table made from these photographs in the folder `capture`.
    pub(crate) fn new(
        capture: &Path,
        measurements: &Measurements,
        report: &SolveReport,
        predicted: PredictedError,
        white: &ReferenceWhite,
    ) -> Self {
        let folder = || {
            let name = capture.canonicalize().ok();
            let name = name.as_deref().and_then(Path::file_name);
            name.map_or_else(String::new, |name| name.to_string_lossy().into_owned())
        };
        let scene = measurements.settings.scene.name.clone();
        let failed = measurements.diagnostics.gates.iter();
        let failed = failed.filter(|gate| gate.fails());
        let mixing = measurements.devices.mixing().map(|mixing| mixing.matrix);
        Self {
            made_by: concat!("iltm ", env!("CARGO_PKG_VERSION")).to_owned(),
            scene: scene.unwrap_or_else(folder),
            date: Self::now(),
            method: report.method.to_string(),
            photographs: Some(Photographs {
                white: report.photographs.white,
                gray_code: report.photographs.gray_code,
                bernoulli: report.photographs.bernoulli,
                images: report.photographs.images,
            }),
            live_cells: report.live_cells,
            ambient_kept: false,
            overlapping: false,
            frames: None,
            lambda: report.lambda,
            condition: report.condition,
            ignored_gates: failed.map(|gate| gate.name.to_string()).collect(),
            compensation: report.compensation.to_string(),
            predicted_error: Some(predicted),
            recovery: report.recovery,
            mixing: mixing.filter(|_| measurements.devices.unmixed),
            white: Some(*white),
            brightness: Brightness::of(measurements, white.light),
            capture: Some(measurements.settings.clone()),
            refined: Vec::new(),
        }
    }

    /// The part of each projector in a wide frame of these cells, if the table is for such a frame and
    /// says it.
    #[must_use]
    pub fn parts(&self, wide: Grid) -> Option<Vec<FramePart>> {
        let frames = self.frames.iter().flatten();
        let parts = FramePart::side_by_side(frames.map(|frame| frame.map(usize::from)));
        (FramePart::grid(&parts) == Some(wide)).then_some(parts)
    }

    /// Reads a table's text; nothing of a text that says nothing.
    #[must_use]
    pub fn read(text: &str) -> Self {
        toml::from_str(text).unwrap_or_default()
    }

    /// The second that `SOURCE_DATE_EPOCH` is, for who makes a table twice and wants the same bytes
    /// (<https://reproducible-builds.org/specs/source-date-epoch/>); `None` if it is not set.
    ///
    /// # Errors
    /// What it is, if that is no second.
    pub fn given_date() -> Result<Option<chrono::DateTime<chrono::Utc>>, OsString> {
        let Some(given) = std::env::var_os("SOURCE_DATE_EPOCH") else {
            return Ok(None);
        };
        let seconds = given.to_str().and_then(|text| text.parse().ok());
        let time = seconds.and_then(|seconds| chrono::DateTime::from_timestamp(seconds, 0));
        time.map(Some).ok_or(given)
    }

    /// Now, or [the date that is given](Self::given_date), as a table says it.
    pub(crate) fn now() -> String {
        let given = Self::given_date().ok().flatten();
        let time = given.unwrap_or_else(chrono::Utc::now);
        time.format("%Y-%m-%d %H:%M:%S UTC").to_string()
    }

    /// What people call the table: its scene, and the day when it was made.
    pub(crate) fn label(&self) -> Label {
        let scene: String = self.scene.split(char::is_control).collect();
        let day = self.date.get(..10).unwrap_or_default().replace('-', "");
        Label::new(&scene, day.parse().unwrap_or(0))
    }

    /// The text for a table.
    pub(crate) fn to_text(&self) -> String {
        // A struct of numbers and strings always has a TOML form.
        toml::to_string(self).unwrap_or_default()
    }
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
const fn is_false(value: &bool) -> bool {
    !*value
}

fn if_readable<'de, T: DeserializeOwned, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    Ok(toml::Value::deserialize(from)?.try_into().ok())
}

fn readable_ones<'de, T: DeserializeOwned, D: Deserializer<'de>>(
    from: D,
) -> Result<Vec<T>, D::Error> {
    Ok(if_readable(from)?.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_called_after_its_scene_and_the_day_when_it_was_made() {
        let provenance = Provenance {
            scene: "Großer\u{1b} Saal".to_owned(),
            date: "2026-11-23 10:30:00 UTC".to_owned(),
            ..Provenance::default()
        };
        let label = provenance.label();
        assert_eq!((label.name(), label.date()), ("Großer Saal", 20_261_123));
        assert_eq!(Provenance::default().label(), Label::default());
    }

    #[test]
    fn bounds_of_the_recovery_theorem_survive_and_what_cannot_be_read_is_left_out() {
        let recovery = Recovery {
            k: 3,
            photographs: 30,
            kappa_at_least: 1.5,
            kappa_at_most: f64::INFINITY,
            gamma_at_least: 1.2,
            gamma_at_most: 7.0,
            gamma_as_shown_at_least: 4.0,
            product_at_least: 2.7,
            product_at_most: f64::INFINITY,
            ratio_at_least: 3.1,
            coherence: 0.4,
            k_may_hold: 2,
            k_holds: 1,
            supports: 100,
        };
        let provenance = Provenance {
            method: "direct".to_owned(),
            recovery: Some(recovery),
            capture: Some(Settings::default()),
            ..Provenance::default()
        };
        let text = provenance.to_text();
        assert_eq!(Provenance::read(&text), provenance);
        let newer = format!("{text}\n[capture.lens]\nfocus = 1\n");
        let read = Provenance::read(&newer);
        assert_eq!((read.recovery, read.capture), (Some(recovery), None));
        assert_eq!(Provenance::read("method = \"joint\"").recovery, None);
    }
}
