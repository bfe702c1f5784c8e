//! Writes the photographs of a simulated scene as a capture folder.

use super::description::Scene;
use super::exposure::Exposed;
use super::sensor::Sensor;
use super::simulation::{Simulation, SimulationError};
use crate::capture::{
    CameraSettings, MANIFEST_FILE, Manifest, Pattern, ProjectorSettings, Role, SETTINGS_FILE,
    SceneSettings, Settings, Shot, columns,
};
use crate::progress::Progress;
use image::{ColorType, ImageFormat};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Photographs that are exposed together: their light is held in memory.
const TOGETHER: usize = 64;

/// Why a capture could not be written.
#[derive(Debug, Error)]
pub enum FolderError {
    /// There is something in its place.
    #[error("{}: it is there already, and not empty", path.display())]
    Taken {
        /// The folder.
        path: PathBuf,
    },
    /// There is no light to photograph.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A file or folder could not be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// What was written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Written {
    /// Photographs.
    pub photographs: usize,
    /// Most bounces that any pattern's light was followed over.
    pub bounces: usize,
}

/// Photographs `patterns` and writes the folder `out`: beside its place first, then
/// renamed, so that it is whole or not there. `seed` repeats the noise.
///
/// # Errors
/// [`FolderError`] if something is in its place or it cannot be written.
pub fn write(
    scene: &Scene,
    simulation: &Simulation<'_>,
    patterns: &[(Role, Pattern)],
    seed: u64,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Written, FolderError> {
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| FolderError::Io { path, source }
    };
    let beside = beside(out)?;
    let folder = beside.path();
    for name in ["patterns", "photos"] {
        let path = folder.join(name);
        fs::create_dir(&path).map_err(at(&path))?;
    }
    let flood = simulation.expose(&DMatrix::from_element(simulation.grid().cells(), 1, 1.0))?;
    let sensor = simulation.sensor(&simulation.photograph(&flood, 0));
    progress.begin("taking photographs", patterns.len() as u64);
    let mut bounces = flood.bounces;
    for (chunk, patterns) in patterns.chunks(TOGETHER).enumerate() {
        let exposed = simulation.expose(&columns(patterns))?;
        bounces = bounces.max(exposed.bounces);
        let written = patterns.par_iter().enumerate().map(|(k, (_, pattern))| {
            let shot = Shooting {
                scene,
                simulation,
                exposed: &exposed,
                sensor: &sensor,
            };
            let index = chunk * TOGETHER + k;
            shot.write(folder, index, k, pattern, seed.wrapping_add(index as u64))?;
            progress.advance(1);
            Ok(())
        });
        written.collect::<Result<Vec<()>, FolderError>>()?;
    }
    let manifest = Manifest {
        shots: patterns.iter().enumerate().map(shot).collect(),
    };
    let texts = [
        (MANIFEST_FILE, manifest.to_csv()),
        (SETTINGS_FILE, settings(scene, simulation)),
    ];
    for (name, text) in texts {
        let path = folder.join(name);
        fs::write(&path, text).map_err(at(&path))?;
    }
    put_in_place(beside, out)?;
    progress.end();
    Ok(Written {
        photographs: patterns.len(),
        bounces,
    })
}

/// Refuses a place that has something in it.
///
/// # Errors
/// [`FolderError::Taken`], or what reading the folder gives.
pub fn check_free(out: &Path) -> Result<(), FolderError> {
    let taken = match fs::read_dir(out) {
        Ok(mut entries) => entries.next().is_some(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => false,
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => true,
        Err(source) => {
            let path = out.to_owned();
            return Err(FolderError::Io { path, source });
        }
    };
    if taken {
        let path = out.to_owned();
        return Err(FolderError::Taken { path });
    }
    Ok(())
}

/// A new folder beside a free place, to be written and then [put there](put_in_place).
///
/// # Errors
/// Those of [`check_free`], or what making it gives.
pub(crate) fn beside(out: &Path) -> Result<tempfile::TempDir, FolderError> {
    check_free(out)?;
    let parent = match out.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let mut prefix = OsString::from(".");
    prefix.push(out.file_name().unwrap_or_default());
    let made = tempfile::Builder::new().prefix(&prefix).tempdir_in(parent);
    made.map_err(|source| FolderError::Io {
        path: parent.to_owned(),
        source,
    })
}

/// Gives a folder that was written beside its place that place.
///
/// # Errors
/// [`FolderError::Io`]; nothing is left behind then.
pub(crate) fn put_in_place(beside: tempfile::TempDir, out: &Path) -> Result<(), FolderError> {
    let io = |source| FolderError::Io {
        path: out.to_owned(),
        source,
    };
    open_to_all(beside.path()).map_err(io)?;
    // An empty folder in its place gives way to the rename.
    let kept = beside.keep();
    fs::rename(&kept, out).map_err(|source| {
        let _ = fs::remove_dir_all(&kept);
        io(source)
    })
}

/// A temporary folder is for its owner only; a capture is like any other folder.
#[cfg(unix)]
fn open_to_all(folder: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn open_to_all(_folder: &Path) -> io::Result<()> {
    Ok(())
}

fn names(index: usize) -> [PathBuf; 2] {
    ["patterns", "photos"].map(|folder| Path::new(folder).join(format!("{index:03}.png")))
}

fn shot((index, (role, _)): (usize, &(Role, Pattern))) -> Shot {
    let [pattern, photo] = names(index);
    Shot {
        index: index as u32,
        role: *role,
        pattern,
        photo,
        exposure: None,
        line: index as u64 + 2,
    }
}

fn settings(scene: &Scene, simulation: &Simulation<'_>) -> String {
    let settings = Settings {
        camera: CameraSettings {
            response: scene.camera.response,
        },
        projector: ProjectorSettings {
            response: scene.projector.response,
            // Known exactly here, as whoever focused the projector might know it.
            blur: if simulation.blurred() {
                scene.projector.blur
            } else {
                0.0
            },
        },
        scene: SceneSettings {
            name: scene.name.clone(),
        },
    };
    // Numbers and strings always have a TOML form.
    toml::to_string(&settings).unwrap_or_default()
}

struct Shooting<'s> {
    scene: &'s Scene,
    simulation: &'s Simulation<'s>,
    exposed: &'s Exposed,
    sensor: &'s Sensor<'s>,
}

impl Shooting<'_> {
    fn write(
        &self,
        folder: &Path,
        index: usize,
        column: usize,
        pattern: &Pattern,
        seed: u64,
    ) -> Result<(), FolderError> {
        let [pattern_name, photo_name] = names(index).map(|name| folder.join(name));
        let lit: Vec<u8> = pattern.lit.iter().map(|lit| 255 * u8::from(*lit)).collect();
        let size = (pattern.cols as u32, pattern.rows as u32);
        save(&pattern_name, &lit, size, ColorType::L8)?;
        let planes = self.simulation.photograph(self.exposed, column);
        let values: Vec<Vec<u16>> = (planes.iter().zip(0_u64..))
            // Each channel has noise of its own.
            .map(|(plane, channel)| self.sensor.values(plane, seed ^ (channel << 40)))
            .collect();
        let eight = self.sensor.file_scale() == 255;
        let mut bytes = Vec::new();
        for pixel in 0..values[0].len() {
            for plane in &values {
                if eight {
                    bytes.push(plane[pixel] as u8);
                } else {
                    bytes.extend(plane[pixel].to_ne_bytes());
                }
            }
        }
        let kind = match (values.len(), eight) {
            (1, true) => ColorType::L8,
            (1, false) => ColorType::L16,
            (_, true) => ColorType::Rgb8,
            (_, false) => ColorType::Rgb16,
        };
        save(&photo_name, &bytes, self.scene.camera.size, kind)
    }
}

fn save(path: &Path, bytes: &[u8], size: (u32, u32), kind: ColorType) -> Result<(), FolderError> {
    image::save_buffer_with_format(path, bytes, size.0, size.1, kind, ImageFormat::Png).map_err(
        |error| FolderError::Io {
            path: path.to_owned(),
            source: match error {
                image::ImageError::IoError(source) => source,
                other => io::Error::other(other),
            },
        },
    )
}
