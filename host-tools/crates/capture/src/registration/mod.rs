//! Registration: which camera pixels belong to which cell.
//!
//! The Gray code gives a first guess. Then each pixel's series over all
//! photographs is regressed on the 3 x 3 cells around its guess, a constant
//! (ambient light) and the lit share of the pattern (light from far cells). The
//! weights say which cell lights the pixel directly. Last, pixels that see two
//! cells are left out ([`mixed_pixels`]). On the path-traced captures
//! this lowers the error of the whole compensation more than any other step.

pub(crate) mod cell_map;
pub(crate) mod gray_code;
mod local_planes;
pub(crate) mod map_file;
mod mixed_pixels;
pub(crate) mod movement;
pub(crate) mod projector_map;
mod regression;

use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::photographs::linearise::LinearPhotographs;
use cell_map::{Candidate, NO_CELL, Registration};
use gray_code::GrayLabels;
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use mixed_pixels::MIXED;
use regression::regress;

/// Photographs, other than black, from which a regression with eleven unknowns
/// tells neighbouring cells apart better than the Gray code does.
pub const MIN_REGRESSION: usize = 16;

/// Share of a pixel's flood light that must come from its own cell: four cells
/// that share a pixel have about .2 each, and a pixel that the projector does not
/// reach gets its light from everywhere, whatever its albedo.
const LEAST_OWN: f32 = 0.15;

/// Smallest Gray code margin that is believed without a regression.
const LEAST_MARGIN: f32 = 0.2;

/// How pixels were registered.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RegistrationMethod {
    /// Gray code, then regression on this many photographs.
    Regression {
        /// Photographs other than black.
        photographs: usize,
    },
    /// Gray code only, without the pixels at the borders of cells, because there
    /// were fewer than [`MIN_REGRESSION`] photographs.
    GrayCode {
        /// Photographs other than black.
        photographs: usize,
    },
}

/// How many camera pixels took which way.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PixelCount {
    /// Lit by the projector, directly or not.
    pub lit: usize,
    /// With a valid Gray code.
    pub coded: usize,
    /// Moved to another cell than the Gray code's by the regression.
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
}

/// Decodes the Gray code and registers the camera pixels, by regression if there are
/// enough photographs.
///
/// # Errors
/// A photograph's own error.
pub(crate) fn register(
    sequence: &Sequence,
    linear: &mut LinearPhotographs<'_>,
    progress: &dyn Progress,
) -> Result<Registered, CaptureError> {
    let grid = sequence.grid;
    let coded = &sequence.views[sequence.coded()];
    let coded: usize = coded.iter().map(|view| view.shots.len()).sum();
    progress.begin("decoding the Gray code", coded as u64);
    let gray = &gray_code::decode(sequence, linear, progress)?;
    progress.end();
    let photographs = &mut linear.photographs;
    // Nobody knows how many rounds over the photographs it will take.
    progress.begin("registering camera pixels", 0);
    let camera = (photographs.format.width, photographs.format.height);
    let mut candidates: Vec<Candidate> = (0..)
        .zip(&gray.cell)
        .filter(|(_, cell)| **cell != NO_CELL)
        .map(|(pixel, cell)| Candidate::new(pixel, *cell))
        .collect();
    let mut count = PixelCount {
        lit: gray.lit,
        coded: candidates.len(),
        ..PixelCount::default()
    };
    let taken = sequence.views.iter().map(|view| view.shots.len()).sum();
    let method = if taken < MIN_REGRESSION {
        candidates.retain(|c| gray.margin[c.pixel as usize] > LEAST_MARGIN);
        mixed_pixels::drop_unlit(&mut candidates, grid, camera);
        judge_by_gray_code(&mut candidates, gray, grid, camera);
        RegistrationMethod::GrayCode { photographs: taken }
    } else {
        regress(sequence, photographs, &mut candidates, progress)?;
        candidates.retain(|c| c.weights[4] > LEAST_OWN * gray.light[c.pixel as usize]);
        mixed_pixels::drop_unlit(&mut candidates, grid, camera);
        mixed_pixels::drop_indirect(&mut candidates, &gray.light);
        mixed_pixels::judge(&mut candidates, grid, camera);
        RegistrationMethod::Regression { photographs: taken }
    };
    progress.end();
    count.weak = count.coded - candidates.len();
    let mut cell_of_pixel = vec![NO_CELL; gray.cell.len()];
    let mut seen_cell = cell_of_pixel.clone();
    for seen in &candidates {
        seen_cell[seen.pixel as usize] = seen.cell;
        count.moved += usize::from(seen.cell != gray.cell[seen.pixel as usize]);
    }
    for kept in purest(&mut candidates) {
        cell_of_pixel[kept.pixel as usize] = kept.cell;
        count.kept += 1;
    }
    count.mixed = candidates.len() - count.kept;
    let centre = cell_map::centres(grid, camera, &seen_cell);
    Ok(Registered {
        registration: Registration {
            camera,
            binning: photographs.format.binning,
            cell_of_pixel,
            seen_cell,
            centre,
        },
        method,
        count,
    })
}

/// Without a regression: a pixel counts as mixed when one of its four
/// neighbours has another cell.
fn judge_by_gray_code(
    candidates: &mut [Candidate],
    gray: &GrayLabels,
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
                gray.cell[y * width + x] == candidate.cell
            }
            _ => false,
        };
        let inner = same(x.checked_sub(reach), Some(y))
            && same(Some(x + reach), Some(y))
            && same(Some(x), y.checked_sub(reach))
            && same(Some(x), Some(y + reach));
        let margin = gray.margin[pixel].min(1.0);
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
