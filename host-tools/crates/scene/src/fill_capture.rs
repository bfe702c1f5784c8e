//! Capture folder that waits for photographs: takes those that it calls for, as the camera of
//! somebody who practises. `iltm patterns` or a verification made it.

use super::description::Scene;
use super::simulation::SimulationError;
use super::virtual_camera::{Photograph, ProjectedFrame, VirtualCamera};
use iltm_capture::{CaptureError, Settings, find_photo, listed};
use iltm_picture::{Samples, foreign_file, png, progress::Progress, whole_file};
use iltm_runtime::{FrameSize, Grid, placement::ProjectorPixels, resample::area::AreaAverage};
use std::fs;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use thiserror::Error;

/// Why photographs could not be taken.
#[derive(Debug, Error)]
pub enum FillCaptureError {
    /// A manifest is not what it should be, or there is none.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// There is no light to photograph.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A pattern cannot be shown.
    #[error("{}: {reason}", path.display())]
    Pattern {
        /// The picture.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// No line has this index.
    #[error("{}: no manifest in it has a line with the index {index}", folder.display())]
    NoIndex {
        /// The folder.
        folder: PathBuf,
        /// Asked for.
        index: u32,
    },
    /// The fault that was asked for leaves no photograph of this index.
    #[error("the camera missed the photograph with the index {index}, as it was asked to")]
    Missed {
        /// Asked for.
        index: u32,
    },
    /// A photograph cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

impl FillCaptureError {
    /// What to do about it, one sentence.
    #[must_use]
    pub fn next_step(&self) -> &'static str {
        match self {
            Self::Capture(error) => error.next_step(),
            Self::Simulation(error) => error.next_step(),
            Self::Pattern { .. } => {
                "Make the patterns with the rows and cols of the scene's projector: `iltm patterns`."
            }
            Self::NoIndex { .. } => "Choose an index from the first column of capture.csv.",
            Self::Missed { .. } => "Leave the fault away.",
            Self::Io { .. } => "Check the folder's permissions and the space on the disk.",
        }
    }
}

/// What a folder calls for, in the order in which it is shown.
#[derive(Clone, Debug)]
pub struct UnfilledCapture {
    folder: PathBuf,
    indices: Vec<u32>,
    photos: Vec<PathBuf>,
    frames: Vec<ProjectedFrame>,
}

impl UnfilledCapture {
    /// Reads the manifests of a folder and their patterns, each of one pixel a cell of `grid` or
    /// a slide of the projector's own pixels.
    ///
    /// # Errors
    /// [`FillCaptureError`] with the manifest's line or the pattern.
    pub fn read(folder: &Path, scene: &Scene) -> Result<Self, FillCaptureError> {
        // What a frame is shown for does not change its light.
        let mut shots: Vec<_> = listed(folder)?.into_iter().map(|(_, shot)| shot).collect();
        shots.sort_by_key(|shot| shot.index);
        // Exposures are relative to the longest, which white is exposed for.
        let longest = shots.iter().filter_map(|s| s.exposure).fold(0.0, f64::max);
        let projector = Settings::read(folder)?.projector.pixels();
        let frames = shots.iter().map(|shot| {
            let path = folder.join(&shot.pattern);
            let (size, codes) = frame(&path, scene, projector)?;
            Ok(ProjectedFrame {
                size,
                codes,
                exposure: shot.exposure.map_or(1.0, |exposure| exposure / longest),
            })
        });
        Ok(Self {
            frames: frames.collect::<Result<_, FillCaptureError>>()?,
            folder: folder.to_owned(),
            indices: shots.iter().map(|shot| shot.index).collect(),
            photos: shots.into_iter().map(|shot| shot.photo).collect(),
        })
    }

    /// Places of the photographs that are not there yet.
    ///
    /// # Errors
    /// [`FillCaptureError`] if two files could be one photograph.
    pub fn missing(&self) -> Result<Vec<usize>, FillCaptureError> {
        let mut missing = Vec::new();
        for (at, photo) in self.photos.iter().enumerate() {
            // A camera may have written it under another ending.
            if find_photo(&self.folder, photo)?.is_none() {
                missing.push(at);
            }
        }
        Ok(missing)
    }

    /// Indices of what is shown, in its order.
    #[must_use]
    pub fn indices(&self) -> Vec<u32> {
        self.indices.clone()
    }

    /// The same with other input codes of every cell for each photograph, in the order of the
    /// indices; what has none stays.
    #[must_use]
    pub fn showing(mut self, grid: Grid, codes: Vec<Vec<[u8; 3]>>) -> Self {
        for (frame, codes) in self.frames.iter_mut().zip(codes) {
            frame.size = FrameSize::of_grid(grid);
            frame.codes = codes;
        }
        self
    }

    /// Takes every photograph that is not there yet; returns how many.
    ///
    /// # Errors
    /// [`FillCaptureError`]; photographs taken before stay.
    pub fn take_missing(
        &self,
        camera: &VirtualCamera<'_>,
        progress: &dyn Progress,
    ) -> Result<usize, FillCaptureError> {
        let paths: Vec<PathBuf> = self.photos.iter().map(|p| self.folder.join(p)).collect();
        let missing = self.missing()?;
        progress.begin("taking photographs", missing.len() as u64);
        let taken = AtomicUsize::new(0);
        camera.take(&self.frames, &missing, |place, photograph| {
            if let Some(photograph) = photograph {
                write(&photograph, &paths[place])?;
                taken.fetch_add(1, Ordering::Relaxed);
            }
            progress.advance(1);
            Ok::<(), FillCaptureError>(())
        })?;
        progress.end();
        Ok(taken.into_inner())
    }

    /// Takes the photograph of one index and writes it to `file`.
    ///
    /// # Errors
    /// [`FillCaptureError`]; `file` is whole or as it was.
    pub fn take_one(
        &self,
        camera: &VirtualCamera<'_>,
        index: u32,
        file: &Path,
    ) -> Result<(), FillCaptureError> {
        let place = self.indices.iter().position(|of_shot| *of_shot == index);
        let place = place.ok_or_else(|| FillCaptureError::NoIndex {
            folder: self.folder.clone(),
            index,
        })?;
        camera.take(&self.frames, &[place], |_, photograph| match photograph {
            Some(photograph) => write(&photograph, file),
            None => Err(FillCaptureError::Missed { index }),
        })?;
        Ok(())
    }
}

/// Writes a photograph whole or not at all.
fn write(photograph: &Photograph, path: &Path) -> Result<(), FillCaptureError> {
    let write = || {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        whole_file::write(path, &photograph.png()?)?;
        Ok(())
    };
    write().map_err(|source: io::Error| FillCaptureError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Size and input codes of a picture of one pixel a cell, or of what a border leaves of a slide.
fn frame(
    path: &Path,
    scene: &Scene,
    projector: Option<ProjectorPixels>,
) -> Result<(FrameSize, Vec<[u8; 3]>), FillCaptureError> {
    let grid = scene.grid();
    let refuse = |reason: String| FillCaptureError::Pattern {
        path: path.to_owned(),
        reason,
    };
    let file = foreign_file::open(path).map_err(|source| FillCaptureError::Io {
        path: path.to_owned(),
        source,
    })?;
    let picture = png::read(BufReader::new(file)).map_err(|error| refuse(error.to_string()))?;
    let (found, cells) = (picture.size(), FrameSize::of_grid(grid));
    let slide = projector.filter(|projector| projector.size() == found);
    let picture = match slide {
        _ if found == cells => picture,
        Some(projector) => picture
            .without_border(projector.border())
            .filter(|inner| AreaAverage::new(grid, inner.size()).is_some())
            .ok_or_else(|| refuse(format!("its border leaves fewer pixels than {grid} cells")))?,
        None => {
            return Err(refuse(format!(
                "{} x {} cells (rows x columns), but the scene's projector has {grid}",
                found.height(),
                found.width()
            )));
        }
    };
    if scene.columns_of(picture.size().width()).is_none() {
        return Err(refuse(format!(
            "its {} columns do not divide among the projectors' {} columns of cells",
            picture.size().width(),
            grid.cols()
        )));
    }
    let codes: Vec<u8> = match picture.samples() {
        Samples::Eight(codes) => codes.clone(),
        Samples::Sixteen(codes) => {
            let eight = |code: &u16| ((u32::from(*code) + 128) / 257) as u8;
            codes.iter().map(eight).collect()
        }
    };
    let pixels = codes.chunks_exact(picture.channels());
    let colour = |pixel: &[u8]| [0, 1, 2].map(|channel| pixel[channel % pixel.len()]);
    Ok((picture.size(), pixels.map(colour).collect()))
}
