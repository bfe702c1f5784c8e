//! The matrices that the constants are about, and their bounds from above.

use super::super::forward::{Inverse, product};
use super::super::haar::Haar;
use super::search::{Extremes, Sampling, search};
use super::{IsometryBounds, RecoveryBounds};
use nalgebra::{DMatrix, DVector, DVectorView};

/// Coefficients of a grid up to which all of them are looked at.
pub(super) const ALL: usize = 400;

/// On larger grids these many of the coarsest, and as many of the others.
const COARSEST: usize = 100;

/// A scene's transport and patterns, ready for bounds at any sparsity.
#[derive(Clone, Debug)]
pub struct Sensing {
    /// Gram matrix of the columns of `T^T W`.
    pub(super) forward: DMatrix<f64>,
    /// Gram matrix of the columns of `C^T W = L^T T^T W`.
    pub(super) sensed: DMatrix<f64>,
    /// Coefficients of the whole grid.
    pub(super) cells: usize,
    /// Photographs: more coefficients than these are never told apart.
    pub(super) photographs: usize,
    /// What the condition number of all of `T` is at most.
    condition: f64,
}

impl Sensing {
    /// `transport` is `T`, `N x N`, `patterns` is `L`, `N x m`.
    ///
    /// # Panics
    /// If the sizes do not agree with the basis.
    #[must_use]
    pub fn new(transport: &DMatrix<f64>, haar: &Haar, patterns: &DMatrix<f64>) -> Self {
        // W^T T, whose rows are the columns of T^T W.
        let columns = haar.analyse_columns(transport).transpose();
        let inverse = transport.clone().try_inverse();
        let condition = inverse.map_or(f64::INFINITY, |inverse| norm(transport) * norm(&inverse));
        Self::of_columns(&columns, patterns, condition)
    }

    /// `columns` are of `T^T W`, all or some, `condition` is at least that of `T`.
    fn of_columns(columns: &DMatrix<f64>, patterns: &DMatrix<f64>, condition: f64) -> Self {
        let sensed = product(&patterns.transpose(), columns);
        let shown = |column: DVectorView<'_, f64>| column.iter().any(|light| *light != 0.0);
        Self {
            photographs: patterns.column_iter().filter(|c| shown(*c)).count(),
            forward: product(&columns.transpose(), columns),
            sensed: product(&sensed.transpose(), &sensed),
            cells: columns.nrows(),
            condition,
        }
    }

    /// Coefficients of the whole grid, `N`.
    #[must_use]
    pub const fn cells(&self) -> usize {
        self.cells
    }

    /// Bounds for rows of `k` coefficients. The lower bounds come from `sampling`.
    #[must_use]
    pub fn bounds(&self, k: usize, sampling: Sampling) -> RecoveryBounds {
        let size = (2 * k).clamp(1, self.cells);
        let (found, supports) = search(self, size, sampling);
        let mut ratio = IsometryBounds {
            lower: found.sensed.ratio(),
            upper: self.upper(&self.sensed, size),
        };
        let mut kappa = IsometryBounds {
            lower: found.forward.ratio().sqrt(),
            upper: self.upper(&self.forward, size).sqrt().min(self.condition),
        };
        let mut gamma = IsometryBounds {
            lower: found.pencil.ratio(),
            // ||L^T x|| / ||x|| is one ratio over another.
            upper: ratio.upper * kappa.upper.powi(2),
        };
        if size > self.photographs {
            // Some h of so many coefficients is in no photograph at all.
            (ratio.lower, gamma.lower) = (f64::INFINITY, f64::INFINITY);
        }
        // Rounding: a bound from above is never below one from below.
        for bounds in [&mut ratio, &mut kappa, &mut gamma] {
            bounds.upper = bounds.upper.max(bounds.lower);
        }
        RecoveryBounds {
            k,
            kappa,
            gamma,
            product: IsometryBounds {
                lower: kappa.lower.powi(2) * gamma.lower,
                upper: kappa.upper.powi(2) * gamma.upper,
            },
            ratio,
            supports,
        }
    }

    /// The product's bound from above alone, which takes no search.
    pub(super) fn product_at_most(&self, k: usize) -> f64 {
        let size = (2 * k).clamp(1, self.cells);
        let kappa = self.upper(&self.forward, size).min(self.condition.powi(2));
        self.upper(&self.sensed, size) * kappa * kappa
    }

    /// Largest over smallest eigenvalue of any `size x size` principal submatrix, at
    /// most: by the discs of Gershgorin (1931) with the largest entries of each row.
    /// Infinite if a disc reaches zero, or not all coefficients are in the pool.
    fn upper(&self, gram: &DMatrix<f64>, size: usize) -> f64 {
        if gram.nrows() < self.cells {
            return f64::INFINITY;
        }
        let (mut most, mut least) = (0.0_f64, f64::INFINITY);
        let mut others = Vec::with_capacity(gram.nrows());
        for (i, column) in gram.column_iter().enumerate() {
            others.clear();
            others.extend(column.iter().map(|entry| entry.abs()));
            others.swap_remove(i);
            let count = size - 1;
            if count > 0 && count < others.len() {
                others.select_nth_unstable_by(count - 1, |a, b| b.total_cmp(a));
            }
            let radius: f64 = others.iter().take(count).sum();
            most = most.max(column[i] + radius);
            least = least.min(column[i] - radius);
        }
        if least > 0.0 {
            most / least
        } else {
            f64::INFINITY
        }
    }

    /// Largest cosine between two columns of the sensing matrix: the coherence `mu`,
    /// with `delta_2k <= (2k - 1) mu` of columns scaled to one length.
    #[must_use]
    pub fn coherence(&self) -> f64 {
        let lengths = self.sensed.diagonal().map(f64::sqrt);
        let mut largest = 0.0_f64;
        for j in 0..lengths.len() {
            for i in 0..j {
                let cosine = self.sensed[(i, j)].abs() / (lengths[i] * lengths[j]);
                largest = largest.max(cosine);
            }
        }
        largest
    }
}

/// `T^T W` of an inverse, of as many coefficients as there is time for: with patterns
/// it makes a [`Sensing`].
#[derive(Clone, Debug)]
pub(super) struct Transported {
    columns: DMatrix<f64>,
    condition: f64,
}

impl Transported {
    /// `None` if the inverse is singular. A cell that took no part is taken to light
    /// itself like a typical one: its column of `T` is not known.
    pub(super) fn new(inverse: &Inverse, haar: &Haar) -> Option<Self> {
        let typical = typical(&inverse.gain);
        let gain = inverse.gain.map(|g| if g > 0.0 { g } else { typical });
        let cells = gain.len();
        let pool = pool(haar);
        let chosen = DMatrix::from_fn(cells, pool.len(), |i, j| f64::from(i == pool[j]));
        // T^T = (diag(g) - K^T)^-1.
        let transposed = Inverse::new(gain.clone(), inverse.operator.transpose());
        let columns = transposed.light(&haar.synthesise_columns(&chosen))?;
        let condition = if pool.len() == cells {
            // W (T^T W)^T is T itself.
            let whole = DMatrix::from_diagonal(&gain) - inverse.operator.dense();
            norm(&haar.synthesise_columns(&columns.transpose())) * norm(&whole)
        } else {
            f64::INFINITY
        };
        Some(Self { columns, condition })
    }

    pub(super) fn sensing(&self, patterns: &DMatrix<f64>) -> Sensing {
        Sensing::of_columns(&self.columns, patterns, self.condition)
    }
}

/// The coefficients that supports are drawn from, ascending.
fn pool(haar: &Haar) -> Vec<usize> {
    let fineness = haar.fineness();
    let mut all: Vec<usize> = (0..fineness.len()).collect();
    if all.len() <= ALL {
        return all;
    }
    all.sort_by(|a, b| fineness[*a].total_cmp(&fineness[*b]));
    let (coarse, others) = all.split_at(COARSEST);
    let step = others.len().div_ceil(COARSEST);
    let mut pool: Vec<usize> = coarse
        .iter()
        .chain(others.iter().step_by(step))
        .copied()
        .collect();
    pool.sort_unstable();
    pool
}

impl Extremes {
    /// Largest over smallest; infinite where the smallest cannot be told from zero.
    pub(super) fn ratio(self) -> f64 {
        // No support was looked at: it is at least 1 whatever it is.
        if self.most <= 0.0 {
            return 1.0;
        }
        // Eigenvalues are good to about 1e-14 of the largest.
        if self.least > 1e-13 * self.most {
            self.most / self.least
        } else {
            f64::INFINITY
        }
    }
}

/// What the largest singular value is at most: `sqrt(||A||_1 ||A||_inf)`.
fn norm(matrix: &DMatrix<f64>) -> f64 {
    let mut rows = DVector::zeros(matrix.nrows());
    let mut most = 0.0_f64;
    for column in matrix.column_iter() {
        let column = column.abs();
        most = most.max(column.sum());
        rows += column;
    }
    (most * rows.amax()).sqrt()
}

/// Median of the positive gains; 1 if there is none.
fn typical(gain: &DVector<f64>) -> f64 {
    let mut live: Vec<f64> = gain.iter().copied().filter(|g| *g > 0.0).collect();
    live.sort_by(f64::total_cmp);
    live.get(live.len() / 2).copied().unwrap_or(1.0)
}
