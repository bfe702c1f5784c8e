//! [`Method::BruteForce`](super::Method::BruteForce): forward transport by least squares.
//!
//! `T = C L^T (L L^T)^-1`: with patterns of one light at a time that is what the
//! photographs show, with multiplexed ones it demultiplexes them (Schechner, Nayar,
//! Belhumeur, *Multiplexing for Optimal Lighting*, 2007). Nothing is assumed of the
//! scene, so there must be as many independent patterns as lit cells.

use super::convergence::Convergence;
use super::error::SolveError;
use super::forward::product;
use super::options::Method;
use super::prepare::Prepared;
use super::solution::Solution;
use super::two_stage::inverted;
use nalgebra::DMatrix;

/// Eigenvalues of `L L^T` below this part of the largest belong to cells that the
/// patterns do not tell apart.
const RANK_TOLERANCE: f64 = 1e-10;

/// Solves from the photographs `chosen`.
pub(super) fn solve(prepared: &Prepared, chosen: &[usize]) -> Result<Solution, SolveError> {
    let patterns = prepared.landed(chosen);
    let lit: Vec<usize> = (0..patterns.nrows())
        .filter(|cell| patterns.row(*cell).amax() > 0.0)
        .collect();
    let demultiplex = demultiplexer(&patterns.select_rows(&lit))?;
    let mut inverses = Vec::new();
    for (channel, light) in prepared.light.iter().enumerate() {
        let columns = product(&light.select_columns(chosen), &demultiplex);
        let mut transport = DMatrix::zeros(patterns.nrows(), patterns.nrows());
        for (column, cell) in columns.column_iter().zip(&lit) {
            transport.set_column(*cell, &column);
        }
        let inverse = inverted(&transport, &prepared.live);
        inverses.push(inverse.ok_or(SolveError::Singular { channel })?);
    }
    let coefficients = prepared.live_cells().pow(2) * inverses.len();
    let end = Convergence::best();
    Ok(Solution::from_inverses(
        inverses,
        &prepared.live,
        coefficients,
        end,
    ))
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
