//! Rows of `K` during the iterations: the data block and the sign block.
//!
//! A block keeps its rows as matrices of `width` rows and one column a cell or
//! photograph. A column's rows are side by side in memory, so that a row's image is
//! transformed in lanes and the product with the shared matrix is one call. `width`
//! is the number of rows rounded up to whole packs; rows beyond the last stay zero.

use super::column_block::ColumnBlock;
use super::convergence::Residuals;
use super::data_term::{DataTerm, Factor, Shrink, WeightedResidual};
use super::haar::{Haar, LANES, Pack, transpose};
use nalgebra::{DMatrix, DVector};

#[derive(Debug)]
pub(super) struct RowBlock {
    start: usize,
    /// Rows that exist.
    rows: usize,
    /// State of the sign block: its solution plus its scaled dual.
    sign_state: DMatrix<f32>,
    /// What the data block is pulled towards, then scratch.
    wanted: DMatrix<f32>,
    /// The data block's `K`.
    solution: DMatrix<f32>,
    /// `K W`, a column a coefficient.
    analysed: DMatrix<f32>,
    /// Lowest value an element may have; negative infinity on the diagonal.
    floor: DMatrix<f32>,
    /// One for a row with photographs, zero for any other, which the other
    /// blocks alone decide on.
    live: DVector<f32>,
    terms: Terms,
    weighted: Option<RowResidual>,
    images: Vec<Pack>,
}

/// This block's rows of a [`WeightedResidual`], a column a photograph.
#[derive(Debug)]
struct RowResidual {
    share: DMatrix<f32>,
    light: Vec<DMatrix<f32>>,
    targets: Vec<DMatrix<f32>>,
    /// The last residual's share that goes back into the target, by channel.
    residual: Vec<DMatrix<f32>>,
}

/// This block's rows of a [`Factor`].
#[derive(Debug, Default)]
struct Terms {
    slopes: Vec<DMatrix<f32>>,
    offset: DMatrix<f32>,
    /// Element `(c, d)` of every row's system in column `c * channels + d`.
    systems: DMatrix<f32>,
    constants: DMatrix<f32>,
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
        let zero = DMatrix::zeros(width, cells);
        let mut floor =
            floor.map_or_else(|| zero.clone(), |floor| rows_of(floor, start, rows, width));
        for row in 0..rows {
            floor[(row, start + row)] = f32::NEG_INFINITY;
        }
        Self {
            start,
            rows,
            sign_state: zero.clone(),
            wanted: zero.clone(),
            solution: zero.clone(),
            analysed: zero,
            floor,
            live: DVector::from_fn(width, |row, _| {
                f32::from(u8::from(row < rows && live[start + row]))
            }),
            terms: Terms::default(),
            weighted: None,
            images: vec![Pack::ZERO; cells],
        }
    }

    fn width(&self) -> usize {
        self.live.len()
    }

    /// Takes this block's rows of new data.
    pub(super) fn load_residual(&mut self, weighted: Option<&WeightedResidual>) {
        let take = |matrix: &DMatrix<f64>| rows_of(matrix, self.start, self.rows, self.width());
        self.weighted = weighted.map(|weighted| {
            let mut share = take(&weighted.share);
            for mut share in share.column_iter_mut() {
                share.component_mul_assign(&self.live);
            }
            let light = weighted.light.iter().map(|c| take(&c.map(f64::from)));
            RowResidual {
                light: light.collect(),
                targets: weighted.targets.iter().map(take).collect(),
                residual: vec![DMatrix::zeros(self.width(), share.ncols()); weighted.light.len()],
                share,
            }
        });
    }

    /// Takes this block's rows of a new factor.
    pub(super) fn load(&mut self, factor: &Factor) {
        let width = self.width();
        let take = |matrix: &DMatrix<f64>| rows_of(matrix, self.start, self.rows, width);
        let channels = factor.slopes.len();
        let systems = &factor.gain_systems[self.start..][..self.rows];
        self.terms = Terms {
            slopes: factor.slopes.iter().map(take).collect(),
            offset: take(&factor.offset),
            systems: DMatrix::from_fn(width, channels * channels, |row, element| {
                let system = systems.get(row);
                system.map_or(0.0, |s| s[(element / channels, element % channels)] as f32)
            }),
            constants: take(&factor.gain_constants),
        };
    }

    /// Multiplies the sign block's scaled dual, after a change of `rho`.
    pub(super) fn scale_dual(&mut self, by: f32) {
        let states = self.sign_state.as_mut_slice().iter_mut();
        for (state, floor) in states.zip(self.floor.as_slice()) {
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
        let constants = self.add_residual(data, factor.rho as f32);
        let gains = self.solve_data(factor, constants);
        self.update_residual(data, &gains);
        let residuals = self.solve_sign(relaxation);
        self.analyse(haar);
        residuals
    }

    /// The coefficients of `LANES` rows and `LANES` columns, columns first.
    pub(super) fn tile(&self, first_column: usize, row_pack: usize) -> [Pack; LANES] {
        let mut tile = [Pack::ZERO; LANES];
        let columns = self.analysed.as_slice().chunks_exact(self.width());
        for (pack, column) in tile.iter_mut().zip(columns.skip(first_column)) {
            pack.0.copy_from_slice(&column[row_pack * LANES..][..LANES]);
        }
        tile
    }

    pub(super) fn start(&self) -> usize {
        self.start
    }

    pub(super) fn packs(&self) -> usize {
        self.width() / LANES
    }

    /// `wanted` = mean of what the l1 and the sign block ask for.
    fn gather(&mut self, haar: &Haar, columns: &[ColumnBlock]) {
        let width = self.width();
        for pack in 0..self.packs() {
            let row = self.start + pack * LANES;
            for (columns, images) in columns.iter().zip(self.images.chunks_mut(LANES)) {
                let turned = transpose(columns.tile(row));
                images.copy_from_slice(&turned[..images.len()]);
            }
            haar.synthesise_in_place(&mut self.images);
            let wanted = self.wanted.as_mut_slice().chunks_exact_mut(width);
            for (wanted, image) in wanted.zip(&self.images) {
                wanted[pack * LANES..][..LANES].copy_from_slice(&image.0);
            }
        }
        let states = self.sign_state.as_slice().iter().zip(self.floor.as_slice());
        for (wanted, (state, floor)) in self.wanted.as_mut_slice().iter_mut().zip(states) {
            *wanted = 0.5 * (*wanted + 2.0 * state.max(*floor) - state);
        }
    }

    /// Moves `wanted` and the gains' constants to targets with the residual added.
    fn add_residual(&mut self, data: &DataTerm, rho: f32) -> DMatrix<f32> {
        let mut constants = self.terms.constants.clone();
        let (Some(own), Some(weighted)) = (&self.weighted, &data.weighted) else {
            return constants;
        };
        for (c, transposed) in weighted.transposed.iter().enumerate() {
            let residual = &own.residual[c];
            self.wanted.gemm(-rho.recip(), residual, transposed, 1.0);
            let mut constants = constants.column_mut(c);
            for (residual, light) in residual.column_iter().zip(own.light[c].column_iter()) {
                constants.cmpy(1.0, &residual, &light, 1.0);
            }
        }
        constants
    }

    /// Computes the share of the new residuals.
    fn update_residual(&mut self, data: &DataTerm, gains: &DMatrix<f32>) {
        let (Some(own), Some(weighted)) = (&mut self.weighted, &data.weighted) else {
            return;
        };
        for (c, light) in weighted.light.iter().enumerate() {
            let (residual, gains) = (&mut own.residual[c], gains.column(c));
            residual.gemm(-1.0, &self.solution, light, 0.0);
            for (k, mut residual) in residual.column_iter_mut().enumerate() {
                residual.cmpy(1.0, &gains, &own.light[c].column(k), 1.0);
                residual -= own.targets[c].column(k);
                residual.component_mul_assign(&own.share.column(k));
            }
        }
    }

    /// Returns the gains, a column a channel.
    fn solve_data(&mut self, factor: &Factor, constants: DMatrix<f32>) -> DMatrix<f32> {
        match &factor.shrink {
            Shrink::Dense(shrink) => self.solution.gemm(1.0, &self.wanted, shrink, 0.0),
            Shrink::LowRank { vectors, scaled } => {
                let seen = &self.wanted * vectors;
                self.solution.copy_from(&self.wanted);
                self.solution.gemm(-1.0, &seen, scaled, 1.0);
            }
        }
        self.add_gains(factor.rho as f32, constants)
    }

    /// Solves for the gains and adds what they and the offset bring to the rows.
    fn add_gains(&mut self, rho: f32, mut right: DMatrix<f32>) -> DMatrix<f32> {
        let (width, channels) = right.shape();
        for (mut right, slopes) in right.column_iter_mut().zip(&self.terms.slopes) {
            let mut dot = DVector::zeros(width);
            for (wanted, slopes) in self.wanted.column_iter().zip(slopes.column_iter()) {
                dot.cmpy(1.0, &wanted, &slopes, 1.0);
            }
            right.axpy(rho, &dot, 1.0);
        }
        let mut gains = DMatrix::zeros(width, channels);
        for (c, mut gains) in gains.column_iter_mut().enumerate() {
            for (d, right) in right.column_iter().enumerate() {
                let system = self.terms.systems.column(c * channels + d);
                gains.cmpy(1.0, &system, &right, 1.0);
            }
        }
        for (k, mut solution) in self.solution.column_iter_mut().enumerate() {
            for (gains, slopes) in gains.column_iter().zip(&self.terms.slopes) {
                solution.cmpy(1.0, &gains, &slopes.column(k), 1.0);
            }
            solution += self.terms.offset.column(k);
            // Rows without photographs stay as they are wanted.
            solution -= self.wanted.column(k);
            solution.component_mul_assign(&self.live);
            solution += self.wanted.column(k);
        }
        gains
    }

    fn solve_sign(&mut self, relaxation: f32) -> Residuals {
        let mut residuals = Residuals::default();
        let (keep, width) = (1.0 - relaxation, self.width());
        let columns = self.sign_state.as_mut_slice().chunks_exact_mut(width);
        let columns = columns.zip(self.solution.as_slice().chunks_exact(width));
        let columns = columns.zip(self.floor.as_slice().chunks_exact(width));
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
        let width = self.width();
        for pack in 0..self.packs() {
            let lanes = pack * LANES..(pack + 1) * LANES;
            let solution = self.solution.as_slice().chunks_exact(width);
            for (image, solution) in self.images.iter_mut().zip(solution) {
                image.0.copy_from_slice(&solution[lanes.clone()]);
            }
            haar.analyse_in_place(&mut self.images);
            let analysed = self.analysed.as_mut_slice().chunks_exact_mut(width);
            for (analysed, image) in analysed.zip(&self.images) {
                analysed[lanes.clone()].copy_from_slice(&image.0);
            }
        }
    }
}

/// Rows `start..start + rows` as a block has them.
fn rows_of(matrix: &DMatrix<f64>, start: usize, rows: usize, width: usize) -> DMatrix<f32> {
    let own = matrix.rows(start, rows).map(|value| value as f32);
    own.resize_vertically(width, 0.0)
}
