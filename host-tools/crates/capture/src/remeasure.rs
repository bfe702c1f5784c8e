//! Remeasuring: the light of every cell in photographs of pictures that are no patterns, taken from
//! anywhere: a Gray code among them says anew where the cells are.

use crate::cells::cell_pixels::LeftOut;
use crate::cells::fine_flood::finest_factor;
use crate::cells::noise::NoiseModel;
use crate::cells::nonlinearity::Nonlinearity;
use crate::cells::pixel_views::PixelViews;
use crate::devices::ColourMixingMatrix;
use crate::evidence::CaptureEvidence;
use crate::format::bracket::Bracket;
use crate::format::error::CaptureError;
use crate::format::manifest::Shot;
use crate::format::photo_files::resolve;
use crate::format::sequence::{CaptureOptions, Selection, Sequence};
use crate::format::settings::Settings;
use crate::photographs::grey_view::shrunk;
use crate::photographs::linearise::LinearPhotographs;
use crate::registration::cell_map::Registration;
use crate::registration::projector_map::{MapError, ProjectorMap};
use crate::{Gate, gates};
use iltm_picture::{LightPicture, progress::Progress};
use iltm_runtime::{FrameSize, Grid};
use std::path::Path;

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
    /// The photographs of the pictures, in their order, ambient light included.
    pub pictures: Vec<CellPlanes>,
    /// The same photographs for people: every [`CellReadings::step`]th pixel of the camera, the
    /// mean of those around it.
    pub views: Vec<LightPicture>,
    /// Camera pixels along a side of which one of the latter is the mean.
    pub step: usize,
    /// Photographs of fine pictures, pixel by pixel; `None` without stripes finer than the cells.
    pub pixels: Option<Result<PixelReadings, MapError>>,
}

/// Photographs of pictures finer than the cells, pixel by pixel.
#[derive(Clone, Debug)]
pub struct PixelReadings {
    /// Width and height of the photographs.
    pub camera: (usize, usize),
    /// What the pixels see of the projector's own, its border left out.
    pub views: PixelViews,
    /// Samples along a cell's width and height that this camera tells apart.
    pub factor: [usize; 2],
    /// Light by picture, channel and pixel of `views`, ambient light included, camera units.
    pub pictures: Vec<Vec<Vec<f32>>>,
    /// Light under black by channel and pixel.
    pub black: Vec<Vec<f32>>,
    /// Noise of a pixel, by channel.
    pub noise: Vec<NoiseModel>,
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
            noise: Vec::new(),
        }
    }

    /// Reads these photographs, and black.
    fn read(
        &mut self,
        brackets: &[usize],
        linear: &mut LinearPhotographs<'_>,
        progress: &dyn Progress,
    ) -> Result<(), CaptureError> {
        let (views, pictures) = (&self.views, &mut self.pictures);
        let of_plane = |plane: &Vec<f32>| {
            let pixels = views.pixels().iter();
            pixels.map(|view| plane[view.pixel as usize]).collect()
        };
        linear
            .photographs
            .for_batches(brackets, progress, |photos| {
                let planes = photos.iter().map(|(_, photo)| photo.planes.iter());
                pictures.extend(planes.map(|planes| planes.map(of_plane).collect()));
            })?;
        self.black = linear.black.iter().map(of_plane).collect();
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
    let options = CaptureOptions {
        min_bernoulli: 0,
        ..CaptureOptions::default()
    };
    let mut code = shots.code.to_vec();
    let mut pictures = shots.pictures.to_vec();
    let mut fine = shots.fine.to_vec();
    for list in [&mut code, &mut pictures, &mut fine] {
        resolve(folder, list)?;
    }
    let mut sequence = Sequence::read(folder, Selection::new(folder, &code, &options)?)?;
    // Behind the patterns, where only their places here lead to them.
    let first = sequence.brackets.len();
    let longest = sequence.longest;
    for list in [&pictures, &fine] {
        sequence.brackets.extend(Bracket::of_each(list, longest));
    }
    let last = first + pictures.len();
    let reading = settings.camera.reading();
    let mut linear = LinearPhotographs::read(folder, &sequence, &reading, progress)?;
    let known = mixing.map(|matrix| ColourMixingMatrix {
        matrix,
        deviation: 0.0,
        white: None,
    });
    let with = (settings, known.as_ref());
    let found = CaptureEvidence::find(folder, &sequence, with, &mut linear, progress)?;
    let mut gates = gates::judge(&sequence, &found);
    let cause = found.cells.as_ref().and_then(|cells| cells.nonlinearity);
    gates::settle(&mut gates, cause);
    let models = found.cells.iter().flat_map(|cells| &cells.channels);
    let noise = models.map(|channel| channel.noise_model).collect();
    let map = found.map;
    let (registration, cells) = (found.registered.registration, found.pixels);

    progress.begin("measuring cells", (pictures.len() + fine.len()) as u64);
    let mut measure = |brackets: &[usize]| -> Result<Vec<CellPlanes>, CaptureError> {
        let mut light = Vec::with_capacity(brackets.len());
        linear
            .photographs
            .for_batches(brackets, progress, |photos| {
                let planes = photos.iter().map(|(_, photo)| &photo.planes);
                light.extend(planes.map(|planes| planes.iter().map(|p| cells.mean(p)).collect()));
            })?;
        Ok(light)
    };
    let white = measure(&sequence.white().shots)?;
    let of_pictures: Vec<usize> = (first..last).collect();
    let pictures = measure(&of_pictures)?;
    let camera = registration.camera;
    let step = camera.0.div_ceil(VIEW_WIDTH).max(1).min(camera.1.max(1));
    let size = FrameSize::new((camera.0 / step) as u16, (camera.1 / step) as u16);
    let mut views = Vec::with_capacity(pictures.len());
    linear
        .photographs
        .for_batches(&of_pictures, progress, |photos| {
            let planes = photos.iter().map(|(_, photo)| {
                let planes = photo.planes.iter();
                planes.map(|plane| shrunk(plane, camera, step)).collect()
            });
            views.extend(planes.filter_map(|planes| LightPicture::new(size?, planes)));
        })?;
    let of_fine: Vec<usize> = (last..sequence.brackets.len()).collect();
    let pixels = map.filter(|_| !of_fine.is_empty()).map(|map| {
        let live = (&registration, &cells.live[..]);
        map.map(|map| PixelReadings::new(&map, sequence.grid, live, &linear.saturated))
    });
    let pixels = match pixels {
        Some(Ok(mut pixels)) => {
            pixels.read(&of_fine, &mut linear, progress)?;
            Some(Ok(PixelReadings { noise, ..pixels }))
        }
        other => other,
    };
    progress.end();
    Ok(CellReadings {
        grid: sequence.grid,
        channels: linear.black.len(),
        black: linear.black.iter().map(|plane| cells.mean(plane)).collect(),
        live: cells.live,
        left_out: cells.left_out,
        registration,
        gates,
        cause,
        white,
        pictures,
        views,
        step,
        pixels,
    })
}
