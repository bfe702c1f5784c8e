//! Live transport: the transport between live cells alone, and what several methods ask of it.

use super::KnownTransport;
use crate::Unfit;
use crate::rig::live_cells;
use nalgebra::{DMatrix, DVector};

/// Steps of a power iteration before growth is watched, and while it is.
const POWER_STEPS: (usize, usize) = (30, 30);

/// Rows and columns of `T` that belong to live cells: `n x n`.
pub(super) struct LiveTransport {
    /// Their indices among all `N` cells, ascending.
    pub(super) chosen: Vec<usize>,
    /// `n x n`.
    pub(super) transport: DMatrix<f64>,
    cells: usize,
}

impl LiveTransport {
    /// # Errors
    /// [`Unfit::Condition`] if no cell is live.
    pub(super) fn new(known: &KnownTransport<'_>) -> Result<Self, Unfit> {
        let chosen = live_cells(known.live);
        if chosen.is_empty() {
            return Err(Unfit::Condition("no cell is live".to_owned()));
        }
        let transport = known.transport.select_rows(&chosen);
        Ok(Self {
            transport: transport.select_columns(&chosen),
            chosen,
            cells: known.live.len(),
        })
    }

    /// Live cells, `n`.
    pub(super) fn len(&self) -> usize {
        self.chosen.len()
    }

    /// The diagonal of `T`: what a cell shows of its own light; an error if it shows none.
    pub(super) fn own_light(&self) -> Result<DVector<f64>, Unfit> {
        self.positive(self.transport.diagonal(), "of its own light")
    }

    /// Light of each cell under white; an error if it shows none.
    pub(super) fn flood(&self) -> Result<DVector<f64>, Unfit> {
        self.positive(self.transport.column_sum(), "under white")
    }

    /// Light to divide by.
    ///
    /// # Errors
    /// [`Unfit::Condition`] if some cell shows none.
    pub(super) fn positive(&self, light: DVector<f64>, which: &str) -> Result<DVector<f64>, Unfit> {
        let dark = light
            .iter()
            .position(|light| !light.recip().is_finite() || *light <= 0.0);
        match dark {
            None => Ok(light),
            Some(at) => Err(Unfit::Condition(format!(
                "cell {} shows {:.3} {which}, nothing to divide by",
                self.chosen[at], light[at]
            ))),
        }
    }

    /// A matrix between live cells, `n x n`, as one between all, `N x N`.
    pub(super) fn whole(&self, part: &DMatrix<f64>) -> DMatrix<f64> {
        let mut whole = DMatrix::zeros(self.cells, self.cells);
        for (col, j) in self.chosen.iter().enumerate() {
            for (row, i) in self.chosen.iter().enumerate() {
                whole[(*i, *j)] = part[(row, col)];
            }
        }
        whole
    }

    /// Root mean square noise of an element of `T`, from those that are negative, which
    /// light never is; 0 for a transport that is known exactly. Elements that are not
    /// dark are seldom negative, so that this is a lower estimate.
    pub(super) fn noise(&self) -> f64 {
        let negative = self.transport.iter().filter(|light| **light < 0.0);
        let add = |(sum, count), light: &f64| (sum + light * light, count + 1.0);
        let (sum, count) = negative.fold((0.0, 0.0_f64), add);
        (sum / count.max(1.0)).sqrt()
    }
}

/// Spectral radius of a linear map of length `n`: mean growth of a power iteration's
/// late steps, which is right for complex pairs as well.
pub(super) fn spectral_radius(n: usize, apply: impl Fn(&DVector<f64>) -> DVector<f64>) -> f64 {
    // Not orthogonal to any eigenvector that matters.
    let mut x = DVector::from_fn(n, |cell, _| 1.0 + 0.5 * (cell as f64).sin());
    let (settle, watch) = POWER_STEPS;
    let mut growth = 0.0;
    for step in 0..settle + watch {
        let norm = x.norm();
        if norm == 0.0 || !norm.is_finite() {
            return if norm == 0.0 { 0.0 } else { f64::INFINITY };
        }
        x = apply(&(x / norm));
        if step >= settle {
            growth += x.norm().ln();
        }
    }
    (growth / watch as f64).exp()
}

/// What a spectral radius says of a series or an iteration.
pub(super) fn convergence(radius: f64) -> String {
    if radius < 1.0 {
        format!("converges, spectral radius {radius:.3}")
    } else {
        format!("diverges, spectral radius {radius:.3}")
    }
}

/// Fails with [`Unfit::Singular`] unless every element is finite.
pub(super) fn finite(matrix: DMatrix<f64>) -> Result<DMatrix<f64>, Unfit> {
    if matrix.iter().all(|value| value.is_finite()) {
        Ok(matrix)
    } else {
        Err(Unfit::Singular)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_by_a_factor_grows_by_that_factor() {
        let turn = DMatrix::from_row_slice(2, 2, &[0.0, -1.5, 1.5, 0.0]);
        let radius = spectral_radius(2, |x| &turn * x);
        assert!((radius - 1.5).abs() < 1e-9, "{radius}");
    }

    #[test]
    fn no_light_at_all_does_not_grow() {
        assert_eq!(spectral_radius(3, |x| x * 0.0).to_bits(), 0);
    }
}
