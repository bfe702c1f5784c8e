//! Registration: which camera pixels belong to which cell.
//!
//! The Gray code gives a first guess, or, where there is none, known pictures do
//! ([`image_matching`]). Then each pixel's series over all
//! photographs is regressed on the 3 x 3 cells around its guess, a constant
//! (ambient light) and the lit share of the pattern (light from far cells). The
//! weights say which cell lights the pixel directly. Last, pixels that see two
//! cells are left out ([`mixed_pixels`]). On the path-traced captures
//! this lowers the error of the whole compensation more than any other step.

pub(crate) mod black_shift;
pub(crate) mod cell_map;
pub(crate) mod correspondence;
pub(crate) mod gray_code;
pub(crate) mod image_matching;
pub(crate) mod image_tracking;
mod inverse_map;
mod local_planes;
pub(crate) mod map_file;
mod mixed_pixels;
pub(crate) mod movement;
pub(crate) mod projector_map;
mod regression;
mod sites;

use crate::cells::images::KnownImages;
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::format::settings::ProjectorSettings;
use crate::photographs::Photographs;
use crate::photographs::linearise::LinearPhotographs;
use cell_map::{Candidate, CellLabels, NO_CELL, Registration};
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use mixed_pixels::{MIXED, ShownStripes};
use projector_map::{MapError, ProjectorMap};
use regression::regress;
use std::path::Path;

/// Photographs, other than black, from which a regression with eleven unknowns
/// tells neighbouring cells apart better than the Gray code does.
pub const MIN_REGRESSION: usize = 16;

/// Share of a pixel's flood light that must come from its own cell: four cells
/// that share a pixel have about .2 each, and a pixel that the projector does not
/// reach gets its light from everywhere, whatever its albedo.
const LEAST_OWN: f32 = 0.15;

/// Smallest Gray code margin that is believed without a regression.
const LEAST_MARGIN: f32 = 0.2;

/// Uncertainty of a pixel's place, in pixels of the projector, below which it sees fine stripes:
/// only a surface that the projector itself lights shows them.
const PLACED: f32 = 0.5;

/// How pixels were registered.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RegistrationMethod {
    /// Gray code, or images where there is none, then regression on this many photographs.
    Regression {
        /// Photographs other than black.
        photographs: usize,
        /// Whether a Gray code was the first guess.
        is_coded: bool,
    },
    /// Gray code only, without the pixels at the borders of cells, because there
    /// were fewer than [`MIN_REGRESSION`] photographs.
    GrayCode {
        /// Photographs other than black.
        photographs: usize,
    },
    /// Images alone, likewise.
    Images {
        /// Photographs of images.
        photographs: usize,
    },
}

/// How many camera pixels took which way.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PixelCount {
    /// Lit by the projector, directly or not.
    pub lit: usize,
    /// With a first guess of their cell.
    pub coded: usize,
    /// Moved to another cell than the first guess by the regression.
    pub moved: usize,
    /// Left out because they see two cells.
    pub mixed: usize,
    /// Left out because their own cell hardly lights them, or because their
    /// neighbours contradict it.
    pub weak: usize,
    /// Used.
    pub kept: usize,
}

/// A registration and how it came about.
pub(crate) struct Registered {
    pub(crate) registration: Registration,
    pub(crate) method: RegistrationMethod,
    pub(crate) count: PixelCount,
    /// The map of stripes finer than the cells, or of the images that cells were told by.
    pub(crate) map: Option<Result<ProjectorMap, MapError>>,
}

/// Guesses the cell of each camera pixel by the Gray code, or by known pictures where there is none,
/// and registers the pixels, by regression if there are enough photographs of patterns.
///
/// # Errors
/// A photograph's own error.
pub(crate) fn register(
    folder: &Path,
    (sequence, projector): (&Sequence, &ProjectorSettings),
    linear: &mut LinearPhotographs<'_>,
    images: Option<(&KnownImages<'_>, &mut Photographs<'_>)>,
    progress: &dyn Progress,
) -> Result<Registered, CaptureError> {
    let grid = sequence.grid;
    let coded = &sequence.views[sequence.coded()];
    let coded: usize = coded.iter().map(|view| view.shots.len()).sum();
    let taken = sequence.views.iter().map(|view| view.shots.len()).sum();
    let mut map = None;
    let is_coded = sequence.is_coded();
    let guess = match images {
        Some((known, images)) if !is_coded => {
            let guess = image_matching::label(sequence, linear, (known, images), progress)?;
            if taken < MIN_REGRESSION {
                let format = &linear.photographs.format;
                let first = Registration::of_labels(guess.cell.clone(), grid, format);
                let found = image_tracking::map(grid, linear, (known, images), &first, progress)?;
                map = found.map(Ok);
            }
            guess.by_map(map.as_ref().and_then(|map| map.as_ref().ok()), grid)
        }
        _ => {
            progress.begin("decoding the Gray code", coded as u64);
            let guess = gray_code::decode(sequence, linear, progress)?;
            progress.end();
            guess
        }
    };
    let format = linear.photographs.format.clone();
    // Nobody knows how many rounds over the photographs it will take.
    progress.begin("registering camera pixels", 0);
    let camera = (format.width, format.height);
    let mut candidates: Vec<Candidate> = (0..)
        .zip(&guess.cell)
        .filter(|(_, cell)| **cell != NO_CELL)
        .map(|(pixel, cell)| Candidate::new(pixel, *cell))
        .collect();
    let mut count = PixelCount {
        lit: guess.lit,
        coded: candidates.len(),
        ..PixelCount::default()
    };
    let is_regression = taken >= MIN_REGRESSION;
    if is_regression {
        regress(sequence, &mut linear.photographs, &mut candidates, progress)?;
        candidates.retain(|c| c.weights[4] > LEAST_OWN * guess.light[c.pixel as usize]);
    } else {
        candidates.retain(|c| guess.margin[c.pixel as usize] > LEAST_MARGIN);
    }
    mixed_pixels::drop_unlit(&mut candidates, grid, camera);
    let first = Registration::of_labels(cells(&candidates, guess.cell.len()), grid, &format);
    let stripes = projector_map::decode(folder, sequence, projector, linear, &first, progress)?;
    let method = if is_regression {
        let stripes = stripes.as_ref().and_then(|stripes| stripes.as_ref().ok());
        let places = stripes.and_then(|stripes| stripes.map(&first, linear).ok());
        let contrast = stripes.map(|stripes| stripes.contrast(linear));
        let shown = |pixel: u32| match (&places, &contrast) {
            (Some(map), Some(contrast)) => ShownStripes {
                contrast: contrast[pixel as usize],
                is_placed: map.uncertainty[pixel as usize] < PLACED,
            },
            _ => ShownStripes::default(),
        };
        mixed_pixels::drop_indirect(&mut candidates, &guess.light, shown);
        mixed_pixels::judge(&mut candidates, grid, camera);
        RegistrationMethod::Regression {
            photographs: taken,
            is_coded,
        }
    } else {
        judge_by_guess(&mut candidates, &guess, grid, camera);
        if is_coded {
            RegistrationMethod::GrayCode { photographs: taken }
        } else {
            RegistrationMethod::Images {
                photographs: sequence.images.len(),
            }
        }
    };
    progress.end();
    count.weak = count.coded - candidates.len();
    let moved = |seen: &&Candidate| seen.cell != guess.cell[seen.pixel as usize];
    count.moved = candidates.iter().filter(moved).count();
    let seen = cells(&candidates, guess.cell.len());
    let pure = purest(&mut candidates);
    count.kept = pure.len();
    count.mixed = candidates.len() - count.kept;
    let registration = Registration {
        cell_of_pixel: cells(&pure, guess.cell.len()),
        ..Registration::of_labels(seen, grid, &format)
    };
    let of_stripes = stripes.map(|found| found.and_then(|found| found.map(&registration, linear)));
    Ok(Registered {
        map: of_stripes.or(map),
        registration,
        method,
        count,
    })
}

/// The cell of each of a camera's pixels.
fn cells(candidates: &[Candidate], pixels: usize) -> Vec<u32> {
    let mut cells = vec![NO_CELL; pixels];
    for candidate in candidates {
        cells[candidate.pixel as usize] = candidate.cell;
    }
    cells
}

/// Without a regression: a pixel counts as mixed when one of its four
/// neighbours has another cell.
fn judge_by_guess(
    candidates: &mut [Candidate],
    guess: &CellLabels,
    grid: Grid,
    camera: (usize, usize),
) {
    let (width, height) = camera;
    let reach = mixed_pixels::reach(candidates, grid);
    for candidate in candidates {
        let pixel = candidate.pixel as usize;
        let (x, y) = (pixel % width, pixel / width);
        let same = |x: Option<usize>, y: Option<usize>| match (x, y) {
            (Some(x), Some(y)) if x < width && y < height => {
                guess.cell[y * width + x] == candidate.cell
            }
            _ => false,
        };
        let inner = same(x.checked_sub(reach), Some(y))
            && same(Some(x + reach), Some(y))
            && same(Some(x), y.checked_sub(reach))
            && same(Some(x), Some(y + reach));
        let margin = guess.margin[pixel].min(1.0);
        // Any order that puts inner pixels first and surer ones before others.
        candidate.mixed = (1.0 - margin) * MIXED * 0.99 + if inner { 0.0 } else { MIXED };
    }
}

/// Pixels that see one cell only. A cell that would keep less than a quarter of
/// its pixels gets the purest quarter of them instead: a hole in the grid costs
/// more than a mixed observation.
fn purest(candidates: &mut [Candidate]) -> Vec<Candidate> {
    candidates.sort_by(|a, b| a.cell.cmp(&b.cell).then(a.mixed.total_cmp(&b.mixed)));
    candidates
        .chunk_by(|a, b| a.cell == b.cell)
        .flat_map(|pixels| {
            let pure = pixels.partition_point(|c| c.mixed < MIXED);
            let enough = pixels.len().div_ceil(4);
            &pixels[..pure.max(enough)]
        })
        .copied()
        .collect()
}
