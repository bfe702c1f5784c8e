//! The whole job on photographs: capture to table.

use crate::capture::{self, CaptureError, CaptureOptions, FineFlood, Measurements};
use crate::compile::{self, CompileError, CompileOptions, Compiled};
use crate::progress::Progress;
use crate::solve::{self, InverseTransport, SolveError, SolveOptions, SolveReport};
use serde::Serialize;
use std::path::Path;
use thiserror::Error;

/// Everything that was learned of a scene.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The registered photographs.
    pub measurements: Measurements,
    /// The inverse light transport.
    pub inverse: InverseTransport,
    /// How the inverse came about.
    pub report: SolveReport,
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
    /// By the photographs held out of the solve, the table would do harm.
    #[error(
        "the table would make the picture worse: predicted error {compensated:.4}, {other:.4} with {instead}"
    )]
    Worse {
        /// Predicted error with the table.
        compensated: f64,
        /// Predicted error of what is better.
        other: f64,
        /// What is better.
        instead: &'static str,
    },
}

/// Reads a capture, solves it and compiles the table.
///
/// # Errors
/// [`LearnError`] by the step that failed; also if photographs that the solve had
/// not seen say that the table would be worse than none or than gain alone.
pub fn learn(
    capture: &Path,
    photographs: &CaptureOptions,
    options: &SolveOptions,
    reference_white: Option<f64>,
    progress: &dyn Progress,
) -> Result<Learned, LearnError> {
    let measurements = capture::read(capture, photographs, progress)?;
    let (inverse, report) = solve::solve(&measurements, options, progress)?;
    if let Some(prediction) = report.prediction {
        let compensated = prediction.compensated;
        for (other, instead) in [
            (prediction.uncompensated, "no compensation"),
            (prediction.gain_only, "gain alone"),
        ] {
            if compensated > other {
                return Err(LearnError::Worse {
                    compensated,
                    other,
                    instead,
                });
            }
        }
    }
    progress.begin("compiling the table", 0);
    let fine = compile::gain::fine_gains(&inverse, &FineFlood::new(&measurements));
    let options = CompileOptions {
        projector: measurements.settings.projector.response,
        reference_white,
        inverse_error: report.prediction.map_or(0.0, |p| p.compensated),
        provenance: provenance(capture, &measurements, &report),
        targets: None,
    };
    let compiled = compile::compile(&inverse, fine.as_ref(), &options)?;
    progress.end();
    Ok(Learned {
        measurements,
        inverse,
        report,
        compiled,
    })
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
    #[serde(skip_serializing_if = "Option::is_none")]
    predicted_error: Option<PredictedError>,
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

fn provenance(capture: &Path, measurements: &Measurements, report: &SolveReport) -> String {
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
        predicted_error: report.prediction.map(|prediction| PredictedError {
            uncompensated: prediction.uncompensated,
            gain_only: prediction.gain_only,
            compensated: prediction.compensated,
        }),
    };
    // A struct of numbers and strings always has a TOML form.
    toml::to_string(&provenance).unwrap_or_default()
}
