//! Sparse recovery from Bernoulli patterns: the project's own solver, by any of its methods.

use super::Acquisition;
use super::compressive::SEN_DARABI;
use crate::{Acquired, Citation, Description, Rig, Unfit};
use iltm_capture::{Pattern, Role, columns, pattern_set};
use iltm_picture::progress::Silent;
use iltm_runtime::Grid;
use iltm_solve::{
    CellNoise, InverseTransport, Method, Observed, ObservedChannel, SolveError, SolveOptions,
    SolveReport, solve_observed,
};
use nalgebra::DMatrix;

/// [`solve_observed`] on photographs of a rig.
#[derive(Clone, Copy, Debug)]
pub struct Sparse {
    method: Method,
    /// All but black.
    photographs: usize,
    /// Of the patterns.
    seed: u64,
}

impl Sparse {
    /// A method on so many photographs, white and (for [`Method::Joint`]) Gray code
    /// among them; `seed` chooses the Bernoulli patterns.
    #[must_use]
    pub const fn new(method: Method, photographs: usize, seed: u64) -> Self {
        Self {
            method,
            photographs,
            seed,
        }
    }
}

impl Acquisition for Sparse {
    fn description(&self) -> Description {
        let photographs = self.photographs;
        Description {
            name: match self.method {
                Method::Joint => format!("iltm, {photographs}"),
                Method::Links => format!("iltm by links, {photographs}"),
                Method::Direct => format!("the paper's direct method, {photographs}"),
                Method::TwoStage => {
                    format!("compressive dual photography by l1 (two-stage), {photographs}")
                }
                Method::BruteForce => format!("least squares, {photographs}"),
            },
            source: match self.method {
                Method::TwoStage | Method::BruteForce => SEN_DARABI,
                Method::Joint | Method::Links | Method::Direct => Citation::THE_PAPER,
            },
            how: match self.method {
                Method::Links => {
                    "White, Gray code and Bernoulli photographs; gains apart from a non-negative \
                     operator of links between blocks of cells, refined where that explains more \
                     than noise."
                }
                Method::Joint => {
                    "White, Gray code and Bernoulli photographs; gains apart from a non-negative \
                     operator that is sparse in Haar; sparsity chosen by photographs held out."
                }
                Method::Direct => {
                    "White and Bernoulli photographs; each row of the inverse, Haar-coded on both \
                     sides, has the least l1 norm that explains them within their noise (P4)."
                }
                _ => {
                    "The direct method's photographs; each row of the transport, Haar-coded on \
                     both sides, has the least l1 norm that explains them within their noise; then \
                     the transport is inverted."
                }
            },
        }
    }

    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit> {
        let shown = patterns(self.method, rig.grid(), self.photographs, self.seed);
        if !shown.iter().any(|(role, _)| *role == Role::Bernoulli) {
            return Err(Unfit::Condition(format!(
                "{} photographs leave none for Bernoulli patterns",
                self.photographs
            )));
        }
        let lit = columns(&shown);
        let light = rig.photograph(&lit);
        let noise = (0..lit.nrows()).map(|cell| cell_noise(rig, &lit, &light, cell));
        let channel = (&light, noise.collect());
        let (inverse, _) = solved(self.method, (rig.grid(), rig.live()), &shown, channel)?;
        Ok(Acquired::Inverse(inverse.channel(0).dense()))
    }
}

/// The patterns that a method is photographed with, white first: so many of white, Gray code
/// (for [`Method::Joint`]) and Bernoulli patterns by `seed`.
pub(crate) fn patterns(
    method: Method,
    grid: Grid,
    photographs: usize,
    seed: u64,
) -> Vec<(Role, Pattern)> {
    let wanted = |role: Role| match role {
        Role::Black | Role::Image => false,
        Role::White | Role::Bernoulli => true,
        Role::Column { .. } | Role::Row { .. } => matches!(method, Method::Joint | Method::Links),
    };
    let shown = pattern_set(grid, photographs, seed).into_iter();
    let shown = shown.filter(|(role, _)| wanted(*role));
    shown.take(photographs).collect()
}

/// Solves by a method from the light of each cell under patterns, `N x m`, and its noise,
/// without ambient light or blur.
pub(crate) fn solved(
    method: Method,
    (grid, live): (Grid, &[bool]),
    shown: &[(Role, Pattern)],
    (light, noise): (&DMatrix<f64>, Vec<CellNoise>),
) -> Result<(InverseTransport, SolveReport), SolveError> {
    let roles: Vec<Role> = shown.iter().map(|(role, _)| *role).collect();
    let (patterns, ambient) = (columns(shown), vec![0.0; grid.cells()]);
    let observed = Observed {
        grid,
        roles: &roles,
        live,
        channels: vec![ObservedChannel {
            patterns: &patterns,
            light,
            ambient: &ambient,
            noise,
        }],
        blur: 0.0,
    };
    let options = SolveOptions {
        method: Some(method),
        ..SolveOptions::default()
    };
    solve_observed(&observed, &options, &Silent)
}

/// Root mean square noise of a cell where it is lit and where it is not.
fn cell_noise(rig: &Rig, patterns: &DMatrix<f64>, light: &DMatrix<f64>, cell: usize) -> CellNoise {
    let of = |lit: bool| {
        let variances: Vec<f64> = (0..patterns.ncols())
            .filter(|photograph| (patterns[(cell, *photograph)] > 0.5) == lit)
            .map(|photograph| rig.noise().variance(light[(cell, photograph)]))
            .collect();
        (variances.iter().sum::<f64>() / variances.len().max(1) as f64).sqrt()
    };
    CellNoise {
        lit: of(true),
        unlit: of(false),
    }
}
