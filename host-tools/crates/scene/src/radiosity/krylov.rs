//! Krylov methods on the symmetrised radiosity equation: the light after all bounces at once,
//! by conjugate gradients or by Cholesky's factors, and the spectral radius, by Lanczos' method.

use super::FormFactorMatrix;
use nalgebra::DMatrix;

/// `M = R^1/2 S R^1/2`, `S = A^1/2 F A^-1/2` the symmetric exchange.
pub(super) struct Symmetrised<'a> {
    exchange: &'a FormFactorMatrix,
    /// `sqrt(albedo)`.
    reflects: Vec<f64>,
    /// `sqrt(area)`, m.
    sizes: Vec<f64>,
}

impl<'a> Symmetrised<'a> {
    pub(super) fn new(exchange: &'a FormFactorMatrix, albedo: &[f64]) -> Self {
        Self {
            exchange,
            reflects: albedo.iter().map(|a| a.sqrt()).collect(),
            sizes: exchange.areas().iter().map(|a| a.sqrt()).collect(),
        }
    }

    pub(super) fn patches(&self) -> usize {
        self.sizes.len()
    }

    /// `M y`, patches x columns.
    pub(super) fn apply(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        let light = self.scaled(y, |r, _| r);
        self.scaled(&self.exchange.symmetric(&light), |r, _| r)
    }

    /// Every row times a factor of `sqrt(albedo)` and `sqrt(area)`.
    pub(super) fn scaled(
        &self,
        y: &DMatrix<f64>,
        factor: impl Fn(f64, f64) -> f64,
    ) -> DMatrix<f64> {
        let mut scaled = y.clone();
        for mut column in scaled.column_iter_mut() {
            let factors = self.reflects.iter().zip(&self.sizes);
            for (value, (r, s)) in column.iter_mut().zip(factors) {
                *value *= factor(*r, *s);
            }
        }
        scaled
    }

    /// `R^1/2 A^1/2 E0`.
    fn right_side(&self, incident: &DMatrix<f64>) -> DMatrix<f64> {
        self.scaled(incident, |r, s| r * s)
    }

    /// `B = A^-1/2 R^1/2 y`.
    fn light(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        self.scaled(y, |r, s| r / s)
    }
}

/// What conjugate gradients came to.
pub(super) struct Solved {
    pub(super) light: DMatrix<f64>,
    pub(super) products: usize,
    /// Upper bound of the relative error of the worst column.
    pub(super) left: f64,
}

/// Conjugate gradients (Hestenes, Stiefel 1952) on `I - M`, every column by
/// itself, all products together.
pub(super) fn conjugate_gradients(
    symmetrised: &Symmetrised<'_>,
    incident: &DMatrix<f64>,
    radius: f64,
    level: f64,
    most: usize,
) -> Solved {
    let mut residual = symmetrised.right_side(incident);
    let mut y = DMatrix::zeros(residual.nrows(), residual.ncols());
    let mut search = residual.clone();
    let mut energy = squares(&residual);
    let (mut products, mut left) = (0, f64::INFINITY);
    while products < most {
        let applied = &search - symmetrised.apply(&search);
        products += 1;
        for (column, energy) in energy.iter().enumerate() {
            let curvature = search.column(column).dot(&applied.column(column));
            // A column without light is done: nothing to follow.
            if *energy == 0.0 || curvature <= 0.0 {
                continue;
            }
            let step = energy / curvature;
            y.column_mut(column).axpy(step, &search.column(column), 1.0);
            residual
                .column_mut(column)
                .axpy(-step, &applied.column(column), 1.0);
        }
        let next = squares(&residual);
        // ||error|| <= ||residual|| / (smallest eigenvalue, 1 - radius).
        let sizes = squares(&y);
        left = next
            .iter()
            .zip(&sizes)
            .map(|(r, y)| {
                if *y > 0.0 {
                    (r / y).sqrt() / (1.0 - radius)
                } else {
                    0.0
                }
            })
            .fold(0.0, f64::max);
        if left <= level {
            break;
        }
        for column in 0..search.ncols() {
            if energy[column] > 0.0 {
                let keep = next[column] / energy[column];
                search
                    .column_mut(column)
                    .axpy(1.0, &residual.column(column), keep);
            }
        }
        energy = next;
    }
    Solved {
        light: symmetrised.light(&y),
        products,
        left,
    }
}

fn squares(columns: &DMatrix<f64>) -> Vec<f64> {
    columns.column_iter().map(|c| c.norm_squared()).collect()
}

/// By Cholesky's factors of the whole matrix; `None` if it is not stored whole, or
/// if light is never lost.
pub(super) fn cholesky(
    symmetrised: &Symmetrised<'_>,
    incident: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let mut matrix = symmetrised.scaled(symmetrised.exchange.whole()?, |r, _| r);
    for (q, mut column) in matrix.column_iter_mut().enumerate() {
        column *= -symmetrised.reflects[q];
        column[q] += 1.0;
    }
    let y = matrix.cholesky()?.solve(&symmetrised.right_side(incident));
    Some(symmetrised.light(&y))
}

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
