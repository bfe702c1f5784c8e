//! Projector blur: how far light spreads, from a few lit cells far from each other.
//!
//! A probe photograph divided by the flood photograph is the same on dark and on
//! bright surfaces: the profile of one cell's light. A sharp projector's is a box;
//! blur rounds it by a Gaussian. The width that fits all spots best is the blur,
//! of projector and camera together (the camera's part is small where a cell has
//! many pixels).

use super::response::least;
use crate::registration::cell_map::{NO_CELL, Registration};
use iltm_runtime::Grid;

/// The projector's blur, measured.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Probe {
    /// Standard deviation in cells.
    pub blur: f64,
    /// Spots that it was measured from.
    pub spots: usize,
}

/// Spots that a blur is measured from at least.
const LEAST_SPOTS: usize = 3;

/// Camera pixels along a cell's side below which its profile is not seen.
const LEAST_PITCH: f64 = 3.0;

/// Cells around a spot that its profile is fitted in.
const REACH: f64 = 2.0;

/// Flood light, relative to that at the spot, below which a quotient is noise.
const LEAST_FLOOD: f32 = 0.1;

/// Largest blur that is looked for, in cells.
const MOST_BLUR: f64 = 1.5;

/// A blur below this is none: what is left of registration errors.
const LEAST_BLUR: f64 = 0.1;

/// Quotients around one lit cell, by place.
struct Spot {
    /// `(column, row)` from the cell's centre in cells, and the quotient.
    pixels: Vec<([f64; 2], f64)>,
    /// Variance, in cells, that a camera pixel's own size adds.
    footprint: f64,
}

impl Probe {
    /// Measures the blur. `probe` and `flood` are photographs with black
    /// subtracted, all channels added; `lit` says which cells the probe lights.
    /// `None` if fewer than three spots are seen well enough.
    #[must_use]
    pub fn measure(
        grid: Grid,
        lit: &[bool],
        registration: &Registration,
        probe: &[f32],
        flood: &[f32],
    ) -> Option<Self> {
        let cells = (0..grid.cells()).filter(|&cell| lit[cell]);
        let spots: Vec<Spot> = cells
            .filter_map(|cell| Spot::new(grid, cell, registration, probe, flood))
            .collect();
        if spots.len() < LEAST_SPOTS {
            return None;
        }
        let misfit = |width: f64| spots.iter().map(|spot| spot.misfit(width)).sum::<f64>();
        let width = least((0.01, MOST_BLUR), 30, 24, misfit);
        let footprint = spots.iter().map(|spot| spot.footprint).sum::<f64>() / spots.len() as f64;
        let blur = (width * width - footprint).max(0.0).sqrt();
        Some(Self {
            blur: if blur < LEAST_BLUR { 0.0 } else { blur },
            spots: spots.len(),
        })
    }
}

impl Spot {
    fn new(
        grid: Grid,
        cell: usize,
        registration: &Registration,
        probe: &[f32],
        flood: &[f32],
    ) -> Option<Self> {
        let (row, col) = (cell / grid.cols(), cell % grid.cols());
        if row == 0 || col == 0 || row + 1 == grid.rows() || col + 1 == grid.cols() {
            return None;
        }
        let at = |cell: usize| registration.centre[cell];
        let centre = at(cell)?;
        let half = |a: [f64; 2], b: [f64; 2]| [0.5 * (b[0] - a[0]), 0.5 * (b[1] - a[1])];
        let along = half(at(cell - 1)?, at(cell + 1)?);
        let down = half(at(cell - grid.cols())?, at(cell + grid.cols())?);
        let area = along[0] * down[1] - along[1] * down[0];
        let pitch = along[0].hypot(along[1]).min(down[0].hypot(down[1]));
        if pitch < LEAST_PITCH || area.abs() < LEAST_PITCH * LEAST_PITCH {
            return None;
        }
        // Camera offsets to cells: the inverse of the matrix [along, down].
        let place = |dx: f64, dy: f64| {
            [
                (dx * down[1] - dy * down[0]) / area,
                (dy * along[0] - dx * along[1]) / area,
            ]
        };
        let (width, height) = registration.camera;
        let reach = [0, 1].map(|axis| REACH * (along[axis].abs() + down[axis].abs()));
        let range = |axis: usize, most: usize| {
            let (low, high) = (centre[axis] - reach[axis], centre[axis] + reach[axis]);
            (low.max(0.0).ceil() as usize)..=(high.max(0.0).floor() as usize).min(most - 1)
        };
        let middle = centre[1].round() as usize * width + centre[0].round() as usize;
        let threshold = LEAST_FLOOD * flood.get(middle)?;
        let mut pixels = Vec::new();
        for y in range(1, height) {
            for x in range(0, width) {
                let pixel = y * width + x;
                let from = place(x as f64 - centre[0], y as f64 - centre[1]);
                let near = from[0].abs() <= REACH && from[1].abs() <= REACH;
                let seen = registration.seen_cell[pixel] != NO_CELL;
                if near && seen && flood[pixel] > threshold && flood[pixel] > 0.0 {
                    pixels.push((from, f64::from(probe[pixel] / flood[pixel])));
                }
            }
        }
        let spot = Self {
            footprint: (1.0 / 12.0) / (pitch * pitch),
            pixels,
        };
        spot.centred()
    }

    /// The spot around its own centre of light: registration is good to a tenth of
    /// a cell or so, which would look like blur. `None` if there is no light.
    fn centred(mut self) -> Option<Self> {
        let outer = |from: &[f64; 2]| from[0].abs().max(from[1].abs()) > 0.75 * REACH;
        let ring: Vec<f64> = self
            .pixels
            .iter()
            .filter(|p| outer(&p.0))
            .map(|p| p.1)
            .collect();
        if ring.len() < 8 {
            return None;
        }
        let background = ring.iter().sum::<f64>() / ring.len() as f64;
        let inner = self.pixels.iter().filter(|p| !outer(&p.0));
        let (mut light, mut moment) = (0.0, [0.0; 2]);
        for (from, quotient) in inner {
            let own = (quotient - background).max(0.0);
            light += own;
            for axis in 0..2 {
                moment[axis] += own * from[axis];
            }
        }
        let peak = self.pixels.iter().map(|p| p.1).fold(0.0, f64::max);
        if light <= 0.0 || peak < 4.0 * background.abs() {
            return None;
        }
        for (from, _) in &mut self.pixels {
            for axis in 0..2 {
                from[axis] -= moment[axis] / light;
            }
        }
        Some(self)
    }

    /// Squared misfit of a profile of this width, with the height and the
    /// background that fit best, relative to the spot's own variance.
    fn misfit(&self, width: f64) -> f64 {
        let (mut s, mut sm, mut sq, mut smm, mut smq, mut sqq) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (from, quotient) in &self.pixels {
            let model = along(from[0], width) * along(from[1], width);
            s += 1.0;
            sm += model;
            sq += quotient;
            smm += model * model;
            smq += model * quotient;
            sqq += quotient * quotient;
        }
        let (vm, vq, c) = (smm - sm * sm / s, sqq - sq * sq / s, smq - sm * sq / s);
        if vm <= 0.0 || vq <= 0.0 {
            return 1.0;
        }
        1.0 - c * c / (vm * vq)
    }
}

/// A cell's light along one axis, `x` cells from its centre, after a blur.
fn along(x: f64, width: f64) -> f64 {
    let below = |x: f64| 0.5 * libm::erfc(-x / (width * std::f64::consts::SQRT_2));
    below(x + 0.5) - below(x - 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall seen turned and sheared, 9 pixels a cell, its albedo a pattern; the
    /// probe lights every fourth cell, blurred.
    fn measured(blur: f64) -> Option<Probe> {
        let grid = Grid::new(12, 12).unwrap();
        let lit: Vec<bool> = (0..144)
            .map(|c| c % 12 % 4 == 2 && c / 12 % 4 == 2)
            .collect();
        let (width, height) = (130, 130);
        let place = |x: f64, y: f64| ((x - 8.0 + 0.1 * y) / 9.0, (y - 10.0 - 0.06 * x) / 9.0);
        let albedo = |x: f64, y: f64| 0.5 + 0.3 * (0.7 * x).sin() * (0.4 * y).cos();
        let (mut probe, mut flood) = (vec![0.0; width * height], vec![0.0; width * height]);
        let mut seen_cell = vec![NO_CELL; width * height];
        let mut sums = vec![[0.0; 3]; 144];
        for pixel in 0..width * height {
            let (x, y) = ((pixel % width) as f64, (pixel / width) as f64);
            let (u, v) = place(x, y);
            let inside = |u: f64| (0.0..12.0).contains(&u);
            let colour = albedo(x, y);
            flood[pixel] = if inside(u) && inside(v) {
                colour as f32
            } else {
                0.0
            };
            let mut light = 0.004;
            for cell in (0..144).filter(|&cell| lit[cell]) {
                let (row, col) = ((cell / 12) as f64 + 0.5, (cell % 12) as f64 + 0.5);
                light += 0.8 * along(u - col, blur.max(1e-3)) * along(v - row, blur.max(1e-3));
            }
            probe[pixel] = (colour * light) as f32;
            if inside(u) && inside(v) {
                let cell = v as usize * 12 + u as usize;
                seen_cell[pixel] = cell as u32;
                sums[cell][0] += x;
                sums[cell][1] += y;
                sums[cell][2] += 1.0;
            }
        }
        let centre = sums
            .iter()
            .map(|s| (s[2] > 0.0).then(|| [s[0] / s[2], s[1] / s[2]]));
        let registration = Registration {
            camera: (width, height),
            binning: 1,
            cell_of_pixel: seen_cell.clone(),
            centre: centre.collect(),
            seen_cell,
        };
        Probe::measure(grid, &lit, &registration, &probe, &flood)
    }

    #[test]
    fn the_blur_that_was_put_in_is_found() {
        for blur in [0.2, 0.4, 0.7] {
            let found = measured(blur).unwrap();
            assert_eq!(found.spots, 9);
            assert!((found.blur / blur - 1.0).abs() < 0.1, "{blur}: {found:?}");
        }
    }

    #[test]
    fn a_sharp_projector_has_no_blur() {
        assert!(measured(0.0).unwrap().blur.abs() < 1e-12);
    }
}
