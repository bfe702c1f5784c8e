//! The data block of the joint solve: rows of `K` and their gains that fit the
//! photographs and stay close to given rows, in closed form.
//!
//! For row `i` and a wanted row `v` it minimises
//!
//! ```text
//! 1/2 sum_c ||g_ci C_c[i] - k C_c - L_c[i]||^2 + rho/2 ||k - v||^2
//! ```
//!
//! over `k` and all `g_ci`. With `M = (sum_c C_c C_c^T + rho I)^-1`, which all
//! rows share,
//!
//! ```text
//! k = rho v M + b0[i] + sum_c g_ci A_c[i],   A_c = C_c C_c^T M,   b0 = -sum_c L_c C_c^T M
//! ```
//!
//! and the gains solve a system of as many equations as there are channels. One
//! eigendecomposition, of the smaller of the two Gram matrices, gives `M` for
//! every `rho`.
//!
//! Weights of the squared residuals differ from row to row, which would take one
//! `M` a row. They are majorised instead: with `w` the largest weight, all
//! residuals get weight `w`, and the share `1 - weight / w` of each one's last
//! value is added to its target (Hunter, Lange, *A Tutorial on MM
//! Algorithms*, 2004). Scaling `C` and `L` by `sqrt w` leaves the equations as
//! they are.

use super::forward::product;
use nalgebra::{DMatrix, DVector};

/// Eigenvalues below this part of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-12;

/// Least natural size of `rho`, of the largest eigenvalue: a third of what photographs of random
/// patterns and of natural images have.
const LEAST_SCALE: f64 = 1e-4;

/// Photographs of one solve with what does not depend on `rho`.
#[derive(Debug)]
pub(super) struct DataTerm {
    /// `C_c`, `N x m`.
    light: Vec<DMatrix<f64>>,
    /// `L_c`, `N x m`.
    targets: Vec<DMatrix<f64>>,
    /// Eigenvectors `U` of `sum_c C_c C_c^T` with non-zero eigenvalues, `N x r`.
    vectors: DMatrix<f64>,
    /// Their eigenvalues, length `r`.
    values: DVector<f64>,
    /// `C_c^T U`, `m x r`.
    seen: Vec<DMatrix<f64>>,
    /// What the iterations need for the weights; `None` if all are equal.
    pub(super) weighted: Option<WeightedResidual>,
    /// The largest weight.
    weight: f64,
}

/// [`DataTerm`] as the weights need it in every iteration.
#[derive(Debug)]
pub(super) struct WeightedResidual {
    /// `1 - weight / w`, `N x m`.
    pub(super) share: DMatrix<f64>,
    /// `C_c`, `N x m`.
    pub(super) light: Vec<DMatrix<f32>>,
    /// `C_c^T`, `m x N`.
    pub(super) transposed: Vec<DMatrix<f32>>,
    /// `L_c`, `N x m`.
    pub(super) targets: Vec<DMatrix<f64>>,
}

/// [`DataTerm`] for one `rho`; see the module for the symbols.
#[derive(Debug)]
pub(super) struct Factor {
    pub(super) rho: f64,
    pub(super) shrink: Shrink,
    /// `A_c`, `N x N`.
    pub(super) slopes: Vec<DMatrix<f64>>,
    /// `b0`, `N x N`.
    pub(super) offset: DMatrix<f64>,
    /// Row `i`'s inverse system for its gains, `channels x channels`; zero for a
    /// cell without light.
    pub(super) gain_systems: Vec<DMatrix<f64>>,
    /// Right side of that system for `v = 0`, `N x channels`.
    pub(super) gain_constants: DMatrix<f64>,
}

/// `rho M`, which shrinks a row towards what the photographs cannot see.
#[derive(Debug)]
pub(super) enum Shrink {
    /// The matrix, `N x N`.
    Dense(DMatrix<f32>),
    /// `I - U D U^T`, with `U` `N x r`: cheaper while `r < N/2`.
    LowRank {
        /// `U`.
        vectors: DMatrix<f32>,
        /// `D U^T`, `r x N`.
        scaled: DMatrix<f32>,
    },
}

impl DataTerm {
    /// `weights` are those of the squared residuals, `N x m`, the same in all
    /// channels.
    pub(super) fn new(
        mut light: Vec<DMatrix<f64>>,
        mut targets: Vec<DMatrix<f64>>,
        weights: &DMatrix<f64>,
    ) -> Self {
        let weight = weights.max();
        for matrix in light.iter_mut().chain(&mut targets) {
            *matrix *= weight.sqrt();
        }
        let (vectors, values) = eigenvectors(&light);
        let seen = light.iter().map(|c| c.tr_mul(&vectors)).collect();
        let weighted = (weights.min() < weight).then(|| WeightedResidual {
            share: weights.map(|own| 1.0 - own / weight),
            light: light.iter().map(|c| c.map(|v| v as f32)).collect(),
            transposed: light
                .iter()
                .map(|c| c.transpose().map(|v| v as f32))
                .collect(),
            targets: targets.clone(),
        });
        Self {
            light,
            targets,
            vectors,
            values,
            seen,
            weighted,
            weight,
        }
    }

    /// Median of the non-zero eigenvalues for a weight of 1: the natural size of
    /// `rho`. Pictures that are much alike leave most of them to the noise; a `rho` so
    /// small lets gains grow beyond all numbers.
    pub(super) fn scale(&self) -> f64 {
        let mut values: Vec<f64> = self.values.iter().copied().collect();
        values.sort_by(f64::total_cmp);
        let (middle, largest) = (values.get(values.len() / 2), values.last());
        middle.zip(largest).map_or(1.0, |(middle, largest)| {
            middle.max(LEAST_SCALE * largest) / self.weight
        })
    }

    /// Square of the norm of the gains that ignore all interreflection: what an
    /// operator is large or small against.
    pub(super) fn squared_gains(&self) -> f64 {
        let mut sum = 0.0;
        for (light, target) in self.light.iter().zip(&self.targets) {
            for (light, target) in light.row_iter().zip(target.row_iter()) {
                let norm = light.norm_squared();
                if norm > 0.0 {
                    sum += (light.dot(&target) / norm).powi(2);
                }
            }
        }
        sum / self.channels() as f64
    }

    pub(super) fn channels(&self) -> usize {
        self.light.len()
    }

    pub(super) fn factor(&self, rho: f64) -> Factor {
        let channels = self.channels();
        let cells = self.vectors.nrows();
        let inverse = self.values.map(|value| 1.0 / (value + rho));
        // `C_c^T M` in eigenvector coordinates.
        let scaled: Vec<_> = self
            .seen
            .iter()
            .map(|s| columns_scaled(s, &inverse))
            .collect();
        let across = self.vectors.transpose();
        let projected: Vec<_> = scaled.iter().map(|s| product(s, &across)).collect();
        let slopes = self
            .light
            .iter()
            .zip(&projected)
            .map(|(c, x)| c * x)
            .collect();
        let mut offset = DMatrix::zeros(cells, cells);
        for (target, x) in self.targets.iter().zip(&projected) {
            offset -= product(target, x);
        }
        let mut systems = vec![DMatrix::zeros(channels, channels); cells];
        let mut constants = DMatrix::zeros(cells, channels);
        for c in 0..channels {
            let light = &self.light[c];
            for (cell, system) in systems.iter_mut().enumerate() {
                system[(c, c)] += light.row(cell).norm_squared();
                constants[(cell, c)] += light.row(cell).dot(&self.targets[c].row(cell));
            }
            for d in 0..channels {
                // `C_d^T M C_c`, `m x m`.
                let between = product(&scaled[d], &self.seen[c].transpose());
                let fitted = product(&self.light[d], &between);
                let wanted = product(&self.targets[d], &between);
                for (cell, system) in systems.iter_mut().enumerate() {
                    system[(c, d)] -= fitted.row(cell).dot(&light.row(cell));
                    constants[(cell, c)] -= wanted.row(cell).dot(&light.row(cell));
                }
            }
        }
        let gain_systems = systems.into_iter().map(inverse_or_zero).collect();
        Factor {
            rho,
            shrink: self.shrink(rho),
            slopes,
            offset,
            gain_systems,
            gain_constants: constants,
        }
    }

    fn shrink(&self, rho: f64) -> Shrink {
        let (cells, rank) = self.vectors.shape();
        let part = self.values.map(|value| value / (value + rho));
        let scaled = columns_scaled(&self.vectors, &part).transpose();
        if 2 * rank < cells {
            return Shrink::LowRank {
                vectors: self.vectors.map(|v| v as f32),
                scaled: scaled.map(|v| v as f32),
            };
        }
        let dense = DMatrix::identity(cells, cells) - product(&self.vectors, &scaled);
        Shrink::Dense(dense.map(|v| v as f32))
    }
}

/// Eigenvectors of `sum_c C_c C_c^T` with non-zero eigenvalues, and those.
fn eigenvectors(light: &[DMatrix<f64>]) -> (DMatrix<f64>, DVector<f64>) {
    let cells = light.first().map_or(0, DMatrix::nrows);
    let photographs: usize = light.iter().map(DMatrix::ncols).sum();
    if photographs >= cells {
        let mut gram = DMatrix::zeros(cells, cells);
        for c in light {
            gram += product(c, &c.transpose());
        }
        let eigen = gram.symmetric_eigen();
        let kept = significant(&eigen.eigenvalues);
        return (
            eigen.eigenvectors.select_columns(&kept),
            eigen.eigenvalues.select_rows(&kept),
        );
    }
    let mut stacked = DMatrix::zeros(cells, photographs);
    let mut first = 0;
    for c in light {
        stacked.columns_mut(first, c.ncols()).copy_from(c);
        first += c.ncols();
    }
    let eigen = stacked.tr_mul(&stacked).symmetric_eigen();
    let kept = significant(&eigen.eigenvalues);
    let values = eigen.eigenvalues.select_rows(&kept);
    let right = eigen.eigenvectors.select_columns(&kept);
    let vectors = columns_scaled(
        &product(&stacked, &right),
        &values.map(|v| v.sqrt().recip()),
    );
    (vectors, values)
}

fn significant(values: &DVector<f64>) -> Vec<usize> {
    let largest = values.iter().copied().fold(0.0, f64::max);
    (0..values.len())
        .filter(|k| values[*k] > RANK_TOLERANCE * largest)
        .collect()
}

fn columns_scaled(matrix: &DMatrix<f64>, by: &DVector<f64>) -> DMatrix<f64> {
    let mut scaled = matrix.clone();
    for (mut column, factor) in scaled.column_iter_mut().zip(by.iter()) {
        column *= *factor;
    }
    scaled
}

fn inverse_or_zero(system: DMatrix<f64>) -> DMatrix<f64> {
    let size = system.nrows();
    system
        .cholesky()
        .map_or_else(|| DMatrix::zeros(size, size), |factor| factor.inverse())
}
