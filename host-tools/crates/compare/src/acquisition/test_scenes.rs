//! Scenes and rigs of the tests.

use super::Acquisition;
use crate::{Found, Rig};
use iltm_capture::NoiseModel;
use iltm_picture::progress::Silent;
use iltm_runtime::Grid;
use iltm_scene::coaxial::{Panels, Scene};
use nalgebra::DMatrix;

/// The M-shaped panels: transport and live cells.
pub(super) fn m_scene(grid: Grid) -> (DMatrix<f64>, Vec<bool>) {
    let scene = Scene::new(grid, &Panels::m_shape(grid, 75.0), 0.7);
    (scene.transport(), scene.covered())
}

/// A rig before a scene.
pub(super) fn rig(grid: Grid, transport: &DMatrix<f64>, live: &[bool], noise: NoiseModel) -> Rig {
    Rig::new(grid, transport.clone(), live.to_vec(), noise, 1)
}

/// The forward transport that a method finds.
pub(super) fn forward(method: &dyn Acquisition, rig: &mut Rig) -> DMatrix<f64> {
    match method.acquire(rig, &Silent) {
        Ok(Found::Forward(transport)) => transport,
        other => panic!("{}: {other:?}", method.name()),
    }
}
