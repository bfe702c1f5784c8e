//! Sites: pixels of a camera on a coarser raster, each with its place in the projector's picture.

use super::local_planes;
use iltm_picture::statistics::median;
use rayon::prelude::*;

/// Squares on each side through which a plane is laid, and good ones that it needs.
const PLANE_REACH: isize = 3;
const LEAST_OF_PLANE: f64 = 8.0;

/// Pixels of a camera on a coarser raster: of each square one that the projector lights.
pub(super) struct Sites {
    side: usize,
    /// Squares across and down.
    size: (usize, usize),
    /// Pixel of each square, if one is lit.
    pub(super) pixel: Vec<Option<usize>>,
}

impl Sites {
    /// Takes the lit pixel nearest to the middle of each square of `side` pixels.
    pub(super) fn new(lit: &[bool], (width, height): (usize, usize), side: usize) -> Self {
        let size = (width.div_ceil(side), height.div_ceil(side));
        let nearest = |square: usize| {
            let (left, top) = (square % size.0 * side, square / size.0 * side);
            let all = (top..(top + side).min(height))
                .flat_map(|y| (left..(left + side).min(width)).map(move |x| (x, y)));
            let far = |&(x, y): &(usize, usize)| {
                (2 * (x - left) + 1).abs_diff(side) + (2 * (y - top) + 1).abs_diff(side)
            };
            let lit = all.filter(|(x, y)| lit[y * width + x]);
            lit.min_by_key(far).map(|(x, y)| y * width + x)
        };
        let squares = 0..size.0 * size.1;
        Self {
            pixel: squares.into_par_iter().map(nearest).collect(),
            side,
            size,
        }
    }

    pub(super) fn square_of(&self, pixel: usize, width: usize) -> usize {
        let (x, y) = (pixel % width / self.side, pixel / width / self.side);
        y * self.size.0 + x
    }

    /// Medians of the known places around a square, `reach` squares to each side.
    fn around(&self, place: &[Option<[f32; 2]>], square: usize, reach: usize) -> Option<[f32; 2]> {
        let (across, down) = self.size;
        let (x, y) = (square % across, square / across);
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(down);
        let columns = || x.saturating_sub(reach)..(x + reach + 1).min(across);
        let squares = rows.flat_map(|y| columns().map(move |x| y * across + x));
        let known: Vec<[f32; 2]> = squares.filter_map(|square| place[square]).collect();
        let middle = |axis: usize| median(known.iter().map(|at| f64::from(at[axis])).collect());
        Some([middle(0)? as f32, middle(1)? as f32])
    }

    /// Gives squares that the projector lights and that have no place the one of those around them.
    pub(super) fn fill(&self, place: &mut [Option<[f32; 2]>], reach: usize) {
        let known: &[Option<[f32; 2]>] = place;
        let filled = |square: usize| match (known[square], self.pixel[square]) {
            (None, Some(_)) => self.around(known, square, reach),
            (own, _) => own,
        };
        let filled: Vec<_> = (0..known.len()).into_par_iter().map(filled).collect();
        place.copy_from_slice(&filled);
    }

    /// The place of a square on the plane through the `good` places around it; `None` with too few.
    fn on_plane(
        &self,
        place: &[Option<[f32; 2]>],
        good: &[bool],
        square: usize,
    ) -> Option<[f32; 2]> {
        let (width, height) = self.size;
        let known = |across: isize, down: isize| {
            let x = (square % width).checked_add_signed(across)?;
            let y = (square / width).checked_add_signed(down)?;
            let other = (x < width && y < height).then_some(y * width + x)?;
            place[other].filter(|_| other != square && good[other])
        };
        let (plane, _) = local_planes::plane(PLANE_REACH, LEAST_OF_PLANE, known)?;
        Some([plane[(0, 0)] as f32, plane[(0, 1)] as f32])
    }

    /// Puts places that are not good, or farther than `most` from the plane of those around them,
    /// there.
    pub(super) fn straighten(&self, place: &mut [Option<[f32; 2]>], good: &[bool], most: f32) {
        let known: &[Option<[f32; 2]>] = place;
        let straightened = |square: usize| {
            let own = known[square]?;
            let Some(plane) = self.on_plane(known, good, square) else {
                return Some(own);
            };
            let off = (own[0] - plane[0]).abs().max((own[1] - plane[1]).abs());
            Some(if off > most || !good[square] {
                plane
            } else {
                own
            })
        };
        let straightened: Vec<_> = (0..known.len()).into_par_iter().map(straightened).collect();
        place.copy_from_slice(&straightened);
    }

    /// Puts places that are farther than `most` from those around them there.
    pub(super) fn settle(&self, place: &mut [Option<[f32; 2]>], reach: usize, most: f32) {
        let known: &[Option<[f32; 2]>] = place;
        let settled = |square: usize| {
            let own = known[square]?;
            let around = self.around(known, square, reach)?;
            let off = (own[0] - around[0]).abs().max((own[1] - around[1]).abs());
            Some(if off > most { around } else { own })
        };
        let settled: Vec<_> = (0..known.len()).into_par_iter().map(settled).collect();
        place.copy_from_slice(&settled);
    }
}
