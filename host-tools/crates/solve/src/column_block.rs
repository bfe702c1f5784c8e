//! Columns of `K^ = W^T K W` during the iterations: the l1 block.

use super::convergence::Residuals;
use super::haar::{Haar, LANES, Pack, transpose};
use super::row_block::RowBlock;

/// [`LANES`] columns, side by side; a column has a coefficient of `K` for each
/// place that [`Haar::analyse_in_place`] leaves one at.
#[derive(Debug)]
pub(super) struct ColumnBlock {
    first: usize,
    /// The block's solution plus its scaled dual.
    state: Vec<Pack>,
    /// What the data block is pulled towards, its rows in the cell domain;
    /// padded to whole packs.
    image: Vec<Pack>,
    /// Penalty weight of each column.
    weights: Pack,
}

impl ColumnBlock {
    /// Columns `first..first + LANES`; `weights` has one entry a place.
    pub(super) fn new(first: usize, weights: &[f32]) -> Self {
        let mut own = Pack::ZERO;
        for (own, weight) in own.0.iter_mut().zip(&weights[first..]) {
            *own = *weight;
        }
        let padded = weights.len().next_multiple_of(LANES);
        Self {
            first,
            state: vec![Pack::ZERO; weights.len()],
            image: vec![Pack::ZERO; padded],
            weights: own,
        }
    }

    /// One step: `rows` hold the data block's answer. `threshold` is
    /// `lambda / rho`, `weights` the penalty weight of each place.
    pub(super) fn step(
        &mut self,
        haar: &Haar,
        rows: &[RowBlock],
        weights: &[f32],
        threshold: f32,
        relaxation: f32,
    ) -> Residuals {
        self.gather(rows);
        let cells = self.state.len();
        let image = &mut self.image[..cells];
        haar.analyse_in_place(image);
        let mut residuals = Residuals::default();
        let keep = 1.0 - relaxation;
        for ((image, state), weight) in image.iter_mut().zip(&mut self.state).zip(weights) {
            let (mut norm, mut primal, mut dual) = (0.0_f32, 0.0_f32, 0.0_f32);
            for lane in 0..LANES {
                let limit = threshold * weight * self.weights.0[lane];
                let solution = image.0[lane];
                let before = soft(state.0[lane], limit);
                let next = relaxation * solution + keep * before + (state.0[lane] - before);
                let after = soft(next, limit);
                state.0[lane] = next;
                image.0[lane] = 2.0 * after - next;
                norm += solution * solution;
                primal += (solution - after) * (solution - after);
                dual += (after - before) * (after - before);
            }
            residuals.norm += f64::from(norm);
            residuals.primal += f64::from(primal);
            residuals.dual += f64::from(dual);
        }
        haar.synthesise_in_place(image);
        residuals
    }

    /// Multiplies the scaled dual, after a change of `rho`; `threshold` is that
    /// before the change.
    pub(super) fn scale_dual(&mut self, weights: &[f32], threshold: f32, by: f32) {
        for (state, weight) in self.state.iter_mut().zip(weights) {
            for (state, own) in state.0.iter_mut().zip(self.weights.0) {
                let solution = soft(*state, threshold * weight * own);
                *state = solution + by * (*state - solution);
            }
        }
    }

    /// Computes what the data block is pulled towards from the state alone, after
    /// a change of the threshold.
    pub(super) fn refresh(&mut self, haar: &Haar, weights: &[f32], threshold: f32) {
        let places = self.image.iter_mut().zip(&self.state).zip(weights);
        for ((image, state), weight) in places {
            for lane in 0..LANES {
                let limit = threshold * weight * self.weights.0[lane];
                image.0[lane] = 2.0 * soft(state.0[lane], limit) - state.0[lane];
            }
        }
        haar.synthesise_in_place(&mut self.image[..self.state.len()]);
    }

    /// The block's solution: `(place, column, coefficient)` of every non-zero.
    pub(super) fn solution<'a>(
        &'a self,
        weights: &'a [f32],
        threshold: f32,
    ) -> impl Iterator<Item = (usize, usize, f32)> + 'a {
        let places = self.state.iter().zip(weights).enumerate();
        places.flat_map(move |(place, (state, weight))| {
            (0..LANES).filter_map(move |lane| {
                let limit = threshold * weight * self.weights.0[lane];
                let value = soft(state.0[lane], limit);
                (value != 0.0).then_some((place, self.first + lane, value))
            })
        })
    }

    /// `LANES` rows of what the data block is pulled towards, from row `first`.
    pub(super) fn tile(&self, first: usize) -> &[Pack; LANES] {
        // Row blocks start at whole packs and `image` is padded to whole packs.
        self.image[first..]
            .first_chunk()
            .unwrap_or(&[Pack::ZERO; LANES])
    }

    fn gather(&mut self, rows: &[RowBlock]) {
        for block in rows {
            for pack in 0..block.packs() {
                let turned = transpose(&block.tile(self.first, pack));
                let first = block.start() + pack * LANES;
                self.image[first..first + LANES].copy_from_slice(&turned);
            }
        }
    }
}

/// Shrinks towards zero by `limit`.
#[inline]
fn soft(value: f32, limit: f32) -> f32 {
    value - value.min(limit).max(-limit)
}
