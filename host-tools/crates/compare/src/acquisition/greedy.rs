//! Regularised orthogonal matching pursuit.
//!
//! Needell, Vershynin, *Uniform Uncertainty Principle and Signal Recovery via Regularized
//! Orthogonal Matching Pursuit*, Foundations of Computational Mathematics 2009. Each step
//! takes the `k` columns of `A` that the residual correlates with most, keeps of them the
//! set of most energy whose correlations differ by no more than a factor of two, and fits
//! all columns taken so far by least squares.
//!
//! Ours: a first support may be given; columns may have any norm; every step's answer is
//! kept, so that the caller can choose among them by photographs held out.

use nalgebra::{DMatrix, DVector};

/// Correlations kept in one step differ by this factor at most: the paper's.
const COMPARABLE: f64 = 2.0;
/// Columns whose squared norm is below this part of the largest are no columns: lights
/// that are not live.
const SILENT: f64 = 1e-12;
/// A residual of this part of the right side is rounding.
const ROUNDING: f64 = 1e-10;
/// Support of a fit, in equations, at most: beyond that least squares fits anything.
const MOST_SUPPORT: f64 = 0.6;

/// Columns of `A` and how much of each.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct SparseEstimate {
    /// Distinct.
    pub(super) support: Vec<usize>,
    /// Length of `support`.
    pub(super) values: Vec<f64>,
}

impl SparseEstimate {
    /// `A x` of a matrix whose columns the support counts.
    pub(super) fn applied(&self, matrix: &DMatrix<f64>) -> DVector<f64> {
        let mut sum = DVector::zeros(matrix.nrows());
        for (column, value) in self.support.iter().zip(&self.values) {
            sum.axpy(*value, &matrix.column(*column), 1.0);
        }
        sum
    }
}

/// `A`, `m x N`, and what every pursuit in it needs.
#[derive(Debug)]
pub(super) struct Greedy {
    matrix: DMatrix<f64>,
    gram: DMatrix<f64>,
    /// Reciprocal norms of the columns; zero for those that are none.
    scale: DVector<f64>,
}

impl Greedy {
    pub(super) fn new(matrix: DMatrix<f64>) -> Self {
        let gram = matrix.tr_mul(&matrix);
        let squares = gram.diagonal();
        let least = SILENT * squares.amax();
        let scale = squares.map(|square| {
            if square > least {
                square.sqrt().recip()
            } else {
                0.0
            }
        });
        Self {
            matrix,
            gram,
            scale,
        }
    }

    /// Answers to `A x = right` with growing support, from that of `first` on (which may
    /// be empty), until the residual is within `radius` or the support is too large to
    /// tell; at most `at_once` columns a step. At least one answer.
    pub(super) fn pursue(
        &self,
        right: &DVector<f64>,
        first: &[usize],
        at_once: usize,
        radius: f64,
    ) -> Vec<SparseEstimate> {
        let radius = radius.max(ROUNDING * right.norm());
        let most = (MOST_SUPPORT * right.len() as f64) as usize;
        let mut support: Vec<usize> = first.iter().copied().take(most).collect();
        support.retain(|column| self.scale[*column] > 0.0);
        let mut answers = vec![self.fit(&support, right).unwrap_or_default()];
        loop {
            let last = answers.last().cloned().unwrap_or_default();
            let residual = right - last.applied(&self.matrix);
            if residual.norm() <= radius || last.support.len() >= most {
                return answers;
            }
            let room = most - last.support.len();
            let chosen = self.choose(&residual, &last.support, at_once.min(room));
            let mut support = last.support;
            support.extend(&chosen);
            match self.fit(&support, right) {
                Some(fit) if !chosen.is_empty() => answers.push(fit),
                _ => return answers,
            }
        }
    }

    /// Identification and regularisation: the columns of one step.
    fn choose(&self, residual: &DVector<f64>, taken: &[usize], at_once: usize) -> Vec<usize> {
        let mut correlation = self.matrix.tr_mul(residual).component_mul(&self.scale);
        for column in taken {
            correlation[*column] = 0.0;
        }
        let size = |column: usize| correlation[column].abs();
        let mut columns: Vec<usize> = (0..correlation.len())
            .filter(|column| size(*column) > 0.0)
            .collect();
        columns.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
        columns.truncate(at_once.max(1));
        // Sorted: a comparable set is a window.
        let window = |first: usize| {
            let least = size(columns[first]) / COMPARABLE;
            let end = columns.partition_point(|column| size(*column) >= least);
            first..end
        };
        let energy = |window: &std::ops::Range<usize>| -> f64 {
            columns[window.clone()]
                .iter()
                .map(|column| size(*column).powi(2))
                .sum()
        };
        let best = (0..columns.len())
            .map(window)
            .max_by(|a, b| energy(a).total_cmp(&energy(b)));
        best.map_or_else(Vec::new, |window| columns[window].to_vec())
    }

    /// Least squares on a support; `None` if its columns depend on each other.
    pub(super) fn fit(&self, support: &[usize], right: &DVector<f64>) -> Option<SparseEstimate> {
        let size = support.len();
        // Unit columns: the factorisation sees dependence only.
        let gram = DMatrix::from_fn(size, size, |i, j| {
            let (i, j) = (support[i], support[j]);
            self.gram[(i, j)] * self.scale[i] * self.scale[j]
        });
        let factor = gram.cholesky()?;
        let project = |vector: &DVector<f64>| {
            DVector::from_fn(size, |i, _| {
                self.matrix.column(support[i]).dot(vector) * self.scale[support[i]]
            })
        };
        let scaled = |values: &DVector<f64>| SparseEstimate {
            support: support.to_vec(),
            values: values
                .iter()
                .zip(support)
                .map(|(value, column)| value * self.scale[*column])
                .collect(),
        };
        let mut values = factor.solve(&project(right));
        // The normal equations square the condition; one refinement makes up for it.
        let left = right - scaled(&values).applied(&self.matrix);
        values += factor.solve(&project(&left));
        Some(scaled(&values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `m x n` of signs by chance.
    fn signs(rows: usize, columns: usize) -> DMatrix<f64> {
        let mut random = fastrand::Rng::with_seed(3);
        DMatrix::from_fn(rows, columns, |_, _| if random.bool() { 1.0 } else { -1.0 })
    }

    #[test]
    fn an_exactly_sparse_answer_is_found_exactly() {
        let mut matrix = signs(40, 100);
        // Columns of other norms, and one of none.
        matrix.column_mut(7).scale_mut(30.0);
        matrix.column_mut(8).fill(0.0);
        let greedy = Greedy::new(matrix);
        let mut random = fastrand::Rng::with_seed(4);
        for at_once in [1, 4] {
            for _ in 0..20 {
                let mut wanted = DVector::zeros(100);
                for _ in 0..4 {
                    wanted[random.usize(9..100)] = random.f64() - 0.5;
                }
                wanted[7] = 1.0;
                let right = &greedy.matrix * &wanted;
                let found = greedy.pursue(&right, &[], at_once, 0.0).pop().unwrap();
                let mut dense = DVector::zeros(100);
                for (column, value) in found.support.iter().zip(&found.values) {
                    dense[*column] = *value;
                }
                assert!((dense - wanted).amax() < 1e-9);
            }
        }
    }

    #[test]
    fn a_right_first_support_is_all_that_is_needed() {
        let greedy = Greedy::new(signs(10, 100));
        let right = greedy.matrix.column(3) * 2.0 - greedy.matrix.column(50);
        let answers = greedy.pursue(&right, &[3, 50], 4, 0.0);
        assert_eq!(answers.len(), 1);
        assert!((answers[0].values[0] - 2.0).abs() < 1e-12);
        assert!((answers[0].values[1] + 1.0).abs() < 1e-12);
    }

    #[test]
    fn within_noise_it_stops_and_takes_no_more_columns() {
        let greedy = Greedy::new(signs(40, 100));
        let right = greedy.matrix.column(3) + greedy.matrix.column(5) * 0.01;
        let radius = 0.02 * 40_f64.sqrt();
        let found = greedy.pursue(&right, &[], 1, radius).pop().unwrap();
        assert_eq!(found.support, [3]);
    }

    #[test]
    fn nothing_to_explain_is_explained_by_nothing() {
        let greedy = Greedy::new(signs(10, 20));
        let answers = greedy.pursue(&DVector::zeros(10), &[], 2, 0.0);
        assert_eq!(answers, [SparseEstimate::default()]);
        let silent = Greedy::new(DMatrix::zeros(10, 20));
        let answers = silent.pursue(&DVector::from_element(10, 1.0), &[], 2, 0.0);
        assert_eq!(answers, [SparseEstimate::default()]);
    }
}
