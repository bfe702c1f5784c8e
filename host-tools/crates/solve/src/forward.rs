//! Forward transport from an inverse: the bounces one by one.
//!
//! `(diag(g) - K) c = p` is solved by `c <- (p + K c) / g`: each step adds one
//! bounce. For most scenes the bounces fade, so a few dozen reach any accuracy a
//! photograph can tell, and no `N x N` factorisation is needed. Where they fade
//! too slowly (a deep wedge of white paper), or the operator is no reflection
//! (it undoes a blur as well), the system is factorised once.

use super::haar::Haar;
use super::interreflection::{Coefficient, Interreflection};
use super::links::Links;
use nalgebra::{DMatrix, DVector, Dyn, LU};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Bounces stop counting when one adds less than this part of the light.
const BOUNCE_TOLERANCE: f64 = 1e-6;
/// Bounces that are followed at most. A scene that returns 90 % of its light to
/// itself needs 130.
const MOST_BOUNCES: usize = 200;
/// Bounces after which it is known how fast they fade.
const SETTLED: usize = 20;
/// Steps of each power iteration; the condition number is good to a few percent.
const POWER_STEPS: usize = 30;
/// Relative change of an eigenvalue in a step from which no further one is worth its time.
const POWER_TOLERANCE: f64 = 3e-3;
/// [`BOUNCE_TOLERANCE`] of light that only a condition number is worked out from.
const CONDITION_TOLERANCE: f64 = 1e-3;

/// `T^-1 = diag(gain) - operator` of one channel; cells that are not live have a
/// zero gain.
#[derive(Clone, Debug)]
pub struct Inverse {
    /// The diagonal `g`, length `N`.
    pub gain: DVector<f64>,
    /// The operator `K_c`, `N x N`.
    pub operator: Interreflection,
    /// The whole inverse, factorised when first needed.
    factor: OnceLock<LU<f64, Dyn, Dyn>>,
}

impl Inverse {
    /// `diag(gain) - operator`, sizes `N` and `N x N`.
    #[must_use]
    pub fn new(gain: DVector<f64>, operator: impl Into<Interreflection>) -> Self {
        Self {
            gain,
            operator: operator.into(),
            factor: OnceLock::new(),
        }
    }

    /// `diag(gain) - operator`, `N x N`.
    #[must_use]
    pub fn dense(&self) -> DMatrix<f64> {
        DMatrix::from_diagonal(&self.gain) - self.operator.dense()
    }

    /// The projector input `T^-1 d` of each column of `wanted`, `N x n` from `N x n`.
    #[must_use]
    pub fn apply(&self, wanted: &DMatrix<f64>) -> DMatrix<f64> {
        let mut input = wanted.clone();
        scale_rows(&mut input, &self.gain);
        input - &self.operator * wanted
    }

    /// The elements of `W^T T^-1 W` that are not zero.
    pub(super) fn haar_coefficients(&self, haar: &Haar) -> Vec<Coefficient> {
        let whole = match &self.operator {
            Interreflection::Dense(_) => Interreflection::Dense(self.dense()),
            links @ Interreflection::Links(_) => {
                let gain = Links::diagonal(haar.grid(), self.gain.as_slice());
                &(links * -1.0) + &Interreflection::Links(gain)
            }
        };
        whole.haar_coefficients(haar)
    }

    /// Why this cannot be the inverse of a real scene's transport, if so.
    ///
    /// With an operator that is nowhere negative, light fades if and only if the
    /// light under white is positive everywhere (Berman, Plemmons, *Nonnegative
    /// Matrices in the Mathematical Sciences*, 1979, theorem 6.2.3).
    pub(super) fn flaw(&self, live: &[bool]) -> Option<String> {
        let gains = self.gain.iter().zip(live).enumerate();
        for (cell, (gain, live)) in gains {
            // Not a number counts as not positive.
            let positive = *gain > 0.0;
            if *live && !positive {
                return Some(format!("the gain of cell {cell} is {gain:.3}"));
            }
        }
        let one = DMatrix::from_fn(live.len(), 1, |cell, _| f64::from(u8::from(live[cell])));
        let lit = |light: DMatrix<f64>| {
            let positive = |(light, live): (&f64, &bool)| !live || *light > 0.0;
            light.iter().zip(live).all(positive)
        };
        if self.light(&one).is_some_and(lit) {
            return None;
        }
        Some(format!(
            "each bounce would return {:.3} of the light of the one before",
            self.return_of_a_bounce(&one)
        ))
    }

    /// How much of one bounce's light the next one has, in the long run.
    fn return_of_a_bounce(&self, start: &DMatrix<f64>) -> f64 {
        let fade = self.fade();
        let mut bounce = start.clone();
        let mut ratio = 0.0;
        for _ in 0..MOST_BOUNCES {
            let mut next = &self.operator * &bounce;
            scale_rows(&mut next, &fade);
            ratio = next.norm() / bounce.norm();
            if !ratio.is_normal() {
                break;
            }
            bounce = next / (bounce.norm() * ratio);
        }
        ratio
    }

    fn fade(&self) -> DVector<f64> {
        self.gain
            .map(|gain| if gain > 0.0 { gain.recip() } else { 0.0 })
    }

    /// Light `T p` of each column of `patterns`, `N x n` from `N x n`, without
    /// ambient, to 1e-6 of its norm; `None` if the inverse is singular.
    #[must_use]
    pub fn light(&self, patterns: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        self.light_within(BOUNCE_TOLERANCE, patterns)
    }

    fn light_within(&self, tolerance: f64, patterns: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        if self.factor.get().is_none()
            && let Some(light) = self.sum_bounces(tolerance, patterns)
        {
            return Some(light);
        }
        self.solved(patterns)
    }

    /// `None` if the bounces fade too slowly or not at all.
    fn sum_bounces(&self, tolerance: f64, patterns: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let fade = self.fade();
        let mut bounce = patterns.clone();
        scale_rows(&mut bounce, &fade);
        let mut light = bounce.clone();
        for step in 0..MOST_BOUNCES {
            let mut next = &self.operator * &bounce;
            scale_rows(&mut next, &fade);
            light += &next;
            let before = bounce.norm();
            bounce = next;
            let (added, total) = (bounce.norm(), light.norm());
            if !total.is_finite() {
                return None;
            }
            if added <= tolerance * total {
                return Some(light);
            }
            let missing = (tolerance * total / added).ln() / (added / before).ln();
            // Written so that light which grows is too slow as well.
            let soon = added < before && missing < (MOST_BOUNCES - step) as f64;
            if step >= SETTLED && !soon {
                return None;
            }
        }
        None
    }

    /// By factorising the inverse.
    fn solved(&self, patterns: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let factor = self.factor.get_or_init(|| {
            let mut whole = -self.operator.dense();
            for (cell, gain) in self.gain.iter().enumerate() {
                // A cell that is not live is dark whatever is projected.
                whole[(cell, cell)] += if *gain > 0.0 { *gain } else { 1.0 };
            }
            whole.lu()
        });
        let mut lit = patterns.clone();
        for (mut row, gain) in lit.row_iter_mut().zip(self.gain.iter()) {
            // Not a number is not live either.
            let live = *gain > 0.0;
            if !live {
                row.fill(0.0);
            }
        }
        let light = factor.solve(&lit)?;
        light.iter().all(|light| light.is_finite()).then_some(light)
    }

    /// Largest over smallest singular value of `T`; infinite if the inverse is
    /// singular.
    pub(super) fn condition(&self, live: &[bool]) -> f64 {
        let start = DMatrix::from_fn(live.len(), 1, |cell, _| {
            // Not orthogonal to any singular vector that matters.
            if live[cell] {
                1.0 + 0.5 * (cell as f64).sin()
            } else {
                0.0
            }
        });
        // With `D = diag(g)`, `T^T = (D - K^T)^-1`.
        let transposed = Self::new(self.gain.clone(), self.operator.transpose());
        let largest_of_inverse = power(&start, |x| Some(transposed.apply(&self.apply(x))));
        let largest_of_forward = power(&start, |x| {
            let light = self.light_within(CONDITION_TOLERANCE, x)?;
            transposed.light_within(CONDITION_TOLERANCE, &light)
        });
        match (largest_of_inverse, largest_of_forward) {
            (Some(a), Some(b)) => (a * b).sqrt(),
            _ => f64::INFINITY,
        }
    }
}

/// `left * right`, columns of `right` in parallel, or rows of `left` if there are few columns.
pub(super) fn product(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    /// Columns of one task: enough to pay for reading `left` again.
    const COLUMNS: usize = 64;
    /// Rows of one task.
    const ROWS: usize = 256;
    let mut result = DMatrix::zeros(left.nrows(), right.ncols());
    if right.ncols() <= COLUMNS || left.nrows() == 0 {
        let tasks = (0..left.nrows()).into_par_iter().step_by(ROWS);
        let parts = tasks.map(|first| {
            let rows = ROWS.min(left.nrows() - first);
            (first, left.rows(first, rows) * right)
        });
        for (first, part) in parts.collect::<Vec<_>>() {
            result.rows_mut(first, part.nrows()).copy_from(&part);
        }
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

pub(super) fn scale_rows(matrix: &mut DMatrix<f64>, by: &DVector<f64>) {
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
    let (mut value, mut before) = (0.0, 0.0_f64);
    for _ in 0..POWER_STEPS {
        let y = apply(&x)?;
        value = y.norm();
        if value == 0.0 || !value.is_finite() {
            return None;
        }
        x = y / value;
        if (value - before).abs() <= POWER_TOLERANCE * value {
            break;
        }
        before = value;
    }
    Some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Inside of a sphere every cell sees every other alike: with `F = 1/N` and an
    /// albedo `r` the light under white is `r / (1 - r)` everywhere.
    fn sphere(cells: usize, albedo: f64) -> Inverse {
        let operator = DMatrix::from_element(cells, cells, 1.0 / cells as f64);
        Inverse::new(DVector::from_element(cells, albedo.recip()), operator)
    }

    #[test]
    fn light_that_fades_too_slowly_to_follow_is_solved_for() {
        let white = DMatrix::from_element(10, 1, 1.0);
        for albedo in [0.5, 0.9, 0.99, 0.9999] {
            let light = sphere(10, albedo).light(&white).unwrap();
            let wanted = albedo / (1.0 - albedo);
            for light in light.iter() {
                assert!((light / wanted - 1.0).abs() < 1e-5, "{albedo}: {light}");
            }
        }
    }

    #[test]
    fn light_that_grows_is_a_flaw_and_its_growth_is_said() {
        assert_eq!(sphere(10, 0.999).flaw(&[true; 10]), None);
        let why = sphere(10, 1.25).flaw(&[true; 10]).unwrap();
        assert!(why.contains("1.250 of the light"), "{why}");
    }

    #[test]
    fn the_condition_of_a_sphere_is_that_of_its_closed_form() {
        // Largest singular value of T: r / (1 - r), smallest: r.
        let condition = sphere(10, 0.995).condition(&[true; 10]);
        assert!((condition / 200.0 - 1.0).abs() < 0.02, "{condition}");
    }

    #[test]
    fn a_cell_that_is_not_live_stays_dark_either_way() {
        for albedo in [0.5, 0.999] {
            let mut inverse = sphere(10, albedo);
            inverse.gain[3] = 0.0;
            let live: Vec<bool> = (0..10).map(|cell| cell != 3).collect();
            inverse.operator = inverse.operator.between(&live, &live);
            let light = inverse.light(&DMatrix::from_element(10, 2, 1.0)).unwrap();
            assert!(light.row(3).amax() < 1e-300);
        }
    }
}
