//! Acquisition: ways to photograph a scene's transport.
//!
//! Each takes as many photographs as it needs from a [`Rig`] and ends with the forward
//! transport or with its inverse.
//!
//! ```text
//! multiplexing   one light at a time, and half of the lights at a time
//! stripes        rows and columns
//! dual           blocks, divided where they are seen
//! nystrom        clusters of columns and rows, of low rank
//! compressive    random patterns, decoded row by row or coarse to fine    sensing, greedy
//! sparse         random patterns, the project's own solver: two-stage, direct, iltm
//! ```

mod compressive;
mod dual;
mod greedy;
mod multiplexing;
mod nystrom;
mod sensing;
mod sparse;
mod stripes;
#[cfg(test)]
mod tests;

use super::{Acquired, Description, Rig, Unfit};
pub use compressive::{CompressiveDual, CompressiveSensing};
pub use dual::DualPhotography;
use iltm_solve::Method;
pub use multiplexing::{BruteForce, Hadamard};
pub use nystrom::Nystrom;
pub use sparse::Sparse;
pub(crate) use sparse::{patterns, solved};
pub use stripes::StripeScanning;

/// A way to photograph a scene.
pub trait Acquisition {
    /// What is said of it in tables.
    fn description(&self) -> Description;
    /// Its name in tables.
    fn name(&self) -> String {
        self.description().name
    }
    /// Takes photographs and works out the transport.
    ///
    /// # Errors
    /// [`Unfit`] if the scene or the grid is none for the method.
    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit>;
}

/// Every way, with `photographs` for those that take as many as one likes, and
/// patterns by `seed` where they are random.
#[must_use]
pub fn all(photographs: usize, seed: u64) -> Vec<Box<dyn Acquisition>> {
    let sparse = |method| Box::new(Sparse::new(method, photographs, seed));
    vec![
        Box::new(BruteForce),
        Box::new(Hadamard),
        Box::new(StripeScanning),
        Box::new(DualPhotography::default()),
        Box::new(Nystrom::new(photographs, false)),
        Box::new(Nystrom::new(photographs, true)),
        Box::new(CompressiveSensing::new(photographs, seed)),
        Box::new(CompressiveDual::new(photographs, seed)),
        sparse(Method::TwoStage),
        sparse(Method::Direct),
        sparse(Method::Joint),
    ]
}
