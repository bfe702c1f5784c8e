//! Movement: how far each photograph is shifted, and where the shifts make a step.
//!
//! Each photograph is predicted from the mean light of every pixel while its cell is
//! lit and while it is dark; how far the photograph is shifted against that is found
//! from the slopes of the prediction (Lucas and Kanade, *An iterative image
//! registration technique*, 1981). Edges between lit and dark cells lie everywhere,
//! so that hundreds of them vote. A step in the shifts is a bump. White has none of these
//! edges, only the outline and the paint, but it is photographed again and again: it must lie where
//! its first photograph does. A single one is predicted from stripes and their inverses.

use super::cell_map::{NO_CELL, Registration};
use crate::format::sequence::Sequence;
use crate::photographs::sampled::{SIDE, Sampled};
use iltm_picture::statistics::median;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

/// How many times the standard error of white's shift is noise.
const NOISE: f64 = 4.0;

/// Photographs that must lie on each side of a bump: the widest stripes of a deep scene and their
/// inverse, tilted by far light, are none.
const LEAST_SIDE: usize = 5;

/// What the photographs show of movement.
pub(crate) struct Moved {
    /// Shift of each photograph but black, in pixels of the file.
    pub(crate) shifts: Vec<(usize, [f64; 2])>,
    /// Side of a cell in pixels of the file.
    pub(crate) cell: f64,
    /// The largest step in the shifts; `None` of too few.
    pub(crate) bump: Option<Bump>,
    /// What white shows of it; `None` where nothing tells.
    pub(crate) white: Option<MovedWhite>,
}

/// How far white moved.
pub(crate) struct MovedWhite {
    /// Photographs of white, and how far each lies beside the first of them, or a single one beside
    /// the sum of stripes and their inverses, in pixels of the file.
    pub(crate) off: Vec<(usize, f64)>,
    /// The place in `off` before which the picture moved most; `None` of a single one.
    pub(crate) step: Option<usize>,
}

/// Measures the shift of every photograph; `None` if too few pixels have a cell.
pub(crate) fn find(
    sequence: &Sequence,
    sampled: &Sampled,
    registration: &Registration,
) -> Option<Moved> {
    let cells: Vec<u32> = (sampled.pixels.iter())
        .map(|&pixel| registration.seen_cell[pixel as usize])
        .collect();
    if cells.iter().filter(|c| **c != NO_CELL).count() < SIDE * SIDE {
        return None;
    }
    let shown: Vec<(usize, &[bool])> = (sequence.views[1..].iter())
        .flat_map(|view| view.shots.iter().map(|&shot| (shot, view.lit.as_slice())))
        .collect();
    let levels = Levels::new(sampled, &cells, &shown);
    let binning = registration.binning as f64;
    let mut shifts: Vec<(usize, [f64; 2])> = shown
        .par_iter()
        .filter_map(|(shot, lit)| {
            let shift = levels.shift(&sampled.shots[*shot], &cells, lit)?;
            Some((*shot, shift.map(|pixels| binning * pixels)))
        })
        .collect();
    shifts.sort_by_key(|(shot, _)| *shot);
    even_pairs(sequence, &mut shifts);
    Some(Moved {
        bump: bump(&shifts),
        white: white(sequence, sampled, binning),
        shifts,
        cell: binning * registration.cell_side(),
    })
}

/// Gives a pattern and its inverse the mean of both shifts. Far light falls off from a
/// wide stripe and tilts its border, which looks like a shift; the inverse tilts it the
/// other way.
fn even_pairs(sequence: &Sequence, shifts: &mut [(usize, [f64; 2])]) {
    for (a, b) in sequence.code_pairs() {
        let place = |view: usize| {
            let shot = sequence.views[view].shots[0];
            shifts.iter().position(|(known, _)| *known == shot)
        };
        if let (Some(a), Some(b)) = (place(a), place(b)) {
            let (one, other) = (shifts[a].1, shifts[b].1);
            let mean = [0.5 * (one[0] + other[0]), 0.5 * (one[1] + other[1])];
            (shifts[a].1, shifts[b].1) = (mean, mean);
        }
    }
}

/// How far the photographs of white moved.
fn white(sequence: &Sequence, sampled: &Sampled, binning: f64) -> Option<MovedWhite> {
    let whites = &sequence.views[0].shots;
    let several = whites.len() > 1;
    let reference = if several {
        sampled.shots[whites[0]].clone()
    } else {
        let pairs = sequence.code_pairs();
        let both = pairs.iter().flat_map(|&(a, b)| [a, b]);
        let stripes: Vec<usize> = both.map(|view| sequence.views[view].shots[0]).collect();
        if stripes.is_empty() {
            return None;
        }
        sampled.mean(&stripes)
    };
    let mut shifts = Vec::with_capacity(whites.len());
    for (at, &shot) in whites.iter().enumerate() {
        let shift = match at {
            0 if several => [0.0; 2],
            _ => shift_of_same(&sampled.shots[shot], &reference)?,
        };
        shifts.push(shift.map(|pixels| binning * pixels));
    }
    let step = |at: &usize| {
        let (one, other) = (shifts[at - 1], shifts[*at]);
        (other[0] - one[0]).hypot(other[1] - one[1])
    };
    Some(MovedWhite {
        step: (1..shifts.len()).max_by(|a, b| step(a).total_cmp(&step(b))),
        off: (whites.iter().zip(&shifts))
            .map(|(&shot, [x, y])| (shot, x.hypot(*y)))
            .collect(),
    })
}

/// How far a photograph is shifted right and down against another of the same light, in pixels,
/// beyond what noise makes of it; `None` where the picture has no edges.
///
/// Slopes tell shifts below a pixel; a larger one is followed step by step, as far as half a
/// square.
fn shift_of_same(photo: &[f32], reference: &[f32]) -> Option<[f64; 2]> {
    let far = SIDE as isize / 2 - 1;
    let mut whole = [0; 2];
    let mut shift = shift_beside(photo, reference, whole)?;
    for _ in 0..2 * far {
        let next = [0, 1].map(|axis: usize| {
            let step = shift[axis].clamp(-1.0, 1.0).round() as isize;
            (whole[axis] + step).clamp(-far, far)
        });
        if next == whole {
            break;
        }
        whole = next;
        shift = shift_beside(photo, reference, whole)?;
    }
    Some([0, 1].map(|axis: usize| whole[axis] as f64 + shift[axis]))
}

/// How far a photograph is shifted beyond `[right, down]` pixels. Where light does not add up, the
/// photograph is another curve of the reference: a parabola stands for it.
fn shift_beside(photo: &[f32], reference: &[f32], [right, down]: [isize; 2]) -> Option<[f64; 2]> {
    let most = f64::from(reference.iter().copied().fold(0.0, f32::max));
    let mut normal = SMatrix::<f64, 5, 5>::zeros();
    let mut both = SVector::<f64, 5>::zeros();
    let (mut square_sum, mut count) = (0.0, 0.0);
    for square in 0..reference.len() / (SIDE * SIDE) {
        for inner in 0..(SIDE - 2) * (SIDE - 2) {
            let (row, col) = (1 + inner / (SIDE - 2), 1 + inner % (SIDE - 2));
            let at = |row: usize, col: usize| square * SIDE * SIDE + row * SIDE + col;
            let (shown_row, shown_col) = (
                row.wrapping_add_signed(down),
                col.wrapping_add_signed(right),
            );
            if shown_row >= SIDE || shown_col >= SIDE {
                continue;
            }
            let value = |row: usize, col: usize| f64::from(reference[at(row, col)]) / most;
            let light = value(row, col);
            let across = 0.5 * (value(row, col + 1) - value(row, col - 1));
            let along = 0.5 * (value(row + 1, col) - value(row - 1, col));
            let unknowns = SVector::from([light, across, along, light * light, 1.0]);
            let seen = f64::from(photo[at(shown_row, shown_col)]) / most;
            normal += unknowns * unknowns.transpose();
            both += unknowns * seen;
            square_sum += seen * seen;
            count += 1.0;
        }
    }
    let inverse = normal.try_inverse()?;
    let found = inverse * both;
    let variance = (square_sum - found.dot(&both)).max(0.0) / f64::max(count - 5.0, 1.0);
    // Of the reference where it is half as bright as it gets: there lies the outline.
    let gain = found[0] + found[3];
    let shift = |axis: usize| {
        let own = NOISE * (variance * inverse[(axis, axis)]).sqrt();
        let size = (found[axis].abs() - own).max(0.0) / gain;
        -size.copysign(found[axis])
    };
    (gain > 0.0).then(|| [shift(1), shift(2)])
}

/// Mean light of every sampled pixel while its cell is dark and while it is lit.
struct Levels {
    dark: Vec<f32>,
    lit: Vec<f32>,
    /// Whether both are known.
    known: Vec<bool>,
}

impl Levels {
    fn new(sampled: &Sampled, cells: &[u32], shown: &[(usize, &[bool])]) -> Self {
        let pixels = cells.len();
        let (mut dark, mut lit) = (vec![0.0_f32; pixels], vec![0.0_f32; pixels]);
        let mut counts = vec![[0_u32; 2]; pixels];
        for (shot, pattern) in shown {
            for (at, &value) in sampled.shots[*shot].iter().enumerate() {
                match pattern.get(cells[at] as usize) {
                    Some(true) => {
                        lit[at] += value;
                        counts[at][1] += 1;
                    }
                    Some(false) => {
                        dark[at] += value;
                        counts[at][0] += 1;
                    }
                    None => {}
                }
            }
        }
        for (at, [darks, lits]) in counts.iter().enumerate() {
            dark[at] /= (*darks).max(1) as f32;
            lit[at] /= (*lits).max(1) as f32;
        }
        let known = counts.iter().map(|c| c[0] > 0 && c[1] > 0).collect();
        Self { dark, lit, known }
    }

    /// How far a photograph of a pattern is shifted right and down, in pixels.
    fn shift(&self, photo: &[f32], cells: &[u32], pattern: &[bool]) -> Option<[f64; 2]> {
        let predicted = |at: usize| {
            let is_lit = pattern.get(cells[at] as usize).copied().unwrap_or(false);
            if is_lit { self.lit[at] } else { self.dark[at] }
        };
        let (mut own, mut both) = (0.0_f64, 0.0_f64);
        for at in (0..cells.len()).filter(|&at| self.known[at]) {
            let predicted = f64::from(predicted(at));
            own += predicted * predicted;
            both += predicted * f64::from(photo[at]);
        }
        let gain = if own > 0.0 { both / own } else { return None };
        let [mut xx, mut xy, mut yy, mut xr, mut yr] = [0.0_f64; 5];
        for square in 0..cells.len() / (SIDE * SIDE) {
            for inner in 0..(SIDE - 2) * (SIDE - 2) {
                let (row, col) = (1 + inner / (SIDE - 2), 1 + inner % (SIDE - 2));
                let at = square * SIDE * SIDE + row * SIDE + col;
                let around = [at, at - 1, at + 1, at - SIDE, at + SIDE];
                if around.iter().any(|&at| !self.known[at]) {
                    continue;
                }
                let slope =
                    |a: usize, b: usize| 0.5 * gain * f64::from(predicted(b) - predicted(a));
                let (x, y) = (slope(at - 1, at + 1), slope(at - SIDE, at + SIDE));
                let left = f64::from(photo[at]) - gain * f64::from(predicted(at));
                xx += x * x;
                xy += x * y;
                yy += y * y;
                xr -= x * left;
                yr -= y * left;
            }
        }
        let determinant = xx * yy - xy * xy;
        let solvable = determinant > 1e-3 * xx * yy && xx > 0.0 && yy > 0.0;
        solvable.then(|| {
            [
                (yy * xr - xy * yr) / determinant,
                (xx * yr - xy * xr) / determinant,
            ]
        })
    }
}

/// A step in the shifts.
pub(crate) struct Bump {
    /// Places in `shifts` before it.
    pub(crate) before: usize,
    /// Pixels of the file.
    pub(crate) size: f64,
    /// Median distance of a shift from the middle of its side, on the worse side.
    pub(crate) scatter: f64,
}

/// The largest difference between the middle shifts before and after a place.
fn bump(shifts: &[(usize, [f64; 2])]) -> Option<Bump> {
    let middle = |of: &[(usize, [f64; 2])], axis: usize| {
        median(of.iter().map(|s| s.1[axis]).collect()).unwrap_or(0.0)
    };
    let places = LEAST_SIDE..shifts.len().saturating_sub(LEAST_SIDE - 1);
    // Where the sum of both sides' scatter is least lies the step.
    let scatter = |of: &[(usize, [f64; 2])]| -> f64 {
        let middles = [middle(of, 0), middle(of, 1)];
        let off = |s: &(usize, [f64; 2])| -> f64 {
            (0..2).map(|axis| (s.1[axis] - middles[axis]).abs()).sum()
        };
        of.iter().map(off).sum()
    };
    let cost = |&at: &usize| scatter(&shifts[..at]) + scatter(&shifts[at..]);
    let before = places.min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
    let (first, second) = shifts.split_at(before);
    let step = |axis: usize| middle(second, axis) - middle(first, axis);
    let apart = |side: &[(usize, [f64; 2])]| {
        let (x, y) = (middle(side, 0), middle(side, 1));
        let off = side.iter().map(|s| (s.1[0] - x).hypot(s.1[1] - y));
        median(off.collect()).unwrap_or(0.0)
    };
    Some(Bump {
        before,
        size: step(0).hypot(step(1)),
        scatter: apart(first).max(apart(second)),
    })
}
