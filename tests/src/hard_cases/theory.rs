//! Error bounds: the errors that theory allows.
//!
//! For a closed loop with a learned inverse the bound is
//!
//! ```text
//! perfect + min over s of (2 tail(s) + cond sigma sqrt(s ln N / m)) + cond tolerance,   s <= m / (2 ln(N / m)) <= N
//! ```
//!
//! `perfect` is what clipping costs even with the true inverse. From `m`
//! photographs the l1 norm recovers about `m / (2 ln(N / m))` coefficients a row
//! (Donoho, Tanner, *Counting faces of randomly projected polytopes*, 2009). The
//! others are lost, at most twice over (Candes, *The restricted isometry
//! property*, 2008): `tail` is the error of the best `s` coefficients a row on the
//! same images. Noise of relative size `sigma` is what `s` coefficients fit of it,
//! and with the weight of the l1 term chosen well as many are kept as pay off
//! (Bickel, Ritov, Tsybakov, *Simultaneous analysis of Lasso and Dantzig
//! selector*, 2009, with constant 1). The condition number carries errors of the
//! inverse to the wall. `tolerance` is the relative residual at which the solver
//! stops.

use iltm::scene::coaxial::CoaxialScene;
use iltm::solve::natural_images;
use iltm::solve::{Haar, SolveOptions};
use nalgebra::DMatrix;

/// Largest over smallest singular value of `T` between the chosen cells.
pub fn condition(transport: &DMatrix<f64>, live: &[bool]) -> f64 {
    let values = part(transport, live).singular_values();
    values.max() / values.min()
}

/// Bound on the closed loop's error; `photographs` are all that the solver uses,
/// `noise` is relative to the light's root mean square.
pub fn bound(
    scene: &CoaxialScene,
    live: &[bool],
    photographs: usize,
    noise: f64,
    perfect: f64,
) -> f64 {
    let transport = scene.transport();
    let cells = live.iter().filter(|live| **live).count() as f64;
    let m = photographs as f64;
    let most = if m < cells {
        (0.5 * m / (cells / m).ln()).min(cells)
    } else {
        cells
    };
    let condition = condition(&transport, live);
    let tails = Tails::new(scene, &transport, live);
    let of = |sparsity: f64| {
        2.0 * tails.of(sparsity) + condition * noise * (sparsity * cells.ln() / m).sqrt()
    };
    let halves = (0..8).map(|k| of(most / f64::from(1 << k)));
    perfect + halves.fold(f64::INFINITY, f64::min) + condition * SolveOptions::default().tolerance
}

/// What is lost with the smaller coefficients of `K`.
struct Tails<'t> {
    haar: Haar,
    live: &'t [bool],
    transport: DMatrix<f64>,
    /// `None` if there is no inverse.
    coefficients: Option<DMatrix<f64>>,
    images: DMatrix<f64>,
}

impl<'t> Tails<'t> {
    fn new(scene: &CoaxialScene, transport: &DMatrix<f64>, live: &'t [bool]) -> Self {
        let chosen = chosen(live);
        let haar = Haar::new(scene.grid);
        let coefficients = part(transport, live).try_inverse().map(|inverse| {
            let mut operator = DMatrix::zeros(live.len(), live.len());
            for (row, i) in chosen.iter().enumerate() {
                for (col, j) in chosen.iter().enumerate().filter(|(col, _)| *col != row) {
                    operator[(*i, *j)] = -inverse[(row, col)];
                }
            }
            haar.analyse_operator(&operator)
        });
        Self {
            live,
            transport: part(transport, live),
            coefficients,
            images: natural_images(scene.grid).select_rows(&chosen),
            haar,
        }
    }

    /// Mean of `||T (K - K_s) d|| / ||d||` over natural images, with the largest
    /// `s N` coefficients of `K` kept.
    fn of(&self, sparsity: f64) -> f64 {
        let Some(coefficients) = &self.coefficients else {
            return f64::INFINITY;
        };
        let mut sizes: Vec<f64> = coefficients.iter().map(|value| value.abs()).collect();
        sizes.sort_by(|a, b| b.total_cmp(a));
        let kept = (sparsity * self.images.nrows() as f64) as usize;
        let least = sizes.get(kept).copied().unwrap_or(0.0);
        let rest = coefficients.map(|value| if value.abs() > least { 0.0 } else { value });
        let lost = part(&self.haar.synthesise_operator(&rest), self.live);
        let light = &self.transport * lost * &self.images;
        let errors = light.column_iter().zip(self.images.column_iter());
        let sum: f64 = errors.map(|(e, d)| e.norm() / d.norm()).sum();
        sum / self.images.ncols() as f64
    }
}

fn part(matrix: &DMatrix<f64>, live: &[bool]) -> DMatrix<f64> {
    let chosen = chosen(live);
    matrix.select_rows(&chosen).select_columns(&chosen)
}

fn chosen(live: &[bool]) -> Vec<usize> {
    (0..live.len()).filter(|cell| live[*cell]).collect()
}
