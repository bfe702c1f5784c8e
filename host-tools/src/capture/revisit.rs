//! The light of every cell in photographs of pictures that are no patterns, taken from
//! anywhere: a Gray code among them says anew where the cells are.

use super::measure::CellPixels;
use super::photographs::Photographs;
use super::sequence::Sequence;
use super::{
    CaptureError, CaptureOptions, LeftOut, MANIFEST_FILE, Registration, Settings, Shot,
    check_exposure, gray_code, registration,
};
use crate::progress::Progress;
use iltm_runtime::Grid;
use std::path::Path;

/// Light of the cells in one photograph: one entry a channel, in each one a cell, camera
/// units; 0 where a cell was not measured.
pub type CellLight = Vec<Vec<f64>>;

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
    pub white: Vec<CellLight>,
    /// Mean of the photographs of black: ambient light and the projector's black.
    pub black: CellLight,
    /// The photographs of the pictures, in their order, ambient light included.
    pub pictures: Vec<CellLight>,
}

/// Registers the cells by the photographs of `code` (white, black and the Gray code of
/// both axes) and measures them in those of `pictures`. Of the latter only photograph
/// and line are looked at.
///
/// # Errors
/// As [`read`](super::read), but that no Bernoulli photographs are asked for.
pub fn revisit(
    folder: &Path,
    settings: &Settings,
    code: &[Shot],
    pictures: &[Shot],
    progress: &dyn Progress,
) -> Result<Revisited, CaptureError> {
    let options = CaptureOptions {
        min_bernoulli: 0,
        ..CaptureOptions::default()
    };
    let sequence = Sequence::read(folder, code, &options)?;
    let shots = [sequence.shots.as_slice(), pictures].concat();
    let mut photographs = Photographs::new(folder, &shots, settings.camera.response)?;
    photographs.prefetch(progress)?;
    let white = &sequence.white().shots;
    let white_path = photographs.path(white[0]);

    progress.begin("finding the cells", 0);
    let (flood, saturated) = photographs.mean(white, progress)?;
    let (black, _) = photographs.mean(&sequence.black, progress)?;
    check_exposure(&flood, &black, &saturated, &white_path)?;
    let gray = gray_code::decode(&sequence, &mut photographs, &flood, &black, progress)?;
    let registered = registration::register(&sequence, &mut photographs, &gray, progress)?;
    let cells = CellPixels::choose(
        &registered.registration,
        &saturated,
        &folder.join(MANIFEST_FILE),
        &white_path,
    )?;
    progress.end();

    progress.begin("measuring cells", pictures.len() as u64);
    let mut measure = |shots: &[usize]| -> Result<Vec<CellLight>, CaptureError> {
        let mut light = Vec::with_capacity(shots.len());
        photographs.for_batches(shots, progress, |photos| {
            let planes = photos.iter().map(|(_, photo)| &photo.planes);
            light.extend(planes.map(|planes| planes.iter().map(|p| cells.mean(p)).collect()));
        })?;
        Ok(light)
    };
    let first = sequence.shots.len();
    let (white, pictures) = (
        measure(white)?,
        measure(&(first..shots.len()).collect::<Vec<_>>())?,
    );
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
