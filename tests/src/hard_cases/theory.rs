//! The errors that theory allows.
//!
//! For a closed loop with a learned inverse the bound is
//!
//! ```text
//! perfect + 2 tail(s) + cond (sigma sqrt(s ln N / m) + tolerance),   s = m / (2 ln(N / m)) <= N
//! ```
//!
//! `perfect` is what clipping costs even with the true inverse. From `m`
//! photographs the l1 norm recovers about `s` coefficients a row (Donoho, Tanner,
//! *Counting faces of randomly projected polytopes*, 2009); the others are lost,
//! at most twice over (Candes, *The restricted isometry property*, 2008): `tail`
//! is the error of the best `s` coefficients a row on the same images. Noise of
//! relative size `sigma` is what `s` coefficients fit of it (Bickel, Ritov,
//! Tsybakov, *Simultaneous analysis of Lasso and Dantzig selector*, 2009, with
//! constant 1), and the condition number carries errors of the inverse to the
//! wall. `tolerance` is the relative residual at which the solver stops.

use super::scene::Scene;
use iltm::content::natural_images;
use iltm::solve::{Basis, Haar, SolveOptions};
use nalgebra::DMatrix;

/// Largest over smallest singular value of `T` between the chosen cells.
#[must_use]
pub fn condition(transport: &DMatrix<f64>, live: &[bool]) -> f64 {
    let values = part(transport, live).singular_values();
    values.max() / values.min()
}

/// Bound on the closed loop's error; `photographs` are all that the solver uses,
/// `noise` is relative to the light's root mean square.
#[must_use]
pub fn bound(scene: &Scene, live: &[bool], photographs: usize, noise: f64, perfect: f64) -> f64 {
    let transport = scene.transport();
    let cells = live.iter().filter(|live| **live).count() as f64;
    let m = photographs as f64;
    let sparsity = if m < cells { (0.5 * m / (cells / m).ln()).min(cells) } else { cells };
    let condition = condition(&transport, live);
    let fitted = noise * (sparsity * cells.ln() / m).sqrt();
    let lost = 2.0 * tail(scene, &transport, live, sparsity);
    perfect + lost + condition * (fitted + SolveOptions::default().tolerance)
}

/// Mean of `||T (K - K_s) d|| / ||d||` over natural images, with the largest `s N`
/// coefficients of `K` kept.
fn tail(scene: &Scene, transport: &DMatrix<f64>, live: &[bool], sparsity: f64) -> f64 {
    let Some(inverse) = part(transport, live).try_inverse() else {
        return f64::INFINITY;
    };
    let chosen = chosen(live);
    let mut operator = DMatrix::zeros(live.len(), live.len());
    for (row, i) in chosen.iter().enumerate() {
        for (col, j) in chosen.iter().enumerate().filter(|(col, _)| *col != row) {
            operator[(*i, *j)] = -inverse[(row, col)];
        }
    }
    let haar = Haar::new(scene.grid, Basis::QuadTree);
    let mut coefficients = haar.analyse_operator(&operator);
    let mut sizes: Vec<f64> = coefficients.iter().map(|value| value.abs()).collect();
    sizes.sort_by(|a, b| b.total_cmp(a));
    let kept = (sparsity * chosen.len() as f64) as usize;
    let least = sizes.get(kept).copied().unwrap_or(0.0);
    coefficients.apply(|value| {
        if value.abs() > least {
            *value = 0.0;
        }
    });
    let lost = part(&haar.synthesise_operator(&coefficients), live);
    let images = natural_images(scene.grid).select_rows(&chosen);
    let light = part(transport, live) * lost * &images;
    let errors = light.column_iter().zip(images.column_iter());
    errors.map(|(e, d)| e.norm() / d.norm()).sum::<f64>() / images.ncols() as f64
}

fn part(matrix: &DMatrix<f64>, live: &[bool]) -> DMatrix<f64> {
    let chosen = chosen(live);
    matrix.select_rows(&chosen).select_columns(&chosen)
}

fn chosen(live: &[bool]) -> Vec<usize> {
    (0..live.len()).filter(|cell| live[*cell]).collect()
}
