//! Test scenes: some whose inverses are known in closed form, and rigs before them.

use crate::acquisition::Acquisition;
use crate::inversion::{Inversion, KnownTransport};
use crate::{Acquired, Answer, GroundTruth, Rig};
use iltm_capture::NoiseModel;
use iltm_runtime::Grid;
use iltm_scene::coaxial::{CoaxialScene, Panels};
use iltm_solve::inverted;
use nalgebra::{DMatrix, DVector};

pub(crate) struct KnownScene {
    pub(crate) grid: Grid,
    pub(crate) live: Vec<bool>,
    pub(crate) transport: DMatrix<f64>,
    pub(crate) rig: Rig,
}

impl KnownScene {
    pub(crate) fn new(rows: u16, cols: u16, transport: DMatrix<f64>, live: Vec<bool>) -> Self {
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
    pub(crate) fn sphere(rows: u16, cols: u16, albedo: f64) -> Self {
        let cells = usize::from(rows) * usize::from(cols);
        let bounced = albedo * albedo / (1.0 - albedo) / cells as f64;
        let mut transport = DMatrix::from_element(cells, cells, bounced);
        transport.fill_diagonal(albedo + bounced);
        Self::new(rows, cols, transport, vec![true; cells])
    }

    pub(crate) fn sphere_inverse(cells: usize, albedo: f64) -> DMatrix<f64> {
        let mut inverse = DMatrix::from_element(cells, cells, -1.0 / cells as f64);
        inverse.fill_diagonal(albedo.recip() - 1.0 / cells as f64);
        inverse
    }

    /// No light between cells; each its own gain, the second (of more than one) dead.
    pub(crate) fn flat(rows: u16, cols: u16) -> Self {
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

    pub(crate) fn scene(scene: &CoaxialScene) -> Self {
        let (rows, cols) = (scene.grid.rows() as u16, scene.grid.cols() as u16);
        Self::new(rows, cols, scene.transport(), scene.covered())
    }

    /// Two valleys, which do not see each other.
    pub(crate) fn panels(rows: u16, cols: u16) -> Self {
        let grid = Grid::new(rows, cols).unwrap();
        Self::scene(&CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7))
    }

    pub(crate) fn textured(rows: u16, cols: u16) -> Self {
        let grid = Grid::new(rows, cols).unwrap();
        let scene = CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7);
        Self::scene(&scene.textured(0.25, 0.95, 1))
    }

    pub(crate) fn noisy(mut self, floor: f64) -> Self {
        let noise = NoiseModel { shot: 0.0, floor };
        let transport = self.transport.clone();
        self.rig = Rig::new(self.grid, transport, self.live.clone(), noise, 1);
        self
    }

    pub(crate) fn known(&self) -> KnownTransport<'_> {
        KnownTransport {
            grid: self.grid,
            live: &self.live,
            transport: &self.transport,
            rig: &self.rig,
        }
    }

    pub(crate) fn truth(&self) -> GroundTruth {
        GroundTruth::new(self.grid, self.transport.clone(), self.live.clone()).unwrap()
    }

    pub(crate) fn answer(&self, method: &dyn Inversion) -> Answer {
        method.invert(self.known()).unwrap().answer
    }

    pub(crate) fn matrix(&self, method: &dyn Inversion) -> DMatrix<f64> {
        match self.answer(method) {
            Answer::Inverse(matrix) => matrix,
            Answer::Frames(_) => panic!("{} has no matrix", method.name()),
        }
    }

    /// Relative error of a method's matrix.
    pub(crate) fn error(&self, method: &dyn Inversion) -> f64 {
        let exact = inverted(&self.transport, &self.live).unwrap();
        (self.matrix(method) - &exact).norm() / exact.norm()
    }

    /// Drive for wanted light, whatever the kind of answer.
    pub(crate) fn drive(&self, method: &dyn Inversion, wanted: &DVector<f64>) -> DVector<f64> {
        self.answer(method).input(wanted)
    }
}

/// The M-shaped panels: transport and live cells.
pub(crate) fn m_scene(grid: Grid) -> (DMatrix<f64>, Vec<bool>) {
    let scene = KnownScene::panels(grid.rows() as u16, grid.cols() as u16);
    (scene.transport, scene.live)
}

/// A rig before a scene.
pub(crate) fn rig(grid: Grid, transport: &DMatrix<f64>, live: &[bool], noise: NoiseModel) -> Rig {
    Rig::new(grid, transport.clone(), live.to_vec(), noise, 1)
}

/// The forward transport that a method finds.
pub(crate) fn forward(method: &dyn Acquisition, rig: &mut Rig) -> DMatrix<f64> {
    match method.acquire(rig) {
        Ok(Acquired::Forward(transport)) => transport,
        other => panic!("{}: {other:?}", method.name()),
    }
}
