//! Observations of a [`CoaxialScene`] for a solver: patterns as a real capture has them, and
//! what a noisy camera makes of them.

use iltm::capture::{Pattern, Role};
use iltm::progress::Silent;
use iltm::scene::coaxial::CoaxialScene;
use iltm::solve::{
    CellNoise, InverseTransport, Method, Observed, ObservedChannel, SolveError, SolveOptions,
    SolveReport, blur, solve_observed,
};
use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// Photographs of a scene, cell by cell. Owns what an [`Observed`] borrows.
#[derive(Clone, Debug)]
pub struct Capture {
    /// Cells of the projector.
    pub grid: Grid,
    /// `L`, `N x m`.
    pub patterns: DMatrix<f64>,
    /// Role of each column of `patterns`.
    pub roles: Vec<Role>,
    /// Cells that the camera could measure.
    pub live: Vec<bool>,
    /// `C`, `N x m`, one entry a channel.
    pub light: Vec<DMatrix<f64>>,
    /// Light under black.
    pub ambient: Vec<f64>,
    /// Standard deviation of every element of `light`.
    pub noise: f64,
    /// Standard deviation of the projector's blur in cells, as far as known.
    pub blur: f64,
}

impl Capture {
    /// White, Gray code with its inverses, and `bernoulli` random patterns,
    /// without noise.
    pub fn new(scene: &CoaxialScene, bernoulli: usize, seed: u64) -> Self {
        let (patterns, roles) = sequence(scene.grid, bernoulli, seed);
        let light = vec![scene.transport() * &patterns];
        Self {
            grid: scene.grid,
            patterns,
            roles,
            live: scene.covered(),
            light,
            ambient: vec![0.0; scene.grid.cells()],
            noise: 0.0,
            blur: 0.0,
        }
    }

    /// Adds white Gaussian noise, `decibels` below the root mean square of all
    /// observations of live cells.
    pub fn noisy(mut self, decibels: f64, seed: u64) -> Self {
        let live = self.live.iter().filter(|live| **live).count();
        let elements = (live * self.patterns.ncols() * self.light.len()) as f64;
        let power: f64 = self.light.iter().map(DMatrix::norm_squared).sum();
        self.noise = (power / elements).sqrt() * 10_f64.powf(-decibels / 20.0);
        let mut random = fastrand::Rng::with_seed(seed ^ 0x5EED);
        for light in &mut self.light {
            for (index, value) in light.iter_mut().enumerate() {
                if self.live[index % self.live.len()] {
                    *value += self.noise * normal(&mut random);
                }
            }
        }
        self
    }

    /// Takes cells out of the camera's sight.
    pub fn unseen(mut self, hidden: impl Fn(usize) -> bool) -> Self {
        for cell in (0..self.live.len()).filter(|cell| hidden(*cell)) {
            self.live[cell] = false;
            for light in &mut self.light {
                light.row_mut(cell).fill(0.0);
            }
        }
        self
    }

    /// Says how far the projector is out of focus.
    pub const fn with_blur(mut self, deviation: f64) -> Self {
        self.blur = deviation;
        self
    }

    /// Does something to all light.
    pub fn map(mut self, with: impl Fn(f64) -> f64) -> Self {
        for light in &mut self.light {
            light.apply(|value| *value = with(*value));
        }
        self
    }

    /// What the solver sees.
    pub fn observed(&self) -> Observed<'_> {
        let noise = CellNoise {
            lit: self.noise,
            unlit: self.noise,
        };
        let channel = |light| ObservedChannel {
            patterns: &self.patterns,
            light,
            ambient: &self.ambient,
            noise: vec![noise; self.grid.cells()],
        };
        Observed {
            grid: self.grid,
            roles: &self.roles,
            live: &self.live,
            channels: self.light.iter().map(channel).collect(),
            blur: self.blur,
        }
    }

    /// Solves by a method.
    ///
    /// # Errors
    /// Those of [`solve_observed`].
    pub fn solve(&self, method: Method) -> Result<(InverseTransport, SolveReport), SolveError> {
        let options = SolveOptions {
            method: Some(method),
            ..SolveOptions::default()
        };
        solve_observed(&self.observed(), &options, &Silent)
    }
}

/// Patterns and roles of a capture without black, whose light is subtracted.
pub fn sequence(grid: Grid, bernoulli: usize, seed: u64) -> (DMatrix<f64>, Vec<Role>) {
    let bits = |cells: usize| cells.next_power_of_two().trailing_zeros() as u8;
    let (column_bits, row_bits) = (bits(grid.cols()), bits(grid.rows()));
    let mut roles = vec![Role::White];
    for inverse in [false, true] {
        roles.extend((0..column_bits).map(|bit| Role::Column { bit, inverse }));
        roles.extend((0..row_bits).map(|bit| Role::Row { bit, inverse }));
    }
    let coded = roles.len();
    roles.extend(vec![Role::Bernoulli; bernoulli]);
    let mut random = fastrand::Rng::with_seed(seed);
    let mut patterns = DMatrix::zeros(grid.cells(), roles.len());
    for (index, mut column) in patterns.column_iter_mut().enumerate() {
        let coded = (index < coded)
            .then(|| Pattern::of_role(grid, roles[index], column_bits, row_bits))
            .flatten();
        match coded {
            Some(pattern) => {
                for (value, lit) in column.iter_mut().zip(&pattern.lit) {
                    *value = f64::from(u8::from(*lit));
                }
            }
            None => column.apply(|value| *value = f64::from(u8::from(random.bool()))),
        }
    }
    (patterns, roles)
}

/// A scene whose projector is out of focus: a Gaussian of `deviation` cells, integrated
/// over each cell; what falls beside the frame is lost.
pub fn out_of_focus(scene: CoaxialScene, deviation: f64) -> CoaxialScene {
    let blur = blur(scene.grid, deviation);
    scene.blurred(blur)
}

/// Standard normal (Box, Muller 1958).
pub fn normal(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.f64()).cos()
}
