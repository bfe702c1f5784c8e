//! Fine flood: the flood photograph in projector coordinates, finer than the cells.
//!
//! Video has more pixels than the grid has cells, so its gain map needs more
//! than one flood value a cell. With fine stripes, the projector map says which
//! pixels see a sample, and by how much: the value of a sample is the light whose
//! reciprocal, as a gain, brings all of them nearest to an even light
//! (`even_gains`). Without, the map from cells to the camera goes through
//! the cells' mean positions, linear between them: it may bend at every cell, as
//! it does where the surface has a crease, and it does not reach across an edge
//! where the surface ends.

use super::measurements::Measurements;
use super::noise::NoiseSource;
use super::pixel_views::PixelViews;
use super::wiener_filter;
use crate::registration::cell_map::Registration;
use crate::registration::projector_map::ProjectorMap;
use crate::several::SeveralCaptures;
use iltm_picture::statistics::median;
use iltm_runtime::{FrameSize, Grid};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Camera pixels that one fine sample should have at least.
const PIXELS_A_SAMPLE: f64 = 1.0;

/// Values that it should average where only the cells tell where it is: pixels times photographs
/// of white's light. Noise would else be seen on the wall.
const VALUES_A_SAMPLE: f64 = 4.0;

/// Finest subdivision of a cell's side where only the cells tell where a sample is.
const MAX_FACTOR: usize = 8;

/// Least weight of usable camera pixels in a fine sample, of a full footprint.
const LEAST_COVER: f32 = 0.1;

/// Share of the row sums of `A' B^2 A` that holds a gain near its sample's own best: where a
/// camera is coarser than the samples, differences of neighbours are noise.
const HELD: f32 = 0.04;

/// Residual, relative to the right side, at which gains are found.
const SMALL: f64 = 1e-4;

/// Steps of conjugate gradients at most.
const MOST_STEPS: usize = 60;

/// Most by which a sample's neighbours change its own best gain, a factor.
const MOST_CHANGE: f32 = 4.0;

/// Light observed under white at each point of a grid finer than the cells.
#[derive(Clone, PartialEq, Debug)]
pub struct FineFlood {
    /// Rows, a multiple of the grid's.
    pub rows: usize,
    /// Columns, a multiple of the grid's.
    pub cols: usize,
    /// Fine samples along a cell's width and height.
    pub factor: [usize; 2],
    /// Flood light with black subtracted in camera units, one plane a channel,
    /// row by row, length `rows * cols`; zeros in cells that are not live.
    /// Without a projector map, the mean over a cell's samples is its observation.
    pub channels: Vec<Vec<f32>>,
    /// Whether the projector map said which pixels see a sample.
    pub mapped: bool,
    /// The flood observation of each cell that a solve works with, one plane a
    /// channel, length `N`.
    pub observed: Vec<Vec<f64>>,
    /// What an even light shows beyond it, one entry a channel; empty without a projector map.
    pub even: Vec<EvenFlood>,
}

/// What the photograph of an even light ([`EvenLight`](crate::EvenLight)) shows, in one channel.
#[derive(Clone, PartialEq, Debug)]
pub struct EvenFlood {
    /// Patterns that were added up, `N x views`.
    pub patterns: DMatrix<f64>,
    /// Observed light of them, `N x views`, camera units.
    pub observations: DMatrix<f64>,
    /// [`EvenChannel::weights`](crate::EvenChannel::weights).
    pub weights: DMatrix<f32>,
    /// [`EvenChannel::beyond`](crate::EvenChannel::beyond) of each sample, row by row; `None` of a cell
    /// that no pixel sees.
    pub beyond: Vec<Option<f32>>,
}

impl FineFlood {
    /// Resamples the flood photograph as finely as leaves each sample a camera pixel, at most as
    /// finely as the projector's pixels; where only the cells tell where a sample is, four values of
    /// pixels and photographs too. There are no more than `most` samples.
    #[must_use]
    pub fn new(measurements: &Measurements, most: Option<FrameSize>) -> Self {
        Self::with_factor(measurements, natural_factor(measurements, most))
    }

    /// The same with a subdivision of each cell's width and height, at least 1.
    #[must_use]
    pub fn with_factor(measurements: &Measurements, factor: [usize; 2]) -> Self {
        let factor = factor.map(|side| side.max(1));
        let grid = measurements.grid;
        let (rows, cols) = (grid.rows() * factor[1], grid.cols() * factor[0]);
        let mut channels = vec![vec![0.0; rows * cols]; measurements.channels.len()];
        let surface = Surface::new(measurements);
        let flood = quiet_flood(measurements, &surface.inner);
        let mapped = match &measurements.map {
            Some(Ok(map)) => Some(MappedFlood::new(measurements, &flood, map, factor)),
            _ => None,
        };
        for cell in (0..grid.cells()).filter(|&cell| measurements.live[cell]) {
            let seen = mapped.as_ref().map(|mapped| mapped.samples(cell));
            let known = |seen: &Vec<Vec<Option<f32>>>| seen.iter().flatten().any(Option::is_some);
            let by_map = seen.as_ref().is_some_and(known);
            let samples = match seen {
                Some(seen) if by_map => seen,
                _ => surface.samples(cell, factor, &flood),
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
                    let row = cell / grid.cols() * factor[1] + at / factor[0];
                    let col = cell % grid.cols() * factor[0] + at % factor[0];
                    channels[channel][row * cols + col] = sample;
                }
            }
        }
        Self {
            rows,
            cols,
            factor,
            channels,
            mapped: mapped.is_some(),
            observed: observed(measurements, Measurements::WHITE),
            even: even(measurements, factor),
        }
    }

    /// Those of several projectors side by side, each by its own photographs of white, as finely
    /// as the coarsest of them allows.
    #[must_use]
    pub fn of_several(several: &SeveralCaptures, most: Option<FrameSize>) -> Self {
        let grid = several.all.grid;
        let own = several.projectors.iter().map(|one| &one.own);
        let factors: Vec<[usize; 2]> = own.map(|own| natural_factor(own, None)).collect();
        let most = most.map_or([usize::MAX; 2], |most| {
            [most.width() / grid.cols(), most.height() / grid.rows()]
        });
        let least = |axis: usize| {
            let told = factors.iter().map(|factor| factor[axis]).min();
            told.unwrap_or(1).min(most[axis]).max(1)
        };
        let factor = [0, 1].map(least);
        let (rows, cols) = (grid.rows() * factor[1], grid.cols() * factor[0]);
        let mut all = Self {
            rows,
            cols,
            factor,
            channels: vec![vec![0.0; rows * cols]; several.all.channels.len()],
            mapped: true,
            observed: vec![vec![0.0; grid.cells()]; several.all.channels.len()],
            // Their gains make an even white right.
            even: Vec::new(),
        };
        for one in &several.projectors {
            let flood = Self::with_factor(&one.own, factor);
            all.mapped &= flood.mapped;
            let start = one.part.columns.start * factor[0];
            for (plane, own) in all.channels.iter_mut().zip(&flood.channels) {
                let rows = plane.chunks_exact_mut(cols);
                for (row, own) in rows.zip(own.chunks_exact(flood.cols)) {
                    row[start..start + own.len()].copy_from_slice(own);
                }
            }
            let white = observed(&several.all, one.views.start + Measurements::WHITE);
            for (all, white) in all.observed.iter_mut().zip(white) {
                for cell in one.part.places(grid.cols()) {
                    all[cell] = white[cell];
                }
            }
        }
        all
    }
}

/// Light of each cell in one view, one plane a channel.
fn observed(measurements: &Measurements, view: usize) -> Vec<Vec<f64>> {
    let channels = measurements.channels.iter();
    let of = channels.map(|channel| channel.observations.column(view).iter().copied().collect());
    of.collect()
}

/// What an even light shows beyond white's, by channel.
fn even(measurements: &Measurements, factor: [usize; 2]) -> Vec<EvenFlood> {
    let (Some(even), Some(Ok(map))) = (&measurements.even, &measurements.map) else {
        return Vec::new();
    };
    let grid = measurements.grid;
    let views = PixelViews::new(map, grid, factor, &measurements.registration);
    let channels = even.channels.par_iter().zip(&measurements.channels);
    let channels = channels.map(|(own, channel)| EvenFlood {
        patterns: channel.patterns.select_columns(&even.views),
        observations: channel.observations.select_columns(&even.views),
        weights: own.weights.clone(),
        beyond: views.means_within(grid, factor, &own.beyond),
    });
    channels.collect()
}

/// White's light without the noise that is known to be in it.
fn quiet_flood(measurements: &Measurements, inside: &[bool]) -> Vec<Vec<f32>> {
    // Where nothing was photographed twice, texture passes for noise.
    if measurements.diagnostics.noise == NoiseSource::Texture {
        return measurements.flood.clone();
    }
    let width = measurements.registration.camera.0;
    let photographs = measurements.flood_photographs.max(1) as f64;
    let planes = measurements.flood.iter().zip(&measurements.channels);
    let filtered = planes.map(|(plane, channel)| {
        let variance = |light: f64| channel.noise_model.variance(light) / photographs;
        wiener_filter::filtered(plane, width, inside, variance)
    });
    filtered.collect()
}

/// The flood photograph gathered by the projector map.
struct MappedFlood {
    grid: Grid,
    factor: [usize; 2],
    /// Light that each sample's gain answers, one plane a channel, row by row over all samples;
    /// `None` where no pixel sees one.
    light: Vec<Vec<Option<f32>>>,
}

impl MappedFlood {
    fn new(
        measurements: &Measurements,
        flood: &[Vec<f32>],
        map: &ProjectorMap,
        factor: [usize; 2],
    ) -> Self {
        let grid = measurements.grid;
        let views = PixelViews::new(map, grid, factor, &measurements.registration);
        let light = flood.par_iter();
        Self {
            grid,
            factor,
            light: light.map(|flood| views.answered_light(flood)).collect(),
        }
    }

    /// Samples of each plane in one cell, row by row; `None` where no pixel sees one.
    fn samples(&self, cell: usize) -> Vec<Vec<Option<f32>>> {
        let [wide, tall] = self.factor;
        let cols = self.grid.cols() * wide;
        let first = cell / self.grid.cols() * tall * cols + cell % self.grid.cols() * wide;
        let at = |sample: usize| first + sample / wide * cols + sample % wide;
        let plane = |plane: &Vec<Option<f32>>| {
            let samples = (0..wide * tall).map(|sample| plane[at(sample)]);
            samples.collect()
        };
        self.light.iter().map(plane).collect()
    }
}

impl PixelViews {
    /// Mean of the pixels that see each sample and whose place is in the same cell; that of the nearest
    /// samples where there is none. `None` of a cell without any.
    fn means_within(&self, grid: Grid, factor: [usize; 2], values: &[f32]) -> Vec<Option<f32>> {
        let cols = grid.cols() * factor[0];
        let cell_of = |row: usize, col: usize| row / factor[1] * grid.cols() + col / factor[0];
        let mut sums = vec![[0.0_f32; 2]; self.samples()];
        for view in self.pixels() {
            let value = values[view.pixel as usize];
            let [across, down] = view.place.map(|at| at.max(0.0) as usize);
            let own = cell_of(down, across);
            if value.is_nan() {
                continue;
            }
            for (at, share) in self.seen(view) {
                if cell_of(at / cols, at % cols) == own {
                    sums[at][0] += share * value;
                    sums[at][1] += share;
                }
            }
        }
        let mut means = vec![None; sums.len()];
        for cell in 0..grid.cells() {
            let first = cell / grid.cols() * factor[1] * cols + cell % grid.cols() * factor[0];
            let at = |sample: usize| first + sample / factor[0] * cols + sample % factor[0];
            let own = (0..factor[0] * factor[1]).map(|sample| {
                let [sum, shares] = sums[at(sample)];
                (shares > 0.0).then(|| sum / shares)
            });
            let own: Vec<Option<f32>> = own.collect();
            if own.iter().any(Option::is_some) {
                for (sample, value) in filled(&own, factor).into_iter().enumerate() {
                    means[at(sample)] = Some(value);
                }
            }
        }
        means
    }

    /// The reciprocal of [`even_gains`](Self::even_gains), where there are any.
    fn answered_light(&self, flood: &[f32]) -> Vec<Option<f32>> {
        let gains = self.even_gains(flood);
        gains.into_iter().map(|gain| Some(1.0 / gain?)).collect()
    }

    /// Gains `z` of the samples with which the flood's light `b` comes nearest to an even 1, over
    /// all camera pixels: `sum over c of (b_c (A z)_c - (A 1)_c)^2` is least.
    ///
    /// Where a sample lies on two paints, or a pixel sees two samples, no gain is right for all
    /// pixels, and the mean light's is far from the best. Conjugate gradients; a share of the
    /// matrix's row sums holds what the pixels do not tell near each sample's own best.
    fn even_gains(&self, flood: &[f32]) -> Vec<Option<f32>> {
        let samples = self.samples();
        let mut area = vec![0.0_f32; samples];
        for view in self.pixels() {
            for (at, share) in self.seen(view) {
                area[at] += share * self.area();
            }
        }
        // What a pixel sees of a sample that is hardly seen counts as the others do.
        let covered: Vec<bool> = area.iter().map(|area| *area >= LEAST_COVER).collect();
        let seen = |view| self.seen(view).filter(|(at, _)| covered[*at]);
        let (mut right, mut weight) = (vec![0.0_f32; samples], vec![0.0_f32; samples]);
        for view in self.pixels() {
            let light = flood[view.pixel as usize];
            let whole: f32 = seen(view).map(|(_, share)| share).sum();
            for (at, share) in seen(view) {
                right[at] += share * light * whole;
                weight[at] += share * light * light * whole;
            }
        }
        // Noise alone may leave less light than black: no gain answers that.
        let known: Vec<bool> = (right.iter().zip(&weight))
            .map(|(right, weight)| *right > 0.0 && *weight > 0.0)
            .collect();
        let own: Vec<f32> = (known.iter().zip(right.iter().zip(&weight)))
            .map(|(known, (right, weight))| if *known { right / weight } else { 0.0 })
            .collect();
        let hold: Vec<f32> = weight.iter().map(|weight| HELD * weight).collect();
        // (A' B^2 A + hold) change = A' B (A 1 - B A own), B the flood's light.
        let normal = |gains: &[f32]| {
            let mut product: Vec<f32> = gains.iter().zip(&hold).map(|(z, h)| z * h).collect();
            for view in self.pixels() {
                let light = flood[view.pixel as usize];
                let light_there: f32 = seen(view).map(|(at, share)| share * gains[at]).sum();
                for (at, share) in seen(view) {
                    product[at] += share * light * light * light_there;
                }
            }
            zero_unknown(&mut product, &known);
            product
        };
        let mut residual: Vec<f32> = normal(&own);
        for (residual, ((own, hold), right)) in
            residual.iter_mut().zip(own.iter().zip(&hold).zip(&right))
        {
            *residual = right + own * hold - *residual;
        }
        zero_unknown(&mut residual, &known);
        let scaled = |residual: &[f32]| -> Vec<f32> {
            let pairs = residual.iter().zip(weight.iter().zip(&known));
            pairs
                .map(|(r, (weight, known))| if *known { r / weight } else { 0.0 })
                .collect()
        };
        let mut gains = own.clone();
        let mut direction = scaled(&residual);
        let mut size = dot(&residual, &direction);
        let small = SMALL * SMALL * dot(&right, &scaled(&right));
        for _ in 0..MOST_STEPS {
            if size <= small {
                break;
            }
            let product = normal(&direction);
            let step = (size / dot(&direction, &product)) as f32;
            for at in 0..samples {
                gains[at] += step * direction[at];
                residual[at] -= step * product[at];
            }
            let next = scaled(&residual);
            let after = dot(&residual, &next);
            let turn = (after / size) as f32;
            for (direction, next) in direction.iter_mut().zip(next) {
                *direction = next + turn * *direction;
            }
            size = after;
        }
        let bounded = |(gain, own): (f32, f32)| gain.clamp(own / MOST_CHANGE, own * MOST_CHANGE);
        let pairs = gains.into_iter().zip(own).zip(known);
        pairs
            .map(|(pair, known)| known.then(|| bounded(pair)))
            .collect()
    }
}

fn zero_unknown(values: &mut [f32], known: &[bool]) {
    for (value, known) in values.iter_mut().zip(known) {
        if !known {
            *value = 0.0;
        }
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| f64::from(*a) * f64::from(*b))
        .sum()
}

/// Fills unknown samples of a cell with the nearest known ones' mean.
fn filled(samples: &[Option<f32>], [wide, tall]: [usize; 2]) -> Vec<f32> {
    let value = |at: usize| {
        let (row, col) = (at / wide, at % wide);
        let near = (0..wide.max(tall)).find_map(|reach| {
            let (mut sum, mut count) = (0.0, 0.0_f32);
            let rows = row.saturating_sub(reach)..(row + reach + 1).min(tall);
            for other in rows {
                for across in col.saturating_sub(reach)..(col + reach + 1).min(wide) {
                    if let Some(sample) = samples[other * wide + across] {
                        sum += sample;
                        count += 1.0;
                    }
                }
            }
            (count > 0.0).then(|| sum / count)
        });
        near.unwrap_or(0.0)
    };
    (0..samples.len()).map(value).collect()
}

/// Subdivision that leaves each sample in a live cell of median size its pixels and values.
fn natural_factor(measurements: &Measurements, most: Option<FrameSize>) -> [usize; 2] {
    let map = match &measurements.map {
        Some(Ok(map)) => Some(map),
        _ => None,
    };
    finest_factor(
        measurements.grid,
        (&measurements.registration, &measurements.live),
        map,
        measurements.flood_photographs,
        most,
    )
}

/// The same of a registration and its live cells.
pub(crate) fn finest_factor(
    grid: Grid,
    (registration, live): (&Registration, &[bool]),
    map: Option<&ProjectorMap>,
    photographs: usize,
    most: Option<FrameSize>,
) -> [usize; 2] {
    let mut pixels = vec![0.0_f64; grid.cells()];
    for &cell in &registration.seen_cell {
        if let Some(pixels) = pixels.get_mut(cell as usize) {
            *pixels += 1.0;
        }
    }
    let of_live = (pixels.iter().zip(live)).filter_map(|(&pixels, &live)| live.then_some(pixels));
    let usual = median(of_live.collect()).unwrap_or(0.0);
    let (needed, finest) = if let Some(map) = map {
        let inner = map.projector.inner();
        let pixels = [inner.width() / grid.cols(), inner.height() / grid.rows()];
        (PIXELS_A_SAMPLE, pixels)
    } else {
        let needed = VALUES_A_SAMPLE / photographs.max(1) as f64;
        (needed.max(PIXELS_A_SAMPLE), [MAX_FACTOR; 2])
    };
    let told = (usual / needed).sqrt() as usize;
    let most = most.map_or([usize::MAX; 2], |most| {
        [most.width() / grid.cols(), most.height() / grid.rows()]
    });
    std::array::from_fn(|axis| told.min(finest[axis]).min(most[axis]).max(1))
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
            inner: pixels
                .map(|pixel| measurements.registration.is_inside(pixel))
                .collect(),
        }
    }

    /// Samples of each plane in one cell, row by row; `None` where no usable pixel is near.
    fn samples(
        &self,
        cell: usize,
        [wide, tall]: [usize; 2],
        planes: &[Vec<f32>],
    ) -> Vec<Vec<Option<f32>>> {
        let empty = vec![vec![None; wide * tall]; planes.len()];
        let Some(centre) = self.registration.centre[cell] else {
            return empty;
        };
        let [across, down] = self.registration.steps(self.grid, cell);
        let longest = across.iter().chain(&down).map(|[x, y]| x.hypot(*y));
        // A point a camera pixel, so that the footprint has no gaps.
        let points = (longest.fold(0.0, f64::max) / wide.min(tall) as f64)
            .ceil()
            .max(1.0) as usize;
        let at = |u: f64, v: f64| -> [f64; 2] {
            let (across, down) = (across[usize::from(u > 0.0)], down[usize::from(v > 0.0)]);
            std::array::from_fn(|k| centre[k] + u * across[k] + v * down[k])
        };
        let offset = |part: usize, parts: usize| (part as f64 + 0.5) / parts as f64 - 0.5;
        let mut samples = empty;
        for (place, (row, col)) in (0..wide * tall).map(|p| (p, (p / wide, p % wide))) {
            let mut sums = vec![0.0_f32; planes.len()];
            let mut cover = 0.0;
            for point in 0..points * points {
                let u = offset(col * points + point % points, wide * points);
                let v = offset(row * points + point / points, tall * points);
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

    /// A row of samples, each seen by two camera pixels of half its width.
    fn two_pixels_a_sample(samples: usize) -> PixelViews {
        let place = |pixel: u32| (pixel, [pixel as f32 / 2.0 + 0.25, 0.5]);
        let places = (0..2 * samples as u32).map(place);
        PixelViews::of_places([samples, 1], [0.5, 1.0], places)
    }

    #[test]
    fn the_gain_of_a_sample_on_two_paints_is_the_one_of_least_squares() {
        // The third sample lies on a paint of 0.8 and one of 0.2.
        let flood = [0.8, 0.8, 0.8, 0.8, 0.8, 0.2, 0.2, 0.2];
        let gains = two_pixels_a_sample(4).even_gains(&flood);
        let wanted = [1.25, 1.25, (0.8 + 0.2) / (0.64 + 0.04), 5.0];
        for (gain, wanted) in gains.iter().zip(wanted) {
            assert!((gain.unwrap() - wanted).abs() < 1e-3, "{gains:?}");
        }
    }

    #[test]
    fn pixels_that_see_two_samples_each_still_tell_both() {
        // Pixels as wide as the samples, half a sample beside them: each sees a mean.
        let truth = [1.0_f32, 1.0, 2.0, 2.0, 2.0];
        let place = |pixel: u32| (pixel, [pixel as f32 / 2.0 + 0.5, 0.5]);
        let places = (0..2 * truth.len() as u32 - 1).map(place);
        let views = PixelViews::of_places([truth.len(), 1], [1.0; 2], places);
        // Light with which the true gains make every pixel even.
        let flood: Vec<f32> = (0..9)
            .map(|pixel| 2.0 / (truth[pixel / 2] + truth[pixel.div_ceil(2)]))
            .collect();
        let gains = views.even_gains(&flood);
        for (gain, truth) in gains.iter().zip(truth) {
            assert!((gain.unwrap() / truth - 1.0).abs() < 0.02, "{gains:?}");
        }
    }

    #[test]
    fn a_sample_that_is_hardly_seen_leaves_the_others_as_they_are() {
        // Pixels as wide as a sample; none of them looks at the last sample but for a tenth.
        let places = [[0.5, 0.5], [1.0, 0.5], [1.5, 0.5], [1.59, 0.5]];
        let places = places
            .into_iter()
            .zip(0..)
            .map(|(place, pixel)| (pixel, place));
        let views = PixelViews::of_places([3, 1], [1.0; 2], places);
        let gains = views.even_gains(&[0.5; 4]);
        for gain in &gains[..2] {
            assert!((gain.unwrap() - 2.0).abs() < 1e-3, "{gains:?}");
        }
        assert!(gains[2].is_none(), "{gains:?}");
    }

    #[test]
    fn what_no_pixel_sees_and_what_is_dark_has_no_gain() {
        let place = |pixel: u32| (pixel, [pixel as f32 / 2.0 + 0.25, 0.5]);
        let views = PixelViews::of_places([4, 1], [0.5, 1.0], (0..6).map(place));
        let gains = views.even_gains(&[0.5, 0.5, 0.0, 0.0, 0.5, 0.5]);
        let known: Vec<bool> = gains.iter().map(Option::is_some).collect();
        assert_eq!(known, [true, false, true, false]);
        let gains = two_pixels_a_sample(2).even_gains(&[0.5, 0.5, -0.01, 0.002]);
        assert!(gains[0].is_some() && gains[1].is_none(), "{gains:?}");
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
        let filled: Vec<f32> = filled(&samples, [3, 3]);
        assert_eq!(filled, [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 2.0, 2.0, 2.0]);
    }
}
