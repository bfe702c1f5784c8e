//! Report of a solve: what it did, for people and for the table's provenance.

use super::convergence::Convergence;
use super::observability::LeftOut;
use super::options::{GainOnly, Method};
use super::restricted_isometry::Recovery;

/// How an inverse came about and how good it is.
///
/// Errors are relative: `||difference|| / ||wanted||` over all live cells,
/// channels and held-out photographs.
#[derive(Clone, PartialEq, Debug)]
pub struct SolveReport {
    /// How it was found: as asked for, or [`Method::TwoStage`] where held-out photographs
    /// say that [`Method::Joint`] errs more.
    pub method: Method,
    /// Photographs it was found from.
    pub photographs: PhotographCounts,
    /// Cells that took no part, in order.
    pub left_out: Vec<LeftOut>,
    /// Cells that took part.
    pub live_cells: usize,
    /// Cells of the grid that a projector shows.
    pub cells: usize,
    /// Weight of the l1 term, light scaled so that a mean flood photograph is 1.
    /// 0 for [`Method::Direct`], which has no such weight.
    pub lambda: f64,
    /// Every weight tried, largest first; empty for [`Method::Direct`].
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
    /// What held-out photographs say.
    pub prediction: Prediction,
    /// What clipping makes of natural images.
    pub clipped: Clipped,
    /// Which way to project is best, [`Prediction::best`].
    pub compensation: Compensation,
    /// Whether the paper's theorem promises anything for this capture; `None` without a
    /// photograph of white.
    pub recovery: Option<Recovery>,
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
    /// Images.
    pub images: usize,
    /// How many of the Bernoulli patterns' and the images' photographs were held out to choose
    /// `lambda` and to predict the error; the final solve uses them too.
    pub held_out: usize,
}

impl PhotographCounts {
    /// How many there are.
    #[must_use]
    pub const fn all(&self) -> usize {
        self.white + self.gray_code + self.bernoulli + self.images
    }

    /// Bernoulli patterns and images in words.
    #[must_use]
    pub fn content(&self) -> String {
        match (self.bernoulli, self.images) {
            (bernoulli, 0) => format!("{bernoulli} Bernoulli"),
            (0, images) => format!("{images} images"),
            (bernoulli, images) => format!("{bernoulli} Bernoulli, {images} images"),
        }
    }
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
    /// Correcting each cell's brightness alone.
    pub gain_only: f64,
    /// This inverse, found without the held-out photographs; infinite if it has
    /// no forward transport.
    pub compensated: f64,
    /// The part of that which is noise of the held-out photographs.
    pub noise: f64,
    /// By how many standard errors, photograph by photograph, `compensated` is
    /// better than `gain_only`.
    pub confidence: f64,
    /// Held-out photographs.
    pub photographs: usize,
    /// Which gains without an operator predict best.
    pub gain_only_kind: GainOnly,
}

/// Standard errors by which an operator must be better than gain alone. Below
/// that the difference may well be chance, and a table without an operator is
/// safe, small and fast.
const CONFIDENT: f64 = 2.0;

/// An operator that cancels less than this is not called for: half a step of an
/// 8-bit code. What one photograph of black leaves in all others looks like as much.
const LEAST_CANCELLED: f64 = 0.5 / 255.0;

impl Prediction {
    /// The part of the light that only the operator cancels, relative: what is
    /// left of gain alone's error without what is noise in both.
    #[must_use]
    pub fn cancelled(&self) -> f64 {
        (self.gain_only.powi(2) - self.compensated.powi(2))
            .max(0.0)
            .sqrt()
    }

    /// Which way to project errs least: by held-out photographs, and on natural
    /// images that the projector has to clip.
    #[must_use]
    pub fn best(&self, clipped: Clipped) -> Compensation {
        let other = self.gain_only.min(self.uncompensated);
        let proven = self.compensated < other && self.confidence > CONFIDENT;
        let proven = proven && self.cancelled() > LEAST_CANCELLED;
        // `clipped` takes the inverse for right. What held-out photographs say that it lacks comes
        // on top, in natural images as large beside the error without a table as in theirs.
        let lacks = self.compensated.powi(2) - self.noise.powi(2);
        let lacks = lacks.max(0.0).sqrt() * clipped.uncompensated / self.uncompensated;
        let compensated = clipped.compensated.hypot(lacks);
        // Written so that what is not a number loses.
        if proven && compensated < clipped.gain_only.min(clipped.uncompensated) {
            return Compensation::Operator;
        }
        if self.gain_only <= self.uncompensated && clipped.gain_only <= clipped.uncompensated {
            Compensation::GainOnly
        } else {
            Compensation::Nothing
        }
    }
}

/// Errors of natural images in the scene as it was found, inputs clipped to what a
/// projector can show: what no knowledge of the scene can avoid.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Clipped {
    /// As they are.
    pub uncompensated: f64,
    /// With gains alone.
    pub gain_only: f64,
    /// With the operator.
    pub compensated: f64,
}

/// A way to project; its name in reports is in kebab case.
#[derive(Clone, Copy, PartialEq, Eq, Debug, strum::Display)]
#[strum(serialize_all = "kebab-case")]
pub enum Compensation {
    /// With the whole inverse.
    Operator,
    /// With gains and no operator.
    GainOnly,
    /// As it is.
    Nothing,
}

impl SolveReport {
    /// Predicted error of the way to project that was chosen.
    #[must_use]
    pub const fn predicted_error(&self) -> f64 {
        match self.compensation {
            Compensation::Operator => self.prediction.compensated,
            Compensation::GainOnly => self.prediction.gain_only,
            Compensation::Nothing => self.prediction.uncompensated,
        }
    }
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
    /// Bounds of the theorem's constants.
    pub recovery: f64,
}

impl Seconds {
    /// What `solve` finds, whose time to choose and to solve is added.
    pub(super) fn and_those_of<T>(&mut self, solve: impl FnOnce(&mut Self) -> T) -> T {
        let before = *self;
        let found = solve(self);
        self.choose += before.choose;
        self.solve += before.solve;
        found
    }
}
