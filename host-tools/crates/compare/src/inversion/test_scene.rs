//! Scenes for the tests of this house, whose inverses are known in closed form.

use super::{Inversion, Known};
use crate::{Answer, Rig, Truth};
use iltm_capture::NoiseModel;
use iltm_picture::progress::Silent;
use iltm_runtime::Grid;
use iltm_scene::coaxial::{Panels, Scene};
use iltm_solve::inverted;
use nalgebra::{DMatrix, DVector};

pub(super) struct Before {
    pub(super) grid: Grid,
    pub(super) live: Vec<bool>,
    pub(super) transport: DMatrix<f64>,
    pub(super) rig: Rig,
}

impl Before {
    pub(super) fn new(rows: u16, cols: u16, transport: DMatrix<f64>, live: Vec<bool>) -> Self {
        let grid = Grid::new(rows, cols).unwrap();
        let noise = NoiseModel::default();
        let rig = Rig::new(grid, transport.clone(), live.clone(), noise, 1);
        Self {
            grid,
            live,
            transport,
            rig,
        }
    }

    /// Inside of a sphere, where every cell sees every other alike: with `F = 1/N`,
    /// `T = r (I + r / (1 - r) 11^T / N)` and `T^-1 = (I - r 11^T / N) / r`.
    pub(super) fn sphere(rows: u16, cols: u16, albedo: f64) -> Self {
        let cells = usize::from(rows) * usize::from(cols);
        let bounced = albedo * albedo / (1.0 - albedo) / cells as f64;
        let mut transport = DMatrix::from_element(cells, cells, bounced);
        transport.fill_diagonal(albedo + bounced);
        Self::new(rows, cols, transport, vec![true; cells])
    }

    pub(super) fn sphere_inverse(cells: usize, albedo: f64) -> DMatrix<f64> {
        let mut inverse = DMatrix::from_element(cells, cells, -1.0 / cells as f64);
        inverse.fill_diagonal(albedo.recip() - 1.0 / cells as f64);
        inverse
    }

    /// No light between cells; each its own gain, the second (of more than one) dead.
    pub(super) fn flat(rows: u16, cols: u16) -> Self {
        let cells = usize::from(rows) * usize::from(cols);
        let live: Vec<bool> = (0..cells).map(|cell| cell != 1).collect();
        let own = |cell: usize| {
            if live[cell] {
                0.3 + 0.02 * cell as f64
            } else {
                0.0
            }
        };
        let transport = DMatrix::from_diagonal(&DVector::from_fn(cells, |cell, _| own(cell)));
        Self::new(rows, cols, transport, live)
    }

    pub(super) fn scene(scene: &Scene) -> Self {
        let (rows, cols) = (scene.grid.rows() as u16, scene.grid.cols() as u16);
        Self::new(rows, cols, scene.transport(), scene.covered())
    }

    /// Two valleys, which do not see each other.
    pub(super) fn panels(rows: u16, cols: u16) -> Self {
        let grid = Grid::new(rows, cols).unwrap();
        Self::scene(&Scene::new(grid, &Panels::m_shape(grid, 75.0), 0.7))
    }

    pub(super) fn textured(rows: u16, cols: u16) -> Self {
        let grid = Grid::new(rows, cols).unwrap();
        let scene = Scene::new(grid, &Panels::m_shape(grid, 75.0), 0.7);
        Self::scene(&scene.textured(0.25, 0.95, 1))
    }

    pub(super) fn noisy(mut self, floor: f64) -> Self {
        let noise = NoiseModel { shot: 0.0, floor };
        let transport = self.transport.clone();
        self.rig = Rig::new(self.grid, transport, self.live.clone(), noise, 1);
        self
    }

    pub(super) fn known(&self) -> Known<'_> {
        Known {
            grid: self.grid,
            live: &self.live,
            transport: &self.transport,
            rig: &self.rig,
        }
    }

    pub(super) fn truth(&self) -> Truth {
        Truth::new(self.grid, self.transport.clone(), self.live.clone()).unwrap()
    }

    pub(super) fn answer(&self, method: &dyn Inversion) -> Answer {
        method.invert(self.known(), &Silent).unwrap().answer
    }

    pub(super) fn matrix(&self, method: &dyn Inversion) -> DMatrix<f64> {
        match self.answer(method) {
            Answer::Inverse(matrix) => matrix,
            Answer::Frames(_) => panic!("{} has no matrix", method.name()),
        }
    }

    /// Relative error of a method's matrix.
    pub(super) fn error(&self, method: &dyn Inversion) -> f64 {
        let exact = inverted(&self.transport, &self.live).unwrap();
        (self.matrix(method) - &exact).norm() / exact.norm()
    }

    /// Drive for wanted light, whatever the kind of answer.
    pub(super) fn drive(&self, method: &dyn Inversion, wanted: &DVector<f64>) -> DVector<f64> {
        match self.answer(method) {
            Answer::Inverse(matrix) => matrix * wanted,
            Answer::Frames(frames) => frames.project(wanted),
        }
    }
}
