//! Ways to compensate once the transport is known.
//!
//! Each is given the same transport and ends with a matrix that stands for the inverse,
//! or with work to do for every frame.

mod albedo;
mod bounded;
mod cancellation;
mod clustered;
mod exact;
mod gain_only;
mod haar_input;
mod krylov;
mod live;
mod out_of_focus;
mod probing;
mod pseudo_inverse;
mod series;
mod stratified;
mod sweeps;
#[cfg(test)]
mod test_scene;
#[cfg(test)]
mod tests;
mod tikhonov;
mod wavelet_inverse;

use super::{Answer, Rig, Source, Unfit};
pub use albedo::{Albedo, AlbedoAlone, albedo};
pub use bounded::Bounded;
pub use cancellation::Cancellation;
pub use clustered::Clustered;
pub use exact::Exact;
pub use gain_only::{FloodGain, Uncompensated};
pub use haar_input::{LargestInputs, StoredElements};
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
pub use krylov::Optical;
use nalgebra::DMatrix;
pub use out_of_focus::OutOfFocus;
pub use probing::Probing;
pub use pseudo_inverse::{Fewer, PseudoInverse};
pub use series::Neumann;
pub use stratified::Stratified;
pub use sweeps::{Order, Sweeps};
pub use tikhonov::Tikhonov;
pub use wavelet_inverse::WaveletInverse;

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

/// Every way, those with a parameter more than once.
#[must_use]
pub fn all() -> Vec<Box<dyn Inversion>> {
    let mut all: Vec<Box<dyn Inversion>> = vec![Box::new(Exact)];
    all.extend(iterative());
    all.extend(sparse());
    all.extend(with_photographs());
    all.push(Box::new(Cancellation));
    all.extend(hard());
    all.extend([8, 32].map(|colours| boxed(Probing { colours })));
    for count in [16, 64] {
        all.push(Box::new(LargestInputs { count }));
        all.push(Box::new(StoredElements { columns: count }));
    }
    all.push(Box::new(AlbedoAlone));
    all.push(Box::new(FloodGain));
    all.push(Box::new(Uncompensated));
    all.push(Box::new(Bounded));
    all
}

fn boxed(method: impl Inversion + 'static) -> Box<dyn Inversion> {
    Box::new(method)
}

/// Series and sweeps.
fn iterative() -> Vec<Box<dyn Inversion>> {
    let mut all: Vec<_> = [1, 3, 8].map(|order| boxed(Neumann { order })).into();
    for order in [Order::Jacobi, Order::GaussSeidel] {
        all.extend([1, 3].map(|count| boxed(Sweeps { order, count })));
    }
    all
}

/// Inverses with few elements.
fn sparse() -> Vec<Box<dyn Inversion>> {
    vec![
        boxed(Stratified {
            strata: 3,
            threshold: 0.002,
        }),
        boxed(Stratified {
            strata: 8,
            threshold: 0.0002,
        }),
        boxed(Clustered {
            limit: 16,
            lumped: false,
        }),
        boxed(Clustered {
            limit: 64,
            lumped: false,
        }),
        boxed(Clustered {
            limit: 64,
            lumped: true,
        }),
        boxed(WaveletInverse { entries: 8 }),
        boxed(WaveletInverse { entries: 32 }),
    ]
}

/// Those that photograph for every frame.
fn with_photographs() -> Vec<Box<dyn Inversion>> {
    [(3, false), (8, false), (3, true)]
        .map(|(steps, scaled)| boxed(Optical { steps, scaled }))
        .into()
}

/// Unequal numbers of lights and camera cells; light of low frequency.
fn hard() -> Vec<Box<dyn Inversion>> {
    let blurred = |method| {
        boxed(OutOfFocus {
            deviation: BLUR,
            method,
        })
    };
    vec![
        boxed(PseudoInverse {
            fewer: Fewer::Lights,
        }),
        boxed(PseudoInverse {
            fewer: Fewer::CameraCells,
        }),
        boxed(Tikhonov),
        blurred(boxed(Exact)),
        blurred(boxed(Neumann { order: 8 })),
        blurred(boxed(Tikhonov)),
        blurred(boxed(Optical {
            steps: 8,
            scaled: false,
        })),
        blurred(boxed(Bounded)),
    ]
}

/// Cells; enough that neighbours give a cell more light than its own input does.
const BLUR: f64 = 0.7;
