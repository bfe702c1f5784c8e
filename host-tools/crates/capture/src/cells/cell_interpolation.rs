//! Cell interpolation: where between the cells' centres a camera pixel lies.
//!
//! The map from cells to the camera goes through the cells' mean positions, linear
//! between them: it may bend at every cell, as it does where the surface has a
//! crease, and it does not reach across an edge where the surface ends.

use super::measurements::Measurements;
use crate::registration::cell_map::{NO_CELL, Registration, cell_beside};
use crate::registration::projector_map::{MapSource, ProjectorMap, within};
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid};
use rayon::prelude::*;

/// Ratio of a cell's distances to its two neighbours from which the farther one
/// is on another surface.
const EDGE: f64 = 2.0;

/// A step in the camera, pixels right and down.
type Step = [f64; 2];

impl Registration {
    /// Centre of the cell `rows` down and `cols` right of `cell`.
    fn neighbour(&self, grid: Grid, cell: usize, rows: isize, cols: isize) -> Option<[f64; 2]> {
        self.centre[cell_beside(grid, cell, rows, cols)?]
    }

    /// Camera steps of one cell: along the columns and along the rows, each towards
    /// lower and towards higher index, all pointing to higher index.
    pub(crate) fn steps(&self, grid: Grid, cell: usize) -> [[Step; 2]; 2] {
        let here = self.centre[cell];
        let difference = |from: Option<[f64; 2]>, to: Option<[f64; 2]>| {
            let (from, to) = (from?, to?);
            Some([to[0] - from[0], to[1] - from[1]])
        };
        let length = |[x, y]: Step| x.hypot(y);
        [[0, 1], [1, 0]].map(|[rows, cols]: [isize; 2]| {
            let before = difference(self.neighbour(grid, cell, -rows, -cols), here);
            let after = difference(here, self.neighbour(grid, cell, rows, cols));
            match (before, after) {
                (Some(b), Some(a)) if length(b) > EDGE * length(a) => [a, a],
                (Some(b), Some(a)) if length(a) > EDGE * length(b) => [b, b],
                (Some(b), Some(a)) => [b, a],
                (Some(only), None) | (None, Some(only)) => [only, only],
                (None, None) => [[0.0; 2]; 2],
            }
        })
    }

    /// The cells around a camera pixel and their weights in a value that is linear
    /// between the cells' centres; the weights sum to 1. `None` of a pixel that
    /// belongs to no cell, or to one that is not `live` (length `N`); others that are
    /// not have no weight.
    #[must_use]
    pub fn weights(&self, grid: Grid, live: &[bool], pixel: usize) -> Option<[(usize, f64); 4]> {
        let cell = *self.seen_cell.get(pixel)?;
        if cell == NO_CELL || !live[cell as usize] {
            return None;
        }
        let cell = cell as usize;
        let [u, v] = self.offset(grid, cell, pixel);
        let toward = |offset: f64| if offset < 0.0 { -1 } else { 1 };
        let (right, down) = (u.abs(), v.abs());
        let corners = [
            (0, 0, (1.0 - down) * (1.0 - right)),
            (0, toward(u), (1.0 - down) * right),
            (toward(v), 0, down * (1.0 - right)),
            (toward(v), toward(u), down * right),
        ];
        let mut weights = corners.map(|(rows, cols, weight)| {
            let other = cell_beside(grid, cell, rows, cols).filter(|other| live[*other]);
            other.map_or((cell, 0.0), |other| (other, weight))
        });
        let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
        if sum > 0.0 {
            for (_, weight) in &mut weights {
                *weight /= sum;
            }
        } else {
            weights[0].1 = 1.0;
        }
        Some(weights)
    }

    /// Cells right and down from the centre of `cell` to a pixel, each -1 to 1.
    fn offset(&self, grid: Grid, cell: usize, pixel: usize) -> [f64; 2] {
        let Some(centre) = self.centre[cell] else {
            return [0.0; 2];
        };
        let x = (pixel % self.camera.0) as f64 - centre[0];
        let y = (pixel / self.camera.0) as f64 - centre[1];
        let [across, down] = self.steps(grid, cell);
        // The map has another slope in each quarter of the cell; the right quarter
        // is the one that its own answer lies in, or the nearest to that.
        let mut best = ([0.0; 2], f64::INFINITY);
        for (side, end) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (a, b) = (across[side], down[end]);
            let determinant = a[0] * b[1] - a[1] * b[0];
            if determinant.abs() < 1e-9 {
                continue;
            }
            let u = (x * b[1] - y * b[0]) / determinant;
            let v = (a[0] * y - a[1] * x) / determinant;
            let beyond = |offset: f64, side: usize| {
                let wrong = if side == 0 { offset } else { -offset };
                wrong.max(0.0)
            };
            let miss = beyond(u, side) + beyond(v, end);
            if miss < best.1 {
                best = ([u, v], miss);
            }
        }
        best.0.map(|offset| offset.clamp(-1.0, 1.0))
    }
}

impl ProjectorMap {
    /// The map that the cells alone give, linear between their centres.
    #[must_use]
    pub fn of_cells(measurements: &Measurements) -> Self {
        let registration = &measurements.registration;
        let grid = measurements.grid;
        let stated = measurements.settings.projector.pixels();
        let cells = ProjectorPixels::whole(FrameSize::of_grid(grid));
        let projector = stated.unwrap_or(cells);
        let inner = projector.inner();
        let sides = [
            inner.width() as f64 / grid.cols() as f64,
            inner.height() as f64 / grid.rows() as f64,
        ];
        let shift = f64::from(projector.border()) - 0.5;
        let uncertainty = within(sides[0] as f32).hypot(within(sides[1] as f32));
        let known = |pixel: usize| {
            let cell = registration.seen_cell[pixel];
            if cell == NO_CELL {
                return ([f32::NAN; 2], f32::NAN);
            }
            let cell = cell as usize;
            let from_centre = registration.offset(grid, cell, pixel);
            let number = [cell % grid.cols(), cell / grid.cols()];
            let place = [0, 1].map(|axis: usize| {
                let cells = number[axis] as f64 + 0.5 + from_centre[axis].clamp(-0.5, 0.5);
                (cells * sides[axis] + shift) as f32
            });
            (place, uncertainty)
        };
        let known = (0..registration.seen_cell.len()).into_par_iter().map(known);
        let (position, uncertainty) = known.unzip();
        Self {
            source: MapSource::Cells,
            projector,
            camera: registration.camera,
            binning: registration.binning,
            position,
            uncertainty,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of 10 x 8 pixels, sheared by `shear` pixels a row of cells.
    fn sheared(grid: Grid, shear: f64) -> Registration {
        let camera = (10 * grid.cols() + 40, 8 * grid.rows());
        let centre = |cell: usize| {
            let (row, col) = (cell / grid.cols(), cell % grid.cols());
            Some([
                10.0 * col as f64 + 4.5 + shear * row as f64,
                8.0 * row as f64 + 3.5,
            ])
        };
        let cell_at = |pixel: usize| {
            let (x, y) = (pixel % camera.0, pixel / camera.0);
            let row = y / 8;
            let col = (x as f64 - shear * row as f64) / 10.0;
            if col < 0.0 || col as usize >= grid.cols() {
                return NO_CELL;
            }
            (row * grid.cols() + col as usize) as u32
        };
        let seen: Vec<u32> = (0..camera.0 * camera.1).map(cell_at).collect();
        Registration {
            camera,
            binning: 1,
            cell_of_pixel: seen.clone(),
            seen_cell: seen,
            centre: (0..grid.cells()).map(centre).collect(),
        }
    }

    #[test]
    fn a_plane_over_the_cells_is_the_same_plane_over_the_pixels_between_them() {
        let grid = Grid::new(4, 5).unwrap();
        let registration = sheared(grid, 3.0);
        let live = vec![true; grid.cells()];
        // Linear in the cell's coordinates, hence in the camera's.
        let value = |row: f64, col: f64| 0.3 + 0.7 * row - 0.2 * col;
        let mut seen = 0;
        for pixel in 0..registration.seen_cell.len() {
            let Some(weights) = registration.weights(grid, &live, pixel) else {
                continue;
            };
            let (x, y) = (
                (pixel % registration.camera.0) as f64,
                (pixel / registration.camera.0) as f64,
            );
            let row = (y - 3.5) / 8.0;
            let col = (x - 4.5 - 3.0 * row) / 10.0;
            if !(0.0..=3.0).contains(&row) || !(0.0..=4.0).contains(&col) {
                continue;
            }
            let found: f64 = weights
                .iter()
                .map(|(cell, weight)| {
                    let (row, col) = (cell / grid.cols(), cell % grid.cols());
                    weight * value(row as f64, col as f64)
                })
                .sum();
            assert!((found - value(row, col)).abs() < 1e-12, "{row} {col}");
            seen += 1;
        }
        assert!(seen > 500, "{seen}");
    }

    #[test]
    fn a_cell_that_is_not_live_lends_no_weight_and_its_own_pixels_have_none() {
        let grid = Grid::new(3, 3).unwrap();
        let registration = sheared(grid, 0.0);
        let mut live = vec![true; 9];
        live[4] = false;
        let at = |x: usize, y: usize| registration.weights(grid, &live, y * 70 + x);
        assert_eq!(at(14, 12), None);
        let beside = at(8, 11).unwrap();
        let sum: f64 = beside.iter().map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-12);
        assert!(
            beside
                .iter()
                .all(|(cell, weight)| *cell != 4 || *weight == 0.0)
        );
    }
}
