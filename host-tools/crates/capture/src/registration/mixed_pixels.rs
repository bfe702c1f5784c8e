//! Mixed pixels: which camera pixels see one cell and nothing else.
//!
//! Only a pixel at the border between two cells can see both. Its regression
//! weight of the other cell would say how much, were it not that light bouncing
//! off that cell's patch looks the same; but a pixel a little further inside
//! receives the bounced light too and nothing else of the other cell. So the
//! excess over that pixel counts. "A little" is an eighth of a cell, so that a
//! blurred border of many pixels is judged like a sharp one of a single pixel.

use super::cell_map::Candidate;
use super::regression::axis_sums;
use iltm_picture::statistics::{median, quantile};
use iltm_runtime::Grid;
use std::collections::BTreeMap;

/// Part of a second cell, relative to the pixel's own, from which a pixel counts
/// as mixed.
pub(crate) const MIXED: f32 = 0.15;

/// Part of a pixel beyond the border of the projection from which it counts as
/// mixed. More than for a second cell: darkness scales what the pixel shows,
/// while a second cell shows something else.
const BEYOND: f32 = 0.45;

/// Direct light, relative to the brightest of the eight neighbours, below which
/// a pixel lies beyond the border of the projection.
const OUTSIDE: f32 = 0.25;

/// Share of a pixel's light that comes from its own and the next cells, relative to that
/// of the cell's bright pixels, from which it is lit directly.
const INDIRECT: f32 = 0.85;

/// Contrast of stripes, relative to what is usual, from which a pixel is lit directly: three walls of a
/// room show .7 at least where the projector lights them and .2 at most where it does not.
const SHOWN: f32 = 0.25;

/// Contrast, relative to the median of all pixels, that nine of ten reach where a projector is sharp:
/// .77 in scenes, and .53 with a blur of .4 cells.
const SHARP: f32 = 0.65;

/// Which of a cell's pixels count as bright.
const BRIGHT: f64 = 0.9;

/// Distance, in cells, of the pixels that a pixel is compared with.
const REACH: f64 = 0.125;

/// Neighbours, of eight, that must have the same cell or one next to it. Where
/// there is only noise, cells are random and agree by accident; a corner of the
/// projection has three.
const COHERENT: usize = 3;

/// Removes candidates that the projector does not light, as the surroundings in
/// the image of `camera` (width and height) pixels show: much darker than a
/// neighbour, or of a cell that the neighbours contradict. Candidates are ordered
/// by pixel.
pub(crate) fn drop_unlit(candidates: &mut Vec<Candidate>, grid: Grid, camera: (usize, usize)) {
    let cols = grid.cols() as u32;
    let map = Map::new(candidates, grid, camera);
    let near =
        |a: u32, b: u32| (a / cols).abs_diff(b / cols) <= 1 && (a % cols).abs_diff(b % cols) <= 1;
    let lit = |candidate: &Candidate| {
        let (mut agreeing, mut brightest) = (0, 0.0_f32);
        for (dx, dy) in directions() {
            if let Some(other) = map.neighbour(candidate, dx, dy) {
                agreeing += usize::from(near(other.cell, candidate.cell));
                brightest = brightest.max(other.direct());
            }
        }
        agreeing >= COHERENT && candidate.direct() >= OUTSIDE * brightest
    };
    let keep: Vec<bool> = candidates.iter().map(lit).collect();
    let mut keep = keep.into_iter();
    candidates.retain(|_| keep.next() == Some(true));
}

/// What a pixel shows of stripes finer than the cells.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ShownStripes {
    /// Of white's light.
    pub(crate) contrast: f32,
    /// Whether they tell its place.
    pub(crate) is_placed: bool,
}

/// What tells whether a pixel's light comes straight from the projector.
struct DirectSigns {
    /// Light of its cell and those around it.
    nearest: f32,
    /// Share of that in all light.
    share: f32,
    shown: ShownStripes,
}

/// What is usual in a cell.
struct UsualSigns {
    /// Of bright pixels.
    nearest: f32,
    /// The same.
    share: f32,
    /// Of pixels whose places stripes tell, or of all pixels if nearly all show them.
    contrast: Option<f32>,
}

impl UsualSigns {
    fn of(pixels: &[DirectSigns], sharp: Option<f32>) -> Self {
        let bright = |of: fn(&DirectSigns) -> f32| {
            let mut values: Vec<f32> = pixels.iter().map(of).collect();
            quantile(&mut values, BRIGHT).unwrap_or(0.0)
        };
        let placed = pixels.iter().filter(|pixel| pixel.shown.is_placed);
        let placed = placed.map(|pixel| pixel.shown.contrast).collect();
        Self {
            nearest: bright(|pixel| pixel.nearest),
            share: bright(|pixel| pixel.share),
            contrast: median(placed).or(sharp),
        }
    }
}

/// Removes candidates that get their cell's light from other surfaces only, as beyond the border of
/// the projection beside a crease.
///
/// Where stripes tell the places of a cell's pixels, or nearly all pixels show them, those show none.
/// Elsewhere they are much darker than the cell's other pixels, and not for a dark paint, which darkens
/// light from everywhere alike.
/// A surface that the projector grazes is as dark beside a crease; its pixels stay where stripes tell
/// their places. `light` is the flood light of each camera pixel.
pub(crate) fn drop_indirect(
    candidates: &mut Vec<Candidate>,
    light: &[f32],
    shown: impl Fn(u32) -> ShownStripes,
) {
    let signs = |candidate: &Candidate| {
        let nearest = candidate.nearest();
        DirectSigns {
            nearest,
            share: nearest / light[candidate.pixel as usize],
            shown: shown(candidate.pixel),
        }
    };
    let mut of_cell: BTreeMap<u32, Vec<DirectSigns>> = BTreeMap::new();
    for candidate in &*candidates {
        let cell = of_cell.entry(candidate.cell).or_default();
        cell.push(signs(candidate));
    }
    let pixels = of_cell.values().flatten();
    let sharp = sharp(pixels.map(|pixel| pixel.shown.contrast).collect());
    let usual: BTreeMap<u32, UsualSigns> = of_cell
        .iter()
        .map(|(cell, pixels)| (*cell, UsualSigns::of(pixels, sharp)))
        .collect();
    candidates.retain(|candidate| {
        let own = signs(candidate);
        let usual = &usual[&candidate.cell];
        let is_direct = if let Some(contrast) = usual.contrast {
            own.shown.contrast >= SHOWN * contrast
        } else {
            own.nearest >= OUTSIDE * usual.nearest || own.share >= INDIRECT * usual.share
        };
        is_direct || own.shown.is_placed
    });
}

/// The usual contrast of stripes, if nearly all pixels show them.
fn sharp(mut contrast: Vec<f32>) -> Option<f32> {
    let least = quantile(&mut contrast, 1.0 - BRIGHT)?;
    let usual = median(contrast).filter(|usual| *usual > 0.0)?;
    (least >= SHARP * usual).then_some(usual)
}

/// Sets [`Candidate::mixed`] of every candidate of an image of `camera` (width
/// and height) pixels. Candidates are ordered by pixel.
pub(crate) fn judge(candidates: &mut [Candidate], grid: Grid, camera: (usize, usize)) {
    let map = Map::new(candidates, grid, camera);
    let mixed = |candidate: &Candidate| {
        let along = |(dx, dy): (isize, isize)| {
            let outward = map.neighbour(candidate, dx, dy);
            let inward = map.neighbour(candidate, -dx, -dy);
            match outward {
                None => dark_part(candidate, inward) * MIXED / BEYOND,
                // What a diagonal neighbour could tell, one of the others does.
                Some(_) if dx != 0 && dy != 0 => 0.0,
                Some(outward) => other_part(candidate, outward, inward, grid),
            }
        };
        directions().map(along).fold(0.0, f32::max)
    };
    let mixed: Vec<f32> = candidates.iter().map(mixed).collect();
    for (candidate, mixed) in candidates.iter_mut().zip(mixed) {
        candidate.mixed = mixed;
    }
}

/// Camera pixels between a pixel and those it is compared with.
pub(crate) fn reach(candidates: &[Candidate], grid: Grid) -> usize {
    let mut seen = vec![false; grid.cells()];
    for candidate in candidates {
        seen[candidate.cell as usize] = true;
    }
    let cells = seen.iter().filter(|&&seen| seen).count().max(1);
    let side = (candidates.len() as f64 / cells as f64).sqrt();
    (REACH * side).round().max(1.0) as usize
}

/// Candidates by pixel.
struct Map<'a> {
    candidates: &'a [Candidate],
    /// Index into `candidates`, or `u32::MAX`.
    at: Vec<u32>,
    camera: (usize, usize),
    reach: isize,
}

impl<'a> Map<'a> {
    fn new(candidates: &'a [Candidate], grid: Grid, camera: (usize, usize)) -> Self {
        let mut at = vec![u32::MAX; camera.0 * camera.1];
        for (index, candidate) in (0..).zip(candidates) {
            at[candidate.pixel as usize] = index;
        }
        Self {
            candidates,
            at,
            camera,
            reach: reach(candidates, grid) as isize,
        }
    }

    /// The pixel that is compared with `of` in a direction.
    fn neighbour(&self, of: &Candidate, dx: isize, dy: isize) -> Option<&'a Candidate> {
        let (width, height) = self.camera;
        let x = (of.pixel as usize % width).checked_add_signed(dx * self.reach)?;
        let y = (of.pixel as usize / width).checked_add_signed(dy * self.reach)?;
        if x >= width || y >= height {
            return None;
        }
        self.candidates.get(self.at[y * width + x] as usize)
    }
}

/// The eight directions from a pixel.
fn directions() -> impl Iterator<Item = (isize, isize)> {
    let around = (0..9).map(|k| (k % 3 - 1, k / 3 - 1));
    around.filter(|&direction| direction != (0, 0))
}

/// Part of `pixel` that no cell lights, given the pixel further `inward`.
fn dark_part(pixel: &Candidate, inward: Option<&Candidate>) -> f32 {
    inward.map_or(0.0, |inward| 1.0 - pixel.direct() / inward.direct())
}

/// Part of `pixel` that belongs to the cell of the pixel `outward` of it, given
/// the pixel on the opposite side, `inward`.
fn other_part(
    pixel: &Candidate,
    outward: &Candidate,
    inward: Option<&Candidate>,
    grid: Grid,
) -> f32 {
    if outward.cell == pixel.cell {
        return 0.0;
    }
    let cols = grid.cols() as u32;
    let (rows, columns) = axis_sums(&pixel.weights);
    let same_cell = inward.filter(|inward| inward.cell == pixel.cell);
    let (rows_within, columns_within) = same_cell
        .map_or(([0.0, 1.0, 0.0], [0.0, 1.0, 0.0]), |inward| {
            axis_sums(&inward.weights)
        });
    let by_row = excess(rows, rows_within, pixel.cell / cols, outward.cell / cols);
    let by_column = excess(
        columns,
        columns_within,
        pixel.cell % cols,
        outward.cell % cols,
    );
    by_row.max(by_column)
}

/// Weight, along one axis, on the side where `other` lies of `own`, relative to
/// the own weight, beyond what a pixel further inside has there. Relative, so
/// that the two pixels may differ in albedo.
fn excess(weights: [f32; 3], within: [f32; 3], own: u32, other: u32) -> f32 {
    let side = match other.cmp(&own) {
        std::cmp::Ordering::Less => 0,
        std::cmp::Ordering::Equal => return 0.0,
        std::cmp::Ordering::Greater => 2,
    };
    let relative = |w: [f32; 3]| (w[1] > 0.0).then(|| w[side] / w[1]);
    // No light from its own cell at all: nothing of the pixel is its own.
    relative(weights).map_or(1.0, |part| part - relative(within).unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pixel of cell 5 with light from it and from the cell on its right, and from far.
    fn pixel(own: f32, next: f32, far: f32) -> (Candidate, f32) {
        let mut weights = [0.0; 9];
        weights[4] = own;
        weights[5] = next;
        let candidate = Candidate {
            weights,
            ..Candidate::new(0, 5)
        };
        (candidate, own + next + far)
    }

    #[test]
    fn light_from_other_surfaces_only_is_dropped_and_dark_paint_is_not() {
        let lit = pixel(0.4, 0.05, 0.05);
        let mixed = pixel(0.2, 0.2, 0.05);
        let painted = pixel(0.04, 0.005, 0.005);
        let indirect = pixel(0.03, 0.015, 0.04);
        let kinds = [lit, lit, lit, lit, mixed, painted, indirect, lit];
        let (mut candidates, light): (Vec<_>, Vec<_>) = kinds.into_iter().unzip();
        for (at, candidate) in candidates.iter_mut().enumerate() {
            candidate.pixel = at as u32;
        }
        let kept = |shown: fn(u32) -> ShownStripes| -> Vec<u32> {
            let mut candidates = candidates.clone();
            drop_indirect(&mut candidates, &light, shown);
            candidates.iter().map(|candidate| candidate.pixel).collect()
        };
        assert_eq!(kept(|_| ShownStripes::default()), [0, 1, 2, 3, 4, 5, 7]);
        // Stripes are seen where it is grazed by the projector's own light, and a blurred border of
        // the lit part shows some of them.
        let grazed = |pixel| ShownStripes {
            contrast: [0.9, 0.9, 0.9, 0.9, 0.5, 0.7, 0.1, 0.9][pixel as usize],
            is_placed: ![4, 5].contains(&pixel),
        };
        assert_eq!(kept(grazed), [0, 1, 2, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn what_shows_no_stripes_of_a_cell_is_dropped_however_many_and_bright_its_pixels_are() {
        let kinds = [pixel(0.4, 0.05, 0.05), pixel(0.3, 0.15, 0.1)];
        let mut candidates = vec![kinds[0].0; 2];
        candidates.extend([kinds[1].0; 30]);
        let light: Vec<f32> = (0..32).map(|at| kinds[usize::from(at > 1)].1).collect();
        for (at, candidate) in candidates.iter_mut().enumerate() {
            candidate.pixel = at as u32;
        }
        drop_indirect(&mut candidates, &light, |pixel| ShownStripes {
            contrast: if pixel < 2 { 0.8 } else { 0.15 },
            is_placed: pixel < 2,
        });
        assert_eq!(candidates.len(), 2);
    }

    #[test]
    fn a_camera_that_cannot_tell_places_judges_by_stripes_unless_the_projector_is_blurred() {
        let kinds = [pixel(0.4, 0.05, 0.05), pixel(0.3, 0.15, 0.1)];
        let candidates: Vec<Candidate> = (0..40)
            .map(|pixel| Candidate {
                pixel,
                ..kinds[usize::from(pixel < 2)].0
            })
            .collect();
        let light: Vec<f32> = (0..40).map(|at| kinds[usize::from(at < 2)].1).collect();
        let kept = |contrast: fn(u32) -> f32| {
            let mut candidates = candidates.clone();
            drop_indirect(&mut candidates, &light, |pixel| ShownStripes {
                contrast: contrast(pixel),
                is_placed: false,
            });
            candidates.len()
        };
        assert_eq!(kept(|pixel| if pixel < 2 { 0.15 } else { 0.8 }), 38);
        // The middle of cells is where half a cell's stripes have their edges.
        assert_eq!(
            kept(|pixel| [0.1, 0.2, 0.4, 0.45, 0.5][pixel as usize % 5]),
            40
        );
        assert_eq!(kept(|_| 0.0), 40);
    }

    #[test]
    fn a_cell_that_is_seen_by_other_surfaces_only_keeps_its_pixels() {
        let (candidate, light) = pixel(0.03, 0.015, 0.04);
        let mut candidates = vec![candidate; 3];
        drop_indirect(&mut candidates, &[light], |_| ShownStripes::default());
        assert_eq!(candidates.len(), 3);
    }
}
