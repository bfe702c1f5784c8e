//! How far the blocks of an iteration are from agreeing, and when that is near
//! enough.

use std::ops::AddAssign;

/// Residuals that differ by less than this factor count as balanced.
const BALANCED: f64 = 2.5;
/// Largest change of the penalty at once.
const BALANCE_STEP: f64 = 4.0;

/// Sums of squares over one or more blocks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Residuals {
    /// Of one block's answer.
    pub(super) norm: f64,
    /// Of its difference from another block's.
    pub(super) primal: f64,
    /// Of the other block's last move.
    pub(super) dual: f64,
}

impl AddAssign for Residuals {
    fn add_assign(&mut self, other: Self) {
        self.norm += other.norm;
        self.primal += other.primal;
        self.dual += other.dual;
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// Largest primal and dual residual, relative to the answer's norm.
    pub(super) tolerance: f64,
    /// Most iterations.
    pub(super) iterations: u32,
}

/// How an iteration ended.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Convergence {
    /// Iterations it took.
    pub iterations: u32,
    /// How far the blocks' answers differ, relative to the answer.
    pub primal_residual: f64,
    /// How far they still move in one iteration, relative to the answer.
    pub dual_residual: f64,
    /// Whether both are below the tolerance asked for.
    pub converged: bool,
}

impl Convergence {
    /// That of an iteration which has not begun.
    pub(super) const fn none() -> Self {
        Self {
            iterations: 0,
            primal_residual: f64::INFINITY,
            dual_residual: f64::INFINITY,
            converged: false,
        }
    }

    /// That of an iteration which had nothing to do.
    pub(super) const fn best() -> Self {
        Self {
            iterations: 0,
            primal_residual: 0.0,
            dual_residual: 0.0,
            converged: true,
        }
    }

    /// The worse of two in every respect.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            iterations: self.iterations.max(other.iterations),
            primal_residual: self.primal_residual.max(other.primal_residual),
            dual_residual: self.dual_residual.max(other.dual_residual),
            converged: self.converged && other.converged,
        }
    }

    /// The larger residual.
    pub(super) fn residual(self) -> f64 {
        self.primal_residual.max(self.dual_residual)
    }

    /// Counts an iteration with what it left.
    pub(super) fn advance(&mut self, residuals: Residuals, stop: Stop) {
        let norm = residuals.norm.max(f64::MIN_POSITIVE);
        self.iterations += 1;
        self.primal_residual = (residuals.primal / norm).sqrt();
        self.dual_residual = (residuals.dual / norm).sqrt();
        self.converged = self.residual() <= stop.tolerance;
    }

    /// Factor on the penalty with which both residuals fall alike; `None` if
    /// they do or if it is over.
    pub(super) fn imbalance(self) -> Option<f64> {
        let ratio = self.primal_residual / self.dual_residual.max(f64::MIN_POSITIVE);
        let balanced = ratio < BALANCED && ratio > BALANCED.recip();
        if self.converged || balanced || !ratio.is_finite() {
            return None;
        }
        Some(ratio.sqrt().clamp(BALANCE_STEP.recip(), BALANCE_STEP))
    }
}
