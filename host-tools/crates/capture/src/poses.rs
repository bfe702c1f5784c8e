//! Poses of the camera: photographs of the same slides from several places, as one capture.
//!
//! A camera does not see all of a dome or a room from one place. The photographs of all poses are
//! put beside each other in one picture. Of each pose the pixels stay that see a cell best, which is
//! with most pixels, and all others are black. To whoever reads such a capture it is one of a
//! camera that sees everything: light is measured pixel by pixel, wherever a pixel lies.
//!
//! Light that a wall throws back must be the same from all poses, as it is of matt walls, and the
//! exposure must stay.

use crate::cells::measurements::Measurements;
use crate::format::error::CaptureError;
use crate::format::manifest::{RoleName, ShotOf, listed};
use crate::format::photo_files::find_photo;
use crate::format::picture_file::{EXPORT, Opened, Samples, Source};
use crate::format::sequence::CaptureOptions;
use crate::format::settings::{SETTINGS_FILE, Settings};
use crate::gate::{Gate, GateName};
use crate::gates::between::{self, Pair};
use crate::registration::cell_map::NO_CELL;
use crate::registration::correspondence::{self, Correspondence, PictureShift};
use crate::registration::projector_map::ProjectorMap;
use crate::several::check_once;
use iltm_picture::progress::Progress;
use iltm_picture::{FolderError, Picture, Samples as Codes, WholeFolder, png};
use iltm_runtime::FrameSize;
use rayon::prelude::*;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Black pixels between the pictures of two poses, so that no filter reaches across.
const APART: usize = 16;

/// Pixels of a cell in each of two poses by which their light is compared.
const COMPARED: usize = 9;

/// The photographs that were taken from one pose.
#[derive(Clone, Debug)]
pub struct PosePhotographs {
    /// For people.
    pub name: String,
    /// The capture of each projector, for all poses in one order.
    pub captures: Vec<PathBuf>,
}

/// Why poses cannot be joined.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// A capture cannot be read or is not like those of other poses, or gates refuse it.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The folder could not be written.
    #[error(transparent)]
    Folder(#[from] FolderError),
}

/// What was joined.
#[derive(Clone, Debug)]
pub struct JoinedPoses {
    /// Cells that each pose sees of each projector, by pose and projector.
    pub seen: Vec<Vec<usize>>,
    /// Cells of each projector that some pose sees.
    pub together: Vec<usize>,
    /// Cells of each projector.
    pub cells: Vec<usize>,
    /// Whether poses belong together.
    pub gates: Vec<Gate>,
}

/// Joins the captures of several poses into one capture of each projector in `out`.
///
/// # Errors
/// [`PoseError`] if a capture cannot be read, shows other slides than those of other poses, gates that
/// `ignore` does not name refuse it, or `out` cannot be written.
///
/// # Panics
/// If there is no pose, or poses have not as many captures as `out` has folders.
pub fn join_poses(
    poses: &[PosePhotographs],
    ignore: &[GateName],
    out: &[PathBuf],
    progress: &dyn Progress,
) -> Result<JoinedPoses, PoseError> {
    let slides = slides(poses)?;
    let options = CaptureOptions {
        ignore: ignore.to_vec(),
        ..CaptureOptions::default()
    };
    let (mut measured, mut gates) = (Vec::new(), Vec::new());
    for pose in poses {
        let captures = pose.captures.iter();
        let found = captures.map(|folder| in_view(folder, &options, progress));
        let found: Vec<_> = found.collect::<Result<_, _>>()?;
        let unseen = pose
            .captures
            .iter()
            .zip(&found)
            .filter(|(_, own)| own.is_none());
        gates.extend(unseen.map(|(folder, _)| between::out_of_view(&folder.display().to_string())));
        let pose = MeasuredPose::new(&pose.name, found);
        gates.extend(pose.gates_beside(&measured));
        measured.push(pose);
    }
    let failed = gates.iter().filter(|gate| options.refuses(gate));
    let failed: Vec<Gate> = failed.cloned().collect();
    if !failed.is_empty() {
        let names: Vec<&str> = poses.iter().map(|pose| &*pose.name).collect();
        return Err(PoseError::Capture(CaptureError::Refused {
            path: names.join(" and ").into(),
            gates: failed,
        }));
    }
    for (projector, capture) in poses[0].captures.iter().enumerate() {
        let cells = measured.iter().map(|pose| pose.pixels[projector].len());
        let cells = cells.max().unwrap_or_default();
        if cells == 0 {
            return Err(PoseError::Capture(CaptureError::Unlike {
                path: capture.clone(),
                reason: "the camera sees no cell of this projector, from none of the places"
                    .to_owned(),
                next_step: "Check the capture of the place that should see it: `iltm check`.",
            }));
        }
        for pose in &mut measured {
            pose.pixels[projector].resize(cells, 0);
        }
    }
    let mut kept = Vec::new();
    for (at, pose) in poses.iter().enumerate() {
        kept.push(KeptPixels::new(at, &measured).ok_or_else(|| CaptureError::Unlike {
            path: pose.name.clone().into(),
            reason: "the camera sees no cell of any projector from there".to_owned(),
            next_step: "Leave it away, or photograph again with the picture in the camera's view.",
        })?);
    }
    let photographs = slides[0].iter().map(|list| list.len() as u64).sum();
    progress.begin("joining photographs", photographs);
    for (projector, out) in out.iter().enumerate() {
        let of_pose = poses.iter().zip(&slides).zip(&kept);
        let views: Vec<PoseCapture<'_>> = of_pose
            .map(|((pose, slides), kept)| PoseCapture {
                folder: &pose.captures[projector],
                slides: &slides[projector],
                kept,
            })
            .collect();
        write(&views, out, progress)?;
    }
    progress.end();
    let seen = |pixels: &[usize]| pixels.iter().filter(|pixels| **pixels > 0).count();
    let projectors = 0..out.len();
    let best = |projector: usize| {
        let of = |cell: usize| {
            measured
                .iter()
                .map(move |pose| pose.pixels[projector][cell])
        };
        let best = (0..measured[0].pixels[projector].len()).map(|cell| of(cell).max());
        best.map(Option::unwrap_or_default).collect::<Vec<_>>()
    };
    Ok(JoinedPoses {
        seen: (measured.iter())
            .map(|pose| pose.pixels.iter().map(|pixels| seen(pixels)).collect())
            .collect(),
        together: projectors.map(|projector| seen(&best(projector))).collect(),
        cells: measured[0].pixels.iter().map(Vec::len).collect(),
        gates,
    })
}

/// What was measured in a capture; `None` if the projector's picture is out of the camera's view.
fn in_view(
    folder: &Path,
    options: &CaptureOptions,
    progress: &dyn Progress,
) -> Result<Option<Measurements>, PoseError> {
    let examined = crate::examine(folder, options, progress)?;
    let unseen = examined.measurements.is_none();
    // What a pose does not see, another one may; and bounced light alone does not tell which pattern
    // is shown.
    let expected = |gate: &Gate| match gate.name {
        GateName::Coverage => true,
        GateName::Order => unseen,
        _ => false,
    };
    let failed = examined.gates.into_iter();
    let failed = failed.filter(|gate| options.refuses(gate) && !expected(gate));
    let failed: Vec<Gate> = failed.collect();
    if failed.is_empty() {
        return Ok(examined.measurements);
    }
    Err(PoseError::Capture(CaptureError::Refused {
        path: folder.to_owned(),
        gates: failed,
    }))
}

/// What one pose sees.
struct MeasuredPose<'p> {
    name: &'p str,
    /// Of each projector; `None` where its picture is out of view.
    captures: Vec<Option<Measurements>>,
    /// Pixels of the camera that see each cell, by projector.
    pixels: Vec<Vec<usize>>,
}

impl<'p> MeasuredPose<'p> {
    fn new(name: &'p str, captures: Vec<Option<Measurements>>) -> Self {
        let pixels =
            |own: &Option<Measurements>| own.as_ref().map_or_else(Vec::new, pixels_of_cells);
        Self {
            name,
            pixels: captures.iter().map(pixels).collect(),
            captures,
        }
    }

    /// Light of the cells that this pose and another one see well, relative to the other's.
    fn light_beside(&self, other: &Self) -> Vec<f64> {
        let mut ratios = Vec::new();
        for (projector, both) in other.captures.iter().zip(&self.captures).enumerate() {
            let (Some(first), Some(second)) = both else {
                continue;
            };
            let white = |own: &Measurements| own.white(own.channels.len() / 2);
            let (one, two) = (white(first), white(second));
            let well = |pose: &Self, cell: usize| pose.pixels[projector][cell] >= COMPARED;
            let cells = (0..one.len().min(two.len())).filter(|cell| {
                let live = first.live[*cell] && second.live[*cell];
                live && well(self, *cell) && well(other, *cell) && one[*cell] > 0.0
            });
            ratios.extend(cells.map(|cell| two[cell] / one[cell]));
        }
        ratios
    }

    /// Which pixel of each projector lights the place that another one's lights.
    fn correspondences(&self) -> Option<Vec<Correspondence>> {
        let maps = self.captures.iter();
        let maps = maps.map(|own| own.as_ref()?.map.as_ref()?.as_ref().ok());
        let maps: Vec<&ProjectorMap> = maps.collect::<Option<_>>()?;
        let inverse: Vec<_> = maps.iter().map(|map| map.inverse()).collect();
        Some(correspondence::find(&maps, &inverse))
    }

    /// Whether this pose and those before it belong together: light and projectors stayed.
    fn gates_beside(&self, before: &[Self]) -> Vec<Gate> {
        let compared = before.iter().map(|other| (other, self.light_beside(other)));
        let Some((other, light)) = compared.max_by_key(|(_, light)| light.len()) else {
            return Vec::new();
        };
        let pair = Pair {
            first: other.name,
            other: self.name,
        };
        let mut gates = vec![between::light_of_poses(&pair, light)];
        if self.captures.len() > 1 {
            let shifts = before.iter().rev().map(|other| {
                let (was, is) = (other.correspondences()?, self.correspondences()?);
                Some((other.name, PictureShift::find(&was, &is)))
            });
            let mut shifts = shifts.flatten().filter(|(_, shifts)| !shifts.is_empty());
            let (first, shifts) = shifts.next().unwrap_or((other.name, Vec::new()));
            let pair = Pair { first, ..pair };
            gates.push(between::pictures_of_poses(&pair, &shifts));
        }
        gates
    }
}

/// What is listed of a capture, list after list.
type ListedShots = Vec<(String, ShotOf<RoleName>)>;

/// The slides of each pose and projector, the same from all poses.
fn slides(poses: &[PosePhotographs]) -> Result<Vec<Vec<ListedShots>>, CaptureError> {
    let all: Vec<PathBuf> = poses
        .iter()
        .flat_map(|pose| pose.captures.clone())
        .collect();
    check_once(&all)?;
    let mut slides: Vec<Vec<ListedShots>> = Vec::new();
    for pose in poses {
        let own = pose.captures.iter().map(|folder| listed(folder));
        slides.push(own.collect::<Result<_, _>>()?);
    }
    let shown = |slides: &ListedShots| -> Vec<_> {
        let shown = |(list, shot): &(String, ShotOf<RoleName>)| {
            let exposure = shot.exposure.map(f64::to_bits);
            (
                list.clone(),
                shot.index,
                shot.role.clone(),
                shot.pattern.clone(),
                exposure,
            )
        };
        slides.iter().map(shown).collect()
    };
    for (pose, own) in poses.iter().zip(&slides) {
        let first = poses[0].captures.iter().zip(&slides[0]);
        for ((folder, own), (first, of_first)) in pose.captures.iter().zip(own).zip(first) {
            let refuse = |what| {
                Err(CaptureError::Unlike {
                    path: folder.clone(),
                    reason: format!("{what} than {}", first.display()),
                    next_step: "Copy the folder of slides for each pose before it is photographed.",
                })
            };
            if shown(own) != shown(of_first) {
                return refuse("it has other slides");
            }
            let [mut settings, of_first] = [Settings::read(folder)?, Settings::read(first)?];
            settings.camera.places = of_first.camera.places;
            if settings != of_first {
                return refuse("its capture.toml says other things");
            }
        }
    }
    Ok(slides)
}

/// Pixels of the camera that see each cell.
fn pixels_of_cells(own: &Measurements) -> Vec<usize> {
    let mut pixels = vec![0; own.grid.cells()];
    for cell in &own.registration.seen_cell {
        if let Some(count) = pixels.get_mut(*cell as usize) {
            *count += 1;
        }
    }
    pixels
}

/// Pixels of a pose that stay in its photographs.
struct KeptPixels {
    /// Width and height of the photographs that were registered, and how many pixels of the files one
    /// of theirs averages along a side.
    camera: (usize, usize),
    binning: usize,
    kept: Vec<bool>,
}

impl KeptPixels {
    /// Those that see a cell of any projector better than other poses, which is with more pixels. Light
    /// that one projector throws on another's cells is measured there as well.
    /// `None` if it sees no cell.
    fn new(pose: usize, poses: &[MeasuredPose<'_>]) -> Option<Self> {
        let mut seen = poses[pose].captures.iter().flatten();
        let registration = &seen.next()?.registration;
        let mut kept = vec![false; registration.seen_cell.len()];
        for (projector, own) in poses[pose].captures.iter().enumerate() {
            let Some(own) = own else {
                continue;
            };
            let pixels = |of: usize, cell: usize| {
                let pixels = poses[of].pixels[projector].get(cell);
                pixels.copied().unwrap_or(0)
            };
            let best = |cell: usize| {
                let own = pixels(pose, cell);
                (0..pose).all(|other| pixels(other, cell) < own)
                    && (pose..poses.len()).all(|other| pixels(other, cell) <= own)
            };
            let best: Vec<bool> = (0..own.grid.cells()).map(best).collect();
            for (kept, cell) in kept.iter_mut().zip(&own.registration.seen_cell) {
                *kept |= *cell != NO_CELL && best[*cell as usize];
            }
        }
        Some(Self {
            camera: registration.camera,
            binning: registration.binning,
            kept,
        })
    }

    fn keeps(&self, x: usize, y: usize) -> bool {
        let (x, y) = (x / self.binning, y / self.binning);
        x < self.camera.0 && y < self.camera.1 && self.kept[y * self.camera.0 + x]
    }
}

/// One projector's capture from one pose.
struct PoseCapture<'v> {
    folder: &'v Path,
    slides: &'v ListedShots,
    kept: &'v KeptPixels,
}

/// Writes one projector's capture with the photographs of all poses.
fn write(views: &[PoseCapture<'_>], out: &Path, progress: &dyn Progress) -> Result<(), PoseError> {
    let folder = WholeFolder::create(out)?;
    let first = &views[0];
    let mut photographs = HashSet::new();
    for (_, shot) in first.slides {
        if let Some(found) = find_photo(first.folder, &shot.photo)? {
            photographs.insert(first.folder.join(found));
        }
    }
    copy(first.folder, &folder, Path::new(""), &photographs)?;
    let mut settings = Settings::read(first.folder)?;
    settings.camera.places = 0;
    for view in views {
        let places = Settings::read(view.folder)?.camera.places;
        settings.camera.places = settings.camera.places.saturating_add(places);
    }
    folder.file(SETTINGS_FILE, settings.to_toml())?;
    let join = |at: usize| {
        let photo = |view: &PoseCapture<'_>| {
            let found = find_photo(view.folder, &view.slides[at].1.photo)?;
            let decoded = found.map(|found| decoded(&view.folder.join(found)));
            decoded.transpose()
        };
        let pictures = views.iter().map(photo);
        let pictures: Option<Vec<Picture>> = pictures.collect::<Result<_, CaptureError>>()?;
        // What can be done without, as photographs of the calibration, may not be there from all places.
        let Some(pictures) = pictures else {
            progress.advance(1);
            return Ok(());
        };
        let kept: Vec<&KeptPixels> = views.iter().map(|view| view.kept).collect();
        let own = &first.slides[at].1.photo;
        let joined = beside(&pictures, &kept).ok_or_else(|| CaptureError::Unlike {
            path: first.folder.join(own),
            reason:
                "photographs of the poses have other channels or bits, or are too wide together"
                    .to_owned(),
            next_step: EXPORT,
        })?;
        // Photographs are found whatever their ending is on the list.
        folder.file(own.with_extension("png"), png::encode_photograph(&joined))?;
        progress.advance(1);
        Ok::<(), PoseError>(())
    };
    (0..first.slides.len()).into_par_iter().try_for_each(join)?;
    folder.finish()?;
    Ok(())
}

/// Copies everything but photographs, folders as well.
fn copy(
    from: &Path,
    to: &WholeFolder,
    within: &Path,
    photographs: &HashSet<PathBuf>,
) -> Result<(), PoseError> {
    let place = from.join(within);
    let entries = fs::read_dir(&place).map_err(FolderError::io(&place))?;
    for entry in entries {
        let entry = entry.map_err(FolderError::io(&place))?;
        let name = within.join(entry.file_name());
        let path = from.join(&name);
        if path.is_dir() {
            let made = to.path().join(&name);
            fs::create_dir(&made).map_err(FolderError::io(&made))?;
            copy(from, to, &name, photographs)?;
        } else if !photographs.contains(&path) {
            let made = to.path().join(&name);
            fs::copy(&path, &made).map_err(FolderError::io(&made))?;
        }
    }
    Ok(())
}

fn decoded(path: &Path) -> Result<Picture, CaptureError> {
    let refuse = |reason: &str| CaptureError::Picture {
        path: path.to_owned(),
        reason: reason.to_owned(),
        next_step: EXPORT,
    };
    let opened = Opened::open(Source {
        path,
        what: "photograph",
        line: 0,
    })?;
    let (width, height) = opened.size();
    let side = |side: u32| u16::try_from(side).ok();
    let size = side(width).zip(side(height));
    let size = size.and_then(|(width, height)| FrameSize::new(width, height));
    let samples: Samples = opened.decode()?;
    let codes = samples.codes();
    let codes = codes
        .ok_or_else(|| refuse("it holds floating point numbers, which poses are not joined of"))?;
    size.and_then(|size| Picture::new(size, codes))
        .ok_or_else(|| refuse("it has more pixels than a photograph may have"))
}

/// Pictures beside each other, black where pixels are not kept; `None` if they are not alike.
fn beside(pictures: &[Picture], kept: &[&KeptPixels]) -> Option<Picture> {
    let first = pictures.first()?;
    let channels = first.channels();
    let height = pictures
        .iter()
        .map(|picture| picture.size().height())
        .max()?;
    let widths = pictures
        .iter()
        .map(|picture| picture.size().width() + APART);
    let width = widths.sum::<usize>() - APART;
    let size = FrameSize::new(width.try_into().ok()?, height.try_into().ok()?)?;
    let alike = |picture: &Picture| {
        let eight = |picture: &Picture| matches!(picture.samples(), Codes::Eight(_));
        picture.channels() == channels && eight(picture) == eight(first)
    };
    if !pictures.iter().all(alike) {
        return None;
    }
    let mut codes = vec![0_u16; width * height * channels];
    let mut left = 0;
    for (picture, kept) in pictures.iter().zip(kept) {
        let own = picture.size();
        let code = |at: usize| match picture.samples() {
            Codes::Eight(codes) => codes[at].into(),
            Codes::Sixteen(codes) => codes[at],
        };
        for y in 0..own.height() {
            for x in (0..own.width()).filter(|x| kept.keeps(*x, y)) {
                for channel in 0..channels {
                    let from = (y * own.width() + x) * channels + channel;
                    codes[(y * width + left + x) * channels + channel] = code(from);
                }
            }
        }
        left += own.width() + APART;
    }
    let codes = match first.samples() {
        Codes::Eight(_) => Codes::Eight(codes.into_iter().map(|code| code as u8).collect()),
        Codes::Sixteen(_) => Codes::Sixteen(codes),
    };
    Picture::new(size, codes)
}
