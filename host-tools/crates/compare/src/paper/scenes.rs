//! M-shaped panels, the scene of the paper's simulations: M-shaped panels on 13 x 21 cells.

use crate::{GroundTruth, Rig};
use iltm_capture::NoiseModel;
use iltm_runtime::Grid;
use iltm_scene::coaxial::{CoaxialScene, Panels};

/// Rows and columns of the paper's grid.
const GRID: (u16, u16) = (13, 21);
/// Angle of the two valleys, degrees: a flood photograph gets 30 % of its light by
/// other ways than straight.
const WEDGE: f64 = 75.0;
/// Albedo of uniform panels.
const ALBEDO: f64 = 0.7;
/// Albedos of textured panels, another one in every cell.
const TEXTURE: (f64, f64) = (0.25, 0.95);
/// Noise below the root mean square light under white, in noisy conditions.
const DECIBELS: f64 = 40.0;

/// Light and camera of an experiment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Condition {
    /// Whether cells differ in albedo.
    pub textured: bool,
    /// Whether the camera is noisy.
    pub noisy: bool,
}

impl Condition {
    /// All, the paper's own first.
    pub const ALL: [Self; 4] = [
        Self::new(false, false),
        Self::new(false, true),
        Self::new(true, false),
        Self::new(true, true),
    ];

    const fn new(textured: bool, noisy: bool) -> Self {
        Self { textured, noisy }
    }

    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match (self.textured, self.noisy) {
            (false, false) => "uniform, noiseless",
            (false, true) => "uniform, 40 dB",
            (true, false) => "textured, noiseless",
            (true, true) => "textured, 40 dB",
        }
    }

    /// The scene with a texture by `seed`.
    pub(super) fn scene(self, seed: u64) -> CoaxialScene {
        let scene = panels(grid(GRID));
        if self.textured {
            scene.textured(TEXTURE.0, TEXTURE.1, seed)
        } else {
            scene
        }
    }

    /// What answers are judged by and photographed with, by `seed`; `None` if the scene
    /// has no inverse, which none of these lacks.
    #[must_use]
    pub fn world(self, seed: u64) -> Option<(GroundTruth, Rig)> {
        let scene = self.scene(seed);
        let live = scene.covered();
        let truth = GroundTruth::new(scene.grid, scene.transport(), live.clone())?;
        let mut noise = NoiseModel::default();
        if self.noisy {
            let flood = truth.flood();
            let mean_square = flood.norm_squared() / truth.live_cells() as f64;
            noise.floor = mean_square * 10_f64.powf(-DECIBELS / 10.0);
        }
        let rig = Rig::new(scene.grid, truth.transport.clone(), live, noise, seed);
        Some((truth, rig))
    }
}

/// How panels are called.
pub(super) const fn surface(textured: bool) -> &'static str {
    if textured { "textured" } else { "uniform" }
}

/// The panels in cells of `grid`.
pub(super) fn panels(grid: Grid) -> CoaxialScene {
    CoaxialScene::new(grid, &Panels::m_shape(grid, WEDGE), ALBEDO)
}

/// A grid of these rows and columns.
pub(super) fn grid((rows, cols): (u16, u16)) -> Grid {
    match Grid::new(rows, cols) {
        Ok(grid) => grid,
        Err(_) => unreachable!("sizes here are constants within the limits"),
    }
}
