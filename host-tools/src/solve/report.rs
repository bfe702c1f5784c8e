//! What a solve did, for people and for the table's provenance.

use super::convergence::Convergence;
use super::options::Method;

/// How an inverse came about and how good it is.
///
/// Errors are relative: `||difference|| / ||wanted||` over all live cells,
/// channels and held-out photographs.
#[derive(Clone, PartialEq, Debug)]
pub struct SolveReport {
    /// How it was found.
    pub method: Method,
    /// Photographs it was found from.
    pub photographs: PhotographCounts,
    /// Cells that took part, and cells of the grid.
    pub live_cells: usize,
    /// Cells of the grid.
    pub cells: usize,
    /// Weight of the l1 term, light scaled so that a mean flood photograph is 1.
    /// 0 for [`Method::Direct`], which has no such weight.
    pub lambda: f64,
    /// Every weight tried, largest first; empty if none was chosen by held-out
    /// photographs.
    pub lambda_path: Vec<LambdaTrial>,
    /// How the last solve ended.
    pub convergence: Convergence,
    /// Iterations of all solves together.
    pub iterations: u32,
    /// Non-zero Haar coefficients of the shared operator as solved.
    pub coefficients: usize,
    /// Largest over smallest singular value of the forward transport, worst
    /// channel.
    pub condition: f64,
    /// What held-out photographs say; `None` if there were too few to hold any
    /// out.
    pub prediction: Option<Prediction>,
    /// Wall-clock time.
    pub seconds: Seconds,
}

/// Photographs by what they show.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PhotographCounts {
    /// Flood photographs.
    pub white: usize,
    /// Gray code, both signs.
    pub gray_code: usize,
    /// Bernoulli patterns.
    pub bernoulli: usize,
    /// How many of the Bernoulli photographs were held out to choose `lambda`
    /// and to predict the error; the final solve uses them too.
    pub held_out: usize,
}

/// One weight of the l1 term and what it led to.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LambdaTrial {
    /// The weight.
    pub lambda: f64,
    /// Relative difference of predicted and observed light in the held-out
    /// photographs.
    pub misfit: f64,
}

/// Error of the compensated projection that held-out photographs predict.
///
/// A held-out photograph is what one wanted image, namely what the inverse says
/// its pattern would show, looks like on the wall.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Prediction {
    /// Projecting the wanted image as it is.
    pub uncompensated: f64,
    /// Dividing by the flood photograph.
    pub gain_only: f64,
    /// This inverse, found without the held-out photographs.
    pub compensated: f64,
}

/// Where the time went.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Seconds {
    /// Checking and preparing.
    pub prepare: f64,
    /// Choosing `lambda`.
    pub choose: f64,
    /// The solve of all photographs.
    pub solve: f64,
    /// Deviations, condition and prediction.
    pub finish: f64,
}
