//! [`Method::TwoStage`](super::Method::TwoStage): forward transport, then its inverse.
//!
//! `T` is Haar-coded on both sides, `T^ = W^T T W`. Row `i` of it explains the
//! photographs if `(W^T L)^T t_i = (W^T C)_i`; among those that do so to within the
//! photographs' noise the one of least l1 norm is taken (Sen, Darabi, *Compressive Dual
//! Photography*, Eurographics 2009, with basis pursuit). It is what the paper compares
//! its direct method with, from the same photographs; one factorisation more is the
//! price, and what inversion makes of errors.

use super::basis_pursuit::BasisPursuit;
use super::convergence::{Convergence, Stop};
use super::error::SolveError;
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
) -> Result<Solution, SolveError> {
    let patterns = prepared.patterns.select_columns(chosen);
    let problem = BasisPursuit::new(&haar.analyse_columns(&patterns));
    let mut end = Convergence::best();
    let (mut inverses, mut coefficients) = (Vec::new(), 0);
    for (channel, light) in prepared.light.iter().enumerate() {
        let right = haar.analyse_columns(&light.select_columns(chosen));
        let radii = radii(haar, &prepared.noise[channel], chosen.len());
        let (rows, channel_end) =
            problem.solve(&right.transpose(), &radii, stop, &|| progress.advance(1));
        end = end.and(channel_end);
        coefficients += rows.iter().filter(|value| **value != 0.0).count();
        let transport = haar.synthesise_operator(&rows.transpose());
        let inverse = inverted(&transport, &prepared.live);
        inverses.push(inverse.ok_or(SolveError::Singular { channel })?);
    }
    let live = &prepared.live;
    Ok(Solution::from_inverses(inverses, live, coefficients, end))
}

/// Inverse of a transport `N x N` between live cells (length `N`), zero elsewhere;
/// `None` if there is none.
///
/// # Panics
/// If the matrix is smaller than `N x N`.
#[must_use]
pub fn inverted(transport: &DMatrix<f64>, live: &[bool]) -> Option<DMatrix<f64>> {
    let chosen: Vec<usize> = (0..live.len()).filter(|cell| live[*cell]).collect();
    let part = transport.select_rows(&chosen).select_columns(&chosen);
    let inverse = part.try_inverse()?;
    if inverse.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let mut whole = DMatrix::zeros(live.len(), live.len());
    for (col, j) in chosen.iter().enumerate() {
        for (row, i) in chosen.iter().enumerate() {
            whole[(*i, *j)] = inverse[(row, col)];
        }
    }
    Some(whole)
}

/// How far each row may be from its photographs: the camera's noise, Haar-coded.
fn radii(haar: &Haar, noise: &[CellNoise], photographs: usize) -> Vec<f64> {
    // A pattern lights half of the cells.
    let variance = |noise: &CellNoise| f64::midpoint(noise.lit.powi(2), noise.unlit.powi(2));
    let cells = noise.len();
    let deviations = DMatrix::from_fn(cells, cells, |row, col| {
        if row == col {
            variance(&noise[row]).sqrt()
        } else {
            0.0
        }
    });
    haar.analyse_columns(&deviations)
        .row_iter()
        .map(|row| row.norm() * (photographs as f64).sqrt())
        .collect()
}
