//! Least l1 norm within noise, for many right sides at once.
//!
//! For each column `b_i` of `B` (`m x n`) it finds
//!
//! ```text
//! min ||h||_1   s.t.  ||A^T h - b_i|| <= e_i        A: N x m
//! ```
//!
//! by ADMM between the l1 norm and the exact projection on the constraint. In
//! the eigenvectors of `A^T A` the projection is one scalar equation a column,
//! so that an iteration is two products with `A` whatever the radii. With
//! `e_i = 0` this is basis pursuit; the paper's P4 has one column for each row
//! of the Haar-coded inverse.

use super::convergence::{Convergence, Residuals, Stop};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Eigenvalues of `A^T A` below this part of the largest belong to photographs
/// that repeat others; they constrain nothing.
const RANK_TOLERANCE: f64 = 1e-10;
/// Columns solved together; they share a step length and when to stop.
const COLUMNS: usize = 32;
const RELAXATION: f64 = 1.7;
/// First threshold, in mean magnitudes of the least-squares answer.
const FIRST_THRESHOLD: f64 = 1.0;
/// The threshold is balanced after every so many of the first iterations.
const BALANCE_EVERY: u32 = 20;
const BALANCED_ITERATIONS: u32 = 300;
/// Newton steps of the scalar equation at most; it takes four or five.
const NEWTON_STEPS: usize = 30;
/// Relative error of a radius that ends them.
const NEWTON_TOLERANCE: f64 = 1e-9;

/// `A` in the eigenvectors of `A^T A`.
#[derive(Debug)]
pub(super) struct BasisPursuit {
    /// `A Q`, `N x r`.
    measured: DMatrix<f64>,
    /// `(A Q)^T`, `r x N`.
    transposed: DMatrix<f64>,
    /// Eigenvectors `Q`, `m x r`.
    vectors: DMatrix<f64>,
    /// Eigenvalues, length `r`.
    values: DVector<f64>,
}

impl BasisPursuit {
    pub(super) fn new(matrix: &DMatrix<f64>) -> Self {
        let eigen = matrix.tr_mul(matrix).symmetric_eigen();
        let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        let kept: Vec<usize> = (0..eigen.eigenvalues.len())
            .filter(|k| eigen.eigenvalues[*k] > RANK_TOLERANCE * largest)
            .collect();
        let vectors = eigen.eigenvectors.select_columns(&kept);
        let measured = matrix * &vectors;
        Self {
            transposed: measured.transpose(),
            measured,
            vectors,
            values: eigen.eigenvalues.select_rows(&kept),
        }
    }

    /// Solves for every column of `right` (`m x n`) within its radius. Returns
    /// the answers (`N x n`), exactly sparse, and the worst convergence.
    pub(super) fn solve(
        &self,
        right: &DMatrix<f64>,
        radii: &[f64],
        stop: Stop,
        step: &(dyn Fn() + Sync),
    ) -> (DMatrix<f64>, Convergence) {
        let cells = self.measured.nrows();
        let right = self.vectors.tr_mul(right);
        let mut answers = DMatrix::zeros(cells, right.ncols());
        let ends: Vec<Convergence> = answers
            .as_mut_slice()
            .par_chunks_mut(cells * COLUMNS)
            .enumerate()
            .map(|(index, answers)| {
                let first = index * COLUMNS;
                let columns = answers.len() / cells;
                let mut batch = Batch {
                    problem: self,
                    right: right.columns(first, columns).into_owned(),
                    radii: &radii[first..first + columns],
                };
                let (found, end) = batch.run(stop);
                answers.copy_from_slice(found.as_slice());
                step();
                end
            })
            .collect();
        let end = ends.into_iter().fold(Convergence::best(), Convergence::and);
        (answers, end)
    }
}

/// Columns that are solved together.
struct Batch<'p> {
    problem: &'p BasisPursuit,
    /// `Q^T B`, `r x n`.
    right: DMatrix<f64>,
    radii: &'p [f64],
}

impl Batch<'_> {
    fn run(&mut self, stop: Stop) -> (DMatrix<f64>, Convergence) {
        let cells = self.problem.measured.nrows();
        let mut sparse = DMatrix::zeros(cells, self.right.ncols());
        let mut dual = sparse.clone();
        let mut feasible = self.project(sparse.clone());
        let elements = (cells * self.right.ncols()) as f64;
        let mut threshold =
            FIRST_THRESHOLD * feasible.iter().map(|x| x.abs()).sum::<f64>() / elements;
        let mut end = Convergence::none();
        // Columns that nothing asks anything of: zero is the answer.
        end.converged = threshold == 0.0;
        while end.iterations < stop.iterations && !end.converged {
            let mut residuals = Residuals::default();
            let elements = feasible.iter().zip(sparse.iter_mut().zip(dual.iter_mut()));
            for (feasible, (sparse, dual)) in elements {
                let state = RELAXATION * feasible + (1.0 - RELAXATION) * *sparse + *dual;
                let clipped = state.max(-threshold).min(threshold);
                let next = state - clipped;
                residuals.primal += (feasible - next) * (feasible - next);
                residuals.dual += (next - *sparse) * (next - *sparse);
                residuals.norm += feasible * feasible;
                *sparse = next;
                *dual = clipped;
            }
            end.advance(residuals, stop);
            let balances = end.iterations.is_multiple_of(BALANCE_EVERY);
            if let Some(change) = end.imbalance()
                && balances
                && end.iterations <= BALANCED_ITERATIONS
            {
                threshold /= change;
                dual /= change;
            }
            feasible = self.project(&sparse - &dual);
        }
        (sparse, end)
    }

    /// The nearest point that every column's constraint allows.
    fn project(&self, mut columns: DMatrix<f64>) -> DMatrix<f64> {
        let mut excess = -&self.right;
        excess.gemm(1.0, &self.problem.transposed, &columns, 1.0);
        let values = self.problem.values.as_slice();
        for (excess, radius) in excess.column_iter_mut().zip(self.radii) {
            pull(excess, values, *radius);
        }
        columns.gemm(-1.0, &self.problem.measured, &excess, 1.0);
        columns
    }
}

/// Turns a column's excess `r = A^T h - b`, in eigenvectors, into the multiples
/// of the columns of `A Q` to take from `h`: `s r_k / (1 + s value_k)`, with `s`
/// such that an excess of the radius is left; infinite for a radius of zero.
fn pull(mut excess: nalgebra::DVectorViewMut<'_, f64>, values: &[f64], radius: f64) {
    if excess.norm() <= radius {
        excess.fill(0.0);
        return;
    }
    if radius <= 0.0 {
        for (excess, value) in excess.iter_mut().zip(values) {
            *excess /= value;
        }
        return;
    }
    let mut multiplier = 0.0;
    for _ in 0..NEWTON_STEPS {
        let (mut left, mut slope) = (0.0, 0.0);
        for (excess, value) in excess.iter().zip(values) {
            let factor = 1.0 / (1.0 + multiplier * value);
            let square = excess * excess * factor * factor;
            left += square;
            slope += square * value * factor;
        }
        // Newton on the reciprocal of the norm, which is nearly linear.
        let norm = left.sqrt();
        if norm <= radius * (1.0 + NEWTON_TOLERANCE) {
            break;
        }
        multiplier += (norm - radius) / radius * left / slope;
    }
    for (excess, value) in excess.iter_mut().zip(values) {
        *excess *= multiplier / (1.0 + multiplier * value);
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Zero and one are exact.
mod tests {
    use super::super::test_linear_program::least_l1;
    use super::super::test_scene::Random;
    use super::*;

    const TIGHT: Stop = Stop {
        tolerance: 1e-7,
        iterations: 50_000,
    };

    fn random(rows: usize, columns: usize) -> DMatrix<f64> {
        let mut random = Random(7);
        DMatrix::from_fn(rows, columns, |_, _| random.uniform() - 0.5)
    }

    fn l1(column: nalgebra::DVectorView<'_, f64>) -> f64 {
        column.iter().map(|value| value.abs()).sum()
    }

    #[test]
    fn without_noise_it_is_the_linear_programs_optimum() {
        let matrix = random(24, 9);
        let right = random(9, 40);
        let problem = BasisPursuit::new(&matrix);
        let (found, end) = problem.solve(&right, &[0.0; 40], TIGHT, &|| {});
        assert!(end.converged, "{end:?}");
        assert!((matrix.tr_mul(&found) - &right).amax() < 1e-6);
        for k in 0..40 {
            let least = least_l1(&matrix, right.column(k).as_slice());
            assert!((l1(found.column(k)) / least - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn within_noise_it_ends_on_the_boundary_at_the_optimum() {
        let matrix = random(24, 9);
        let right = random(9, 3);
        let radius = 0.2;
        let problem = BasisPursuit::new(&matrix);
        let (found, end) = problem.solve(&right, &[radius; 3], TIGHT, &|| {});
        assert!(end.converged);
        let residual = matrix.tr_mul(&found) - &right;
        for k in 0..3 {
            assert!((residual.column(k).norm() / radius - 1.0).abs() < 1e-5);
            // Optimality: the residual's gradient is parallel to the l1 norm's
            // subgradient, largest and alternating exactly on the support.
            let gradient = &matrix * residual.column(k);
            let largest = gradient.amax();
            for (value, slope) in found.column(k).iter().zip(gradient.iter()) {
                if *value != 0.0 {
                    assert!((slope * value.signum() / -largest - 1.0).abs() < 1e-4);
                }
            }
        }
    }

    #[test]
    fn a_radius_that_zero_satisfies_gives_zero() {
        let matrix = random(10, 4);
        let (found, end) =
            BasisPursuit::new(&matrix).solve(&random(4, 2), &[10.0; 2], TIGHT, &|| {});
        assert!(end.converged);
        assert_eq!(found.amax(), 0.0);
    }

    #[test]
    fn a_repeated_photograph_changes_nothing() {
        let (matrix, right) = (random(24, 9), random(9, 2));
        let twice = |matrix: &DMatrix<f64>| {
            let mut doubled = matrix.clone().resize_horizontally(18, 0.0);
            doubled.columns_mut(9, 9).copy_from(matrix);
            doubled
        };
        let right_twice = twice(&right.transpose()).transpose();
        let (once, _) = BasisPursuit::new(&matrix).solve(&right, &[0.0; 2], TIGHT, &|| {});
        let problem = BasisPursuit::new(&twice(&matrix));
        let (again, _) = problem.solve(&right_twice, &[0.0; 2], TIGHT, &|| {});
        assert!((once - again).amax() < 1e-6);
    }
}
