//! Haar-domain sensing: white and Bernoulli photographs as equations for the doubly transformed transport.
//!
//! With patterns `P` the camera sees `T P = C`, and `T^ = W^T T W`, coded in Haar on both
//! sides, obeys `(P^T W) T^^T = (W^T C)^T`: one sparse unknown, the response to the
//! projector's coefficients, for each of the camera's coefficients. Row by row it is
//! solved greedily.
//!
//! Coefficients are looked for in signs (twice a 0/1 pattern less white), whose equations
//! have columns nearly at right angles; their values come from the photographs as they
//! are, whose noise is independent. White is the photograph of the constant, so that every
//! search begins there.
//!
//! The papers have the number of coefficients from experience; here one photograph in
//! eight is held out, each row stops where it predicts them best, and is fitted to all
//! photographs once the support is chosen.

use super::greedy::{Greedy, SparseEstimate};
use super::patterns;
use crate::rig::clear_dead;
use crate::{Rig, Unfit};
use iltm_capture::columns;
use iltm_solve::{Haar, Method};
use nalgebra::{DMatrix, DVector};

/// One photograph of so many is held out.
const HELD_OUT: usize = 8;
/// Equations below which none is.
const FEW: usize = 2 * HELD_OUT;
/// Columns a step that are tried, as parts of the equations.
const AT_ONCE: [usize; 4] = [64, 32, 16, 8];

/// What was photographed, transformed.
pub(super) struct HaarSensing {
    pub(super) haar: Haar,
    /// All equations in signs, `m x N`.
    signs: DMatrix<f64>,
    /// `(W^T C)^T` in signs, `m x N`.
    answers: DMatrix<f64>,
    /// Equations that are not held out, by index, and those in signs.
    kept: Vec<usize>,
    search: Greedy,
    /// The others.
    held_out: Vec<usize>,
    /// All equations as photographed, and `(W^T C)^T`, `m x N`.
    fit: Greedy,
    photographed: DMatrix<f64>,
    /// Noise of each camera coefficient in one equation in signs, length `N`.
    noise: Vec<f64>,
}

impl HaarSensing {
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
        let shown = patterns(Method::Direct, rig.grid(), photographs, seed);
        let mut patterns = columns(&shown);
        for (mut lights, live) in patterns.row_iter_mut().zip(rig.live()) {
            lights *= f64::from(u8::from(*live));
        }
        let light = rig.photograph(&patterns);
        let haar = Haar::new(rig.grid());
        let matrix = haar.analyse_columns(&signs(&patterns)).transpose();
        // The first is white's.
        let (held_out, kept): (Vec<_>, Vec<_>) =
            (0..photographs).partition(|row| photographs >= FEW && row % HELD_OUT == HELD_OUT - 1);
        Ok(Self {
            noise: coefficient_noise(rig, &haar, &light),
            search: Greedy::new(matrix.select_rows(&kept)),
            signs: matrix,
            answers: haar.analyse_columns(&signs(&light)).transpose(),
            fit: Greedy::new(haar.analyse_columns(&patterns).transpose()),
            photographed: haar.analyse_columns(&light).transpose(),
            kept,
            held_out,
            haar,
        })
    }

    /// The response of one camera coefficient, `predicted` being where to look first.
    pub(super) fn decode(&self, coefficient: usize, predicted: &[usize]) -> SparseEstimate {
        let right = self.answers.column(coefficient).into_owned();
        let kept = right.select_rows(&self.kept);
        let radius = self.noise[coefficient] * (kept.len() as f64).sqrt();
        let constant = self.signs.ncols() - 1;
        let others = predicted
            .iter()
            .copied()
            .filter(|column| *column != constant);
        let first: Vec<usize> = [constant].into_iter().chain(others).collect();
        let mut best = (f64::INFINITY, SparseEstimate::default());
        for part in AT_ONCE {
            let at_once = (kept.len() / part).max(1);
            for answer in self.search.pursue(&kept, &first, at_once, radius) {
                let misfit = self.misfit(&answer, &right);
                if misfit < best.0 {
                    best = (misfit, answer);
                }
            }
        }
        let photographed = self.photographed.column(coefficient).into_owned();
        let fitted = self.fit.fit(&best.1.support, &photographed);
        fitted.unwrap_or(best.1)
    }

    /// Squared residual in the photographs held out, or in all if none is.
    fn misfit(&self, answer: &SparseEstimate, right: &DVector<f64>) -> f64 {
        let left = right - answer.applied(&self.signs);
        if self.held_out.is_empty() {
            left.norm_squared()
        } else {
            left.select_rows(&self.held_out).norm_squared()
        }
    }

    /// `T`, `N x N`, of responses by camera coefficient; rows and columns of cells that
    /// are not live are zero.
    pub(super) fn transport(&self, responses: &[SparseEstimate], live: &[bool]) -> DMatrix<f64> {
        let cells = live.len();
        let mut coded = DMatrix::zeros(cells, cells);
        for (row, response) in responses.iter().enumerate() {
            for (column, value) in response.support.iter().zip(&response.values) {
                coded[(row, *column)] = *value;
            }
        }
        let mut transport = self.haar.synthesise_operator(&coded);
        clear_dead(&mut transport, live);
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

#[cfg(test)]
mod tests {
    use super::super::{Acquisition, CompressiveDual, CompressiveSensing};
    use crate::Unfit;
    use crate::known_scene::{forward, rig};
    use iltm_capture::NoiseModel;
    use iltm_runtime::Grid;
    use iltm_solve::Haar;
    use nalgebra::DMatrix;

    /// Coded on both sides, each row has its parent's three coefficients: the constant,
    /// the next coarsest and one that moves with it.
    #[test]
    fn a_transport_of_few_coefficients_is_found_exactly() {
        let grid = Grid::new(8, 8).unwrap();
        let coded = DMatrix::from_fn(64, 64, |row, column| match column {
            63 => 1.0,
            62 => 0.5 / (1 + row % 5) as f64,
            _ if column == row / 4 => -0.3,
            _ => 0.0,
        });
        let transport = Haar::new(grid).synthesise_operator(&coded);
        let methods: [Box<dyn Acquisition>; 2] = [
            Box::new(CompressiveDual::new(40, 1)),
            Box::new(CompressiveSensing::new(40, 1)),
        ];
        for method in methods {
            let mut rig = rig(grid, &transport, &[true; 64], NoiseModel::default());
            let found = forward(method.as_ref(), &mut rig);
            assert_eq!(rig.photographs(), 40);
            let off = (found - &transport).norm() / transport.norm();
            assert!(off < 1e-9, "{}: {off}", method.name());
        }
    }

    #[test]
    fn one_photograph_is_refused() {
        let grid = Grid::new(2, 2).unwrap();
        let mut rig = rig(
            grid,
            &DMatrix::identity(4, 4),
            &[true; 4],
            NoiseModel::default(),
        );
        let refused = CompressiveDual::new(1, 1).acquire(&mut rig);
        assert!(matches!(refused, Err(Unfit::Condition(_))));
    }
}
