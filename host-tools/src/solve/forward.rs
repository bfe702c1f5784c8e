//! Forward transport from an inverse: the bounces one by one.
//!
//! `(diag(g) - K) c = p` is solved by `c <- (p + K c) / g`: each step adds one
//! bounce. For a real scene the bounces fade, so a few dozen reach any accuracy
//! a photograph can tell, and no `N x N` factorisation is needed.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Bounces stop counting when one adds less than this part of the light.
const BOUNCE_TOLERANCE: f64 = 1e-6;
/// Bounces that are followed at most. A scene that returns 90 % of its light to
/// itself needs 130.
const MOST_BOUNCES: usize = 200;
/// Steps of each power iteration; the condition number is good to a few percent.
const POWER_STEPS: usize = 30;

/// `T^-1 = diag(gain) - operator` of one channel; cells that are not live have a
/// zero gain.
#[derive(Clone, Debug)]
pub struct Inverse {
    /// The diagonal `g`, length `N`.
    pub gain: DVector<f64>,
    /// The operator `K_c`, `N x N`.
    pub operator: DMatrix<f64>,
}

impl Inverse {
    /// Why this cannot be the inverse of a real scene's transport, if so.
    pub(super) fn flaw(&self, live: &[bool]) -> Option<String> {
        let gains = self.gain.iter().zip(live).enumerate();
        for (cell, (gain, live)) in gains {
            // Not a number counts as not positive.
            let positive = *gain > 0.0;
            if *live && !positive {
                return Some(format!("the gain of cell {cell} is {gain:.3}"));
            }
        }
        let one = DMatrix::from_element(self.gain.len(), 1, 1.0);
        if self.light(&one).is_none() {
            return Some(format!("light does not fade within {MOST_BOUNCES} bounces"));
        }
        None
    }

    /// Light `T p` of each column of `patterns`, `N x n` from `N x n`, without
    /// ambient, to 1e-6 of its norm; `None` if the bounces do not fade.
    #[must_use]
    pub fn light(&self, patterns: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        self.sum_bounces(&self.operator, patterns)
    }

    /// `T^T p`: with `D = diag(g)`, `T^T = (D - K^T)^-1`.
    fn transposed_light(&self, patterns: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        self.sum_bounces(&self.operator.transpose(), patterns)
    }

    fn sum_bounces(
        &self,
        operator: &DMatrix<f64>,
        patterns: &DMatrix<f64>,
    ) -> Option<DMatrix<f64>> {
        let fade = self
            .gain
            .map(|gain| if gain > 0.0 { gain.recip() } else { 0.0 });
        let mut bounce = patterns.clone();
        scale_rows(&mut bounce, &fade);
        let mut light = bounce.clone();
        for _ in 0..MOST_BOUNCES {
            let mut next = product(operator, &bounce);
            scale_rows(&mut next, &fade);
            light += &next;
            bounce = next;
            let (added, total) = (bounce.norm(), light.norm());
            if !total.is_finite() {
                return None;
            }
            if added <= BOUNCE_TOLERANCE * total {
                return Some(light);
            }
        }
        None
    }

    /// Largest over smallest singular value of `T`; infinite if the bounces do
    /// not fade.
    pub(super) fn condition(&self, live: &[bool]) -> f64 {
        let start = DMatrix::from_fn(live.len(), 1, |cell, _| {
            // Not orthogonal to any singular vector that matters.
            if live[cell] {
                1.0 + 0.5 * (cell as f64).sin()
            } else {
                0.0
            }
        });
        let inverse = |x: &DMatrix<f64>| {
            let mut y = x.clone();
            scale_rows(&mut y, &self.gain);
            y
        };
        let largest_of_inverse = power(&start, |x| {
            let y = inverse(x) - &self.operator * x;
            Some(inverse(&y) - self.operator.tr_mul(&y))
        });
        let largest_of_forward = power(&start, |x| self.transposed_light(&self.light(x)?));
        match (largest_of_inverse, largest_of_forward) {
            (Some(a), Some(b)) => (a * b).sqrt(),
            _ => f64::INFINITY,
        }
    }
}

/// `left * right`, columns of `right` in parallel.
pub(super) fn product(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    /// Columns of one task: enough to pay for reading `left` again.
    const COLUMNS: usize = 64;
    let mut result = DMatrix::zeros(left.nrows(), right.ncols());
    if right.ncols() <= COLUMNS || left.nrows() == 0 {
        result.gemm(1.0, left, right, 0.0);
        return result;
    }
    let rows = left.nrows();
    let tasks = result.as_mut_slice().par_chunks_mut(rows * COLUMNS);
    tasks.enumerate().for_each(|(task, part)| {
        let columns = part.len() / rows;
        let right = right.columns(task * COLUMNS, columns);
        let mut part = nalgebra::DMatrixViewMut::from_slice(part, rows, columns);
        part.gemm(1.0, left, &right, 0.0);
    });
    result
}

fn scale_rows(matrix: &mut DMatrix<f64>, by: &DVector<f64>) {
    for mut column in matrix.column_iter_mut() {
        column.component_mul_assign(by);
    }
}

/// Largest eigenvalue of the symmetric map `apply`.
fn power(
    start: &DMatrix<f64>,
    apply: impl Fn(&DMatrix<f64>) -> Option<DMatrix<f64>>,
) -> Option<f64> {
    let mut x = start / start.norm();
    let mut value = 0.0;
    for _ in 0..POWER_STEPS {
        let y = apply(&x)?;
        value = y.norm();
        if value == 0.0 || !value.is_finite() {
            return None;
        }
        x = y / value;
    }
    Some(value)
}
