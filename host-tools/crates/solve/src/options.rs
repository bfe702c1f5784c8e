//! What a solve can be told.

use super::error::SolveError;
use super::haar::Basis;
use std::fmt;
use std::str::FromStr;

/// How the inverse is found.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
pub enum Method {
    /// Gains and one operator for all channels together, from every photograph:
    /// sparse in the Haar basis, non-negative off the diagonal.
    #[default]
    Joint,
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

impl Method {
    /// Every method, the default first.
    pub const ALL: [Self; 4] = [Self::Joint, Self::Direct, Self::TwoStage, Self::BruteForce];

    /// Its name on the command line and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Direct => "direct",
            Self::TwoStage => "two-stage",
            Self::BruteForce => "brute-force",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        Self::ALL
            .into_iter()
            .find(|method| method.name() == name)
            .ok_or_else(|| UnknownMethod(name.to_owned()))
    }
}

/// A name that no [`Method`] has.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("there is no method `{0}`; there are `joint`, `direct`, `two-stage` and `brute-force`")]
pub struct UnknownMethod(String);

/// Settings of [`solve`](super::solve). The defaults are the recipe that was
/// measured best; nothing needs to be set.
#[derive(Clone, PartialEq, Debug)]
pub struct SolveOptions {
    /// How the inverse is found.
    pub method: Method,
    /// Basis in which the operator is sparse. The runtime codes a table in
    /// [`Basis::QuadTree`] whatever this is.
    pub basis: Basis,
    /// Weight of the l1 term of [`Method::Joint`] once light is scaled so that a
    /// mean flood photograph is 1; `None` chooses it by held-out photographs.
    pub lambda: Option<f64>,
    /// Largest primal and dual residual relative to the operator's norm.
    pub tolerance: f64,
    /// Most iterations of one solve.
    pub iterations: u32,
}

impl Default for SolveOptions {
    fn default() -> Self {
        Self {
            method: Method::default(),
            basis: Basis::default(),
            lambda: None,
            tolerance: 5e-4,
            iterations: 2000,
        }
    }
}

impl SolveOptions {
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
