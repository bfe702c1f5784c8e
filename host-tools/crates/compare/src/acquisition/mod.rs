//! Ways to photograph a scene's transport.
//!
//! Each takes as many photographs as it needs from a [`Rig`] and ends with the forward
//! transport or with its inverse.
//!
//! ```text
//! brute_force          one light at a time
//! hadamard             half of the lights at a time
//! stripes              rows and columns
//! dual                 blocks, divided where they are seen
//! nystrom              clusters of columns and rows, of low rank
//! compressive_sensing  random patterns, decoded coarse to fine    } sensing, greedy:
//! compressive_dual     random patterns, decoded row by row        } what they share
//! sparse               random patterns, the project's own solver: two-stage, direct, iltm
//! ```

mod brute_force;
mod compressive_dual;
mod compressive_sensing;
mod dual;
mod greedy;
mod hadamard;
mod nystrom;
mod sensing;
mod sparse;
mod stripes;
#[cfg(test)]
mod test_scenes;
#[cfg(test)]
mod tests;

use super::{Found, Rig, Source, Unfit};
pub use brute_force::BruteForce;
pub use compressive_dual::CompressiveDual;
pub use compressive_sensing::CompressiveSensing;
pub use dual::DualPhotography;
pub use hadamard::Hadamard;
use iltm_picture::progress::Progress;
use iltm_solve::Method;
pub use nystrom::Nystrom;
pub use sparse::Sparse;
pub use stripes::Stripes;

/// A way to photograph a scene.
pub trait Acquisition {
    /// Its name in tables.
    fn name(&self) -> String;
    /// Where it comes from.
    fn source(&self) -> Source;
    /// What it does, a sentence or two, with what it needs that others do not.
    fn how(&self) -> &'static str;
    /// Takes photographs and works out the transport.
    ///
    /// # Errors
    /// [`Unfit`] if the scene or the grid is none for the method.
    fn acquire(&self, rig: &mut Rig, progress: &dyn Progress) -> Result<Found, Unfit>;
}

/// Every way, with `photographs` for those that take as many as one likes, and
/// patterns by `seed` where they are random.
#[must_use]
pub fn all(photographs: usize, seed: u64) -> Vec<Box<dyn Acquisition>> {
    let sparse = |method| Box::new(Sparse::new(method, photographs, seed));
    vec![
        Box::new(BruteForce),
        Box::new(Hadamard),
        Box::new(Stripes),
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
