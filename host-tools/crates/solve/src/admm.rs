//! The joint solve's iteration: consensus ADMM over three blocks.
//!
//! ```text
//! min  1/2 sum_c ||diag(g_c) C_c - K C_c - L_c||_w^2  +  lambda sum_ij w_i w_j |(W^T K W)_ij|
//! s.t. K_ij >= floor_ij off the diagonal
//! ```
//!
//! The data term ([`DataTerm`]), the l1 term and the sign constraint each keep
//! their own `K` and are pulled together with strength `rho`. The data term
//! couples nothing but a row's elements and the sign constraint not even those,
//! so rows are dealt out in blocks; the l1 term is dealt out in blocks of columns
//! of `K W`. Blocks are cut by the size of the problem, never by the number of
//! threads, and their sums are added in order: the answer does not depend on how
//! many threads there are.
//!
//! Boyd, Parikh, Chu, Peleato, Eckstein, *Distributed Optimization and
//! Statistical Learning via ADMM* (2011), sections 3.3 (stopping), 3.4.1
//! (balancing), 3.4.3 (over-relaxation), 7.1 (consensus).

use super::column_block::ColumnBlock;
use super::convergence::{Convergence, Residuals, Stop};
use super::data_term::{DataTerm, Factor};
use super::haar::{Haar, LANES};
use super::row_block::RowBlock;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Over-relaxation: 1 is none, 2 the limit.
const RELAXATION: f32 = 1.7;
/// First `rho`, in medians of the data term's non-zero eigenvalues.
const FIRST_RHO: f64 = 0.3;
/// `rho` is balanced after every so many iterations, in the first
/// [`BALANCED_ITERATIONS`] only, which keeps the proof of convergence.
const BALANCE_EVERY: u32 = 10;
/// See [`BALANCE_EVERY`].
const BALANCED_ITERATIONS: u32 = 100;
/// Part of the gains' norm that counts as operator when residuals are judged: a
/// flat scene's operator is zero, and nothing is small against it.
const GAIN_PART: f64 = 0.05;
/// Most rows in a block: its matrices then stay in a core's cache.
const MOST_PACKS: usize = 16;
/// Least number of blocks, for as many threads.
const LEAST_BLOCKS: usize = 4;

/// The state of the iteration. It survives a change of `lambda` and of the data,
/// which then start from the last solution.
#[derive(Debug)]
pub(super) struct Consensus<'h> {
    haar: &'h Haar,
    rows: Vec<RowBlock>,
    columns: Vec<ColumnBlock>,
    /// Penalty weight of each place.
    weights: Vec<f32>,
    /// Square of the norm that residuals are relative to, beside those of `K`
    /// and of the gains.
    floor_norm: f64,
    /// `rho` of the scaled duals in the blocks.
    rho: Option<f64>,
    lambda: f64,
}

impl<'h> Consensus<'h> {
    /// Starts from `K = 0`.
    ///
    /// `weights` are those of the coefficients, in the order of `haar`. Rows and
    /// columns of cells that are not `live` have no photographs to fit; the
    /// other two blocks alone decide on them.
    pub(super) fn new(
        haar: &'h Haar,
        weights: &[f64],
        live: &[bool],
        floor: Option<&DMatrix<f64>>,
    ) -> Self {
        let cells = live.len();
        let mut by_place = vec![0.0_f32; cells];
        for (place, weight) in haar.places().iter().zip(weights) {
            by_place[*place as usize] = *weight as f32;
        }
        let columns = (0..cells)
            .step_by(LANES)
            .map(|first| ColumnBlock::new(first, &by_place))
            .collect();
        let rows = row_ranges(cells)
            .into_iter()
            .map(|(start, width)| RowBlock::new(start, width, live, floor))
            .collect();
        Self {
            haar,
            rows,
            columns,
            weights: by_place,
            floor_norm: floor.map_or(0.0, DMatrix::norm_squared),
            rho: None,
            lambda: 0.0,
        }
    }

    /// Iterates on `data` until `stop`; `step` is called after every iteration.
    pub(super) fn run(
        &mut self,
        data: &DataTerm,
        lambda: f64,
        stop: Stop,
        step: &(dyn Fn() + Sync),
    ) -> Convergence {
        let mut factor = data.factor(self.rho.unwrap_or(FIRST_RHO * data.scale()));
        self.lambda = lambda;
        self.rows
            .par_iter_mut()
            .for_each(|block| block.load_residual(data.weighted.as_ref()));
        self.take(&factor);
        let norm = self.floor_norm + GAIN_PART * GAIN_PART * data.squared_gains();
        let mut end = Convergence::none();
        while end.iterations < stop.iterations && !end.converged {
            let residuals = self.iterate(data, &factor);
            step();
            end.advance(
                Residuals {
                    norm: residuals.norm + norm,
                    ..residuals
                },
                stop,
            );
            let balances = end.iterations.is_multiple_of(BALANCE_EVERY);
            if balances && end.iterations <= BALANCED_ITERATIONS {
                self.balance(data, &mut factor, end);
            }
        }
        end
    }

    /// The l1 block's `K`: exactly sparse in the Haar basis.
    pub(super) fn operator(&self) -> DMatrix<f64> {
        let cells = self.weights.len();
        let mut coefficients = DMatrix::zeros(cells, cells);
        let mut order = vec![0; cells];
        for (coefficient, place) in self.haar.places().iter().enumerate() {
            order[*place as usize] = coefficient;
        }
        for block in &self.columns {
            for (row, column, value) in block.solution(&self.weights, self.threshold()) {
                coefficients[(order[row], order[column])] = f64::from(value);
            }
        }
        self.haar.synthesise_operator(&coefficients)
    }

    /// Non-zero coefficients of [`Self::operator`].
    pub(super) fn coefficients(&self) -> usize {
        let threshold = self.threshold();
        let count = |block: &ColumnBlock| block.solution(&self.weights, threshold).count();
        self.columns.iter().map(count).sum()
    }

    /// What the l1 block shrinks a coefficient of weight 1 by. Two blocks share
    /// `rho`.
    fn threshold(&self) -> f32 {
        (2.0 * self.lambda / self.rho.unwrap_or(1.0)) as f32
    }

    /// Makes the blocks use `factor`, whose `rho` may be new.
    fn take(&mut self, factor: &Factor) {
        self.rho = Some(factor.rho);
        let threshold = self.threshold();
        let Self { haar, weights, .. } = self;
        self.rows
            .par_iter_mut()
            .for_each(|block| block.load(factor));
        self.columns
            .par_iter_mut()
            .for_each(|block| block.refresh(haar, weights, threshold));
    }

    fn iterate(&mut self, data: &DataTerm, factor: &Factor) -> Residuals {
        let threshold = self.threshold();
        let Self {
            haar,
            rows,
            columns,
            weights,
            ..
        } = self;
        let by_rows: Vec<_> = rows
            .par_iter_mut()
            .map(|block| block.step(haar, columns, (data, factor), RELAXATION))
            .collect();
        let by_columns: Vec<_> = columns
            .par_iter_mut()
            .map(|block| block.step(haar, rows, weights, threshold, RELAXATION))
            .collect();
        let mut total = Residuals::default();
        for residuals in by_rows.into_iter().chain(by_columns) {
            total += residuals;
        }
        // Both blocks have counted the data block's norm.
        total.norm /= 2.0;
        total
    }

    /// Moves `rho` so that both residuals fall alike.
    fn balance(&mut self, data: &DataTerm, factor: &mut Factor, end: Convergence) {
        let Some(change) = end.imbalance() else {
            return;
        };
        let threshold = self.threshold();
        let dual = change.recip() as f32;
        for block in &mut self.rows {
            block.scale_dual(dual);
        }
        for block in &mut self.columns {
            block.scale_dual(&self.weights, threshold, dual);
        }
        *factor = data.factor(factor.rho * change);
        self.take(factor);
    }
}

/// Start and width of each block of rows: whole packs, as equal as can be.
fn row_ranges(cells: usize) -> Vec<(usize, usize)> {
    let packs = cells.div_ceil(LANES);
    let blocks = packs.div_ceil(MOST_PACKS).max(LEAST_BLOCKS).min(packs);
    let cut = |block: usize| block * packs / blocks * LANES;
    (0..blocks)
        .map(|block| (cut(block), cut(block + 1) - cut(block)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::test_linear_program::least_penalty;
    use super::super::test_reference::Problem;
    use super::super::test_scene::{Corner, Random, add_noise, patterns};
    use super::*;
    use iltm_runtime::Grid;
    use proptest::prelude::*;

    const TIGHT: Stop = Stop {
        // What single precision can reach.
        tolerance: 1e-5,
        iterations: 20_000,
    };

    fn haar(rows: u16, cols: u16) -> (Haar, Vec<f64>) {
        let haar = Haar::new(Grid::new(rows, cols).unwrap());
        let weights = haar
            .fineness()
            .iter()
            .map(|f| 1.3_f64.powf(f / 2.0))
            .collect();
        (haar, weights)
    }

    #[test]
    fn the_blocks_agree_with_the_plain_reference() {
        let (rows, cols) = (4, 5);
        let (haar, coefficient_weights) = haar(rows, cols);
        for (channels, weighted) in [(1, false), (1, true), (3, false), (3, true)] {
            let patterns = patterns(20, 12);
            let light: Vec<_> = (0..channels)
                .map(|channel| {
                    let scene = Corner::new(4, 5, |cell| 0.4 + 0.02 * (cell + channel) as f64);
                    let mut light = scene.photograph(&patterns);
                    add_noise(&mut light, 0.01);
                    light
                })
                .collect();
            let mut random = Random(3);
            let weights = patterns.map(|_| {
                if weighted {
                    0.5 + random.uniform()
                } else {
                    1.0
                }
            });
            let lambda = 0.02;
            let reference = Problem {
                haar: &haar,
                light: &light,
                patterns: &patterns,
                weights: &weights,
                coefficient_weights: &coefficient_weights,
                lambda,
            };
            let (wanted, _) = reference.solve(0.4, 6000);
            let data = DataTerm::new(light, vec![patterns.clone(); channels], &weights);
            let mut consensus = Consensus::new(&haar, &coefficient_weights, &[true; 20], None);
            let end = consensus.run(&data, lambda, TIGHT, &|| {});
            assert!(end.converged, "{end:?}");
            let error = (consensus.operator() - &wanted).norm() / wanted.norm();
            assert!(error < 1e-3, "{channels} {weighted}: {error}");
        }
    }

    #[test]
    fn a_vanishing_lambda_gives_the_linear_programs_optimum() {
        let (haar, weights) = haar(2, 3);
        let patterns = patterns(6, 3);
        let light = Corner::new(2, 3, |cell| 0.5 + 0.05 * cell as f64).photograph(&patterns);
        let least = least_penalty(&haar, &weights, &light, &patterns);
        let equal = patterns.map(|_| 1.0);
        let data = DataTerm::new(vec![light], vec![patterns], &equal);
        let mut consensus = Consensus::new(&haar, &weights, &[true; 6], None);
        for lambda in [1e-2, 1e-3, 1e-4, 1e-5] {
            consensus.run(&data, lambda, TIGHT, &|| {});
        }
        let coefficients = haar.analyse_operator(&consensus.operator());
        let mut penalty = 0.0;
        for (a, row) in weights.iter().zip(coefficients.row_iter()) {
            for (b, value) in weights.iter().zip(row.iter()) {
                penalty += a * b * value.abs();
            }
        }
        assert!(
            (penalty / least - 1.0).abs() < 2e-3,
            "{penalty} against {least}"
        );
    }

    proptest! {
        #[test]
        fn blocks_are_whole_packs_and_hold_every_row_once(cells in 1_usize..5000) {
            let mut next = 0;
            for (start, width) in row_ranges(cells) {
                prop_assert_eq!(start, next);
                prop_assert!(width > 0 && width.is_multiple_of(LANES));
                next = start + width;
            }
            prop_assert_eq!(next, cells.next_multiple_of(LANES));
        }
    }
}
