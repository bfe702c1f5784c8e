//! Pattern matching: which pattern each photograph shows, whatever its line says.
//!
//! Some pixels are given to cells by their whole series: each pixel goes to the cell
//! whose on and off over all photographs its own light follows best. That needs no
//! Gray code and survives some photographs that show another pattern; where all
//! after one are shifted, the shift that fits best is tried. Then every photograph
//! is compared with every pattern.

use super::sampled::{SIDE, Sampled};
use crate::format::sequence::Sequence;
use iltm_picture::statistics::median;
use nalgebra::DMatrix;

/// Pixels that are given to cells.
const MOST_PIXELS: usize = 1024;

/// Photographs, other than black, from which a pixel's series says which cell it is.
const LEAST_SHOTS: usize = 24;

/// Photographs that one may be taken too early or too late by.
const MOST_SHIFT: isize = 2;

/// Correlation of a pixel's series with its cell's from which it is used.
const LEAST_ALIKE: f64 = 0.5;

/// The same where enough pixels have as much: what only bounces to a pixel follows no cell.
const WELL_ALIKE: f64 = 0.8;

/// Pixels that must be left.
const LEAST_PIXELS: usize = 24;

/// Distance to the own pattern, in those to the best other, from which the other one
/// is shown.
const OTHER: f64 = 1.5;

/// Distance to a pattern, of the range between dark and lit squared, below which it may
/// be the one that is shown; one half is another random pattern's.
const NONE: f64 = 0.2;

/// Distance to the own pattern from which no pattern is shown.
const UNLIKE: f64 = 0.35;

/// The same, in those of the session's other photographs: where cells are a few pixels
/// wide or light each other much, all patterns look a little unlike themselves.
const STRANGE: f64 = 3.0;

/// What a photograph shows instead of its own pattern.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Wrong {
    /// The shot.
    pub(crate) shot: usize,
    /// A shot whose pattern it shows; `None` if it shows no pattern.
    pub(crate) shows: Option<usize>,
}

/// What the comparison of photographs and patterns found.
pub(crate) struct Order {
    /// Photographs that show another pattern, in order.
    pub(crate) wrong: Vec<Wrong>,
    /// Distance of each photograph to its own pattern.
    pub(crate) distances: Vec<f64>,
    /// Distance from which no pattern is shown.
    pub(crate) none: f64,
}

/// Compares every photograph with every pattern; `None` if there are too few, or too
/// few pixels that follow any cell.
pub(crate) fn find(sequence: &Sequence, sampled: &Sampled) -> Option<Order> {
    let patterns = patterns(sequence);
    if patterns.len() < LEAST_SHOTS {
        return None;
    }
    let light = light(sampled);
    let shifts = (0..=MOST_SHIFT).flat_map(|shift| [shift, -shift]);
    let best = shifts
        .map(|shift| Assigned::new(&light, &patterns, shift))
        // The first of equals: no shift at all.
        .fold(None, |best: Option<Assigned>, next| match best {
            Some(best) if best.alike >= 1.05 * next.alike => Some(best),
            Some(best) if best.shift == -next.shift && best.shift == 0 => Some(best),
            Some(best) if next.alike <= 1.05 * best.alike => Some(best),
            _ => Some(next),
        })?;
    if best.pixels.len() < LEAST_PIXELS {
        return None;
    }
    Some(best.compare(&light, &patterns))
}

/// Which cells are lit in each shot.
fn patterns(sequence: &Sequence) -> Vec<Vec<bool>> {
    let dark = vec![false; sequence.grid.cells()];
    let mut patterns = vec![dark; sequence.shots.len()];
    for view in &sequence.views {
        for &shot in &view.shots {
            patterns[shot].clone_from(&view.lit);
        }
    }
    patterns
}

/// Light of some of the sampled pixels, `pixels x shots`: the middle ones of each
/// square's quarters.
fn light(sampled: &Sampled) -> DMatrix<f32> {
    let quarter = SIDE / 4;
    let places: Vec<usize> = (0..sampled.squares())
        .flat_map(|square| {
            (0..4).map(move |k| {
                let (row, col) = (quarter + k / 2 * 2 * quarter, quarter + k % 2 * 2 * quarter);
                square * SIDE * SIDE + row * SIDE + col
            })
        })
        .collect();
    let step = places.len().div_ceil(MOST_PIXELS).max(1);
    let places: Vec<usize> = places.into_iter().step_by(step).collect();
    DMatrix::from_fn(places.len(), sampled.shots.len(), |pixel, shot| {
        sampled.shots[shot][places[pixel]]
    })
}

/// Pixels and their cells, if photograph `s` shows the pattern of shot `s + shift`.
struct Assigned {
    shift: isize,
    /// Pixels that follow a cell, and that cell.
    pixels: Vec<(usize, usize)>,
    /// Sum over the pixels of how well they do.
    alike: f64,
}

impl Assigned {
    fn new(light: &DMatrix<f32>, patterns: &[Vec<bool>], shift: isize) -> Self {
        let cells = patterns[0].len();
        let shown =
            |shot: usize| -> Option<&Vec<bool>> { patterns.get(shot.checked_add_signed(shift)?) };
        let shots: Vec<usize> = (0..patterns.len())
            .filter(|&s| shown(s).is_some())
            .collect();
        let mut codes = DMatrix::from_fn(shots.len(), cells, |at, cell| {
            let lit = shown(shots[at]).is_some_and(|lit| lit[cell]);
            f32::from(u8::from(lit))
        });
        let mut series = DMatrix::from_fn(shots.len(), light.nrows(), |at, pixel| {
            light[(pixel, shots[at])]
        });
        for mut column in codes.column_iter_mut().chain(series.column_iter_mut()) {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let alike = series.tr_mul(&codes);
        let best = (alike.row_iter().enumerate()).map(|(pixel, row)| {
            let (mut cell, mut most) = (0, f32::MIN);
            for (at, &value) in row.iter().enumerate() {
                if value > most {
                    (cell, most) = (at, value);
                }
            }
            (pixel, cell, f64::from(most))
        });
        let mut best: Vec<(usize, usize, f64)> = best.filter(|b| b.2 > LEAST_ALIKE).collect();
        let well = |b: &&(usize, usize, f64)| b.2 > WELL_ALIKE;
        if best.iter().filter(well).count() >= 4 * LEAST_PIXELS {
            best.retain(|b| b.2 > WELL_ALIKE);
        }
        Self {
            shift,
            alike: best.iter().map(|b| b.2).sum(),
            pixels: best
                .into_iter()
                .map(|(pixel, cell, _)| (pixel, cell))
                .collect(),
        }
    }

    /// Compares every photograph with every pattern.
    fn compare(&self, light: &DMatrix<f32>, patterns: &[Vec<bool>]) -> Order {
        let shots = patterns.len();
        let shown = |shot: usize| {
            let at = shot.checked_add_signed(self.shift)?;
            patterns.get(at)
        };
        // How far each pixel is from dark to lit in each photograph.
        let rows = self.pixels.iter().map(|&(pixel, cell)| {
            let middle = |lit: bool| {
                let of = (0..shots).filter(|&s| shown(s).is_some_and(|l| l[cell] == lit));
                let values: Vec<f64> = of.map(|s| f64::from(light[(pixel, s)])).collect();
                median(values).unwrap_or(0.0)
            };
            let (dark, lit) = (middle(false), middle(true));
            let range = (lit - dark).max(1e-6);
            let value =
                move |s: usize| ((f64::from(light[(pixel, s)]) - dark) / range).clamp(-0.5, 1.5);
            (0..shots).map(value).collect::<Vec<f64>>()
        });
        let rows: Vec<Vec<f64>> = rows.collect();
        let pixels = rows.len() as f64;
        let distance = |shot: usize, pattern: &[bool]| {
            let of = rows.iter().zip(&self.pixels).map(|(row, &(_, cell))| {
                let off = row[shot] - f64::from(u8::from(pattern[cell]));
                off * off
            });
            of.sum::<f64>() / pixels
        };
        let distances: Vec<f64> = (0..shots).map(|s| distance(s, &patterns[s])).collect();
        let typical = median(distances.clone()).unwrap_or(0.0);
        let none = UNLIKE.max(STRANGE * typical);
        let wrong = (0..shots).filter_map(|shot| {
            let own = distances[shot];
            // What fits well needs no comparison.
            if own < 0.25 * NONE {
                return None;
            }
            let all = (0..shots).map(|other| (other, distance(shot, &patterns[other])));
            let (best, least) = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
            let near = NONE.max(OTHER * typical);
            let other = patterns[best] != patterns[shot] && own > OTHER * least && least < near;
            // White is brighter than any sum of its parts, and black darker.
            let even = patterns[shot].iter().all(|lit| *lit == patterns[shot][0]);
            match (other, own > none && !even) {
                (true, _) => Some(Wrong {
                    shot,
                    shows: Some(best),
                }),
                (false, true) => Some(Wrong { shot, shows: None }),
                (false, false) => None,
            }
        });
        let mut wrong: Vec<Wrong> = wrong.collect();
        // One in ten may be disturbed; if more fit no pattern, the picture moved.
        let strange = wrong.iter().filter(|wrong| wrong.shows.is_none()).count();
        if strange > (shots / 10).max(2) {
            wrong.retain(|wrong| wrong.shows.is_some());
        }
        Order {
            wrong,
            distances,
            none,
        }
    }
}
