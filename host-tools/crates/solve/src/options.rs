//! Options of a solve: the method, and the settings that it has.

use super::error::SolveError;
use super::group::Processes;
use strum::{Display, EnumString, IntoStaticStr, VariantArray};

/// How the inverse is found; the name on the command line and in reports is in kebab case.
#[derive(
    Clone, Copy, PartialEq, Eq, Debug, Hash, Display, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "kebab-case", parse_err_ty = UnknownMethod, parse_err_fn = unknown)]
pub enum Method {
    /// Gains and one operator for all channels together, from every photograph:
    /// sparse in the Haar basis, non-negative off the diagonal.
    Joint,
    /// Gains and one operator for all channels, from every photograph, as links between blocks
    /// of cells: non-negative, refined where the photographs ask for it. Cost grows as the
    /// number of cells.
    Links,
    /// The paper's P4: each row of the Haar-coded inverse has the least l1 norm
    /// among those that explain the flood and Bernoulli photographs to within
    /// their noise. No knowledge of physics; channel by channel.
    Direct,
    /// Forward transport first: each row of the Haar-coded `T` has the least l1 norm
    /// among those that explain the flood and Bernoulli photographs to within their
    /// noise (Sen, Darabi, *Compressive Dual Photography*, 2009). Then it is inverted.
    TwoStage,
    /// Forward transport by least squares from all photographs, nothing assumed;
    /// then it is inverted. Needs more independent patterns than cells, whatever they
    /// are: one light at a time, Hadamard, random.
    BruteForce,
}

/// A name that no [`Method`] has.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "there is no method `{0}`; there are `joint`, `links`, `direct`, `two-stage` and `brute-force`"
)]
pub struct UnknownMethod(String);

fn unknown(name: &str) -> UnknownMethod {
    UnknownMethod(name.to_owned())
}

/// How gains are found when there is no operator.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum GainOnly {
    /// From light under white, bounced light included: right for even images.
    Flood,
    /// By least squares over all photographs: less noise, and right where no
    /// light bounces.
    Fitted,
}

impl GainOnly {
    /// Both.
    pub(super) const ALL: [Self; 2] = [Self::Flood, Self::Fitted];
}

/// Cells and photographs from which `links` is the default.
pub(super) const MANY_CELLS: usize = 2048;
const MANY_PHOTOGRAPHS: usize = 200;
/// Cells above which `links` is the default, however few the photographs.
const MOST_JOINT_CELLS: usize = 6144;
/// Cells up to which the two-stage method is tried where the first one errs.
pub(super) const MOST_INVERTED_CELLS: usize = 2048;

/// Settings of [`solve`](super::solve). The defaults are the recipe that was
/// measured best; nothing needs to be set.
#[derive(Clone, PartialEq, Debug)]
pub struct SolveOptions {
    /// How the inverse is found; `None` for [`Method::Joint`] or [`Method::Links`]: the one that
    /// predicts held-out photographs better, or of many cells and photographs the one that takes a
    /// fraction of the time.
    pub method: Option<Method>,
    /// Weight of the l1 term of [`Method::Joint`] once light is scaled so that a
    /// mean flood photograph is 1; `None` chooses it by held-out photographs.
    pub lambda: Option<f64>,
    /// Largest primal and dual residual relative to the operator's norm.
    pub tolerance: f64,
    /// Most iterations of one solve.
    pub iterations: u32,
    /// Processes that share the work of [`Method::Links`]; this one is the first of them.
    pub processes: Processes,
}

impl Default for SolveOptions {
    fn default() -> Self {
        Self {
            method: None,
            lambda: None,
            tolerance: 5e-4,
            iterations: 2000,
            processes: Processes::default(),
        }
    }
}

impl SolveOptions {
    /// The method for so many live cells and photographs; where both take seconds, held-out
    /// photographs [may choose](Self::may_choose) another.
    ///
    /// `docs/measured.md` compares both. Of more than [`MOST_JOINT_CELLS`] `joint` would take more
    /// memory than most computers have.
    pub(super) fn method_for(&self, cells: usize, photographs: usize) -> Method {
        let many = cells >= MANY_CELLS && photographs >= MANY_PHOTOGRAPHS;
        match self.method {
            Some(method) => method,
            // The weight is `joint`'s.
            None if self.lambda.is_some() => Method::Joint,
            None if many || cells > MOST_JOINT_CELLS => Method::Links,
            None => Method::Joint,
        }
    }

    /// Whether held-out photographs choose between `joint` and `links`: where both take seconds.
    pub(super) fn may_choose(&self, cells: usize) -> bool {
        self.method.is_none() && self.lambda.is_none() && cells < MANY_CELLS
    }

    pub(super) fn check(&self) -> Result<(), SolveError> {
        let refuse = |option, value, must| {
            Err(SolveError::Option {
                option,
                value,
                must,
            })
        };
        match self.lambda {
            Some(lambda) if !(lambda.is_finite() && lambda >= 0.0) => {
                return refuse("lambda", lambda, "a number that is not negative");
            }
            _ => {}
        }
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return refuse("tolerance", self.tolerance, "between 0 and 1");
        }
        if self.iterations == 0 {
            return refuse("iterations", 0.0, "at least 1");
        }
        Ok(())
    }
}
