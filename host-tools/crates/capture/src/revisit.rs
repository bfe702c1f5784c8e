//! The light of every cell in photographs of pictures that are no patterns, taken from
//! anywhere: a Gray code among them says anew where the cells are.

use super::calibration::Mixing;
use super::frame::Frame;
use super::light::Light;
use super::measure::CellPixels;
use super::sequence::{Chosen, Sequence};
use super::{
    CaptureError, CaptureOptions, LeftOut, Registration, Settings, Shot, find, gray_code,
    registration,
};
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use std::path::Path;

/// Light of the cells in one photograph: one entry a channel, in each one a cell, camera
/// units; 0 where a cell was not measured.
pub type CellPlanes = Vec<Vec<f64>>;

/// What photographs of a scene show of its cells.
#[derive(Clone, Debug)]
pub struct Revisited {
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
    /// Each photograph of white, ambient light included.
    pub white: Vec<CellPlanes>,
    /// Mean of the photographs of black: ambient light and the projector's black.
    pub black: CellPlanes,
    /// The photographs of the pictures, in their order, ambient light included.
    pub pictures: Vec<CellPlanes>,
}

/// Registers the cells by the photographs of `code` (white, black, the Gray code of both
/// axes and any Bernoulli patterns) and measures them in those of `pictures`. Of the
/// latter only photograph and line are looked at. With `mixing`, of camera channels by
/// projector channels, all light is that of the projector's channels.
///
/// # Errors
/// [`CaptureError`] for whatever is missing, contradictory or unusable.
pub fn revisit(
    folder: &Path,
    settings: &Settings,
    mixing: Option<[[f64; 3]; 3]>,
    (code, pictures): (&[Shot], &[Shot]),
    progress: &dyn Progress,
) -> Result<Revisited, CaptureError> {
    let options = CaptureOptions {
        min_bernoulli: 0,
        ..CaptureOptions::default()
    };
    let mut code = code.to_vec();
    let mut pictures = pictures.to_vec();
    find::resolve(folder, &mut code)?;
    find::resolve(folder, &mut pictures)?;
    let mut sequence = Sequence::read(folder, Chosen::new(folder, &code, &options)?)?;
    // Behind the patterns, where only their places here lead to them.
    let first = sequence.frames.len();
    sequence
        .frames
        .extend(Frame::of_each(&pictures, sequence.longest));
    let mut light = Light::read(folder, &sequence, settings, progress)?;
    light.find_clipped(&sequence, progress)?;
    light.measure_devices(folder, &sequence, settings, progress)?;
    let known = mixing.map(|matrix| Mixing {
        matrix,
        deviation: 0.0,
        white: None,
    });
    if let Some(unmix) = known.as_ref().and_then(Mixing::unmix) {
        light.unmix(unmix, &sequence, progress)?;
    }
    let Light {
        mut photographs,
        flood,
        black,
        saturated,
        ..
    } = light;

    progress.begin("finding the cells", 0);
    let gray = gray_code::decode(&sequence, &mut photographs, &flood, &black, progress)?;
    let registered = registration::register(&sequence, &mut photographs, &gray, progress)?;
    let cells = CellPixels::choose(&registered.registration, &saturated);
    progress.end();

    progress.begin("measuring cells", pictures.len() as u64);
    let mut measure = |frames: &[usize]| -> Result<Vec<CellPlanes>, CaptureError> {
        let mut light = Vec::with_capacity(frames.len());
        photographs.for_batches(frames, progress, |photos| {
            let planes = photos.iter().map(|(_, photo)| &photo.planes);
            light.extend(planes.map(|planes| planes.iter().map(|p| cells.mean(p)).collect()));
        })?;
        Ok(light)
    };
    let white = measure(&sequence.white().shots)?;
    let pictures = measure(&(first..sequence.frames.len()).collect::<Vec<_>>())?;
    progress.end();
    Ok(Revisited {
        grid: sequence.grid,
        channels: black.len(),
        black: black.iter().map(|plane| cells.mean(plane)).collect(),
        live: cells.live,
        left_out: cells.left_out,
        registration: registered.registration,
        white,
        pictures,
    })
}
