//! Bernoulli patterns and sparsity: the project's own solver, by any of its methods.

use super::Acquisition;
use super::compressive_dual::SEN_DARABI;
use crate::{Found, Rig, Source, Unfit};
use iltm_capture::{Role, columns, pattern_set};
use iltm_picture::progress::Progress;
use iltm_solve::{CellNoise, Method, Observed, ObservedChannel, SolveOptions, solve_observed};
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
    fn name(&self) -> String {
        let Self {
            method,
            photographs,
            ..
        } = self;
        match method {
            Method::Joint => format!("iltm, {photographs}"),
            Method::Direct => format!("the paper's direct method, {photographs}"),
            Method::TwoStage => {
                format!("compressive dual photography by l1 (two-stage), {photographs}")
            }
            Method::BruteForce => format!("least squares, {photographs}"),
        }
    }

    fn source(&self) -> Source {
        match self.method {
            Method::TwoStage | Method::BruteForce => SEN_DARABI,
            Method::Joint | Method::Direct => Source::THE_PAPER,
        }
    }

    fn how(&self) -> &'static str {
        match self.method {
            Method::Joint => {
                "White, Gray code and Bernoulli photographs; gains apart from a non-negative \
                 operator that is sparse in Haar; sparsity chosen by photographs held out."
            }
            Method::Direct => {
                "White and Bernoulli photographs; each row of the inverse, Haar-coded on both \
                 sides, has the least l1 norm that explains them within their noise (P4)."
            }
            _ => {
                "The direct method's photographs; each row of the transport, Haar-coded on both \
                 sides, has the least l1 norm that explains them within their noise; then the \
                 transport is inverted."
            }
        }
    }

    fn acquire(&self, rig: &mut Rig, progress: &dyn Progress) -> Result<Found, Unfit> {
        let taken = self.take(rig)?;
        let options = SolveOptions {
            method: self.method,
            ..SolveOptions::default()
        };
        let (inverse, _) = solve_observed(&taken.observed(rig), &options, progress)?;
        Ok(Found::Inverse(inverse.channel(0).dense()))
    }
}

/// Photographs of a rig, as the solver wants them.
struct Taken {
    patterns: DMatrix<f64>,
    roles: Vec<Role>,
    light: DMatrix<f64>,
    ambient: Vec<f64>,
    noise: Vec<CellNoise>,
}

impl Sparse {
    fn take(&self, rig: &mut Rig) -> Result<Taken, Unfit> {
        let shown: Vec<_> = pattern_set(rig.grid(), self.photographs, self.seed)
            .into_iter()
            .filter(|(role, _)| match role {
                Role::Black => false,
                Role::White | Role::Bernoulli => true,
                Role::Column { .. } | Role::Row { .. } => self.method == Method::Joint,
            })
            .take(self.photographs)
            .collect();
        if !shown.iter().any(|(role, _)| *role == Role::Bernoulli) {
            return Err(Unfit::Condition(format!(
                "{} photographs leave none for Bernoulli patterns",
                self.photographs
            )));
        }
        let roles = shown.iter().map(|(role, _)| *role).collect();
        let patterns = columns(&shown);
        let light = rig.photograph(&patterns);
        let noise = (0..patterns.nrows())
            .map(|cell| cell_noise(rig, &patterns, &light, cell))
            .collect();
        Ok(Taken {
            ambient: vec![0.0; patterns.nrows()],
            patterns,
            roles,
            light,
            noise,
        })
    }
}

impl Taken {
    fn observed<'t>(&'t self, rig: &'t Rig) -> Observed<'t> {
        Observed {
            grid: rig.grid(),
            patterns: &self.patterns,
            roles: &self.roles,
            live: rig.live(),
            channels: vec![ObservedChannel {
                light: &self.light,
                ambient: &self.ambient,
                noise: self.noise.clone(),
            }],
            blur: 0.0,
        }
    }
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
