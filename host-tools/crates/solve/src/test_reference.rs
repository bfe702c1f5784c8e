//! The joint solve written down plainly, for tests: dense matrices, double
//! precision, one system a row with that row's own weights, small fixed steps.

use super::haar::Haar;
use nalgebra::{DMatrix, DVector};

/// What [`super::admm`] is given.
pub(super) struct Problem<'p> {
    pub(super) haar: &'p Haar,
    /// `C_c`, `N x m`.
    pub(super) light: &'p [DMatrix<f64>],
    /// `L`, `N x m`.
    pub(super) patterns: &'p DMatrix<f64>,
    /// Weights of the squared residuals, `N x m`.
    pub(super) weights: &'p DMatrix<f64>,
    /// Weights of the l1 term's coefficients, length `N`.
    pub(super) coefficient_weights: &'p [f64],
    pub(super) lambda: f64,
}

impl Problem<'_> {
    /// The operator and the gains (`N x channels`) of least objective.
    pub(super) fn solve(&self, rho: f64, iterations: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        let cells = self.patterns.nrows();
        let rows: Vec<Row> = (0..cells).map(|row| Row::new(self, row, rho)).collect();
        let zero = DMatrix::<f64>::zeros(cells, cells);
        let (mut sparse, mut positive) = (zero.clone(), zero.clone());
        let (mut sparse_dual, mut positive_dual) = (zero.clone(), zero);
        let mut gains = DMatrix::zeros(cells, self.light.len());
        for _ in 0..iterations {
            let wanted = (&sparse - &sparse_dual + &positive - &positive_dual) / 2.0;
            let mut operator = DMatrix::zeros(cells, cells);
            for (index, row) in rows.iter().enumerate() {
                let answer = row.solve(&wanted.row(index).transpose(), rho);
                operator.set_row(index, &answer.rows(0, cells).transpose());
                gains.set_row(index, &answer.rows(cells, self.light.len()).transpose());
            }
            let mut coefficients = self.haar.analyse_operator(&(&operator + &sparse_dual));
            for i in 0..cells {
                for j in 0..cells {
                    let weight = self.coefficient_weights[i] * self.coefficient_weights[j];
                    let limit = 2.0 * self.lambda * weight / rho;
                    let value = &mut coefficients[(i, j)];
                    *value -= value.clamp(-limit, limit);
                }
            }
            sparse = self.haar.synthesise_operator(&coefficients);
            positive = &operator + &positive_dual;
            for i in 0..cells {
                for j in 0..cells {
                    if i != j {
                        positive[(i, j)] = positive[(i, j)].max(0.0);
                    }
                }
            }
            sparse_dual += &operator - &sparse;
            positive_dual += &operator - &positive;
        }
        (sparse, gains)
    }
}

/// The normal equations of one row's operator elements and gains.
struct Row {
    inverse: DMatrix<f64>,
    right: DVector<f64>,
}

impl Row {
    fn new(problem: &Problem<'_>, row: usize, rho: f64) -> Self {
        let (cells, photographs) = problem.patterns.shape();
        let unknowns = cells + problem.light.len();
        let mut system = DMatrix::zeros(unknowns, unknowns);
        let mut right = DVector::zeros(unknowns);
        for (channel, light) in problem.light.iter().enumerate() {
            for k in 0..photographs {
                let mut equation = DVector::zeros(unknowns);
                equation.rows_mut(0, cells).copy_from(&-light.column(k));
                equation[cells + channel] = light[(row, k)];
                let weight = problem.weights[(row, k)];
                system += &equation * equation.transpose() * weight;
                right += equation * (problem.patterns[(row, k)] * weight);
            }
        }
        for cell in 0..cells {
            system[(cell, cell)] += rho;
        }
        Self {
            inverse: system.try_inverse().unwrap(),
            right,
        }
    }

    fn solve(&self, wanted: &DVector<f64>, rho: f64) -> DVector<f64> {
        let mut right = self.right.clone();
        for (right, wanted) in right.iter_mut().zip(wanted.iter()) {
            *right += rho * wanted;
        }
        &self.inverse * right
    }
}
