//! Leave-one-out prediction: what each cell should look like in each photograph, by all
//! the others.
//!
//! Each cell's light is fitted as a sum over the 3 x 3 cells around it and over the
//! lit share of coarse blocks of the whole grid: near light exactly, far light
//! smoothly. A photograph's own part in the fit is taken out of its prediction
//! (leave-one-out, the PRESS residual of Allen 1974), so that a photograph that does
//! not fit cannot hide. All photographs share one projector, so that how much
//! brighter a photograph is than predicted, over all cells, is its gain.

use crate::format::sequence::Sequence;
use crate::registration::cell_map::cell_beside;
use iltm_picture::statistics::median;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Cells that are looked at; of larger grids evenly chosen ones.
const MOST_CELLS: usize = 1024;

/// Blocks along a side of the grid.
const BLOCKS: usize = 4;

/// Cells along a block's side at least.
const LEAST_SIDE: usize = 3;

/// Ridge on the light of the cells around and of the blocks: the square of the
/// relative misfit (about 1 %) over the square of the coefficient's size.
const RIDGE_NEAR: f64 = 1e-4;
const RIDGE_FAR: f64 = 1e-2;

/// Rounds of fitting cells and gains in turn.
const ROUNDS: usize = 4;

/// Part of a cell's brightest light from which it counts as lit in a photograph.
const LIT: f64 = 0.4;

/// Predictions of one channel.
pub(crate) struct LeaveOneOut {
    /// The cells that were fitted.
    pub(crate) cells: Vec<usize>,
    /// Photographs that were fitted: all but black, in the order they were taken.
    pub(crate) shots: Vec<usize>,
    /// Light in those cells and photographs, black removed.
    pub(crate) light: DMatrix<f64>,
    /// What the other photographs predict, at gain 1.
    pub(crate) predicted: DMatrix<f64>,
    /// How much brighter than predicted each photograph is; median 1.
    pub(crate) gains: Vec<f64>,
    /// Standard error of each gain, from the scatter over the cells.
    pub(crate) errors: Vec<f64>,
}

impl LeaveOneOut {
    /// Fits `light` (`N x shots`, black not removed) of one channel; `black` is its
    /// light under black. `None` if there are too few photographs or cells.
    pub(crate) fn fit(
        sequence: &Sequence,
        live: &[bool],
        light: &DMatrix<f64>,
        black: impl Fn(usize, usize) -> f64,
    ) -> Option<Self> {
        let found: Vec<usize> = (0..live.len()).filter(|&cell| live[cell]).collect();
        let step = found.len().div_ceil(MOST_CELLS).max(1);
        let cells: Vec<usize> = found.into_iter().step_by(step).collect();
        let mut shown: Vec<(usize, &[bool])> = (sequence.views.iter())
            .flat_map(|view| view.shots.iter().map(|&shot| (shot, view.lit.as_slice())))
            .collect();
        shown.sort_by_key(|(shot, _)| *shot);
        let shots: Vec<usize> = shown.iter().map(|(shot, _)| *shot).collect();
        let far = blocks(sequence, &shown);
        if cells.len() < 4 || shots.len() < 2 * (9 + far.ncols()) {
            return None;
        }
        let light = DMatrix::from_fn(cells.len(), shots.len(), |cell, at| {
            light[(cells[cell], shots[at])] - black(cells[cell], shots[at])
        });
        let rows = cells
            .iter()
            .map(|&cell| Row::new(sequence, cell, &shown, &far));
        let rows: Vec<Row> = rows.collect();
        let mut model = Self {
            gains: vec![1.0; shots.len()],
            errors: vec![0.0; shots.len()],
            predicted: DMatrix::zeros(cells.len(), shots.len()),
            cells,
            shots,
            light,
        };
        for _ in 0..ROUNDS {
            model.predict(&rows);
            model.weigh();
        }
        Some(model)
    }

    /// Predicts every photograph from the others at the present gains.
    fn predict(&mut self, rows: &[Row]) {
        let predicted: Vec<DVector<f64>> = rows
            .par_iter()
            .enumerate()
            .map(|(cell, row)| {
                let light = self.light.row(cell);
                let even = light
                    .iter()
                    .zip(&self.gains)
                    .map(|(light, gain)| light / gain);
                row.left_out(&DVector::from_iterator(self.gains.len(), even))
            })
            .collect();
        for (cell, predicted) in predicted.iter().enumerate() {
            self.predicted.row_mut(cell).tr_copy_from(predicted);
        }
    }

    /// Compares light and prediction in the lit cells of each photograph.
    fn weigh(&mut self) {
        for at in 0..self.shots.len() {
            let mut ratios = self.ratios(at);
            ratios.sort_by(f64::total_cmp);
            let Some(&middle) = ratios.get(ratios.len() / 2) else {
                continue;
            };
            let quarter = |k: usize| ratios[(k * (ratios.len() - 1)) / 4];
            // Half the range between quartiles is .674 of a standard deviation, and
            // a median's error is 1.25 of a mean's.
            let spread = (quarter(3) - quarter(1)) / 1.349;
            self.gains[at] = middle;
            self.errors[at] = 1.25 * spread / (ratios.len() as f64).sqrt();
        }
        if let Some(middle) = median(self.gains.clone()).filter(|middle| *middle > 0.0) {
            for gain in &mut self.gains {
                *gain /= middle;
            }
        }
    }

    /// How far each photograph is from what the others predict at its gain: root mean square over the
    /// cells, relative to that of all photographs' light.
    pub(crate) fn misfits(&self) -> impl Iterator<Item = f64> + '_ {
        let usual = (self.light.norm_squared() / self.shots.len() as f64).sqrt();
        (self.gains.iter().enumerate()).map(move |(at, gain)| {
            let off = self.light.column(at) - self.predicted.column(at) * *gain;
            off.norm() / usual.max(f64::MIN_POSITIVE)
        })
    }

    /// Light over prediction in each lit cell of a photograph.
    fn ratios(&self, at: usize) -> Vec<f64> {
        self.lit(at)
            .map(|cell| self.light[(cell, at)] / self.predicted[(cell, at)])
            .collect()
    }

    /// Places in `cells` of those that are lit in a photograph.
    pub(crate) fn lit(&self, at: usize) -> impl Iterator<Item = usize> + '_ {
        let lit = move |cell: &usize| {
            let brightest = self.predicted.row(*cell).max();
            self.predicted[(*cell, at)] > LIT * brightest && brightest > 0.0
        };
        (0..self.cells.len()).filter(lit)
    }
}

/// Lit share of each block of the grid in each photograph, `shots x blocks`.
fn blocks(sequence: &Sequence, shown: &[(usize, &[bool])]) -> DMatrix<f64> {
    let grid = sequence.grid;
    let side = |cells: usize| (cells / LEAST_SIDE).clamp(1, BLOCKS);
    let (down, across) = (side(grid.rows()), side(grid.cols()));
    let block = |cell: usize| {
        let (row, col) = (cell / grid.cols(), cell % grid.cols());
        row * down / grid.rows() * across + col * across / grid.cols()
    };
    let mut sizes = vec![0.0; down * across];
    for cell in 0..grid.cells() {
        sizes[block(cell)] += 1.0;
    }
    let mut shares = DMatrix::zeros(shown.len(), down * across);
    for (at, (_, lit)) in shown.iter().enumerate() {
        for cell in (0..grid.cells()).filter(|&cell| lit[cell]) {
            shares[(at, block(cell))] += 1.0 / sizes[block(cell)];
        }
    }
    shares
}

/// The regression of one cell: `shots x unknowns`, and what solves it.
struct Row {
    known: DMatrix<f64>,
    /// From light to coefficients, `unknowns x shots`.
    solver: DMatrix<f64>,
    /// Part of each photograph in its own prediction.
    leverage: Vec<f64>,
}

impl Row {
    fn new(
        sequence: &Sequence,
        cell: usize,
        shown: &[(usize, &[bool])],
        far: &DMatrix<f64>,
    ) -> Self {
        let near: Vec<usize> = (0..9)
            .filter_map(|k| cell_beside(sequence.grid, cell, k / 3 - 1, k % 3 - 1))
            .collect();
        let unknowns = near.len() + far.ncols();
        let known = DMatrix::from_fn(shown.len(), unknowns, |at, k| match near.get(k) {
            Some(&cell) => f64::from(u8::from(shown[at].1[cell])),
            None => far[(at, k - near.len())],
        });
        let mut normal = known.tr_mul(&known);
        for k in 0..unknowns {
            normal[(k, k)] += if k < near.len() {
                RIDGE_NEAR
            } else {
                RIDGE_FAR
            };
        }
        // Positive definite by the ridge; zeros would only predict nothing.
        let solver = normal.cholesky().map_or_else(
            || DMatrix::zeros(unknowns, shown.len()),
            |normal| normal.solve(&known.transpose()),
        );
        let leverage = (0..shown.len())
            .map(|at| (known.row(at) * solver.column(at))[(0, 0)])
            .collect();
        Self {
            known,
            solver,
            leverage,
        }
    }

    /// What the fit to all other photographs predicts for each.
    fn left_out(&self, light: &DVector<f64>) -> DVector<f64> {
        let fitted = &self.known * (&self.solver * light);
        DVector::from_fn(light.len(), |at, _| {
            let own = self.leverage[at].min(0.99);
            light[at] - (light[at] - fitted[at]) / (1.0 - own)
        })
    }
}
