//! Does the theorem hold here? Bounds of the constants that decide it.
//!
//! The paper's direct method finds the rows of the Haar-coded inverse by least l1
//! norm. Its Lemma 3.1 and Theorem 3.1 (Chu, Ng, Pahwa, Quek, Huang, *Compressive
//! Inverse Light Transport*, BMVC 2011) say that rows with `k` coefficients are found
//! exactly, without noise, if
//!
//! ```text
//! kappa_2k(T)^2 gamma_2k < sqrt 2 + 1
//!
//! kappa_2k   largest over smallest ||T^T W h|| / ||h||             of 2k-sparse h
//! gamma_2k   largest over smallest ||L^T x||^2 / ||x||^2           of x = T^T W h, h 2k-sparse
//! ```
//!
//! Their product bounds the largest over the smallest `||C^T W h||^2 / ||h||^2`, which
//! is `(1 + delta) / (1 - delta)` of the sensing matrix's restricted isometry constant;
//! `delta_2k < sqrt 2 - 1` suffices (Candes, *The restricted isometry property and its
//! implications for compressed sensing*, 2008), and only the ratio matters (Foucart,
//! Lai, *Sparsest solutions of underdetermined linear systems via l_q-minimization*,
//! 2009).
//!
//! The exact constants are NP-hard (Tillmann, Pfetsch, *The Computational Complexity of
//! the Restricted Isometry Property, the Nullspace Property, and Related Concepts in
//! Compressed Sensing*, 2014), so there are bounds here: from below by supports that
//! were looked at (`search.rs`), from above by Gershgorin's discs (`sensing.rs`).
//!
//! # Which patterns
//!
//! Photographs may be combined before they are solved from, and the paper's theorem is
//! about combinations that are `+1` and `-1`: [`signed`] makes them. Patterns as shown,
//! 0 and 1, share their mean, which alone makes `gamma` as large as the number of
//! cells; the l1 problem is the same for both, so the form that promises more is
//! reported, and the other one beside it.

mod report;
mod search;
mod sensing;
#[cfg(test)]
mod tests;

pub use report::{Isometry, Recovery};
pub use search::Sampling;
pub use sensing::Sensing;

pub(super) use report::of_direct;

use nalgebra::DMatrix;
use std::f64::consts::SQRT_2;

/// What `kappa^2 gamma` has to stay below: `sqrt 2 + 1`.
pub const LIMIT: f64 = SQRT_2 + 1.0;

/// A number that is not known, from below and from above.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct IsometryBounds {
    /// It is at least this, at least 1; infinite if it is known to be.
    pub lower: f64,
    /// It is at most this; infinite if nothing better is known.
    pub upper: f64,
}

/// Bounds of the constants of one sparsity.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RecoveryBounds {
    /// Coefficients a row.
    pub k: usize,
    /// Bounds of `kappa_2k`.
    pub kappa: IsometryBounds,
    /// Bounds of `gamma_2k`.
    pub gamma: IsometryBounds,
    /// Bounds of `kappa_2k^2 gamma_2k`, which the theorem compares with [`LIMIT`].
    pub product: IsometryBounds,
    /// Bounds of what that product bounds: the largest over the smallest
    /// `||C^T W h||^2 / ||h||^2` of 2k-sparse `h`. The theorem needs no more than this
    /// below [`LIMIT`].
    pub ratio: IsometryBounds,
    /// Supports that the lower bounds are from.
    pub supports: usize,
}

/// Patterns of 0 and 1 as `+1` and `-1`: twice each less `flood`, the pattern of white,
/// `N x m`. Rows of cells that the projector does not reach stay zero.
#[must_use]
pub fn signed(patterns: &DMatrix<f64>, flood: &nalgebra::DVector<f64>) -> DMatrix<f64> {
    let mut signed = patterns * 2.0;
    for mut column in signed.column_iter_mut() {
        column -= flood;
    }
    signed
}
