//! What a method finds.

use nalgebra::{DMatrix, DVector};
use std::fmt;
use thiserror::Error;

/// What a way to photograph ends with.
#[derive(Clone, Debug)]
pub enum Found {
    /// Forward transport `T`, `N x N`.
    Forward(DMatrix<f64>),
    /// Inverse transport `T^-1`, `N x N`.
    Inverse(DMatrix<f64>),
}

/// A way to project wanted light.
pub enum Answer {
    /// `p = M d`: a matrix `N x N` that is applied to every frame.
    Inverse(DMatrix<f64>),
    /// Work that depends on the frame.
    Frames(Box<dyn Project>),
}

impl fmt::Debug for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Inverse(_) => "Inverse",
            Self::Frames(_) => "Frames",
        })
    }
}

impl Answer {
    /// What a projector shows for wanted light, both length `N`: clipped to 0 to 1, and
    /// no light where the answer is not a number.
    #[must_use]
    pub fn shown(&self, wanted: &DVector<f64>) -> DVector<f64> {
        let input = match self {
            Self::Inverse(matrix) => matrix * wanted,
            Self::Frames(frames) => frames.project(wanted),
        };
        input.map(|p| if p > 0.0 { p.min(1.0) } else { 0.0 })
    }
}

/// A way to project that is no fixed matrix.
pub trait Project {
    /// The projector's input, length `N`, relative to its white, for wanted light in
    /// camera units, length `N`. What is outside 0 to 1 will be clipped.
    fn project(&self, wanted: &DVector<f64>) -> DVector<f64>;
}

/// Why a method gives no answer for this scene.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum Unfit {
    /// The method's own condition is not met.
    #[error("{0}")]
    Condition(String),
    /// What it found has no inverse.
    #[error("what it found has no inverse")]
    Singular,
    /// The project's own solver refused.
    #[error(transparent)]
    Solve(#[from] iltm_solve::SolveError),
}
