//! Capture folder that waits for photographs: takes those that it calls for, as the camera of
//! somebody who practises. `iltm patterns` or a verification made it.

use super::description::Scene;
use super::simulation::SimulationError;
use super::virtual_camera::{Photograph, ProjectedFrame, VirtualCamera};
use iltm_capture::{CaptureError, Settings, find_photo, listed};
use iltm_picture::{FramePart, Samples, foreign_file, png, progress::Progress, whole_file};
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
                "Make the patterns with the rows and cols of the scene's projector: `iltm patterns`; \
                 --projector NAME is for those of one of several."
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
    place: SlidePlace,
    /// The photographs of each projector, and from each place of the camera, are a session of their
    /// own.
    session: u64,
}

/// Where slides stand in the frame of all projectors.
#[derive(Clone, Debug)]
struct SlidePlace {
    /// Cells of the frame of all projectors.
    all: Grid,
    /// Its cells that slides have.
    part: FramePart,
    /// Cells of a slide.
    grid: Grid,
    /// Of whom the slides are, for words: the scene's projectors, or one of them.
    whose: String,
}

impl SlidePlace {
    /// Of slides for the projector with this index, or for all of the scene's.
    ///
    /// # Panics
    /// If there is no such projector.
    fn new(scene: &Scene, projector: Option<usize>) -> Self {
        let all = scene.grid();
        match projector {
            Some(index) => Self {
                all,
                part: scene.parts()[index].clone(),
                grid: scene.projectors[index].grid,
                whose: format!("the projector `{}` has", scene.projector_names()[index]),
            },
            None => Self {
                all,
                part: FramePart::whole(all),
                grid: all,
                whose: if scene.projectors.len() == 1 {
                    "the scene's projector has".to_owned()
                } else {
                    "the scene's projectors, side by side, have".to_owned()
                },
            },
        }
    }

    /// Size of the frame of all projectors whose part is a slide of this size, and the part of its
    /// pixels; `None` if there would be no whole number of them.
    fn within(&self, scene: &Scene, slide: FrameSize) -> Option<(FrameSize, FramePart)> {
        let size = self.part.wide(self.all, slide)?;
        // No projector shares a pixel with another, however many cells they have.
        scene.parts_of(size)?;
        Some((size, self.part.pixels(self.all, size)?))
    }

    /// The frame of all projectors while the others show black, and its size.
    fn widened(
        &self,
        scene: &Scene,
        slide: FrameSize,
        codes: Vec<[u8; 3]>,
    ) -> Option<(FrameSize, Vec<[u8; 3]>)> {
        let (size, part) = self.within(scene, slide)?;
        if size == slide {
            return Some((size, codes));
        }
        let mut frame = vec![[0; 3]; size.pixels()];
        for (pixel, code) in part.places(size.width()).zip(codes) {
            frame[pixel] = code;
        }
        Some((size, frame))
    }
}

impl UnfilledCapture {
    /// Reads the manifests of a folder and their patterns, each of one pixel a cell of `grid` or
    /// a slide of the projector's own pixels.
    ///
    /// The slides are those of the scene's projector with the index `projector`, while all others
    /// show black; or, where it is `None`, of the frames of all projectors side by side.
    ///
    /// # Errors
    /// [`FillCaptureError`] with the manifest's line or the pattern.
    ///
    /// # Panics
    /// If the scene has no projector with that index.
    pub fn read(
        folder: &Path,
        scene: &Scene,
        projector: Option<usize>,
    ) -> Result<Self, FillCaptureError> {
        // What a frame is shown for does not change its light.
        let mut shots: Vec<_> = listed(folder)?.into_iter().map(|(_, shot)| shot).collect();
        shots.sort_by_key(|shot| shot.index);
        // Exposures are relative to the longest, which white is exposed for.
        let longest = shots.iter().filter_map(|s| s.exposure).fold(0.0, f64::max);
        let place = SlidePlace::new(scene, projector);
        let pixels = Settings::read(folder)?.projector.pixels();
        let frames = shots.iter().map(|shot| {
            let path = folder.join(&shot.pattern);
            let (size, codes) = frame(&path, scene, &place, pixels)?;
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
            place,
            session: projector.unwrap_or(0) as u64,
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

    /// Cells of a slide: those of one projector, or of all side by side.
    #[must_use]
    pub fn grid(&self) -> Grid {
        self.place.grid
    }

    /// The same for photographs from the further place of the camera with this index, which have noise
    /// of their own.
    #[must_use]
    pub fn from_pose(mut self, pose: usize) -> Self {
        self.session |= (pose as u64 + 1) << 8;
        self
    }

    /// The same with other input codes of every cell of a slide, [`grid`](Self::grid), for each
    /// photograph, in the order of the indices; what has none stays.
    #[must_use]
    pub fn showing(mut self, scene: &Scene, codes: Vec<Vec<[u8; 3]>>) -> Self {
        let cells = FrameSize::of_grid(self.place.grid);
        for (frame, codes) in self.frames.iter_mut().zip(codes) {
            // A pixel a cell always makes a whole number of them.
            if let Some((size, codes)) = self.place.widened(scene, cells, codes) {
                frame.size = size;
                frame.codes = codes;
            }
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
        let camera = camera.in_session(self.session);
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
        let camera = camera.in_session(self.session);
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

/// Size and input codes of the frame of all projectors that has a picture of one pixel a cell in its
/// place, or what a border leaves of a slide.
fn frame(
    path: &Path,
    scene: &Scene,
    place: &SlidePlace,
    projector: Option<ProjectorPixels>,
) -> Result<(FrameSize, Vec<[u8; 3]>), FillCaptureError> {
    let grid = place.grid;
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
                "{} x {} cells (rows x columns), but {} {grid}",
                found.height(),
                found.width(),
                place.whose
            )));
        }
    };
    let codes: Vec<u8> = match picture.samples() {
        Samples::Eight(codes) => codes.clone(),
        Samples::Sixteen(codes) => {
            let eight = |code: &u16| ((u32::from(*code) + 128) / 257) as u8;
            codes.iter().map(eight).collect()
        }
    };
    let pixels = codes.chunks_exact(picture.channels());
    let colour = |pixel: &[u8]| [0, 1, 2].map(|channel| pixel[channel % pixel.len()]);
    let widened = place.widened(scene, picture.size(), pixels.map(colour).collect());
    widened.ok_or_else(|| {
        let (size, all) = (picture.size(), place.all);
        let (width, height) = (size.width(), size.height());
        refuse(if place.grid == all {
            format!("its {width} x {height} pixels do not divide among the projectors' {all} cells")
        } else {
            format!(
                "its {width} x {height} pixels, over {} cells, leave no whole number of pixels for \
                 each projector in a frame of all {all} cells",
                place.grid
            )
        })
    })
}
