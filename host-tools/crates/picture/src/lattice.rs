//! Resampling between pixels and cells in floating point: the runtime's `A` and `U`.

use iltm_runtime::resample::interpolation::Axis;
use iltm_runtime::{FrameSize, Grid};

/// One pixel's part in the two cells between whose centres it lies, or in the two
/// cells that it overlaps.
#[derive(Clone, Copy, Debug)]
struct Share {
    cells: [usize; 2],
    weights: [f64; 2],
}

/// A grid, or a smaller picture, laid over a frame.
#[derive(Clone, Debug)]
pub struct Lattice {
    cells: FrameSize,
    frame: FrameSize,
    /// Interpolation along rows and columns of pixels.
    spread: [Vec<Share>; 2],
    /// Overlap of pixels with cells along the same.
    gather: [Vec<Share>; 2],
}

impl Lattice {
    /// `None` if some cell would cover no pixel.
    #[must_use]
    pub fn new(grid: Grid, frame: FrameSize) -> Option<Self> {
        Self::between(FrameSize::of_grid(grid), frame)
    }

    /// The same of samples that are more than any grid has.
    #[must_use]
    pub fn between(cells: FrameSize, frame: FrameSize) -> Option<Self> {
        Some(Self {
            cells,
            frame,
            spread: [
                interpolation(cells.height(), frame.height())?,
                interpolation(cells.width(), frame.width())?,
            ],
            gather: [
                overlaps(cells.height(), frame.height()),
                overlaps(cells.width(), frame.width()),
            ],
        })
    }

    /// Cells of the grid.
    #[must_use]
    pub const fn cells(&self) -> usize {
        self.cells.pixels()
    }

    /// `A`: means over the cells.
    #[must_use]
    pub fn average(&self, pixels: &[f32]) -> Vec<f64> {
        let (width, cols) = (self.frame.width(), self.cells.width());
        let mut cells = vec![0.0; self.cells.pixels()];
        let mut line = vec![0.0; cols];
        for (row, share) in pixels.chunks_exact(width).zip(&self.gather[0]) {
            line.fill(0.0);
            for (light, share) in row.iter().zip(&self.gather[1]) {
                for (cell, weight) in share.cells.iter().zip(share.weights) {
                    line[*cell] += weight * f64::from(*light);
                }
            }
            for (cell, weight) in share.cells.iter().zip(share.weights) {
                for (sum, value) in cells[cell * cols..].iter_mut().zip(&line) {
                    *sum += weight * value;
                }
            }
        }
        cells
    }

    /// `U`: linear interpolation between the cells' centres.
    #[must_use]
    pub fn expand(&self, cells: &[f64]) -> Vec<f32> {
        let cols = self.cells.width();
        let mut pixels = Vec::with_capacity(self.frame.pixels());
        for share in &self.spread[0] {
            let [above, below] = share.cells.map(|row| &cells[row * cols..][..cols]);
            let blend = |(a, b): (&f64, &f64)| share.weights[0] * a + share.weights[1] * b;
            let line: Vec<f64> = above.iter().zip(below).map(blend).collect();
            let along = self.spread[1].iter().map(|share| {
                let [before, after] = share.cells;
                (share.weights[0] * line[before] + share.weights[1] * line[after]) as f32
            });
            pixels.extend(along);
        }
        pixels
    }
}

fn interpolation(cells: usize, length: usize) -> Option<Vec<Share>> {
    let axis = Axis::new(cells, length)?;
    let share = |pixel: usize| {
        let place = axis.place(pixel);
        let after = f64::from(place.fraction) / f64::from(1_u32 << 31);
        Share {
            cells: [place.before, place.after],
            weights: [1.0 - after, after],
        }
    };
    Some((0..length).map(share).collect())
}

/// Weights of each pixel in the means of its cells.
fn overlaps(cells: usize, length: usize) -> Vec<Share> {
    let share = |pixel: usize| {
        // In units of which a pixel has `cells` and a cell `length`.
        let (start, end) = (pixel * cells, (pixel + 1) * cells);
        let cell = start / length;
        let border = ((cell + 1) * length).min(end);
        let part = |units: usize| units as f64 / length as f64;
        Share {
            cells: [cell, (cell + 1).min(cells - 1)],
            weights: [part(border - start), part(end - border)],
        }
    };
    (0..length).map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_frame_is_its_own_mean_and_interpolation() {
        let grid = Grid::new(3, 5).unwrap();
        let lattice = Lattice::new(grid, FrameSize::new(17, 10).unwrap()).unwrap();
        let means = lattice.average(&[0.75; 170]);
        assert!(means.iter().all(|mean| (mean - 0.75).abs() < 1e-12));
        let pixels = lattice.expand(&means);
        assert_eq!(pixels.len(), 170);
        assert!(pixels.iter().all(|light| (light - 0.75).abs() < 1e-6));
    }

    #[test]
    fn means_keep_the_light_of_a_frame_whose_pixels_cells_cut() {
        let grid = Grid::new(2, 3).unwrap();
        let lattice = Lattice::new(grid, FrameSize::new(4, 3).unwrap()).unwrap();
        let mut pixels = vec![0.0; 12];
        pixels[5] = 1.0;
        let means = lattice.average(&pixels);
        // Pixel (1, 1) covers rows 1/3..2/3 and columns 1/4..1/2 of the frame: the
        // cells' border at row 1/2 halves it, the one at column 1/3 cuts it 1 : 2.
        let area = 1.0 / 12.0 * 6.0;
        let expected = [1.0 / 6.0, 2.0 / 6.0, 0.0, 1.0 / 6.0, 2.0 / 6.0, 0.0];
        for (mean, expected) in means.iter().zip(expected) {
            assert!((mean - expected * area).abs() < 1e-12);
        }
    }

    #[test]
    fn a_frame_with_fewer_pixels_than_cells_has_no_lattice() {
        let grid = Grid::new(4, 4).unwrap();
        assert!(Lattice::new(grid, FrameSize::new(8, 3).unwrap()).is_none());
    }
}
