//! Remeasuring: the light of every cell in photographs of pictures that are no patterns, taken from
//! anywhere: a Gray code among them says anew where the cells are.

use crate::cells::cell_pixels::{CellPixels, LeftOut};
use crate::cells::fine_flood::finest_factor;
use crate::cells::measurements::Measurements;
use crate::cells::noise::NoiseModel;
use crate::cells::nonlinearity::Nonlinearity;
use crate::cells::pixel_views::PixelViews;
use crate::devices::{ColourMixingMatrix, Unmixing};
use crate::evidence::CaptureEvidence;
use crate::format::bracket::Bracket;
use crate::format::error::CaptureError;
use crate::format::manifest::{Shot, projector_file, projector_stripes_file};
use crate::format::photo_files::resolve;
use crate::format::sequence::{CaptureOptions, Selection, Sequence};
use crate::format::settings::Settings;
use crate::photographs::Photographs;
use crate::photographs::clipping::Clipped;
use crate::photographs::grey_view::shrunk;
use crate::photographs::linearise::LinearPhotographs;
use crate::registration::cell_map::{NO_CELL, Registration};
use crate::registration::correspondence::{self, Correspondence};
use crate::registration::projector_map::{MapError, ProjectorMap};
use crate::wide_frame::WideFrame;
use crate::{Gate, gates};
use iltm_picture::{LightPicture, progress::Progress};
use iltm_runtime::{FrameSize, Grid};
use std::path::{Path, PathBuf};

/// Light of the cells in one photograph: one entry a channel, in each one a cell, camera
/// units; 0 where a cell was not measured.
pub type CellPlanes = Vec<Vec<f64>>;

/// What photographs of a scene show of its cells.
#[derive(Clone, Debug)]
pub struct CellReadings {
    /// Cells of the projector, as the Gray code's patterns have them.
    pub grid: Grid,
    /// Channels of the photographs, 1 or 3.
    pub channels: usize,
    /// Whether the cell was measured, length `N`.
    pub live: Vec<bool>,
    /// Why others were not.
    pub left_out: Vec<LeftOut>,
    /// Camera pixels that each cell was measured by, length `N`; none of others.
    pub pixels_of_cells: Vec<Vec<u32>>,
    /// Where the cells are.
    pub registration: Registration,
    /// What the gates say of the photographs of the code.
    pub gates: Vec<Gate>,
    /// Why light does not add up in them, where it does not.
    pub cause: Option<Nonlinearity>,
    /// Each photograph of white, ambient light included.
    pub white: Vec<CellPlanes>,
    /// Mean of the photographs of black: ambient light and the projector's black.
    pub black: CellPlanes,
    /// Noise of a camera pixel, by channel.
    pub noise: Vec<NoiseModel>,
    /// The photographs of the pictures, in their order, ambient light included.
    pub pictures: Vec<CellPlanes>,
    /// The same photographs for people: every [`CellReadings::step`]th pixel of the camera, the
    /// mean of those around it.
    pub views: Vec<LightPicture>,
    /// Camera pixels along a side of which one of the latter is the mean.
    pub step: usize,
    /// Photographs of fine pictures, pixel by pixel; `None` without stripes finer than the cells.
    pub pixels: Option<Result<PixelReadings, MapError>>,
    /// Of several projectors, pixels of two that light one place.
    pub correspondences: Vec<Correspondence>,
}

/// Photographs of pictures finer than the cells, pixel by pixel.
#[derive(Clone, Debug)]
pub struct PixelReadings {
    /// Width and height of the photographs.
    pub camera: (usize, usize),
    /// What the pixels see of the projector's own, its border left out. Where several projectors overlap,
    /// a pixel is there for each that it sees, for the one with the largest share last.
    pub views: PixelViews,
    /// Samples along a cell's width and height that this camera tells apart.
    pub factor: [usize; 2],
    /// Light by picture, channel and pixel of `views`, ambient light included, camera units.
    pub pictures: Vec<Vec<Vec<f32>>>,
    /// Light under black by channel and pixel.
    pub black: Vec<Vec<f32>>,
}

impl PixelReadings {
    /// Those of no photograph yet, without saturated pixels.
    fn new(
        map: &ProjectorMap,
        grid: Grid,
        (registration, live): (&Registration, &[bool]),
        saturated: &[bool],
    ) -> Self {
        let inner = map.projector.inner();
        let views = PixelViews::new(map, grid, [1; 2], registration);
        Self {
            camera: registration.camera,
            views: views
                .over([inner.width(), inner.height()])
                .without(saturated),
            factor: finest_factor(grid, (registration, live), Some(map), 1, None),
            pictures: Vec::new(),
            black: Vec::new(),
        }
    }

    /// Reads these photographs, and what was photographed of black.
    fn read(
        &mut self,
        (photographs, brackets): (&mut Photographs<'_>, &[usize]),
        black: &[Vec<f32>],
        progress: &dyn Progress,
    ) -> Result<(), CaptureError> {
        let (views, pictures) = (&self.views, &mut self.pictures);
        let of_plane = |plane: &Vec<f32>| {
            let pixels = views.pixels().iter();
            pixels.map(|view| plane[view.pixel as usize]).collect()
        };
        photographs.for_batches(brackets, progress, |photos| {
            let planes = photos.iter().map(|(_, photo)| photo.planes.iter());
            pictures.extend(planes.map(|planes| planes.map(of_plane).collect()));
        })?;
        self.black = black.iter().map(of_plane).collect();
        Ok(())
    }
}

/// What is photographed in a folder.
#[derive(Clone, Copy, Debug)]
pub struct Remeasured<'s> {
    /// White, black, the Gray code of both axes and any Bernoulli patterns: they tell where the
    /// cells are.
    pub code: &'s [Shot],
    /// Pictures that are measured cell by cell. Of these and the next, only photograph and line
    /// are looked at.
    pub pictures: &'s [Shot],
    /// Pictures that are measured pixel by pixel, where stripes say what each pixel sees.
    pub fine: &'s [Shot],
}

/// Photographs of pictures of several projectors that light one scene, which all show at once.
#[derive(Clone, Copy, Debug)]
pub struct RemeasuredSeveral<'s> {
    /// White, black, Gray code and Bernoulli patterns of each projector, from left to right in the wide
    /// frame, shown while the others are black; patterns have the columns of all. The fine stripes of
    /// the one that is counted `k` from 1 are in [`projector_stripes_file`] of `k`.
    pub codes: &'s [Vec<Shot>],
    /// White of all, at least one.
    pub white: &'s [Shot],
    /// Pictures that are measured cell by cell, and pixel by pixel.
    pub pictures: &'s [Shot],
}

/// Most pixels across a photograph for people.
const VIEW_WIDTH: usize = 400;

/// Registers the cells by the photographs of the code and measures them in those of the pictures.
/// With `mixing`, of camera channels by projector channels, all light is that of the projector's
/// channels.
///
/// # Errors
/// [`CaptureError`] for whatever is missing, contradictory or unusable.
pub fn remeasure(
    folder: &Path,
    settings: &Settings,
    mixing: Option<[[f64; 3]; 3]>,
    shots: Remeasured<'_>,
    progress: &dyn Progress,
) -> Result<CellReadings, CaptureError> {
    let mut code = shots.code.to_vec();
    let mut pictures = shots.pictures.to_vec();
    let mut fine = shots.fine.to_vec();
    for list in [&mut code, &mut pictures, &mut fine] {
        resolve(folder, list)?;
    }
    let mut sequence = Sequence::read(folder, Selection::new(folder, &code, &for_places())?)?;
    // Behind the patterns, where only their places here lead to them.
    let first = sequence.brackets.len();
    let longest = sequence.longest;
    for list in [&pictures, &fine] {
        sequence.brackets.extend(Bracket::of_each(list, longest));
    }
    let last = first + pictures.len();
    let reading = settings.camera.reading();
    let mut linear = LinearPhotographs::read(folder, &sequence, &reading, progress)?;
    let known = known(mixing);
    let with = (settings, Unmixing::As(known.as_ref()));
    let found = CaptureEvidence::find(folder, &sequence, with, &mut linear, progress)?;
    let mut gates = gates::judge(&sequence, &found);
    let cause = found.cells.as_ref().and_then(|cells| cells.nonlinearity);
    gates::settle(&mut gates, cause);
    let noise = noise(&found);
    let map = found.map;
    let (registration, cells) = (found.registered.registration, found.pixels);

    progress.begin("measuring cells", (pictures.len() + fine.len()) as u64);
    let photographs = &mut linear.photographs;
    let white = measure((photographs, &sequence.white().shots), &cells, progress)?;
    let of_pictures: Vec<usize> = (first..last).collect();
    let pictures = measure((photographs, &of_pictures), &cells, progress)?;
    let step = view_step(&registration);
    let views = views((photographs, &of_pictures), (&registration, step), progress)?;
    let of_fine: Vec<usize> = (last..sequence.brackets.len()).collect();
    let pixels = map.filter(|_| !of_fine.is_empty()).map(|map| {
        let live = (&registration, &cells.live[..]);
        map.map(|map| PixelReadings::new(&map, sequence.grid, live, &linear.saturated))
    });
    let pixels = match pixels {
        Some(Ok(mut pixels)) => {
            pixels.read((photographs, &of_fine), &linear.black, progress)?;
            Some(Ok(pixels))
        }
        other => other,
    };
    progress.end();
    Ok(CellReadings {
        grid: sequence.grid,
        channels: linear.black.len(),
        black: linear.black.iter().map(|plane| cells.mean(plane)).collect(),
        pixels_of_cells: cells.of_cells().map(<[u32]>::to_vec).collect(),
        live: cells.live,
        left_out: cells.left_out,
        registration,
        gates,
        cause,
        white,
        noise,
        pictures,
        views,
        step,
        pixels,
        correspondences: Vec::new(),
    })
}

/// The same of several projectors: each one's cells are registered by its own code, and measured in the
/// photographs of pictures that all show. A camera pixel's place is that in the picture of the projector
/// with the largest share of its light.
///
/// # Errors
/// As [`remeasure`]; [`CaptureError::Unlike`] where the projectors' cells do not fit beside each other.
pub fn remeasure_several(
    folder: &Path,
    settings: &Settings,
    mixing: Option<[[f64; 3]; 3]>,
    shots: RemeasuredSeveral<'_>,
    progress: &dyn Progress,
) -> Result<CellReadings, CaptureError> {
    let known = known(mixing);
    let mut of_projector = Vec::new();
    for (index, code) in shots.codes.iter().enumerate() {
        let found = Placed::find(
            folder,
            (settings, Unmixing::As(known.as_ref())),
            (index, code),
            progress,
        )?;
        of_projector.push(found);
    }
    let (mut pictures, mut white) = (shots.pictures.to_vec(), shots.white.to_vec());
    resolve(folder, &mut pictures)?;
    resolve(folder, &mut white)?;
    let longest = of_projector[0].longest;
    let brackets = [&white, &pictures].map(|list| Bracket::of_each(list, longest));
    let mut photographs = of_projector[0].linear.others(folder, brackets.concat())?;
    photographs.prefetch(progress)?;
    let of_white: Vec<usize> = (0..white.len()).collect();
    let of_pictures: Vec<usize> = (white.len()..white.len() + pictures.len()).collect();
    // Where pictures overlap, all together may be too bright for the camera.
    let (_, saturated) = photographs.mean(&of_white, progress)?;

    let mut gates = Vec::new();
    let (mut own, mut lists, mut linear) = (Vec::new(), Vec::new(), Vec::new());
    let (mut cause, mut noise) = (None, Vec::new());
    for placed in of_projector {
        cause = cause.or(placed.cause);
        gates.extend(placed.gates);
        noise = placed.noise;
        own.push(placed.measurements);
        lists.push(placed.list);
        linear.push(placed.linear);
    }
    let wide = WideFrame::new(&lists, own)?;
    let either = |linear: &LinearPhotographs<'_>| -> Vec<bool> {
        let pairs = linear.saturated.iter().zip(&saturated);
        pairs.map(|(own, together)| *own || *together).collect()
    };
    let clipped: Vec<Vec<bool>> = linear.iter().map(either).collect();
    let of_all: Vec<&[bool]> = clipped.iter().map(Vec::as_slice).collect();
    let cells = wide.pixels(&of_all);
    let registration = wide.registration();
    let lit = registration.seen_cell.iter().zip(&saturated);
    let lit = lit.filter(|(cell, _)| **cell != NO_CELL);
    let together = Clipped {
        lit: lit.clone().count(),
        count: lit.filter(|(_, saturated)| **saturated).count(),
        ceiling: None,
    };
    let live = cells.live.iter().filter(|live| **live).count();
    let mut bright = gates::saturation::judge(&together, &cells.left_out, live);
    bright.what = format!("all projectors together: {}", bright.what);
    gates.push(bright);
    let black = &linear[0].black;
    progress.begin("measuring cells", (white.len() + pictures.len()) as u64);
    let white = measure((&mut photographs, &of_white), &cells, progress)?;
    let light = measure((&mut photographs, &of_pictures), &cells, progress)?;
    let step = view_step(&registration);
    let of_views = (&mut photographs, &of_pictures[..]);
    let views = views(of_views, (&registration, step), progress)?;
    let maps = wide.maps().unwrap_or_default();
    let inverse: Vec<_> = maps.iter().map(|map| map.inverse()).collect();
    let live = (&registration, &cells.live[..]);
    let mut pixels = wide.map().map(|map| {
        let pixels = PixelReadings::new(&map, wide.grid, live, &saturated);
        let views = wide.views(&pixels.views).without(&saturated);
        Ok(PixelReadings { views, ..pixels })
    });
    match &mut pixels {
        Some(Ok(pixels)) => pixels.read((&mut photographs, &of_pictures), black, progress)?,
        _ => pixels = wide.without_map().cloned().map(Err),
    }
    progress.end();
    gates::settle(&mut gates, cause);
    Ok(CellReadings {
        grid: wide.grid,
        channels: black.len(),
        black: black.iter().map(|plane| cells.mean(plane)).collect(),
        pixels_of_cells: cells.of_cells().map(<[u32]>::to_vec).collect(),
        live: cells.live,
        left_out: cells.left_out,
        registration,
        gates,
        cause,
        white,
        noise,
        pictures: light,
        views,
        step,
        pixels,
        correspondences: correspondence::find(&maps, &inverse),
    })
}

/// What the photographs of one of several projectors say of its cells.
struct Placed<'f> {
    /// The list of its patterns.
    list: PathBuf,
    longest: Option<f64>,
    linear: LinearPhotographs<'f>,
    measurements: Measurements,
    gates: Vec<Gate>,
    cause: Option<Nonlinearity>,
    noise: Vec<NoiseModel>,
}

impl<'f> Placed<'f> {
    fn find(
        folder: &'f Path,
        (settings, unmixing): (&Settings, Unmixing<'_>),
        (index, code): (usize, &[Shot]),
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        let list = folder.join(projector_file(index + 1));
        let mut code = code.to_vec();
        resolve(folder, &mut code)?;
        let selection = Selection::new(folder, &code, &for_places())?;
        let selection = selection.of_part(projector_stripes_file(index + 1));
        let sequence = Sequence::read(folder, selection)?;
        let mut own = settings.clone();
        if let (Some(size), Some(part)) = (&mut own.projector.size, &sequence.part) {
            let [width, height] = *size;
            let pixels = FrameSize::new(width, height).and_then(|wide| part.pixels(wide));
            let pixels = pixels.ok_or_else(|| CaptureError::Unlike {
                path: list.clone(),
                reason: format!(
                    "{width} x {height} pixels in all are no whole number for each cell"
                ),
                next_step: "Make the folder again with `iltm verify`.",
            })?;
            *size = [pixels.width(), pixels.height()].map(|side| side as u16);
        }
        let reading = own.camera.reading();
        let mut linear = LinearPhotographs::read(folder, &sequence, &reading, progress)?;
        let found =
            CaptureEvidence::find(folder, &sequence, (&own, unmixing), &mut linear, progress)?;
        linear.photographs.forget();
        let mut gates = gates::judge(&sequence, &found);
        for gate in &mut gates {
            gate.what = format!("projector {}: {}", index + 1, gate.what);
        }
        let cause = found.cells.as_ref().and_then(|cells| cells.nonlinearity);
        let noise = noise(&found);
        let measurements = found.into_measurements(folder, &sequence, &own)?;
        let measurements = measurements.ok_or_else(|| CaptureError::Refused {
            path: list.clone(),
            gates: gates.iter().filter(|gate| gate.fails()).cloned().collect(),
        })?;
        Ok(Self {
            list,
            longest: sequence.longest,
            linear,
            measurements,
            gates,
            cause,
            noise,
        })
    }
}

/// Patterns that tell places need no more than a code.
fn for_places() -> CaptureOptions {
    CaptureOptions {
        min_bernoulli: 0,
        ..CaptureOptions::default()
    }
}

fn known(mixing: Option<[[f64; 3]; 3]>) -> Option<ColourMixingMatrix> {
    mixing.map(|matrix| ColourMixingMatrix {
        matrix,
        deviation: 0.0,
        white: None,
    })
}

fn noise(found: &CaptureEvidence) -> Vec<NoiseModel> {
    let models = found.cells.iter().flat_map(|cells| &cells.channels);
    models.map(|channel| channel.noise_model).collect()
}

/// Light of the cells in each of these photographs.
fn measure(
    (photographs, brackets): (&mut Photographs<'_>, &[usize]),
    cells: &CellPixels,
    progress: &dyn Progress,
) -> Result<Vec<CellPlanes>, CaptureError> {
    let mut light = Vec::with_capacity(brackets.len());
    photographs.for_batches(brackets, progress, |photos| {
        let planes = photos.iter().map(|(_, photo)| &photo.planes);
        light.extend(planes.map(|planes| planes.iter().map(|p| cells.mean(p)).collect()));
    })?;
    Ok(light)
}

/// Camera pixels along a side of which one of a photograph for people is the mean.
fn view_step(registration: &Registration) -> usize {
    let (width, height) = registration.camera;
    width.div_ceil(VIEW_WIDTH).max(1).min(height.max(1))
}

/// These photographs for people.
fn views(
    (photographs, brackets): (&mut Photographs<'_>, &[usize]),
    (registration, step): (&Registration, usize),
    progress: &dyn Progress,
) -> Result<Vec<LightPicture>, CaptureError> {
    let camera = registration.camera;
    let size = FrameSize::new((camera.0 / step) as u16, (camera.1 / step) as u16);
    let mut views = Vec::with_capacity(brackets.len());
    photographs.for_batches(brackets, progress, |photos| {
        let planes = photos.iter().map(|(_, photo)| {
            let planes = photo.planes.iter();
            planes.map(|plane| shrunk(plane, camera, step)).collect()
        });
        views.extend(planes.filter_map(|planes| LightPicture::new(size?, planes)));
    })?;
    Ok(views)
}
