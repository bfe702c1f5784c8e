//! Building a table: the whole job on photographs, from a capture to a checked image.

use crate::provenance::{PredictedError, Provenance};
use crate::reference_white::{ReferenceWhite, WhiteRequest};
use crate::{CompileError, CompileOptions, Compiled, FineGains, ViewerError};
use iltm_capture::{
    CaptureError, CaptureOptions, FineFlood, Measurements, ProjectorAreas, SeveralCaptures,
};
use iltm_picture::progress::Progress;
use iltm_runtime::FrameSize;
use iltm_solve::{Compensation, InverseTransport, SolveError, SolveOptions, SolveReport, Solved};
use std::path::Path;
use thiserror::Error;

/// A table with everything that it was made from.
#[derive(Clone, Debug)]
pub struct BuiltTable {
    /// The registered photographs.
    pub measurements: Measurements,
    /// Who lights what, of several projectors with a capture each.
    pub projectors: Option<ProjectorAreas>,
    /// The inverse light transport that the table has: without an operator, or with the same gain
    /// everywhere, if [`SolveReport::compensation`] says so.
    pub inverse: InverseTransport,
    /// Gains finer than the cells; `None` if there are none.
    pub fine: Option<FineGains>,
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

    /// Whether it is for projectors whose pictures overlap: two places of its frame are one place on
    /// the wall then.
    #[must_use]
    pub fn is_overlapping(&self) -> bool {
        self.projectors.as_ref().is_some_and(|areas| areas.overlap)
    }
}

/// What a table is to be, beside what the photographs say.
#[derive(Clone, Copy, Default, Debug)]
pub struct TableOptions<'c> {
    /// Reference white; the brightest even grey that every live cell reaches if left out.
    pub white: Option<WhiteRequest<'c>>,
    /// Most samples of the gains that are finer than the cells; as fine as the camera tells, at
    /// most a sample a pixel of the projector, if left out.
    pub gain_resolution: Option<FrameSize>,
    /// Leaves light that is there without the projector as it is, instead of counting it as a
    /// part of the picture.
    pub keep_ambient: bool,
    /// Raises black to that of the brightest cells, so that it is even: where projectors overlap,
    /// their black adds up.
    pub match_black: bool,
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

/// Has what is interpolated go on below lower frames; no cell there counts.
fn continue_below(
    several: &SeveralCaptures,
    inverse: &mut InverseTransport,
    (fine, factor): (&mut Option<FineGains>, [usize; 2]),
) {
    for channel in &mut inverse.channels {
        several.continue_below([1, 1], &mut channel.gain);
        several.continue_below([1, 1], &mut channel.ambient);
    }
    for gains in fine.iter_mut().flat_map(|fine| &mut fine.channels) {
        several.continue_below(factor, gains);
    }
}

/// Rows and columns of the frame of each projector.
fn frames(several: &SeveralCaptures) -> Vec<[u16; 2]> {
    let parts = several.projectors.iter().map(|one| &one.part);
    let sides = parts.map(|part| [part.rows, part.columns.len()]);
    // Sides of a grid are `u16`s.
    sides.map(|sides| sides.map(|side| side as u16)).collect()
}

/// Reads a capture, solves it and compiles the table; one without an operator if
/// photographs that the solve had not seen do not show that the operator helps, and one that
/// leaves pictures as they are if the wall is as even as a projector's codes can make it.
///
/// # Errors
/// [`BuildError`] by the step that failed; also if photographs that the solve had
/// not seen say that any table would be worse than none.
pub fn build_table(
    capture: &Path,
    photographs: &CaptureOptions,
    options: &SolveOptions,
    table: &TableOptions<'_>,
    progress: &dyn Progress,
) -> Result<BuiltTable, BuildError> {
    let measurements = iltm_capture::read(capture, photographs, progress)?;
    build_table_from(measurements.into(), capture, options, table, progress)
}

/// What a table is made from.
#[derive(Debug)]
pub enum LearnedFrom {
    /// The capture of one projector.
    One(Box<Measurements>),
    /// Captures of several projectors, whose frames stand side by side. Where they overlap, each
    /// shows its share of the light.
    Several(Box<SeveralCaptures>),
}

impl From<Measurements> for LearnedFrom {
    fn from(one: Measurements) -> Self {
        Self::One(Box::new(one))
    }
}

impl From<SeveralCaptures> for LearnedFrom {
    fn from(several: SeveralCaptures) -> Self {
        Self::Several(Box::new(several))
    }
}

impl LearnedFrom {
    /// Those of the whole frame.
    #[must_use]
    pub const fn measurements(&self) -> &Measurements {
        match self {
            Self::One(one) => one,
            Self::Several(several) => &several.all,
        }
    }

    /// The same, to change their settings.
    pub const fn measurements_mut(&mut self) -> &mut Measurements {
        match self {
            Self::One(one) => one,
            Self::Several(several) => &mut several.all,
        }
    }

    const fn several(&self) -> Option<&SeveralCaptures> {
        match self {
            Self::One(_) => None,
            Self::Several(several) => Some(several),
        }
    }
}

/// The same from photographs that have been read before; `capture` is where, for a name.
///
/// # Errors
/// Those of [`build_table`], but for [`BuildError::Capture`].
pub fn build_table_from(
    mut learned: LearnedFrom,
    capture: &Path,
    options: &SolveOptions,
    table: &TableOptions<'_>,
    progress: &dyn Progress,
) -> Result<BuiltTable, BuildError> {
    let solved = match &mut learned {
        LearnedFrom::One(measurements) => iltm_solve::solve(measurements, options, progress)?,
        LearnedFrom::Several(several) => iltm_solve::solve_several(several, options, progress)?,
    };
    let (measurements, several) = (learned.measurements(), learned.several());
    let Solved {
        inverse,
        mut report,
        trials,
    } = solved;
    if report.compensation == Compensation::Nothing {
        return Err(BuildError::Worse {
            uncompensated: report.prediction.uncompensated,
            gain_only: report.prediction.gain_only,
            compensated: report.prediction.compensated,
        });
    }
    progress.begin("predicting what a viewer sees", 0);
    let flood = match several {
        Some(several) => FineFlood::of_several(several, table.gain_resolution),
        None => FineFlood::new(measurements, table.gain_resolution),
    };
    let gain_only = iltm_solve::gain_only(&measurements.into(), &report)?;
    let viewer = match several {
        Some(several) => ViewerError::predict_several(several, &trials, &gain_only, &flood),
        None => ViewerError::predict(measurements, &trials, &gain_only, &flood),
    };
    let as_even = |viewer: ViewerError| viewer.uncompensated.relative <= viewer.gain_only.relative;
    // Who asks for a white asks for another picture.
    let free = table.white.is_none() && report.compensation == Compensation::GainOnly;
    if free && viewer.is_some_and(as_even) {
        report.compensation = Compensation::Nothing;
    }
    let predicted = PredictedError::new(&report, viewer);
    progress.end();
    let mut inverse = match report.compensation {
        Compensation::GainOnly => gain_only,
        Compensation::Nothing => crate::gain::even(gain_only, &report.left_out),
        Compensation::Operator => inverse,
    };
    progress.begin("compiling the table", 0);
    let ambient_kept = table.keep_ambient || report.compensation == Compensation::Nothing;
    if ambient_kept {
        for channel in &mut inverse.channels {
            channel.ambient.fill(0.0);
        }
    }
    let mut fine = match report.compensation {
        Compensation::Nothing => None,
        _ => match several {
            Some(several) => crate::gain::fine_gains_of_several(&inverse, &flood, several),
            None => crate::gain::fine_gains(&inverse, &flood),
        },
    };
    if let Some(several) = several {
        inverse.share(&several.shares_of_cells());
    }
    let white = ReferenceWhite::new(&inverse, fine.as_ref(), table.white, table.match_black)?;
    if let Some(several) = several {
        continue_below(several, &mut inverse, (&mut fine, flood.factor));
    }
    let provenance = Provenance {
        ambient_kept,
        overlapping: several.is_some_and(SeveralCaptures::is_overlapping),
        frames: several.map(frames),
        ..Provenance::new(capture, measurements, &report, predicted, &white)
    };
    let options = CompileOptions {
        label: provenance.label(),
        projector: measurements.devices.projector.clone(),
        pixels: measurements.settings.projector.pixels(),
        reference_white: Some(white.light),
        match_black: table.match_black,
        inverse_error: predicted.of(report.compensation),
        provenance: provenance.to_text(),
        targets: None,
    };
    let compiled = crate::compile(&inverse, fine.as_ref(), &options)?;
    progress.end();
    let (measurements, projectors) = match learned {
        LearnedFrom::One(measurements) => (*measurements, None),
        LearnedFrom::Several(several) => {
            let (all, areas) = several.into_areas();
            (all, Some(areas))
        }
    };
    Ok(BuiltTable {
        measurements,
        projectors,
        inverse,
        fine,
        report,
        predicted,
        white,
        compiled,
    })
}
