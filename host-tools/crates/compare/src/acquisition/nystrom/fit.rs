//! Kernel fit: a transport from samples, direct light, and all other by a kernel of low rank.

use super::clusters::ClusterSamples;
use super::separation::Separation;
use crate::rig::clear_dead;
use nalgebra::{DMatrix, DVector};

/// Exponents of the element-wise kernel that are tried.
const EXPONENTS: [f64; 4] = [1.0, 0.75, 0.5, 0.25];
/// Singular values below which part of the largest are dropped, tried one by one.
const CUTS: [f64; 9] = [0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-6, 1e-10];
/// Times that direct light and all other are found each from what the other leaves.
const TURNS: usize = 2;

/// Kernel and rank.
#[derive(Clone, Copy, Debug)]
pub(super) struct KernelModel {
    exponent: f64,
    cut: f64,
}

impl Default for KernelModel {
    fn default() -> Self {
        Self {
            exponent: 1.0,
            cut: 1e-10,
        }
    }
}

impl KernelModel {
    /// The model of least `error`, and that error.
    pub(super) fn best(error: impl Fn(&Self) -> f64) -> (f64, Self) {
        let mut best = (f64::INFINITY, Self::default());
        for exponent in EXPONENTS {
            for cut in CUTS {
                let model = Self { exponent, cut };
                let error = error(&model);
                if error < best.0 {
                    best = (error, model);
                }
            }
        }
        best
    }

    /// `f^-1(f(C) f(A)^+ f(R))`, `N x N`, of samples less `direct` light.
    fn transport(self, samples: &ClusterSamples, direct: &DVector<f64>) -> DMatrix<f64> {
        let (lights, means) = (samples.clusters.lights(), samples.clusters.means());
        let own = DMatrix::from_diagonal(direct) * &lights;
        let sizes = lights.row_sum();
        let mean = |light: &DMatrix<f64>| {
            let mut light = light - &own;
            for (mut column, size) in light.column_iter_mut().zip(sizes.iter()) {
                column /= *size;
            }
            light
        };
        let (columns, rows) = (mean(&samples.columns), mean(&samples.rows));
        // Means between clusters, seen from both sides.
        let crossing = (means.tr_mul(&columns) + rows.tr_mul(&means)) * 0.5;
        let factors = self.kernel(&crossing, self.exponent).svd(true, true);
        let least = self.cut * factors.singular_values.amax();
        let Ok(inverse) = factors.pseudo_inverse(least) else {
            return DMatrix::zeros(columns.nrows(), columns.nrows());
        };
        let (columns, rows) = (
            self.kernel(&columns, self.exponent),
            self.kernel(&rows, self.exponent),
        );
        let product = columns * inverse * rows.transpose();
        self.kernel(&product, self.exponent.recip())
    }

    /// Element by element; light below zero is noise and becomes none, unless the kernel
    /// is linear.
    fn kernel(self, matrix: &DMatrix<f64>, exponent: f64) -> DMatrix<f64> {
        if self.exponent >= 1.0 {
            matrix.clone()
        } else {
            matrix.map(|value| value.max(0.0).powf(exponent))
        }
    }
}

/// Direct light and all other.
pub(super) struct DirectAndGlobal {
    direct: DVector<f64>,
    other: DMatrix<f64>,
}

impl DirectAndGlobal {
    /// Each in turn from what the other leaves.
    pub(super) fn new(
        samples: &ClusterSamples,
        model: KernelModel,
        separation: Option<&Separation>,
    ) -> Self {
        let cells = samples.columns.nrows();
        let mut fit = Self {
            direct: DVector::zeros(cells),
            other: DMatrix::zeros(cells, cells),
        };
        let Some(separation) = separation else {
            fit.other = model.transport(samples, &fit.direct);
            return fit;
        };
        for _ in 0..TURNS {
            fit.direct = separation.direct_light(&fit.other);
            fit.other = model.transport(samples, &fit.direct);
        }
        fit
    }

    /// Relative error of samples it was not made of.
    pub(super) fn error(&self, next: &ClusterSamples) -> f64 {
        let lights = next.clusters.lights();
        let own = DMatrix::from_diagonal(&self.direct) * &lights;
        let columns = &self.other * &lights + &own - &next.columns;
        let rows = self.other.tr_mul(&lights) + &own - &next.rows;
        let total = next.columns.norm_squared() + next.rows.norm_squared();
        if total > 0.0 {
            ((columns.norm_squared() + rows.norm_squared()) / total).sqrt()
        } else {
            0.0
        }
    }

    /// `T`, `N x N`; rows and columns of cells that are not `live` are zero.
    pub(super) fn transport(self, live: &[bool]) -> DMatrix<f64> {
        let mut transport = self.other;
        for (cell, direct) in self.direct.iter().enumerate() {
            transport[(cell, cell)] += direct;
        }
        clear_dead(&mut transport, live);
        transport
    }
}
