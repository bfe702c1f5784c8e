//! Building a table: the whole job on photographs, from a capture to a checked image.

use crate::provenance::{PredictedError, Provenance};
use crate::reference_white::{ReferenceWhite, WhiteRequest};
use crate::{CompileError, CompileOptions, Compiled, ViewerError};
use iltm_capture::{CaptureError, CaptureOptions, FineFlood, Measurements};
use iltm_picture::progress::Progress;
use iltm_solve::{Compensation, InverseTransport, SolveError, SolveOptions, SolveReport, Solved};
use std::path::Path;
use thiserror::Error;

/// A table with everything that it was made from.
#[derive(Clone, Debug)]
pub struct BuiltTable {
    /// The registered photographs.
    pub measurements: Measurements,
    /// The inverse light transport that the table has: without an operator if
    /// [`SolveReport::compensation`] says so.
    pub inverse: InverseTransport,
    /// How the inverse came about.
    pub report: SolveReport,
    /// What a viewer is predicted to see.
    pub predicted: PredictedError,
    /// The reference white, and why it is that.
    pub white: ReferenceWhite,
    /// The table.
    pub compiled: Compiled,
}

impl BuiltTable {
    /// Predicted error of the way to project that the table has.
    #[must_use]
    pub fn predicted_error(&self) -> f64 {
        self.predicted.of(self.report.compensation)
    }
}

/// Why a capture did not become a table.
#[derive(Debug, Error)]
pub enum BuildError {
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
/// [`BuildError`] by the step that failed; also if photographs that the solve had
/// not seen say that any table would be worse than none.
pub fn build_table(
    capture: &Path,
    photographs: &CaptureOptions,
    options: &SolveOptions,
    white: Option<WhiteRequest<'_>>,
    progress: &dyn Progress,
) -> Result<BuiltTable, BuildError> {
    let measurements = iltm_capture::read(capture, photographs, progress)?;
    build_table_from(measurements, capture, options, white, progress)
}

/// The same from photographs that have been read before; `capture` is where.
///
/// # Errors
/// Those of [`build_table`], but for [`BuildError::Capture`].
pub fn build_table_from(
    measurements: Measurements,
    capture: &Path,
    options: &SolveOptions,
    white: Option<WhiteRequest<'_>>,
    progress: &dyn Progress,
) -> Result<BuiltTable, BuildError> {
    let Solved {
        inverse,
        report,
        trials,
    } = iltm_solve::solve(&measurements, options, progress)?;
    if report.compensation == Compensation::Nothing {
        return Err(BuildError::Worse {
            uncompensated: report.prediction.uncompensated,
            gain_only: report.prediction.gain_only,
            compensated: report.prediction.compensated,
        });
    }
    progress.begin("predicting what a viewer sees", 0);
    let flood = FineFlood::new(&measurements);
    let gain_only = iltm_solve::gain_only(&(&measurements).into(), &report)?;
    let viewer = ViewerError::predict(&measurements, &trials, &gain_only, &flood);
    let predicted = PredictedError::new(&report, viewer);
    progress.end();
    let inverse = match report.compensation {
        Compensation::GainOnly => gain_only,
        Compensation::Operator | Compensation::Nothing => inverse,
    };
    progress.begin("compiling the table", 0);
    let fine = crate::gain::fine_gains(&inverse, &flood);
    let white = ReferenceWhite::new(&inverse, fine.as_ref(), white)?;
    let provenance = Provenance::new(capture, &measurements, &report, predicted, &white);
    let options = CompileOptions {
        label: provenance.label(),
        projector: measurements.devices.projector.clone(),
        pixels: measurements.settings.projector.pixels(),
        reference_white: Some(white.light),
        inverse_error: predicted.of(report.compensation),
        provenance: provenance.to_text(),
        targets: None,
    };
    let compiled = crate::compile(&inverse, fine.as_ref(), &options)?;
    progress.end();
    Ok(BuiltTable {
        measurements,
        inverse,
        report,
        predicted,
        white,
        compiled,
    })
}
