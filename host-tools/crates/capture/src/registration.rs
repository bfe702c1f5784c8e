//! Which camera pixels belong to which cell.
//!
//! The Gray code gives a first guess. Then each pixel's series over all
//! photographs is regressed on the 3 x 3 cells around its guess, a constant
//! (ambient light) and the lit share of the pattern (light from far cells). The
//! weights say which cell lights the pixel directly. Last, pixels that see two
//! cells are left out ([`sharing`](super::sharing)). On the path-traced captures
//! this lowers the error of the whole compensation more than any other step.

use super::CaptureError;
use super::gray_code::GrayLabels;
use super::photographs::Photographs;
use super::regression::regress;
use super::sequence::Sequence;
use super::sharing::{self, SHARED};
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;

/// What [`Registration`] holds for a camera pixel without a cell.
pub const NO_CELL: u32 = u32::MAX;

/// Photographs, other than black, from which a regression with eleven unknowns
/// tells neighbouring cells apart better than the Gray code does.
pub const MIN_REGRESSION: usize = 16;

/// Share of a pixel's flood light that must come from its own cell: four cells
/// that share a pixel have about .2 each, and a pixel that the projector does not
/// reach gets its light from everywhere, whatever its albedo.
const LEAST_OWN: f32 = 0.15;

/// Smallest Gray code margin that is believed without a regression.
const LEAST_MARGIN: f32 = 0.2;

/// Where each cell is in the photographs.
#[derive(Clone, PartialEq, Debug)]
pub struct Registration {
    /// Width and height of the registered photographs in pixels.
    pub camera: (usize, usize),
    /// Side of the square of file pixels that one registered pixel averages: 1
    /// unless the photographs are larger than 4 megapixels.
    pub binning: usize,
    /// Cell of each camera pixel whose light is used, row by row, or
    /// [`NO_CELL`], length `width * height`.
    pub cell_of_pixel: Vec<u32>,
    /// The same before pixels that see two cells were left out: the map of the
    /// whole projection.
    pub seen_cell: Vec<u32>,
    /// Mean position `[x, y]` of each cell's pixels in `seen_cell`, in pixels,
    /// the centre of the first pixel being `[0, 0]`; `None` where the camera
    /// sees nothing of the cell. Length `N`.
    pub centre: Vec<Option<[f64; 2]>>,
}

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
    pub shared: usize,
    /// Left out because their own cell hardly lights them, or because their
    /// neighbours contradict it.
    pub weak: usize,
    /// Used.
    pub kept: usize,
}

/// A registration and how it came about.
pub(super) struct Registered {
    pub(super) registration: Registration,
    pub(super) method: RegistrationMethod,
    pub(super) count: PixelCount,
}

/// A camera pixel with a cell, while its registration is worked out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) pixel: u32,
    pub(super) cell: u32,
    /// Light that the pixel gets from each of the 3 x 3 cells around `cell`,
    /// row by row, camera units.
    pub(super) weights: [f32; 9],
    /// Part of a second cell, or of none, in the pixel, relative to its own
    /// cell's: smaller is purer.
    pub(super) shared: f32,
}

impl Candidate {
    /// Light from all 3 x 3 cells.
    pub(super) fn direct(&self) -> f32 {
        self.weights.iter().sum()
    }

    /// Light from the brightest 2 x 2 of them: no more cells meet in a pixel.
    pub(super) fn nearest(&self) -> f32 {
        let squares = [[0, 1, 3, 4], [1, 2, 4, 5], [3, 4, 6, 7], [4, 5, 7, 8]];
        let light = |square: [usize; 4]| square.iter().map(|&k| self.weights[k].max(0.0)).sum();
        squares.map(light).into_iter().fold(0.0, f32::max)
    }
}

/// Registers the camera pixels, by regression if there are enough photographs.
///
/// # Errors
/// A photograph's own error.
pub(super) fn register(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    gray: &GrayLabels,
    progress: &dyn Progress,
) -> Result<Registered, CaptureError> {
    let grid = sequence.grid;
    let camera = (photographs.format.width, photographs.format.height);
    let mut candidates: Vec<Candidate> = (0..).zip(&gray.cell).filter_map(candidate).collect();
    let mut count = PixelCount {
        lit: gray.lit,
        coded: candidates.len(),
        ..PixelCount::default()
    };
    let taken = sequence.views.iter().map(|view| view.shots.len()).sum();
    let method = if taken < MIN_REGRESSION {
        candidates.retain(|c| gray.margin[c.pixel as usize] > LEAST_MARGIN);
        sharing::drop_unlit(&mut candidates, grid, camera);
        judge_by_gray_code(&mut candidates, gray, grid, camera);
        RegistrationMethod::GrayCode { photographs: taken }
    } else {
        regress(sequence, photographs, &mut candidates, progress)?;
        candidates.retain(|c| c.weights[4] > LEAST_OWN * gray.light[c.pixel as usize]);
        sharing::drop_unlit(&mut candidates, grid, camera);
        sharing::drop_indirect(&mut candidates, &gray.light);
        sharing::judge(&mut candidates, grid, camera);
        RegistrationMethod::Regression { photographs: taken }
    };
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
    count.shared = candidates.len() - count.kept;
    let centre = centres(grid, camera, &seen_cell);
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

fn candidate((pixel, &cell): (u32, &u32)) -> Option<Candidate> {
    (cell != NO_CELL).then_some(Candidate {
        pixel,
        cell,
        weights: [0.0; 9],
        shared: 0.0,
    })
}

/// Without a regression: a pixel counts as shared when one of its four
/// neighbours has another cell.
fn judge_by_gray_code(
    candidates: &mut [Candidate],
    gray: &GrayLabels,
    grid: Grid,
    camera: (usize, usize),
) {
    let (width, height) = camera;
    let reach = sharing::reach(candidates, grid);
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
        candidate.shared = (1.0 - margin) * SHARED * 0.99 + if inner { 0.0 } else { SHARED };
    }
}

/// Pixels that see one cell only. A cell that would keep less than a quarter of
/// its pixels gets the purest quarter of them instead: a hole in the grid costs
/// more than a mixed observation.
fn purest(candidates: &mut [Candidate]) -> Vec<Candidate> {
    candidates.sort_by(|a, b| a.cell.cmp(&b.cell).then(a.shared.total_cmp(&b.shared)));
    candidates
        .chunk_by(|a, b| a.cell == b.cell)
        .flat_map(|pixels| {
            let pure = pixels.partition_point(|c| c.shared < SHARED);
            let enough = pixels.len().div_ceil(4);
            &pixels[..pure.max(enough)]
        })
        .copied()
        .collect()
}

/// Mean camera position of the pixels of each cell.
fn centres(grid: Grid, camera: (usize, usize), cell: &[u32]) -> Vec<Option<[f64; 2]>> {
    let mut sums = vec![[0.0; 3]; grid.cells()];
    for (pixel, &cell) in cell.iter().enumerate() {
        if let Some(sum) = sums.get_mut(cell as usize) {
            sum[0] += (pixel % camera.0) as f64;
            sum[1] += (pixel / camera.0) as f64;
            sum[2] += 1.0;
        }
    }
    let mean = |[x, y, n]: [f64; 3]| (n > 0.0).then(|| [x / n, y / n]);
    sums.into_iter().map(mean).collect()
}
