//! A scene whose transport is known exactly, for tests and benches.
//!
//! Two equal Lambertian walls meet in a right angle; the projector looks into
//! it, so that every cell gets the same irradiance. Cells of one wall do not see
//! each other; between the walls the form factor of two small patches holds,
//! `cos a cos b A / (pi r^2)`.

use nalgebra::{DMatrix, DVector, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// `T^-1 = diag(gain) - operator`.
#[derive(Debug)]
pub struct Corner {
    pub gain: DVector<f64>,
    pub operator: DMatrix<f64>,
}

impl Corner {
    /// `albedo` gives the albedo of each cell.
    pub fn new(rows: usize, cols: usize, albedo: impl Fn(usize) -> f64) -> Self {
        let cells = rows * cols;
        let step = 2.0 / cols as f64;
        let area = step / FRAC_1_SQRT_2 * step;
        let place = |cell: usize| {
            let x = ((cell % cols) as f64 + 0.5) * step - 1.0;
            Vector3::new(x, (cell / cols) as f64 * step, x.abs())
        };
        let normal = |cell: usize| Vector3::new(-place(cell).x.signum(), 0.0, 1.0) * FRAC_1_SQRT_2;
        let form_factor = |i: usize, j: usize| {
            let between = place(j) - place(i);
            if place(i).x * place(j).x >= 0.0 {
                return 0.0;
            }
            let (a, b) = (normal(i).dot(&between), -normal(j).dot(&between));
            (a * b).max(0.0) * area / (PI * between.norm_squared().powi(2))
        };
        Self {
            gain: DVector::from_fn(cells, |cell, _| 1.0 / albedo(cell)),
            operator: DMatrix::from_fn(cells, cells, form_factor),
        }
    }

    pub fn inverse(&self) -> DMatrix<f64> {
        DMatrix::from_diagonal(&self.gain) - &self.operator
    }

    /// What the camera sees of `patterns`, by bounces.
    pub fn photograph(&self, patterns: &DMatrix<f64>) -> DMatrix<f64> {
        let fade = self.gain.map(f64::recip);
        let reflect = |light: DMatrix<f64>| {
            DMatrix::from_fn(light.nrows(), light.ncols(), |i, k| light[(i, k)] * fade[i])
        };
        let mut bounce = reflect(patterns.clone());
        let mut light = bounce.clone();
        while bounce.amax() > 1e-13 {
            bounce = reflect(&self.operator * bounce);
            light += &bounce;
        }
        light
    }
}

/// White, then `bernoulli` random patterns.
pub fn patterns(cells: usize, bernoulli: usize) -> DMatrix<f64> {
    let mut random = Random(1);
    DMatrix::from_fn(cells, bernoulli + 1, |_, k| {
        if k == 0 || random.uniform() < 0.5 {
            1.0
        } else {
            0.0
        }
    })
}

/// Adds `relative` of each value as noise, near enough to Gaussian.
pub fn add_noise(light: &mut DMatrix<f64>, relative: f64) {
    let mut random = Random(2);
    for value in light.iter_mut() {
        let sum: f64 = (0..12).map(|_| random.uniform()).sum();
        *value += relative * *value * (sum - 6.0);
    }
}

/// `SplitMix64`: the same numbers everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
