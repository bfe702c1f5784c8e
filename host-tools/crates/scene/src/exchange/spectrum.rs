//! How much of the light a bounce leaves in the end.

use super::krylov::Symmetrised;
use nalgebra::DMatrix;

/// Steps at most.
const STEPS: usize = 24;
/// Relative change of the loss between steps at which it is known.
const SETTLED: f64 = 0.01;

/// Spectral radius of `R F`, from below, to about a hundredth of the loss.
///
/// Lanczos, *An Iteration Method for the Solution of the Eigenvalue Problem* (1950),
/// fully orthogonalised. The start is the light of an even wash: the first
/// eigenvector of a non-negative matrix is non-negative (Perron), so it is never
/// missing there.
pub(super) fn spectral_radius(symmetrised: &Symmetrised<'_>) -> f64 {
    let even = DMatrix::from_element(symmetrised.patches(), 1, 1.0);
    let start = symmetrised.scaled(&even, |r, s| r * s);
    if start.norm() == 0.0 {
        return 0.0;
    }
    let mut basis = vec![&start / start.norm()];
    let mut projected = DMatrix::<f64>::zeros(STEPS, STEPS);
    let mut radius = 0.0_f64;
    for step in 0..STEPS {
        let mut next = symmetrised.apply(&basis[step]);
        // Twice is enough (Kahan).
        for _ in 0..2 {
            for (k, vector) in basis.iter().enumerate() {
                let part = vector.dot(&next);
                projected[(k, step)] += part;
                next -= vector * part;
            }
        }
        let size = step + 1;
        let upper = projected.view((0, 0), (size, size)).into_owned();
        let symmetric = (&upper + upper.transpose()) / 2.0;
        let last = radius;
        radius = symmetric.symmetric_eigenvalues().max().max(0.0);
        let norm = next.norm();
        let settled = (radius - last) <= SETTLED * (1.0 - radius).max(1e-12);
        if norm <= 1e-12 || (step > 1 && settled) || step + 1 == STEPS {
            break;
        }
        projected[(step + 1, step)] = norm;
        basis.push(next / norm);
    }
    radius
}
