//! Fine flood: the flood photograph in projector coordinates, finer than the cells.
//!
//! Video has more pixels than the grid has cells, so its gain map needs more
//! than one flood value a cell. With fine stripes, the projector map says which
//! pixels see a sample. Without, the map from cells to the camera goes through
//! the cells' mean positions, linear between them: it may bend at every cell, as
//! it does where the surface has a crease, and it does not reach across an edge
//! where the surface ends.

use super::measurements::Measurements;
use crate::registration::cell_map::Registration;
use crate::registration::projector_map::ProjectorMap;
use iltm_picture::statistics::median;
use iltm_runtime::Grid;

/// Camera pixels that one fine sample should average at least.
const PIXELS_A_SAMPLE: f64 = 4.0;

/// Finest subdivision of a cell's side.
const MAX_FACTOR: usize = 8;

/// Least weight of usable camera pixels in a fine sample, of a full footprint.
const LEAST_COVER: f32 = 0.1;

/// Light observed under white at each point of a grid finer than the cells.
#[derive(Clone, PartialEq, Debug)]
pub struct FineFlood {
    /// Rows, `factor` times the grid's.
    pub rows: usize,
    /// Columns, `factor` times the grid's.
    pub cols: usize,
    /// Fine samples along a cell's side, 1 to 8.
    pub factor: usize,
    /// Flood light with black subtracted in camera units, one plane a channel,
    /// row by row, length `rows * cols`; zeros in cells that are not live.
    /// Without a projector map, the mean over a cell's samples is its observation.
    pub channels: Vec<Vec<f32>>,
    /// The flood observation of each cell that a solve works with, one plane a
    /// channel, length `N`.
    pub observed: Vec<Vec<f64>>,
}

impl FineFlood {
    /// Resamples the flood photograph, as finely as leaves each sample about four
    /// camera pixels.
    #[must_use]
    pub fn new(measurements: &Measurements) -> Self {
        Self::with_factor(measurements, natural_factor(measurements))
    }

    /// The same with a subdivision of each cell's side by `factor`, clamped to
    /// 1 to 8.
    #[must_use]
    pub fn with_factor(measurements: &Measurements, factor: usize) -> Self {
        let factor = factor.clamp(1, MAX_FACTOR);
        let grid = measurements.grid;
        let (rows, cols) = (grid.rows() * factor, grid.cols() * factor);
        let mut channels = vec![vec![0.0; rows * cols]; measurements.channels.len()];
        let surface = Surface::new(measurements);
        let mapped = match &measurements.map {
            Some(Ok(map)) => Some(MappedFlood::new(measurements, map, factor)),
            _ => None,
        };
        for cell in (0..grid.cells()).filter(|&cell| measurements.live[cell]) {
            let seen = mapped.as_ref().map(|mapped| mapped.samples(cell));
            let known = |seen: &Vec<Vec<Option<f32>>>| seen.iter().flatten().any(Option::is_some);
            let by_map = seen.as_ref().is_some_and(known);
            let samples = match seen {
                Some(seen) if by_map => seen,
                _ => surface.samples(cell, factor, &measurements.flood),
            };
            for (channel, samples) in samples.into_iter().enumerate() {
                let observations = &measurements.channels[channel].observations;
                let flood = observations[(cell, Measurements::WHITE)];
                let samples = if by_map {
                    filled(&samples, factor)
                } else {
                    scaled(&samples, flood)
                };
                for (at, sample) in samples.into_iter().enumerate() {
                    let row = cell / grid.cols() * factor + at / factor;
                    let col = cell % grid.cols() * factor + at % factor;
                    channels[channel][row * cols + col] = sample;
                }
            }
        }
        let observed = measurements.channels.iter().map(|channel| {
            let flood = channel.observations.column(Measurements::WHITE);
            flood.iter().copied().collect()
        });
        Self {
            rows,
            cols,
            factor,
            channels,
            observed: observed.collect(),
        }
    }
}

/// The flood photograph gathered by the projector map.
struct MappedFlood {
    grid: Grid,
    factor: usize,
    /// Light times area, one plane a channel, and area, row by row over all samples.
    light: Vec<Vec<f32>>,
    area: Vec<f32>,
}

impl MappedFlood {
    fn new(measurements: &Measurements, map: &ProjectorMap, factor: usize) -> Self {
        let grid = measurements.grid;
        let (rows, cols) = (grid.rows() * factor, grid.cols() * factor);
        let mut light = vec![vec![0.0; rows * cols]; measurements.flood.len()];
        let mut area = vec![0.0; rows * cols];
        // Side of a camera's pixel in samples: as wide as it is, it adds to what it covers.
        let side = (factor as f64 / measurements.registration.cell_side()) as f32;
        for (pixel, place) in map.position.iter().enumerate() {
            let [across, down] = map.in_cells(*place, grid).map(|at| at * factor as f32);
            if across.is_nan() || down.is_nan() || !measurements.is_inside(pixel) {
                continue;
            }
            for (row, tall) in covered(down, side, rows) {
                for (col, wide) in covered(across, side, cols) {
                    let (at, share) = (row * cols + col, tall * wide);
                    area[at] += share;
                    for (light, flood) in light.iter_mut().zip(&measurements.flood) {
                        light[at] += share * flood[pixel];
                    }
                }
            }
        }
        Self {
            grid,
            factor,
            light,
            area,
        }
    }

    /// Samples of each plane in one cell, row by row; `None` where no pixel sees one.
    fn samples(&self, cell: usize) -> Vec<Vec<Option<f32>>> {
        let (cols, factor) = (self.grid.cols() * self.factor, self.factor);
        let first = cell / self.grid.cols() * factor * cols + cell % self.grid.cols() * factor;
        let value = |plane: &Vec<f32>, sample: usize| {
            let at = first + sample / factor * cols + sample % factor;
            (self.area[at] >= LEAST_COVER).then(|| plane[at] / self.area[at])
        };
        let plane = |plane| {
            (0..factor * factor)
                .map(|sample| value(plane, sample))
                .collect()
        };
        self.light.iter().map(plane).collect()
    }
}

/// Samples along a side of `count` that an interval of `side` around `middle` covers, and how much
/// of each.
fn covered(middle: f32, side: f32, count: usize) -> impl Iterator<Item = (usize, f32)> {
    let (from, to) = (middle - side / 2.0, middle + side / 2.0);
    let last = (to.ceil().max(0.0) as usize).min(count);
    (from.max(0.0) as usize..last).filter_map(move |at| {
        let share = to.min(at as f32 + 1.0) - from.max(at as f32);
        (share > 0.0).then_some((at, share))
    })
}

/// Fills unknown samples of a cell with the nearest known ones' mean.
fn filled(samples: &[Option<f32>], factor: usize) -> Vec<f32> {
    let value = |at: usize| {
        let (row, col) = (at / factor, at % factor);
        let near = (0..factor).find_map(|reach| {
            let (mut sum, mut count) = (0.0, 0.0_f32);
            for (other, sample) in samples.iter().enumerate() {
                let (down, across) = (
                    (other / factor).abs_diff(row),
                    (other % factor).abs_diff(col),
                );
                if let (true, Some(sample)) = (down.max(across) == reach, sample) {
                    sum += sample;
                    count += 1.0;
                }
            }
            (count > 0.0).then(|| sum / count)
        });
        near.unwrap_or(0.0)
    };
    (0..samples.len()).map(value).collect()
}

/// Subdivision that leaves [`PIXELS_A_SAMPLE`] in a live cell of median size.
fn natural_factor(measurements: &Measurements) -> usize {
    let mut pixels = vec![0.0_f64; measurements.grid.cells()];
    for &cell in &measurements.registration.seen_cell {
        if let Some(pixels) = pixels.get_mut(cell as usize) {
            *pixels += 1.0;
        }
    }
    let of_live = (pixels.iter().zip(&measurements.live))
        .filter_map(|(&pixels, &live)| live.then_some(pixels));
    let usual = median(of_live.collect()).unwrap_or(0.0);
    ((usual / PIXELS_A_SAMPLE).sqrt() as usize).clamp(1, MAX_FACTOR)
}

/// Fills samples that no pixel covers with the others' mean and scales all so
/// that their mean is `flood`.
fn scaled(samples: &[Option<f32>], flood: f64) -> Vec<f32> {
    let known = || samples.iter().flatten().map(|&s| f64::from(s));
    let mean = known().sum::<f64>() / known().count() as f64;
    if mean.is_nan() || mean <= 0.0 || flood <= 0.0 {
        return vec![flood as f32; samples.len()];
    }
    let scale = flood / mean;
    let value = |s: &Option<f32>| s.map_or(flood, |s| f64::from(s) * scale) as f32;
    samples.iter().map(value).collect()
}

/// The map from cell coordinates to camera pixels.
struct Surface<'a> {
    grid: Grid,
    registration: &'a Registration,
    /// Whether a pixel and its four neighbours all belong to the projection: a
    /// pixel at its very border is only partly lit.
    inner: Vec<bool>,
}

impl<'a> Surface<'a> {
    fn new(measurements: &'a Measurements) -> Self {
        let pixels = 0..measurements.registration.seen_cell.len();
        Self {
            grid: measurements.grid,
            registration: &measurements.registration,
            inner: pixels.map(|pixel| measurements.is_inside(pixel)).collect(),
        }
    }

    /// Samples of each plane in one cell, `factor * factor` a plane, row by row;
    /// `None` where no usable pixel is near.
    fn samples(&self, cell: usize, factor: usize, planes: &[Vec<f32>]) -> Vec<Vec<Option<f32>>> {
        let empty = vec![vec![None; factor * factor]; planes.len()];
        let Some(centre) = self.registration.centre[cell] else {
            return empty;
        };
        let [across, down] = self.registration.steps(self.grid, cell);
        let longest = across.iter().chain(&down).map(|[x, y]| x.hypot(*y));
        // A point a camera pixel, so that the footprint has no gaps.
        let points = (longest.fold(0.0, f64::max) / factor as f64)
            .ceil()
            .max(1.0) as usize;
        let at = |u: f64, v: f64| -> [f64; 2] {
            let (across, down) = (across[usize::from(u > 0.0)], down[usize::from(v > 0.0)]);
            std::array::from_fn(|k| centre[k] + u * across[k] + v * down[k])
        };
        let parts = factor * points;
        let offset = |part: usize| (part as f64 + 0.5) / parts as f64 - 0.5;
        let mut samples = empty;
        for (place, (row, col)) in (0..factor * factor).map(|p| (p, (p / factor, p % factor))) {
            let mut sums = vec![0.0_f32; planes.len()];
            let mut cover = 0.0;
            for point in 0..points * points {
                let u = offset(col * points + point % points);
                let v = offset(row * points + point / points);
                self.gather(cell, at(u, v), planes, &mut sums, &mut cover);
            }
            if cover >= LEAST_COVER * (points * points) as f32 {
                for (samples, sum) in samples.iter_mut().zip(sums) {
                    samples[place] = Some(sum / cover);
                }
            }
        }
        samples
    }

    /// Adds the four pixels around a camera position, with bilinear weights, if
    /// they lie inside the projection and on the surface around `cell`.
    fn gather(
        &self,
        cell: usize,
        position: [f64; 2],
        planes: &[Vec<f32>],
        sums: &mut [f32],
        cover: &mut f32,
    ) {
        let (width, height) = self.registration.camera;
        let [x, y] = position;
        if !(x >= 0.0 && y >= 0.0) {
            return;
        }
        let (left, top) = (x as usize, y as usize);
        let (right, below) = (x.fract() as f32, y.fract() as f32);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (px, py) = (left + dx, top + dy);
            if px >= width || py >= height {
                continue;
            }
            let pixel = py * width + px;
            if !self.inner[pixel] || !self.near(cell, self.registration.seen_cell[pixel]) {
                continue;
            }
            let weight_x = if dx == 0 { 1.0 - right } else { right };
            let weight_y = if dy == 0 { 1.0 - below } else { below };
            let weight = weight_x * weight_y;
            for (sum, plane) in sums.iter_mut().zip(planes) {
                *sum += weight * plane[pixel];
            }
            *cover += weight;
        }
    }

    /// Whether two cells are the same or neighbours.
    fn near(&self, cell: usize, other: u32) -> bool {
        let (cols, other) = (self.grid.cols(), other as usize);
        (cell / cols).abs_diff(other / cols) <= 1 && (cell % cols).abs_diff(other % cols) <= 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_adds_to_each_sample_by_as_much_as_it_covers() {
        let shares = |middle: f32| -> Vec<(usize, f32)> {
            let covered = covered(middle, 0.5, 4);
            covered
                .map(|(at, share)| (at, (100.0 * share).round() / 100.0))
                .collect()
        };
        assert_eq!(shares(1.25), [(1, 0.5)]);
        assert_eq!(shares(2.0), [(1, 0.25), (2, 0.25)]);
        assert_eq!(shares(-0.1), [(0, 0.15)]);
        assert_eq!(shares(4.1), [(3, 0.15)]);
        assert_eq!((shares(-3.0), shares(9.0)), (vec![], vec![]));
    }

    #[test]
    fn an_unknown_sample_has_the_mean_of_the_nearest_known_ones() {
        let samples = [
            Some(1.0),
            None,
            Some(3.0),
            None,
            None,
            None,
            None,
            None,
            None,
        ];
        let filled: Vec<f32> = filled(&samples, 3);
        assert_eq!(filled, [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 2.0, 2.0, 2.0]);
    }
}
