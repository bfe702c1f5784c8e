//! Least l1 norms by linear programming, for tests: exact, and slow.

use super::haar::Haar;
use microlp::{ComparisonOp, LinearExpr, OptimizationDirection, Problem, Variable};
use nalgebra::DMatrix;

/// `min ||h||_1` subject to `A^T h = b`.
pub(super) fn least_l1(matrix: &DMatrix<f64>, right: &[f64]) -> f64 {
    let mut problem = Problem::new(OptimizationDirection::Minimize);
    let mut part = || problem.add_var(1.0, (0.0, f64::INFINITY));
    let parts: Vec<(Variable, Variable)> = (0..matrix.nrows()).map(|_| (part(), part())).collect();
    for (column, right) in matrix.column_iter().zip(right) {
        let mut sum = LinearExpr::empty();
        for ((plus, minus), value) in parts.iter().zip(column.iter()) {
            sum.add(*plus, *value);
            sum.add(*minus, -value);
        }
        problem.add_constraint(sum, ComparisonOp::Eq, *right);
    }
    problem
        .solve()
        .unwrap()
        .into_solution()
        .unwrap()
        .objective()
}

/// `min sum w_i w_j |(W^T K W)_ij|` over `K` and `g` subject to
/// `diag(g) C - K C = L` and `K >= 0` off the diagonal.
pub(super) fn least_penalty(
    haar: &Haar,
    weights: &[f64],
    light: &DMatrix<f64>,
    patterns: &DMatrix<f64>,
) -> f64 {
    let cells = light.nrows();
    let mut problem = Problem::new(OptimizationDirection::Minimize);
    let free = (f64::NEG_INFINITY, f64::INFINITY);
    let positive = (0.0, f64::INFINITY);
    let gains: Vec<_> = (0..cells).map(|_| problem.add_var(0.0, free)).collect();
    let operator = DMatrix::from_fn(cells, cells, |i, j| {
        problem.add_var(0.0, if i == j { free } else { positive })
    });
    for i in 0..cells {
        for k in 0..light.ncols() {
            let mut seen = LinearExpr::empty();
            seen.add(gains[i], light[(i, k)]);
            for j in 0..cells {
                seen.add(operator[(i, j)], -light[(j, k)]);
            }
            problem.add_constraint(seen, ComparisonOp::Eq, patterns[(i, k)]);
        }
    }
    let basis = haar.synthesise_columns(&DMatrix::identity(cells, cells));
    for a in 0..cells {
        for b in 0..cells {
            let size = problem.add_var(weights[a] * weights[b], positive);
            for sign in [1.0, -1.0] {
                let mut coefficient = LinearExpr::empty();
                coefficient.add(size, 1.0);
                for i in 0..cells {
                    for j in 0..cells {
                        coefficient.add(operator[(i, j)], sign * basis[(i, a)] * basis[(j, b)]);
                    }
                }
                problem.add_constraint(coefficient, ComparisonOp::Ge, 0.0);
            }
        }
    }
    problem
        .solve()
        .unwrap()
        .into_solution()
        .unwrap()
        .objective()
}
