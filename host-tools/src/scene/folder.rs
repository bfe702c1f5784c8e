//! Writes the photographs of a simulated scene as a capture folder.

use super::description::Scene;
use super::shooting::{Shooting, Slide, save};
use super::simulation::{Simulation, SimulationError};
use crate::capture::{
    CameraSettings, MANIFEST_FILE, Manifest, Pattern, ProjectorSettings, Role, SETTINGS_FILE,
    SceneSettings, Settings, Shot,
};
use crate::progress::Progress;
use image::ColorType;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use thiserror::Error;

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
/// renamed, so that it is whole or not there.
///
/// # Errors
/// [`FolderError`] if something is in its place or it cannot be written.
pub fn write(
    shooting: &Shooting<'_>,
    patterns: &[(Role, Pattern)],
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
    for (index, (_, pattern)) in patterns.iter().enumerate() {
        let [path, _] = names(index).map(|name| folder.join(name));
        let lit: Vec<u8> = pattern.lit.iter().map(|lit| 255 * u8::from(*lit)).collect();
        let size = (pattern.cols as u32, pattern.rows as u32);
        save(&path, &lit, size, ColorType::L8).map_err(at(&path))?;
    }
    progress.begin("taking photographs", patterns.len() as u64);
    let slides: Vec<Slide> = patterns.iter().map(|(_, pattern)| pattern.into()).collect();
    let all: Vec<usize> = (0..slides.len()).collect();
    let taken = AtomicUsize::new(0);
    let bounces = shooting.take(&slides, &all, |place, photograph| {
        let [_, path] = names(place).map(|name| folder.join(name));
        if let Some(photograph) = photograph {
            photograph.save(&path).map_err(at(&path))?;
            taken.fetch_add(1, Ordering::Relaxed);
        }
        progress.advance(1);
        Ok::<(), FolderError>(())
    })?;
    let manifest = Manifest {
        shots: patterns.iter().enumerate().map(shot).collect(),
    };
    let texts = [
        (MANIFEST_FILE, manifest.to_csv()),
        (SETTINGS_FILE, settings(shooting.scene, shooting.simulation)),
    ];
    for (name, text) in texts {
        let path = folder.join(name);
        fs::write(&path, text).map_err(at(&path))?;
    }
    put_in_place(beside, out)?;
    progress.end();
    Ok(Written {
        photographs: taken.into_inner(),
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
            response: scene.camera.response.into(),
            ..CameraSettings::default()
        },
        projector: ProjectorSettings {
            response: scene.projector.response.into(),
            // Known exactly here, as whoever focused the projector might know it.
            blur: Some(if simulation.blurred() {
                scene.projector.blur
            } else {
                0.0
            }),
            ..ProjectorSettings::default()
        },
        scene: SceneSettings {
            name: scene.name.clone(),
        },
    };
    // Numbers and strings always have a TOML form.
    toml::to_string(&settings).unwrap_or_default()
}
