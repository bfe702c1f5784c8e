//! Low-rank blocks: a block of the exchange as the product of two thin matrices.
//!
//! Adaptive cross approximation: rows and columns of the block itself, chosen
//! by the largest that is left, so that only `rank (rows + columns)` entries are ever
//! evaluated. Then Gram-Schmidt and singular values drop what is not needed.
//!
//! Bebendorf, *Approximation of Boundary Element Matrices* (2000); Bebendorf,
//! Rjasanow, *Adaptive Low-Rank Approximation of Collocation Matrices* (2003).

use nalgebra::{DMatrix, DVector};

/// `left right^T`: rows x rank, columns x rank.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct LowRank {
    pub(super) left: DMatrix<f64>,
    pub(super) right: DMatrix<f64>,
}

/// Rows that are compared in the end, lest the crosses have missed a part.
const CHECKED: usize = 4;

/// The block with a relative error of `error` (Frobenius), or `None` if storing all of
/// it takes less.
pub(super) fn cross_approximation(
    (rows, columns): (usize, usize),
    entry: impl Fn(usize, usize) -> f64,
    error: f64,
) -> Option<LowRank> {
    let mut crosses = Crosses {
        left: Vec::new(),
        right: Vec::new(),
        squared: 0.0,
        used_rows: vec![false; rows],
        used_columns: vec![false; columns],
    };
    let most = rows * columns * 2 / (3 * (rows + columns));
    let mut row = 0;
    let mut checked = 0;
    loop {
        if crosses.left.len() > most {
            return None;
        }
        let added = crosses.add(row, &entry);
        let next = match added {
            // Half the error: the other half is for what rounding by singular
            // values drops.
            Some((size, next)) if size > 0.5 * error * crosses.squared.sqrt() => next,
            _ => None,
        };
        if let Some(next) = next {
            row = next;
            checked = 0;
            continue;
        }
        let Some(unchecked) = crosses.unseen_row(checked).filter(|_| checked < CHECKED) else {
            break;
        };
        row = unchecked;
        checked += 1;
    }
    Some(crosses.compressed(0.5 * error))
}

struct Crosses {
    left: Vec<DVector<f64>>,
    right: Vec<DVector<f64>>,
    /// Squared Frobenius norm of the sum so far.
    squared: f64,
    used_rows: Vec<bool>,
    used_columns: Vec<bool>,
}

impl Crosses {
    /// Adds the cross through a row and its largest entry that is left; gives its size and
    /// the row to go on with. `None` if nothing of the row is left.
    fn add(
        &mut self,
        row: usize,
        entry: &impl Fn(usize, usize) -> f64,
    ) -> Option<(f64, Option<usize>)> {
        self.used_rows[row] = true;
        let columns = self.used_columns.len();
        let mut right = DVector::from_fn(columns, |j, _| entry(row, j));
        let size = right.amax();
        for (l, r) in self.left.iter().zip(&self.right) {
            right.axpy(-l[row], r, 1.0);
        }
        let pivot = largest(&right, &self.used_columns)?;
        if right[pivot].abs() <= 1e-14 * size {
            return None;
        }
        self.used_columns[pivot] = true;
        right /= right[pivot];
        let mut left = DVector::from_fn(self.used_rows.len(), |i, _| entry(i, pivot));
        for (l, r) in self.left.iter().zip(&self.right) {
            left.axpy(-r[pivot], l, 1.0);
        }
        let size = left.norm() * right.norm();
        let with_others = self.left.iter().zip(&self.right);
        let mixed: f64 = with_others.map(|(l, r)| l.dot(&left) * r.dot(&right)).sum();
        self.squared = (self.squared + size * size + 2.0 * mixed).max(0.0);
        let next = largest(&left, &self.used_rows);
        self.left.push(left);
        self.right.push(right);
        Some((size, next))
    }

    /// An unused row, another one for each check.
    fn unseen_row(&self, check: usize) -> Option<usize> {
        let rows = self.used_rows.len();
        let from = (2 * check + 1) * rows / (2 * CHECKED);
        (from..rows)
            .chain(0..from)
            .find(|row| !self.used_rows[*row])
    }

    /// The same to `error` with the least rank.
    fn compressed(self, error: f64) -> LowRank {
        let (rows, columns) = (self.used_rows.len(), self.used_columns.len());
        if self.left.is_empty() {
            return LowRank {
                left: DMatrix::zeros(rows, 0),
                right: DMatrix::zeros(columns, 0),
            };
        }
        let left = DMatrix::from_columns(&self.left).qr();
        let right = DMatrix::from_columns(&self.right).qr();
        let core = (left.r() * right.r().transpose()).svd(true, true);
        let (Some(u), Some(v)) = (core.u, core.v_t) else {
            return LowRank {
                left: DMatrix::from_columns(&self.left),
                right: DMatrix::from_columns(&self.right),
            };
        };
        let values = core.singular_values;
        let most = error * values.norm();
        let tail = |rank: usize| values.rows_range(rank..).norm();
        let rank = (0..values.len())
            .find(|r| tail(*r) <= most)
            .unwrap_or(values.len());
        let mut weighted = u.columns(0, rank).into_owned();
        for (k, mut column) in weighted.column_iter_mut().enumerate() {
            column *= values[k];
        }
        LowRank {
            left: left.q() * weighted,
            right: right.q() * v.rows(0, rank).transpose(),
        }
    }
}

/// Index of the largest entry that is not used.
fn largest(values: &DVector<f64>, used: &[bool]) -> Option<usize> {
    let free = (0..values.len()).filter(|k| !used[*k]);
    free.max_by(|a, b| values[*a].abs().total_cmp(&values[*b].abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_block_is_found_to_its_error_with_few_columns() {
        let kernel = |i: usize, j: usize| {
            let (x, y) = (i as f64 / 80.0, 2.0 + j as f64 / 50.0);
            (x - y).powi(-2)
        };
        let dense = DMatrix::from_fn(80, 50, kernel);
        for error in [1e-3, 1e-6, 1e-9] {
            let found = cross_approximation((80, 50), kernel, error).unwrap();
            let product = &found.left * found.right.transpose();
            let off = (&product - &dense).norm() / dense.norm();
            assert!(off < error, "{error}: {off}");
            assert!(found.left.ncols() <= 12, "{}", found.left.ncols());
        }
    }

    #[test]
    fn two_separate_parts_are_both_found_and_full_rank_is_refused() {
        let parts = |i: usize, j: usize| match (i < 40, j < 30) {
            (true, true) => 1.0,
            (false, false) => 2.0 + i as f64,
            _ => 0.0,
        };
        let found = cross_approximation((80, 60), parts, 1e-6).unwrap();
        let product = &found.left * found.right.transpose();
        assert!((product - DMatrix::from_fn(80, 60, parts)).norm() < 1e-3);
        let identity = |i: usize, j: usize| f64::from(u8::from(i == j));
        assert!(cross_approximation((60, 60), identity, 1e-6).is_none());
    }
}
