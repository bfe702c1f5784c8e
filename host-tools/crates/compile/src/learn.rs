//! The whole job on photographs: capture to table.

use crate::wish::{ChosenWhite, WhiteWish};
use crate::{CompileError, CompileOptions, Compiled};
use iltm_capture::{CaptureError, CaptureOptions, FineFlood, Measurements, Settings};
use iltm_picture::progress::Progress;
use iltm_solve::{Compensation, InverseTransport, Recovery, SolveError, SolveOptions, SolveReport};
use serde::{Deserialize, Serialize};
use std::path::Path;
use thiserror::Error;

/// Everything that was learned of a scene.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The registered photographs.
    pub measurements: Measurements,
    /// The inverse light transport that the table has: without an operator if
    /// [`SolveReport::compensation`] says so.
    pub inverse: InverseTransport,
    /// How the inverse came about.
    pub report: SolveReport,
    /// The reference white, and why it is that.
    pub white: ChosenWhite,
    /// The table.
    pub compiled: Compiled,
}

/// Why a capture did not become a table.
#[derive(Debug, Error)]
pub enum LearnError {
    /// The photographs cannot be used.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// No inverse was found.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The inverse cannot be stored.
    #[error(transparent)]
    Compile(#[from] CompileError),
    /// By the photographs held out of the solve, any table would do harm.
    #[error(
        "no table helps: photographs that the solve had not seen predict an error of {uncompensated:.4} with nothing, {gain_only:.4} with gain alone and {compensated:.4} with the operator"
    )]
    Worse {
        /// Predicted error of the picture as it is.
        uncompensated: f64,
        /// Predicted error with gain alone.
        gain_only: f64,
        /// Predicted error with the operator.
        compensated: f64,
    },
}

/// Reads a capture, solves it and compiles the table; one without an operator if
/// photographs that the solve had not seen do not show that the operator helps.
///
/// # Errors
/// [`LearnError`] by the step that failed; also if photographs that the solve had
/// not seen say that any table would be worse than none.
pub fn learn(
    capture: &Path,
    photographs: &CaptureOptions,
    options: &SolveOptions,
    white: Option<WhiteWish<'_>>,
    progress: &dyn Progress,
) -> Result<Learned, LearnError> {
    let measurements = iltm_capture::read(capture, photographs, progress)?;
    learn_measured(measurements, capture, options, white, progress)
}

/// The same from photographs that have been read before; `capture` is where.
///
/// # Errors
/// Those of [`learn`], but for [`LearnError::Capture`].
pub fn learn_measured(
    measurements: Measurements,
    capture: &Path,
    options: &SolveOptions,
    white: Option<WhiteWish<'_>>,
    progress: &dyn Progress,
) -> Result<Learned, LearnError> {
    let (inverse, report) = iltm_solve::solve(&measurements, options, progress)?;
    let inverse = match report.compensation {
        Compensation::Operator => inverse,
        Compensation::GainOnly => iltm_solve::gain_only(&(&measurements).into(), &report)?,
        Compensation::Nothing => {
            return Err(LearnError::Worse {
                uncompensated: report.prediction.uncompensated,
                gain_only: report.prediction.gain_only,
                compensated: report.prediction.compensated,
            });
        }
    };
    progress.begin("compiling the table", 0);
    let fine = crate::gain::fine_gains(&inverse, &FineFlood::new(&measurements));
    let white = ChosenWhite::new(&inverse, fine.as_ref(), white)?;
    let options = CompileOptions {
        projector: measurements.devices.projector.clone(),
        reference_white: Some(white.light),
        inverse_error: report.predicted_error(),
        provenance: provenance(capture, &measurements, &report, &white),
        targets: None,
    };
    let compiled = crate::compile(&inverse, fine.as_ref(), &options)?;
    progress.end();
    Ok(Learned {
        measurements,
        inverse,
        report,
        white,
        compiled,
    })
}

/// What a table's provenance says of the theorem's constants; `None` if the table is
/// older than that, or was not made from photographs.
#[must_use]
pub fn recovery_in(provenance: &str) -> Option<Recovery> {
    #[derive(Deserialize)]
    struct Stored {
        recovery: Recovery,
    }
    toml::from_str(provenance)
        .ok()
        .map(|stored: Stored| stored.recovery)
}

/// What a table's provenance says of its reference white; `None` if the table is older
/// than that, or was not made from photographs.
#[must_use]
pub fn white_in(provenance: &str) -> Option<ChosenWhite> {
    #[derive(Deserialize)]
    struct Stored {
        white: ChosenWhite,
    }
    let stored = toml::from_str(provenance).ok();
    stored.map(|stored: Stored| stored.white)
}

/// The `capture.toml` that a table was learned with, as its provenance has it; `None` if
/// the table is older than that, or was not made from photographs.
#[must_use]
pub fn settings_in(provenance: &str) -> Option<Settings> {
    #[derive(Deserialize)]
    struct Stored {
        capture: Settings,
    }
    let stored = toml::from_str(provenance).ok();
    stored.map(|stored: Stored| stored.capture)
}

/// The mixing of projector channels in the camera's that a table's photographs were freed
/// of, `[camera][projector]`; `None` if there was none.
#[must_use]
pub fn mixing_in(provenance: &str) -> Option<[[f64; 3]; 3]> {
    #[derive(Deserialize)]
    struct Stored {
        mixing: [[f64; 3]; 3],
    }
    let stored = toml::from_str(provenance).ok();
    stored.map(|stored: Stored| stored.mixing)
}

/// What a table says about where it comes from.
#[derive(Serialize)]
struct Provenance<'a> {
    made_by: &'a str,
    scene: String,
    date: String,
    method: &'a str,
    photographs: Photographs,
    live_cells: usize,
    lambda: f64,
    condition: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    ignored_gates: Vec<&'static str>,
    compensation: &'static str,
    predicted_error: PredictedError,
    #[serde(skip_serializing_if = "Option::is_none")]
    recovery: Option<Recovery>,
    /// Before the tables, as TOML wants it.
    #[serde(skip_serializing_if = "Option::is_none")]
    mixing: Option<[[f64; 3]; 3]>,
    white: &'a ChosenWhite,
    capture: &'a Settings,
}

#[derive(Serialize)]
struct Photographs {
    white: usize,
    gray_code: usize,
    bernoulli: usize,
}

#[derive(Serialize)]
struct PredictedError {
    uncompensated: f64,
    gain_only: f64,
    compensated: f64,
}

fn provenance(
    capture: &Path,
    measurements: &Measurements,
    report: &SolveReport,
    white: &ChosenWhite,
) -> String {
    let folder = || {
        let name = capture.canonicalize().ok();
        let name = name.as_deref().and_then(Path::file_name);
        name.map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    };
    let scene = measurements.settings.scene.name.clone();
    let provenance = Provenance {
        made_by: concat!("iltm ", env!("CARGO_PKG_VERSION")),
        scene: scene.unwrap_or_else(folder),
        date: jiff::Timestamp::now()
            .strftime("%Y-%m-%d %H:%M:%S UTC")
            .to_string(),
        method: report.method.name(),
        photographs: Photographs {
            white: report.photographs.white,
            gray_code: report.photographs.gray_code,
            bernoulli: report.photographs.bernoulli,
        },
        live_cells: report.live_cells,
        lambda: report.lambda,
        condition: report.condition,
        ignored_gates: (measurements.diagnostics.gates.iter())
            .filter(|gate| gate.fails())
            .map(|gate| gate.name.name())
            .collect(),
        compensation: report.compensation.name(),
        predicted_error: PredictedError {
            uncompensated: report.prediction.uncompensated,
            gain_only: report.prediction.gain_only,
            compensated: report.prediction.compensated,
        },
        recovery: report.recovery,
        mixing: (measurements.devices.unmixed)
            .then(|| measurements.devices.mixing().map(|mixing| mixing.matrix))
            .flatten(),
        white,
        capture: &measurements.settings,
    };
    // A struct of numbers and strings always has a TOML form.
    toml::to_string(&provenance).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_the_recovery_theorem_survive_the_tables_provenance() {
        #[derive(Serialize)]
        struct Provenance {
            method: &'static str,
            recovery: Recovery,
        }
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
            method: "direct",
            recovery,
        };
        let text = toml::to_string(&provenance).unwrap();
        assert_eq!(recovery_in(&text), Some(recovery));
        assert_eq!(recovery_in("method = \"joint\""), None);
    }
}
