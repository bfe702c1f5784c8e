//! [`Method::Direct`](super::Method::Direct): the paper's P4.
//!
//! The whole inverse is Haar-coded, `H = W^T T^-1 W`. Row `i` of it explains the
//! photographs if `(W^T C)^T h_i = (W^T L)_i`; among the rows that do so to
//! within the photographs' noise, the one of least l1 norm is taken. It uses the
//! flood and the Bernoulli photographs, as the paper does, channel by channel.

use super::basis_pursuit::BasisPursuit;
use super::convergence::{Convergence, Stop};
use super::haar::Haar;
use super::observed::CellNoise;
use super::prepare::Prepared;
use super::solution::Solution;
use iltm_picture::progress::Progress;
use nalgebra::DMatrix;

/// Solves from the photographs `chosen`. The convergence is that of the worst channel.
pub(super) fn solve(
    prepared: &Prepared,
    haar: &Haar,
    chosen: &[usize],
    stop: Stop,
    progress: &dyn Progress,
) -> Solution {
    let patterns = prepared.patterns.select_columns(chosen);
    let right = haar.analyse_columns(&patterns).transpose();
    let mut end = Convergence::best();
    let (mut inverses, mut coefficients) = (Vec::new(), 0);
    for (light, noise) in prepared.light.iter().zip(&prepared.noise) {
        let light = light.select_columns(chosen);
        let radii = radii(haar, &light, &patterns, noise);
        let problem = BasisPursuit::new(&haar.analyse_columns(&light));
        let (rows, channel_end) = problem.solve(&right, &radii, stop, &|| progress.advance(1));
        end = end.and(channel_end);
        coefficients += rows.iter().filter(|value| **value != 0.0).count();
        inverses.push(haar.synthesise_operator(&rows.transpose()));
    }
    Solution::from_inverses(inverses, &prepared.live, coefficients, end)
}

/// How far each row may be from its photographs: the noise that `T^-1` makes of
/// the camera's. For this the inverse's diagonal is enough.
fn radii(
    haar: &Haar,
    light: &DMatrix<f64>,
    patterns: &DMatrix<f64>,
    noise: &[CellNoise],
) -> Vec<f64> {
    let cells = light.nrows();
    let mut projected = DMatrix::zeros(cells, cells);
    for (cell, noise) in noise.iter().enumerate() {
        let seen = light.row(cell);
        let gain = patterns.row(cell).dot(&seen) / seen.norm_squared();
        projected[(cell, cell)] = if gain.is_finite() {
            gain * noise.lit
        } else {
            0.0
        };
    }
    let photographs = light.ncols() as f64;
    haar.analyse_columns(&projected)
        .row_iter()
        .map(|row| row.norm() * photographs.sqrt())
        .collect()
}
