//! Inversion: ways to compensate once the transport is known.
//!
//! Each is given the same transport and ends with a matrix that stands for the inverse,
//! or with work to do for every frame.

mod albedo;
mod bounded;
mod clustered;
mod each_alone;
mod exact;
mod gain_only;
mod haar_input;
mod krylov;
mod live;
mod neumann;
mod out_of_focus;
mod probing;
mod pseudo_inverse;
mod sweeps;
#[cfg(test)]
mod tests;
mod tikhonov;
mod together;
mod wavelet_inverse;

use super::{Answer, Description, Rig, Unfit};
pub use albedo::{Albedo, AlbedoAlone, albedo};
pub use bounded::Bounded;
pub use clustered::Clustered;
pub use each_alone::EachAlone;
pub(crate) use each_alone::projector_of;
pub use exact::{Cancellation, Exact};
pub use gain_only::{FloodGain, Uncompensated};
pub use haar_input::{LargestInputs, StoredElements};
use iltm_picture::FramePart;
use iltm_runtime::Grid;
pub use krylov::Optical;
use nalgebra::DMatrix;
pub use neumann::{Neumann, Stratified};
pub use out_of_focus::OutOfFocus;
pub use probing::Probing;
pub use pseudo_inverse::{Fewer, PseudoInverse};
pub use sweeps::{SweepOrder, Sweeps};
pub use tikhonov::Tikhonov;
pub use together::Together;
pub use wavelet_inverse::WaveletInverse;

/// What a way to invert may look at.
#[derive(Clone, Copy, Debug)]
pub struct KnownTransport<'k> {
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

impl Inverted {
    /// A `matrix` that is applied to every frame, by so many multiplications.
    fn matrix(matrix: DMatrix<f64>, multiplications: f64, remark: String) -> Self {
        Self {
            answer: Answer::Inverse(matrix),
            multiplications: Some(multiplications),
            photographs: 0,
            remark,
        }
    }
}

/// A way to invert, or to do without an inverse.
pub trait Inversion {
    /// What is said of it in tables.
    fn description(&self) -> Description;
    /// Its name in tables.
    fn name(&self) -> String {
        self.description().name
    }
    /// Prepares to project.
    ///
    /// # Errors
    /// [`Unfit`] if the scene is none for the method.
    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit>;
}

/// Cells that a projector out of focus spreads light over; enough that neighbours give a cell
/// more light than its own input does.
const BLUR: f64 = 0.7;

/// Every way, those with a parameter more than once. `parts` are those of several projectors.
#[must_use]
pub fn all(parts: &[FramePart]) -> Vec<Box<dyn Inversion>> {
    let mut all = vec![boxed(Exact)];
    if parts.len() > 1 {
        let parts = parts.to_vec();
        all.push(boxed(EachAlone { parts }));
    }
    // Series and sweeps.
    all.extend([1, 3, 8].map(|order| boxed(Neumann { order })));
    for order in [SweepOrder::Jacobi, SweepOrder::GaussSeidel] {
        all.extend([1, 3].map(|count| boxed(Sweeps { order, count })));
    }
    // Inverses with few elements.
    let strata = [(3, 0.002), (8, 0.0002)];
    all.extend(strata.map(|(strata, threshold)| boxed(Stratified { strata, threshold })));
    let clusters = [(16, false), (64, false), (64, true)];
    all.extend(clusters.map(|(limit, lumped)| boxed(Clustered { limit, lumped })));
    all.extend([8, 32].map(|entries| boxed(WaveletInverse { entries })));
    // Those that photograph for every frame.
    let optical = [(3, false), (8, false), (3, true)];
    all.extend(optical.map(|(steps, scaled)| boxed(Optical { steps, scaled })));
    all.push(boxed(Cancellation));
    // Unequal numbers of lights and camera cells; light of low frequency.
    let fewer = [Fewer::Lights, Fewer::CameraCells];
    all.extend(fewer.map(|fewer| boxed(PseudoInverse { fewer })));
    all.push(boxed(Tikhonov));
    let (steps, scaled) = (8, false);
    let blurred = [
        boxed(Exact),
        boxed(Neumann { order: 8 }),
        boxed(Tikhonov),
        boxed(Optical { steps, scaled }),
        boxed(Bounded),
    ];
    let deviation = BLUR;
    all.extend(blurred.map(|method| boxed(OutOfFocus { deviation, method })));
    // Gains, and few multiplications in Haar.
    all.extend([8, 32].map(|colours| boxed(Probing { colours })));
    for count in [16, 64] {
        all.push(boxed(LargestInputs { count }));
        all.push(boxed(StoredElements { columns: count }));
    }
    all.extend([boxed(AlbedoAlone), boxed(FloodGain), boxed(Uncompensated)]);
    all.push(boxed(Bounded));
    all
}

/// Ways for projectors that overlap: others need one cell a place. `parts` are those of each projector.
#[must_use]
pub fn of_overlapping(parts: &[FramePart], together: &Together) -> Vec<Box<dyn Inversion>> {
    let (overlaps, parts) = (together.overlaps.clone(), parts.to_vec());
    let shares = None;
    vec![
        boxed(together.clone()),
        boxed(Together { overlaps, shares }),
        boxed(EachAlone { parts }),
        boxed(FloodGain),
        boxed(Uncompensated),
    ]
}

fn boxed(method: impl Inversion + 'static) -> Box<dyn Inversion> {
    Box::new(method)
}
