//! White and Bernoulli photographs as equations for the doubly transformed transport.
//!
//! With `P` signs (twice a 0/1 pattern less white) the camera sees `T P = Y`, and
//! `T^ = W^T T W`, coded in Haar on both sides, obeys `(P^T W) T^^T = (W^T Y)^T`: one
//! sparse unknown, the response to the projector's coefficients, for each of the camera's
//! coefficients. Row by row it is solved greedily.
//!
//! The papers have the number of coefficients from experience; here one photograph in
//! eight is held out, each row stops where it predicts them best, and is fitted to all
//! photographs once the support is chosen.

use super::greedy::{Estimate, Greedy};
use crate::capture::{Role, columns, shown};
use crate::compare::{Rig, Unfit};
use crate::solve::{Basis, Haar};
use nalgebra::{DMatrix, DVector};

/// One photograph of so many is held out.
const HELD_OUT: usize = 8;
/// Equations below which none is.
const FEW: usize = 2 * HELD_OUT;
/// Columns a step that are tried, as parts of the equations.
const AT_ONCE: [usize; 4] = [64, 32, 16, 8];

/// What was photographed, transformed.
pub(super) struct Sensing {
    pub(super) haar: Haar,
    /// All equations, `m x N`.
    all: Greedy,
    /// Those that are not held out, by index, and their matrix.
    kept: Vec<usize>,
    part: Greedy,
    /// The others.
    held_out: Vec<usize>,
    /// `(W^T Y)^T`, `m x N`.
    right: DMatrix<f64>,
    /// Noise of each camera coefficient in one equation, length `N`.
    noise: Vec<f64>,
}

impl Sensing {
    /// Takes white and `photographs - 1` Bernoulli patterns by `seed`.
    ///
    /// # Errors
    /// [`Unfit::Condition`] if none is left for a pattern.
    pub(super) fn take(rig: &mut Rig, photographs: usize, seed: u64) -> Result<Self, Unfit> {
        if photographs < 2 {
            return Err(Unfit::Condition(format!(
                "{photographs} photographs leave none for Bernoulli patterns"
            )));
        }
        let shown: Vec<_> = shown(rig.grid(), photographs - 1, seed)
            .into_iter()
            .filter(|(role, _)| matches!(role, Role::White | Role::Bernoulli))
            .collect();
        let mut patterns = columns(&shown);
        for (mut lights, live) in patterns.row_iter_mut().zip(rig.live()) {
            lights *= f64::from(u8::from(*live));
        }
        let light = rig.photograph(&patterns);
        let haar = Haar::new(rig.grid(), Basis::QuadTree);
        let matrix = haar.analyse_columns(&signs(&patterns)).transpose();
        let right = haar.analyse_columns(&signs(&light)).transpose();
        let equations = matrix.nrows();
        // The first is white's.
        let (held_out, kept): (Vec<_>, Vec<_>) =
            (0..equations).partition(|row| equations >= FEW && row % HELD_OUT == HELD_OUT - 1);
        Ok(Self {
            noise: coefficient_noise(rig, &haar, &light),
            part: Greedy::new(matrix.select_rows(&kept)),
            all: Greedy::new(matrix),
            kept,
            held_out,
            right,
            haar,
        })
    }

    /// The response of one camera coefficient, `first` being where to look first.
    pub(super) fn decode(&self, coefficient: usize, first: &[usize]) -> Estimate {
        let right: DVector<f64> = self.right.column(coefficient).into_owned();
        let kept = right.select_rows(&self.kept);
        let radius = self.noise[coefficient] * (kept.len() as f64).sqrt();
        let mut best = (f64::INFINITY, Estimate::default());
        for part in AT_ONCE {
            let at_once = (kept.len() / part).max(1);
            let answers = self.part.pursue(&kept, first, at_once, radius);
            let answers = if self.held_out.is_empty() {
                // Nothing to choose by but the residual.
                answers.into_iter().last().into_iter().collect()
            } else {
                answers
            };
            for answer in answers {
                let misfit = self.misfit(&answer, &right);
                if misfit < best.0 {
                    best = (misfit, answer);
                }
            }
        }
        let fitted = self.all.fit(&best.1.support, &right);
        fitted.unwrap_or(best.1)
    }

    /// Squared residual in the photographs held out, or in all.
    fn misfit(&self, answer: &Estimate, right: &DVector<f64>) -> f64 {
        let left = right - answer.applied(self.all.matrix());
        if self.held_out.is_empty() {
            left.norm_squared()
        } else {
            left.select_rows(&self.held_out).norm_squared()
        }
    }

    /// `T`, `N x N`, of responses by camera coefficient; rows and columns of cells that
    /// are not live are zero.
    pub(super) fn transport(&self, responses: &[Estimate], live: &[bool]) -> DMatrix<f64> {
        let cells = live.len();
        let mut coded = DMatrix::zeros(cells, cells);
        for (row, response) in responses.iter().enumerate() {
            for (column, value) in response.support.iter().zip(&response.values) {
                coded[(row, *column)] = *value;
            }
        }
        let mut transport = self.haar.synthesise_operator(&coded);
        for (cell, _) in live.iter().enumerate().filter(|(_, live)| !**live) {
            transport.row_mut(cell).fill(0.0);
            transport.column_mut(cell).fill(0.0);
        }
        transport
    }
}

/// White as it is, every other column twice less white.
fn signs(columns: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(columns.nrows(), columns.ncols(), |row, column| {
        if column == 0 {
            columns[(row, 0)]
        } else {
            2.0 * columns[(row, column)] - columns[(row, 0)]
        }
    })
}

/// Standard deviation of each coefficient of `2 c - white`, from that of the cells.
fn coefficient_noise(rig: &Rig, haar: &Haar, light: &DMatrix<f64>) -> Vec<f64> {
    let cells = light.nrows();
    let mut deviations = DMatrix::zeros(cells, cells);
    for cell in rig.live_cells() {
        let white = rig.noise().variance(light[(cell, 0)]);
        let half = rig.noise().variance(0.5 * light[(cell, 0)]);
        deviations[(cell, cell)] = (4.0 * half + white).sqrt();
    }
    let coded = haar.analyse_columns(&deviations);
    coded.row_iter().map(|row| row.norm()).collect()
}
