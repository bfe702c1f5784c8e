//! Ways to compensate once the transport is known.
//!
//! Each is given the same transport and ends with a matrix that stands for the inverse,
//! or with work to do for every frame.

mod exact;

use super::{Answer, Rig, Source, Unfit};
use crate::progress::Progress;
pub use exact::Exact;
use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// What a way to invert may look at.
#[derive(Clone, Copy, Debug)]
pub struct Known<'k> {
    /// Cells of the projector.
    pub grid: Grid,
    /// Cells that are lit and seen, length `N`.
    pub live: &'k [bool],
    /// `T`, `N x N`, camera units; zero rows and columns of cells that are not live.
    pub transport: &'k DMatrix<f64>,
    /// The rig itself, for ways that ask it for photographs.
    pub rig: &'k Rig,
}

/// An answer and what it costs.
#[derive(Debug)]
pub struct Inverted {
    /// The way to project.
    pub answer: Answer,
    /// Multiplications a frame, those with zeros of a sparse matrix left out; `None`
    /// where photographs do the work.
    pub multiplications: Option<f64>,
    /// Photographs a frame, for ways that take some.
    pub photographs: usize,
    /// A remark with a number, such as iterations or coefficients; may be empty.
    pub remark: String,
}

/// A way to invert, or to do without an inverse.
pub trait Inversion {
    /// Its name in tables.
    fn name(&self) -> String;
    /// Where it comes from.
    fn source(&self) -> Source;
    /// What it does, a sentence or two.
    fn how(&self) -> &'static str;
    /// Prepares to project.
    ///
    /// # Errors
    /// [`Unfit`] if the scene is none for the method.
    fn invert(&self, known: Known<'_>, progress: &dyn Progress) -> Result<Inverted, Unfit>;
}

/// Every way.
#[must_use]
pub fn all() -> Vec<Box<dyn Inversion>> {
    vec![Box::new(Exact)]
}
