//! How bright each cell's light is on its way out of the projector.
//!
//! A gain `g_i = 1/(rho_i E_i)` mixes what the wall gives back with what the
//! projector sends: vignetting cannot be told from paint in one photograph. But light
//! travels both ways alike: `E_i K_ij A_j = E_j K_ji A_i` up to the cells' sizes, so
//! that `flux_i K_ij = flux_j K_ji` with the flux of a cell's light `A_i E_i`. Pairs of
//! cells that light each other tell the ratio of their fluxes.

use super::InverseTransport;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Flux of each cell relative to the mean, by reciprocity.
#[derive(Clone, PartialEq, Debug)]
pub struct Flux {
    /// One a cell, `rows x cols`; `None` for a cell that exchanges no light with
    /// others, or is not live.
    pub cells: Vec<Option<f64>>,
    /// How far pairs of cells are from agreeing with it: the root mean square of
    /// `log(flux_i K_ij / (flux_j K_ji))` over the strongest pairs.
    pub misfit: f64,
    /// The same if all fluxes were equal.
    pub misfit_if_even: f64,
    /// Pairs it was found from.
    pub pairs: usize,
}

/// Cells of a grid up to which the system of equations is worth its time, a cube of
/// their number.
const MOST_CELLS: usize = 1200;

/// Share of the strongest element below which a pair says nothing.
const LEAST_STRENGTH: f64 = 0.02;

/// Pairs a cell must have on average.
const LEAST_PAIRS: usize = 4;

/// How much better than an even flux the found one must explain pairs.
const BETTER: f64 = 0.7;

impl Flux {
    /// Finds the flux from the operator that all channels share; `None` if too few
    /// cells exchange light, or the pairs do not agree on a flux any better than on
    /// an even one.
    #[must_use]
    pub fn find(inverse: &InverseTransport) -> Option<Self> {
        let cells = inverse.shared.cells();
        if cells > MOST_CELLS {
            return None;
        }
        let shared = inverse.shared.dense();
        let strongest = shared.iter().copied().fold(0.0, f64::max);
        let mut pairs = Vec::new();
        for i in 0..cells {
            for j in 0..i {
                let (there, back) = (shared[(i, j)], shared[(j, i)]);
                let weak = there.min(back) < LEAST_STRENGTH * strongest;
                if !weak && inverse.live[i] && inverse.live[j] {
                    // log flux_j - log flux_i
                    pairs.push((i, j, (there / back).ln(), there.min(back)));
                }
            }
        }
        if pairs.len() < LEAST_PAIRS * cells {
            return None;
        }
        let logs = solve(cells, &pairs)?;
        let spread = |log: &dyn Fn(usize) -> f64| {
            let off = pairs
                .iter()
                .map(|&(i, j, ratio, _)| (ratio - log(j) + log(i)).powi(2));
            (off.sum::<f64>() / pairs.len() as f64).sqrt()
        };
        let (misfit, misfit_if_even) = (spread(&|cell| logs[cell]), spread(&|_| 0.0));
        if misfit > BETTER * misfit_if_even {
            return None;
        }
        let mut paired = vec![false; cells];
        for &(i, j, ..) in &pairs {
            (paired[i], paired[j]) = (true, true);
        }
        let known = || (0..cells).filter(|&cell| paired[cell]);
        let mean = known().map(|cell| logs[cell].exp()).sum::<f64>() / known().count() as f64;
        let flux = |cell: usize| paired[cell].then(|| logs[cell].exp() / mean);
        Some(Self {
            cells: (0..cells).map(flux).collect(),
            misfit,
            misfit_if_even,
            pairs: pairs.len(),
        })
    }

    /// Flux of the dimmest cell relative to that of the brightest.
    #[must_use]
    pub fn evenness(&self) -> f64 {
        let known = || self.cells.iter().flatten().copied();
        known().fold(f64::INFINITY, f64::min) / known().fold(0.0, f64::max)
    }
}

/// Logarithms of the fluxes by weighted least squares, near 0 where nothing is said.
fn solve(cells: usize, pairs: &[(usize, usize, f64, f64)]) -> Option<DVector<f64>> {
    let total: f64 = pairs.iter().map(|pair| pair.3).sum();
    let mut normal = DMatrix::identity(cells, cells) * (1e-3 * total / cells as f64);
    let mut wanted = DVector::zeros(cells);
    for &(i, j, ratio, weight) in pairs {
        normal[(i, i)] += weight;
        normal[(j, j)] += weight;
        normal[(i, j)] -= weight;
        normal[(j, i)] -= weight;
        wanted[j] += weight * ratio;
        wanted[i] -= weight * ratio;
    }
    Some(Cholesky::new(normal)?.solve(&wanted))
}

#[cfg(test)]
mod tests {
    use super::super::{ChannelInverse, Interreflection};
    use super::*;
    use iltm_runtime::Grid;

    /// A symmetric exchange seen through these fluxes.
    fn inverse(flux: impl Fn(usize) -> f64) -> InverseTransport {
        let grid = Grid::new(6, 8).unwrap();
        let exchange = |i: usize, j: usize| {
            let (rows, cols) = ((i / 8).abs_diff(j / 8), (i % 8).abs_diff(j % 8));
            if i == j {
                0.0
            } else {
                0.02 / (1.0 + (rows * rows + cols * cols) as f64)
            }
        };
        let shared = DMatrix::from_fn(48, 48, |i, j| exchange(i, j) / flux(i)).into();
        InverseTransport {
            grid,
            live: vec![true; 48],
            shared,
            channels: vec![ChannelInverse {
                gain: vec![1.0; 48],
                scale: 1.0,
                deviation: None,
                ambient: vec![0.0; 48],
            }],
        }
    }

    #[test]
    fn vignetting_is_found_by_the_ways_there_and_back() {
        let flux = |cell: usize| 1.0 - 0.01 * cell as f64;
        let found = Flux::find(&inverse(flux)).unwrap();
        let mean = (0..48).map(flux).sum::<f64>() / 48.0;
        for (cell, found) in found.cells.iter().enumerate() {
            let truth = flux(cell) / mean;
            assert!(
                (found.unwrap() / truth - 1.0).abs() < 0.01,
                "{cell}: {found:?} {truth}"
            );
        }
        assert!(found.misfit < 0.1 * found.misfit_if_even);
        assert!((found.evenness() - 0.53).abs() < 0.01);
    }

    #[test]
    fn an_asymmetry_that_no_flux_explains_is_none() {
        let mut odd = inverse(|_| 1.0);
        let mut sign = 1_u64;
        let mut shared = odd.shared.dense();
        for value in &mut shared {
            sign = sign.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            *value *= if sign >> 63 == 0 { 1.3 } else { 0.7 };
        }
        odd.shared = shared.into();
        assert_eq!(Flux::find(&odd), None);
        let dark = InverseTransport {
            shared: Interreflection::none(Grid::new(6, 8).unwrap()),
            ..inverse(|_| 1.0)
        };
        assert_eq!(Flux::find(&dark), None);
    }
}
