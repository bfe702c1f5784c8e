//! Methods that take each row, or each channel, for itself; for comparison with
//! [`Method::Joint`], and where that errs.
//!
//! [`Method::Direct`] is the paper's P4. The whole inverse is Haar-coded,
//! `H = W^T T^-1 W`. Row `i` of it explains the photographs if
//! `(W^T C)^T h_i = (W^T L)_i`; among the rows that do so to within the photographs'
//! noise, the one of least l1 norm is taken.
//!
//! [`Method::TwoStage`] finds the forward transport first, Haar-coded on both sides:
//! row `i` of `T^ = W^T T W` explains the photographs if `(W^T L)^T t_i = (W^T C)_i`, and
//! again the one of least l1 norm is taken (Sen, Darabi, *Compressive Dual Photography*,
//! Eurographics 2009, with basis pursuit). It is what the paper compares its direct method
//! with, from the same photographs; one factorisation more is the price, and what
//! inversion makes of errors.
//!
//! [`Method::BruteForce`] finds the forward transport by least squares,
//! `T = C L^T (L L^T)^-1`: with patterns of one light at a time that is what the
//! photographs show, with multiplexed ones it demultiplexes them (Schechner, Nayar,
//! Belhumeur, *Multiplexing for Optimal Lighting*, 2007). Nothing is assumed of the
//! scene, so there must be as many independent patterns as lit cells.

use super::basis_pursuit::BasisPursuit;
use super::convergence::{Convergence, Stop};
use super::error::SolveError;
use super::forward::product;
use super::haar::Haar;
use super::observed::CellNoise;
use super::options::Method;
use super::prepare::Prepared;
use super::solution::Solution;
use iltm_picture::progress::Progress;
use nalgebra::{DMatrix, DVector};

/// Eigenvalues of `L L^T` below this part of the largest belong to cells that the
/// patterns do not tell apart.
const RANK_TOLERANCE: f64 = 1e-10;

/// [`Method::Direct`] from the photographs `chosen`. The convergence is that of the worst
/// channel.
pub(super) fn direct(
    prepared: &Prepared,
    haar: &Haar,
    chosen: &[usize],
    stop: Stop,
    progress: &dyn Progress,
) -> Solution {
    let mut end = Convergence::best();
    let (mut inverses, mut coefficients) = (Vec::new(), 0);
    for (channel, noise) in prepared.noise.iter().enumerate() {
        let patterns = prepared.patterns[channel].select_columns(chosen);
        let right = haar.analyse_columns(&patterns).transpose();
        let light = prepared.light[channel].select_columns(chosen);
        // The noise that `T^-1` makes of the camera's, for which its diagonal is enough.
        let radii = radii(haar, chosen.len(), noise, |cell, noise| {
            let seen = light.row(cell);
            let gain = patterns.row(cell).dot(&seen) / seen.norm_squared();
            if gain.is_finite() {
                gain * noise.lit
            } else {
                0.0
            }
        });
        let problem = BasisPursuit::new(&haar.analyse_columns(&light));
        let (rows, channel_end) = problem.solve(&right, &radii, stop, &|| progress.advance(1));
        end = end.and(channel_end);
        coefficients += rows.iter().filter(|value| **value != 0.0).count();
        inverses.push(haar.synthesise_operator(&rows.transpose()));
    }
    Solution::from_inverses(inverses, &prepared.live, coefficients, end)
}

/// [`Method::TwoStage`] from the photographs `chosen`. The convergence is that of the worst
/// channel.
pub(super) fn two_stage(
    prepared: &Prepared,
    haar: &Haar,
    chosen: &[usize],
    stop: Stop,
    progress: &dyn Progress,
) -> Result<Solution, SolveError> {
    let mut end = Convergence::best();
    let (mut inverses, mut coefficients) = (Vec::new(), 0);
    for (channel, light) in prepared.light.iter().enumerate() {
        let patterns = prepared.patterns[channel].select_columns(chosen);
        let problem = BasisPursuit::new(&haar.analyse_columns(&patterns));
        let right = haar.analyse_columns(&light.select_columns(chosen));
        // A pattern lights half of the cells.
        let radii = radii(haar, chosen.len(), &prepared.noise[channel], |_, noise| {
            f64::midpoint(noise.lit.powi(2), noise.unlit.powi(2)).sqrt()
        });
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

/// How far each row may be from so many photographs: their noise, Haar-coded, of the
/// standard deviation that `deviation` gives each cell.
fn radii(
    haar: &Haar,
    photographs: usize,
    noise: &[CellNoise],
    deviation: impl Fn(usize, &CellNoise) -> f64,
) -> Vec<f64> {
    let deviations = noise.iter().enumerate();
    let deviations = deviations.map(|(cell, noise)| deviation(cell, noise));
    let deviations = DVector::from_iterator(noise.len(), deviations);
    haar.analyse_columns(&DMatrix::from_diagonal(&deviations))
        .row_iter()
        .map(|row| row.norm() * (photographs as f64).sqrt())
        .collect()
}

/// [`Method::BruteForce`] from the photographs `chosen`.
pub(super) fn brute_force(prepared: &Prepared, chosen: &[usize]) -> Result<Solution, SolveError> {
    let mut inverses = Vec::new();
    for (channel, light) in prepared.light.iter().enumerate() {
        let patterns = prepared.landed(channel, chosen);
        let lit: Vec<usize> = (0..patterns.nrows())
            .filter(|cell| patterns.row(*cell).amax() > 0.0)
            .collect();
        let demultiplex = demultiplexer(&patterns.select_rows(&lit))?;
        let columns = product(&light.select_columns(chosen), &demultiplex);
        let mut transport = DMatrix::zeros(patterns.nrows(), patterns.nrows());
        for (column, cell) in columns.column_iter().zip(&lit) {
            transport.set_column(*cell, &column);
        }
        let inverse = inverted(&transport, &prepared.live);
        inverses.push(inverse.ok_or(SolveError::Singular { channel })?);
    }
    let coefficients = prepared.live_cells().pow(2) * inverses.len();
    let (live, end) = (&prepared.live, Convergence::best());
    Ok(Solution::from_inverses(inverses, live, coefficients, end))
}

/// `L^T (L L^T)^-1`, `m x N`, of patterns `N x m`.
fn demultiplexer(patterns: &DMatrix<f64>) -> Result<DMatrix<f64>, SolveError> {
    let eigen = product(patterns, &patterns.transpose()).symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let significant = |value: &&f64| **value > RANK_TOLERANCE * largest;
    let rank = eigen.eigenvalues.iter().filter(significant).count();
    let cells = patterns.nrows();
    if rank < cells {
        return Err(SolveError::Dependent {
            method: Method::BruteForce,
            rank,
            cells,
        });
    }
    let mut scaled = eigen.eigenvectors.clone();
    for (mut column, value) in scaled.column_iter_mut().zip(eigen.eigenvalues.iter()) {
        column /= *value;
    }
    Ok(patterns.tr_mul(&(scaled * eigen.eigenvectors.transpose())))
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
