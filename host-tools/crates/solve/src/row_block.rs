//! Rows of `K` during the iterations: the data block and the sign block.
//!
//! A block keeps its rows side by side: element `(row, column)` is at
//! `column * width + row`, so that a row's image is transformed in lanes and
//! the product with the shared matrix is one call. `width` is the number of
//! rows rounded up to whole packs; rows beyond the last stay zero.

use super::column_block::ColumnBlock;
use super::convergence::Residuals;
use super::data_term::{DataTerm, Factor, Shrink, Slack};
use super::haar::{Haar, LANES, Pack, transpose};
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};

#[derive(Debug)]
pub(super) struct RowBlock {
    start: usize,
    /// Rows, rounded up to whole packs.
    width: usize,
    /// Rows that exist.
    rows: usize,
    /// State of the sign block: its solution plus its scaled dual.
    sign_state: Vec<f32>,
    /// What the data block is pulled towards, then scratch.
    wanted: Vec<f32>,
    /// The data block's `K`.
    solution: Vec<f32>,
    /// `K W`, one coefficient after the other.
    analysed: Vec<f32>,
    /// Lowest value an element may have; negative infinity on the diagonal.
    floor: Vec<f32>,
    /// One for a row with photographs, zero for any other, which the other
    /// blocks alone decide on.
    live: Vec<f32>,
    terms: Terms,
    slack: Option<RowSlack>,
    images: Vec<Pack>,
}

/// This block's rows of a [`Slack`], one photograph after the other.
#[derive(Debug)]
struct RowSlack {
    part: Vec<f32>,
    light: Vec<Vec<f32>>,
    targets: Vec<Vec<f32>>,
    /// The last residual's part that goes back into the target, by channel.
    excess: Vec<Vec<f32>>,
}

/// This block's rows of a [`Factor`].
#[derive(Debug, Default)]
struct Terms {
    slopes: Vec<Vec<f32>>,
    offset: Vec<f32>,
    /// Element `(c, d)` of every row's system at `(c * channels + d) * width`.
    systems: Vec<f32>,
    constants: Vec<f32>,
}

impl RowBlock {
    /// Rows `start..start + rows` of the matrix of `live.len()` rows.
    pub(super) fn new(
        start: usize,
        width: usize,
        live: &[bool],
        floor: Option<&DMatrix<f64>>,
    ) -> Self {
        let cells = live.len();
        let rows = width.min(cells - start);
        let size = width * cells;
        let mut lanes = vec![0.0; width];
        for (lane, live) in lanes.iter_mut().zip(&live[start..start + rows]) {
            *lane = f32::from(u8::from(*live));
        }
        let mut floor = floor.map_or_else(
            || vec![0.0; size],
            |floor| rows_of(floor, start, rows, width),
        );
        for row in 0..rows {
            floor[(start + row) * width + row] = f32::NEG_INFINITY;
        }
        Self {
            start,
            width,
            rows,
            sign_state: vec![0.0; size],
            wanted: vec![0.0; size],
            solution: vec![0.0; size],
            analysed: vec![0.0; size],
            floor,
            live: lanes,
            terms: Terms::default(),
            slack: None,
            images: vec![Pack::ZERO; cells],
        }
    }

    /// Takes this block's rows of new data.
    pub(super) fn load_slack(&mut self, slack: Option<&Slack>) {
        let take = |matrix: &DMatrix<f64>| rows_of(matrix, self.start, self.rows, self.width);
        self.slack = slack.map(|slack| RowSlack {
            part: {
                let mut part = take(&slack.part);
                for part in part.chunks_exact_mut(self.width) {
                    part.iter_mut()
                        .zip(&self.live)
                        .for_each(|(part, live)| *part *= live);
                }
                part
            },
            light: slack
                .light
                .iter()
                .map(|c| take(&c.map(f64::from)))
                .collect(),
            targets: slack.targets.iter().map(take).collect(),
            excess: vec![vec![0.0; self.width * slack.part.ncols()]; slack.light.len()],
        });
    }

    /// Takes this block's rows of a new factor.
    pub(super) fn load(&mut self, factor: &Factor) {
        let take = |matrix: &DMatrix<f64>| rows_of(matrix, self.start, self.rows, self.width);
        let channels = factor.slopes.len();
        let mut systems = vec![0.0; channels * channels * self.width];
        for (lane, system) in factor.gain_systems[self.start..][..self.rows]
            .iter()
            .enumerate()
        {
            for c in 0..channels {
                for d in 0..channels {
                    systems[(c * channels + d) * self.width + lane] = system[(c, d)] as f32;
                }
            }
        }
        self.terms = Terms {
            slopes: factor.slopes.iter().map(take).collect(),
            offset: take(&factor.offset),
            systems,
            constants: take(&factor.gain_constants),
        };
    }

    /// Multiplies the sign block's scaled dual, after a change of `rho`.
    pub(super) fn scale_dual(&mut self, by: f32) {
        for (state, floor) in self.sign_state.iter_mut().zip(&self.floor) {
            let solution = state.max(*floor);
            *state = solution + by * (*state - solution);
        }
    }

    /// One step of the data and the sign block; `columns` hold the l1 block's
    /// answer to the step before.
    pub(super) fn step(
        &mut self,
        haar: &Haar,
        columns: &[ColumnBlock],
        (data, factor): (&DataTerm, &Factor),
        relaxation: f32,
    ) -> Residuals {
        self.gather(haar, columns);
        let constants = self.take_up_slack(data, factor.rho as f32);
        let gains = self.solve_data(factor, constants);
        self.leave_slack(data, &gains);
        let residuals = self.solve_sign(relaxation);
        self.analyse(haar);
        residuals
    }

    /// The coefficients of `LANES` rows and `LANES` columns, columns first.
    pub(super) fn tile(&self, first_column: usize, row_pack: usize) -> [Pack; LANES] {
        let mut tile = [Pack::ZERO; LANES];
        let columns = self.analysed.chunks_exact(self.width).skip(first_column);
        for (pack, column) in tile.iter_mut().zip(columns) {
            pack.0.copy_from_slice(&column[row_pack * LANES..][..LANES]);
        }
        tile
    }

    pub(super) fn start(&self) -> usize {
        self.start
    }

    pub(super) fn packs(&self) -> usize {
        self.width / LANES
    }

    /// `wanted` = mean of what the l1 and the sign block ask for.
    fn gather(&mut self, haar: &Haar, columns: &[ColumnBlock]) {
        for pack in 0..self.packs() {
            let row = self.start + pack * LANES;
            for (columns, images) in columns.iter().zip(self.images.chunks_mut(LANES)) {
                let turned = transpose(columns.tile(row));
                images.copy_from_slice(&turned[..images.len()]);
            }
            haar.synthesise_in_place(&mut self.images);
            let wanted = self.wanted.chunks_exact_mut(self.width);
            for (wanted, image) in wanted.zip(&self.images) {
                wanted[pack * LANES..][..LANES].copy_from_slice(&image.0);
            }
        }
        let states = self.sign_state.iter().zip(&self.floor);
        for (wanted, (state, floor)) in self.wanted.iter_mut().zip(states) {
            *wanted = 0.5 * (*wanted + 2.0 * state.max(*floor) - state);
        }
    }

    /// Moves `wanted` and the gains' constants to targets with the excess added.
    fn take_up_slack(&mut self, data: &DataTerm, rho: f32) -> Vec<f32> {
        let mut constants = self.terms.constants.clone();
        let (Some(own), Some(slack)) = (&self.slack, &data.slack) else {
            return constants;
        };
        let (width, cells) = (self.width, self.images.len());
        for (c, transposed) in slack.transposed.iter().enumerate() {
            let excess = DMatrixView::from_slice(&own.excess[c], width, transposed.nrows());
            let mut wanted = DMatrixViewMut::from_slice(&mut self.wanted, width, cells);
            wanted.gemm(-rho.recip(), &excess, transposed, 1.0);
            let constants = &mut constants[c * width..][..width];
            let photographs = own.excess[c].chunks_exact(width);
            for (excess, light) in photographs.zip(own.light[c].chunks_exact(width)) {
                for (constant, (excess, light)) in
                    constants.iter_mut().zip(excess.iter().zip(light))
                {
                    *constant += excess * light;
                }
            }
        }
        constants
    }

    /// Computes the excess of the new residuals.
    fn leave_slack(&mut self, data: &DataTerm, gains: &[f32]) {
        let (Some(own), Some(slack)) = (&mut self.slack, &data.slack) else {
            return;
        };
        let (width, cells) = (self.width, self.images.len());
        let solution = DMatrixView::from_slice(&self.solution, width, cells);
        for (c, light) in slack.light.iter().enumerate() {
            let excess = &mut own.excess[c];
            let mut reflected = DMatrixViewMut::from_slice(excess, width, light.ncols());
            reflected.gemm(-1.0, &solution, light, 0.0);
            let gains = &gains[c * width..][..width];
            let rest = own
                .part
                .chunks_exact(width)
                .zip(own.light[c].chunks_exact(width));
            let rest = rest.zip(own.targets[c].chunks_exact(width));
            for (excess, ((part, light), target)) in excess.chunks_exact_mut(width).zip(rest) {
                for lane in 0..width {
                    excess[lane] =
                        part[lane] * (excess[lane] + gains[lane] * light[lane] - target[lane]);
                }
            }
        }
    }

    /// Returns the gains, one channel after the other.
    fn solve_data(&mut self, factor: &Factor, constants: Vec<f32>) -> Vec<f32> {
        let cells = self.images.len();
        let wanted = DMatrixView::from_slice(&self.wanted, self.width, cells);
        let mut product = DMatrixViewMut::from_slice(&mut self.solution, self.width, cells);
        match &factor.shrink {
            Shrink::Dense(shrink) => product.gemm(1.0, &wanted, shrink, 0.0),
            Shrink::LowRank { vectors, scaled } => {
                let seen = wanted * vectors;
                product.copy_from(&wanted);
                product.gemm(-1.0, &seen, scaled, 1.0);
            }
        }
        self.add_gains(factor.rho as f32, constants)
    }

    /// Solves for the gains and adds what they and the offset bring to the rows.
    fn add_gains(&mut self, rho: f32, mut right: Vec<f32>) -> Vec<f32> {
        let (width, channels) = (self.width, self.terms.slopes.len());
        for (right, slopes) in right.chunks_exact_mut(width).zip(&self.terms.slopes) {
            let mut dot = vec![0.0_f32; width];
            let columns = self
                .wanted
                .chunks_exact(width)
                .zip(slopes.chunks_exact(width));
            for (wanted, slopes) in columns {
                for (dot, (wanted, slope)) in dot.iter_mut().zip(wanted.iter().zip(slopes)) {
                    *dot += wanted * slope;
                }
            }
            for (right, dot) in right.iter_mut().zip(dot) {
                *right += rho * dot;
            }
        }
        let mut gains = vec![0.0_f32; channels * width];
        for (c, gains) in gains.chunks_exact_mut(width).enumerate() {
            for (d, right) in right.chunks_exact(width).enumerate() {
                let system = &self.terms.systems[(c * channels + d) * width..][..width];
                for (gain, (system, right)) in gains.iter_mut().zip(system.iter().zip(right)) {
                    *gain += system * right;
                }
            }
        }
        for (gains, slopes) in gains.chunks_exact(width).zip(&self.terms.slopes) {
            let columns = self.solution.chunks_exact_mut(width);
            for (solution, slopes) in columns.zip(slopes.chunks_exact(width)) {
                for (value, (gain, slope)) in solution.iter_mut().zip(gains.iter().zip(slopes)) {
                    *value += gain * slope;
                }
            }
        }
        let columns = self.solution.chunks_exact_mut(width);
        let columns = columns.zip(self.terms.offset.chunks_exact(width));
        for ((solution, offset), wanted) in columns.zip(self.wanted.chunks_exact(width)) {
            for lane in 0..width {
                let found = solution[lane] + offset[lane];
                solution[lane] = wanted[lane] + self.live[lane] * (found - wanted[lane]);
            }
        }
        gains
    }

    fn solve_sign(&mut self, relaxation: f32) -> Residuals {
        let mut residuals = Residuals::default();
        let keep = 1.0 - relaxation;
        let columns = self.sign_state.chunks_exact_mut(self.width);
        let columns = columns.zip(self.solution.chunks_exact(self.width));
        let columns = columns.zip(self.floor.chunks_exact(self.width));
        for ((states, solutions), floors) in columns {
            let elements = states.iter_mut().zip(solutions.iter().zip(floors));
            let (mut norm, mut primal, mut dual) = (0.0_f32, 0.0_f32, 0.0_f32);
            for (state, (solution, floor)) in elements {
                let before = state.max(*floor);
                let next = relaxation * solution + keep * before + (*state - before);
                let after = next.max(*floor);
                *state = next;
                norm += solution * solution;
                primal += (solution - after) * (solution - after);
                dual += (after - before) * (after - before);
            }
            residuals.norm += f64::from(norm);
            residuals.primal += f64::from(primal);
            residuals.dual += f64::from(dual);
        }
        residuals
    }

    fn analyse(&mut self, haar: &Haar) {
        for pack in 0..self.packs() {
            let lanes = pack * LANES..(pack + 1) * LANES;
            let solution = self.solution.chunks_exact(self.width);
            for (image, solution) in self.images.iter_mut().zip(solution) {
                image.0.copy_from_slice(&solution[lanes.clone()]);
            }
            haar.analyse_in_place(&mut self.images);
            let analysed = self.analysed.chunks_exact_mut(self.width);
            for (analysed, image) in analysed.zip(&self.images) {
                analysed[lanes.clone()].copy_from_slice(&image.0);
            }
        }
    }
}

/// Rows `start..start + rows` in a block's layout.
fn rows_of(matrix: &DMatrix<f64>, start: usize, rows: usize, width: usize) -> Vec<f32> {
    let mut block = vec![0.0; width * matrix.ncols()];
    for (column, to) in block.chunks_exact_mut(width).enumerate() {
        for (lane, value) in to[..rows].iter_mut().enumerate() {
            *value = matrix[(start + lane, column)] as f32;
        }
    }
    block
}
