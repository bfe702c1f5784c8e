//! Cell map: which camera pixel belongs to which cell, and where the cells are.

use super::projector_map::ProjectorMap;
use crate::photographs::photo::PhotoFormat;
use iltm_picture::statistics::median;
use iltm_runtime::Grid;

/// What [`Registration`] holds for a camera pixel without a cell.
pub const NO_CELL: u32 = u32::MAX;

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

impl Registration {
    /// All pixels of which the cell is known, whether they see others or not.
    pub(super) fn of_labels(cell: Vec<u32>, grid: Grid, format: &PhotoFormat) -> Self {
        let camera = (format.width, format.height);
        Self {
            camera,
            binning: format.binning,
            centre: centres(grid, camera, &cell),
            cell_of_pixel: cell.clone(),
            seen_cell: cell,
        }
    }

    /// Side of a cell in registered pixels, of the mean area of those that are seen.
    #[must_use]
    pub fn cell_side(&self) -> f64 {
        let seen = self.seen_cell.iter().filter(|cell| **cell != NO_CELL);
        let cells = self.centre.iter().flatten().count();
        (seen.count() as f64 / cells.max(1) as f64).sqrt()
    }

    /// What a pixel covers of the cells along their width and their height, in cells: the median
    /// over the cells that the camera sees.
    ///
    /// A camera that looks from the side sees many pixels of the projector in one of its own along
    /// one axis, and few along the other.
    pub(crate) fn pixel_in_cells(&self, grid: Grid) -> [f64; 2] {
        let covered = |cell: usize| -> Option<[f64; 2]> {
            self.centre[cell]?;
            let [[_, right], [_, down]] = self.steps(grid, cell);
            let area = (right[0] * down[1] - right[1] * down[0]).abs();
            let extent = |[x, y]: [f64; 2]| (x.abs() + y.abs()) / area;
            (area > 0.0).then(|| [extent(down), extent(right)])
        };
        let covered: Vec<[f64; 2]> = (0..grid.cells()).filter_map(covered).collect();
        [0, 1].map(|axis: usize| {
            let all = covered.iter().map(|both| both[axis]).collect();
            median(all).unwrap_or_else(|| 1.0 / self.cell_side())
        })
    }

    /// Whether a pixel and its four neighbours all belong to the projection: one at its very
    /// border is only partly lit.
    pub(crate) fn is_inside(&self, pixel: usize) -> bool {
        let (width, height) = self.camera;
        let (x, y) = (pixel % width, pixel / width);
        let lit = |pixel: usize| self.seen_cell[pixel] != NO_CELL;
        (1..width - 1).contains(&x)
            && (1..height - 1).contains(&y)
            && [pixel, pixel - 1, pixel + 1, pixel - width, pixel + width]
                .into_iter()
                .all(lit)
    }
}

/// A first guess of the cell that lights each camera pixel.
#[derive(Clone, Debug)]
pub(crate) struct CellLabels {
    /// Cell of each pixel, or [`NO_CELL`].
    pub(crate) cell: Vec<u32>,
    /// How sure that is. Of a Gray code it is the smallest difference between a
    /// bit's pattern and its inverse over all bits, relative to the pixel's flood
    /// light: 1 where nothing but the pixel's own cell lights it, about 0 where the
    /// bit is a guess. Of images it is the share of the pixel's light that its cell
    /// explains.
    pub(crate) margin: Vec<f32>,
    /// Flood light of each pixel, summed over the channels, black removed.
    pub(crate) light: Vec<f32>,
    /// Camera pixels that the projector lights.
    pub(crate) lit: usize,
}

impl CellLabels {
    /// Takes the cells of a map's places, where it has any.
    pub(super) fn by_map(mut self, map: Option<&ProjectorMap>, grid: Grid) -> Self {
        let Some(map) = map else {
            return self;
        };
        let place = |place: &[f32; 2]| {
            let [col, row] = map.in_cells(*place, grid);
            let inside = (0.0..grid.cols() as f32).contains(&col)
                && (0.0..grid.rows() as f32).contains(&row);
            inside.then(|| row as u32 * grid.cols() as u32 + col as u32)
        };
        for (cell, at) in self.cell.iter_mut().zip(&map.position) {
            *cell = place(at).unwrap_or(NO_CELL);
        }
        self
    }
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
    pub(super) mixed: f32,
}

impl Candidate {
    /// A pixel before anything is known but its cell.
    pub(super) const fn new(pixel: u32, cell: u32) -> Self {
        Self {
            pixel,
            cell,
            weights: [0.0; 9],
            mixed: 0.0,
        }
    }

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

/// Mean camera position of the pixels of each cell.
pub(super) fn centres(grid: Grid, camera: (usize, usize), cell: &[u32]) -> Vec<Option<[f64; 2]>> {
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

/// The cell `rows` down and `cols` right of `cell`, if the grid has it.
pub(crate) fn cell_beside(grid: Grid, cell: usize, rows: isize, cols: isize) -> Option<usize> {
    let row = (cell / grid.cols()).checked_add_signed(rows)?;
    let col = (cell % grid.cols()).checked_add_signed(cols)?;
    (row < grid.rows() && col < grid.cols()).then_some(row * grid.cols() + col)
}
