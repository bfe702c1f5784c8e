//! Errors of a solve: why it gives no inverse.

use super::options::Method;

/// What is wrong with the measurements or with what came of them.
///
/// A message says what happened, where, and what to do next.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// A part of the measurements does not have the size the others imply.
    #[error(
        "the {what} are {given_rows} x {given_cols} where the grid and the photographs make {rows} x {cols}; read the capture again"
    )]
    Size {
        /// Which part.
        what: &'static str,
        /// Rows it should have.
        rows: usize,
        /// Columns it should have.
        cols: usize,
        /// Rows it has.
        given_rows: usize,
        /// Columns it has.
        given_cols: usize,
    },
    /// Neither one channel nor three.
    #[error("{given} colour channels; a capture has 1 (grey) or 3 (red, green, blue)")]
    Channels {
        /// Channels given.
        given: usize,
    },
    /// A measurement is NaN or infinite.
    #[error(
        "the {what} of cell {cell}, photograph {photograph}, channel {channel} is not a finite number; look at that photograph"
    )]
    NotFinite {
        /// Light or pattern.
        what: &'static str,
        /// Cell index, row by row.
        cell: usize,
        /// Column of the measurements.
        photograph: usize,
        /// Channel index.
        channel: usize,
    },
    /// An option has a value that makes no sense.
    #[error("{option} is {value}; it must be {must}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// What it was set to.
        value: f64,
        /// What it may be.
        must: &'static str,
    },
    /// No cell is seen by the camera and lit by the projector.
    #[error(
        "none of the {cells} cells is seen to answer to its own light; check that the camera sees the projection, that the patterns belong to the photographs and that the flood photograph is exposed"
    )]
    NoLiveCells {
        /// Cells of the grid.
        cells: usize,
    },
    /// The light is too weak or too strong to be a camera's.
    #[error(
        "the mean light under white is {level:.1e} of the camera's full scale; check the exposure, and that values are from 0 to 1"
    )]
    Level {
        /// Mean light under white.
        level: f64,
    },
    /// The photographs do not follow from the patterns.
    #[error(
        "photographs that the solve had not seen differ by {percent:.0} % from what it predicts of them (at most {limit:.0} % can be used); check that the patterns belong to the photographs, that nothing moved, and the exposure"
    )]
    Unpredictable {
        /// Predicted error of the best way to project, per cent.
        percent: f64,
        /// Limit.
        limit: f64,
    },
    /// There is less to solve from than the method needs.
    #[error(
        "{given} photographs of the kinds that `{method}` uses, and it needs at least {least}; take more Bernoulli photographs (`iltm patterns --photos`)"
    )]
    TooFewPhotographs {
        /// The method asked for.
        method: Method,
        /// Photographs it can use.
        given: usize,
        /// Photographs it needs.
        least: usize,
    },
    /// The patterns do not tell cells apart that a method has to tell apart.
    #[error(
        "the patterns that are not held out have rank {rank}, and `{method}` needs {cells}, one for each cell that is lit; take more photographs, or use `joint`"
    )]
    Dependent {
        /// The method asked for.
        method: Method,
        /// Independent patterns.
        rank: usize,
        /// Cells lit.
        cells: usize,
    },
    /// The forward transport that was found cannot be inverted.
    #[error(
        "the forward transport found in channel {channel} has no inverse; take more photographs, or use `joint`"
    )]
    Singular {
        /// Channel index.
        channel: usize,
    },
    /// The iteration ended far from an answer.
    #[error(
        "after {iterations} iterations the solve still moves by {residual:.1e} of its operator (wanted {tolerance:.1e}); the photographs contradict each other: check that the patterns belong to the photographs and that nothing moved or changed exposure"
    )]
    DidNotConverge {
        /// Iterations made.
        iterations: u32,
        /// Larger of the primal and the dual residual.
        residual: f64,
        /// Residual asked for.
        tolerance: f64,
    },
    /// The inverse found has no forward transport: light would grow from bounce
    /// to bounce, or a gain is not positive.
    #[error(
        "the inverse found in channel {channel} cannot be that of a real scene ({why}); check that the patterns belong to the photographs, or take more photographs"
    )]
    NotPhysical {
        /// Channel index.
        channel: usize,
        /// What cannot be.
        why: String,
    },
}
