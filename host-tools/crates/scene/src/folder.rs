//! Simulated capture folder: the photographs of a described scene, as `iltm solve` reads them.

use super::description::Scene;
use super::simulation::{Simulation, SimulationError};
use super::virtual_camera::{ProjectedFrame, VirtualCamera, png};
use iltm_capture::{
    CameraSettings, MANIFEST_FILE, Manifest, Pattern, ProjectorSettings, Role, SETTINGS_FILE,
    SceneSettings, Settings, numbered,
};
use iltm_picture::{FolderError, FramePart, WholeFolder, progress::Progress};
use png::{BitDepth, ColorType};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use thiserror::Error;

/// Why a capture could not be written.
#[derive(Debug, Error)]
pub enum CaptureFolderError {
    /// There is no light to photograph.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The folder could not be written.
    #[error(transparent)]
    Folder(#[from] FolderError),
}

/// What was written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SimulatedCapture {
    /// Photographs.
    pub photographs: usize,
    /// Most bounces that any pattern's light was followed over.
    pub bounces: usize,
}

/// Photographs `patterns` and writes the folder `out`: beside its place first, then
/// renamed, so that it is whole or not there. They are patterns of the scene's projector with
/// this index, while all others show black; or, without it, of all side by side.
///
/// # Errors
/// [`CaptureFolderError`] if something is in its place or it cannot be written.
///
/// # Panics
/// If there is no such projector.
pub fn write(
    camera: &VirtualCamera<'_>,
    projector: Option<usize>,
    patterns: &[(Role, Pattern)],
    out: &Path,
    progress: &dyn Progress,
) -> Result<SimulatedCapture, CaptureFolderError> {
    let folder = WholeFolder::create(out)?;
    folder.folder("patterns")?;
    folder.folder("photos")?;
    for (index, (_, pattern)) in patterns.iter().enumerate() {
        let lit: Vec<u8> = pattern.lit.iter().map(|lit| 255 * u8::from(*lit)).collect();
        let size = (pattern.cols as u32, pattern.rows as u32);
        let picture =
            png(&lit, size, ColorType::Grayscale, BitDepth::Eight).map_err(FolderError::io(out))?;
        folder.file(numbered("patterns", index as u32), picture)?;
    }
    progress.begin("taking photographs", patterns.len() as u64);
    let all = FramePart::whole(camera.grid());
    let part = projector.map_or(all, |index| camera.scene.parts()[index].clone());
    let frame =
        |(_, pattern): &(Role, Pattern)| ProjectedFrame::of_pattern(camera.grid(), &part, pattern);
    let frames: Vec<ProjectedFrame> = patterns.iter().map(frame).collect();
    let all: Vec<usize> = (0..frames.len()).collect();
    let taken = AtomicUsize::new(0);
    let bounces = camera.take(&frames, &all, |place, photograph| {
        if let Some(photograph) = photograph {
            let picture = photograph.png().map_err(FolderError::io(out))?;
            folder.file(numbered("photos", place as u32), picture)?;
            taken.fetch_add(1, Ordering::Relaxed);
        }
        progress.advance(1);
        Ok::<(), CaptureFolderError>(())
    })?;
    let roles = (0..).zip(patterns.iter().map(|(role, _)| *role));
    let manifest = Manifest::numbered("patterns", roles);
    folder.file(MANIFEST_FILE, manifest.to_csv())?;
    let settings = settings(camera.scene, projector.unwrap_or(0), camera.simulation);
    folder.file(SETTINGS_FILE, settings)?;
    folder.finish()?;
    progress.end();
    Ok(SimulatedCapture {
        photographs: taken.into_inner(),
        bounces,
    })
}

fn settings(scene: &Scene, projector: usize, simulation: &Simulation<'_>) -> String {
    let projector = &scene.projectors[projector];
    let settings = Settings {
        camera: CameraSettings {
            response: scene.camera.response.into(),
            ..CameraSettings::default()
        },
        projector: ProjectorSettings {
            response: projector.response.into(),
            // Known exactly here, as whoever focused the projector might know it.
            blur: Some(if simulation.blurred() {
                projector.blur
            } else {
                0.0
            }),
            ..ProjectorSettings::default()
        },
        scene: SceneSettings {
            name: scene.name.clone(),
        },
    };
    settings.to_toml()
}
