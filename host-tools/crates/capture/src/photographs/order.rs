//! Pattern matching: which pattern each photograph shows, whatever its line says.
//!
//! Some pixels are given to cells by their whole series: each pixel goes to the cell
//! whose on and off over all photographs its own light follows best. That needs no
//! Gray code and survives some photographs that show another pattern. Where all after one
//! are shifted, the place and the shift that make the series likeliest are tried too; a Gray
//! code looks much like itself two photographs later, so that all pixels together decide and
//! not how many follow some cell. Then every photograph is compared with every pattern, in the
//! cells in which the pattern differs from the photograph's own.

use super::sampled::Sampled;
use crate::format::sequence::Sequence;
use iltm_picture::statistics::median;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Pixels that are given to cells.
const MOST_PIXELS: usize = 1024;

/// Photographs, other than black, from which a pixel's series says which cell it is.
const LEAST_SHOTS: usize = 24;

/// Photographs that one may be taken too early or too late by.
const MOST_SHIFT: isize = 2;

/// Places of the session from which photographs may be shifted, evenly.
const PLACES: usize = 8;

/// How many times as likely the series must be with a shift, in logarithms.
const LIKELIER: f64 = 1.25;

/// Correlation of a pixel's series with its cell's from which it is used.
const LEAST_ALIKE: f64 = 0.5;

/// The same where enough pixels have as much: what only bounces to a pixel follows no cell.
const WELL_ALIKE: f64 = 0.8;

/// Pixels that must be left.
const LEAST_PIXELS: usize = 24;

/// Cells in which another pattern must differ for a photograph to tell them apart.
const LEAST_CELLS: usize = 6;

/// How much nearer a photograph must be to another pattern than to its own, in the cells in
/// which they differ: 1 if it shows the other one, -1 if its own.
const OTHER: f64 = 0.3;

/// The same in standard errors over these cells.
const SURE: f64 = 5.0;

/// Distance to the own pattern, of the range between dark and lit squared, from which no
/// pattern is shown; one half is another random pattern's.
const UNLIKE: f64 = 0.35;

/// The same, in those of the session's other photographs: where cells are a few pixels
/// wide or light each other much, all patterns look a little unlike themselves.
const STRANGE: f64 = 3.0;

/// How much farther than from the nearest pattern a photograph may be from another one that fits
/// as well.
const AS_WELL: f64 = 0.1;

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

impl Order {
    /// The same of these photographs and of others behind them.
    pub(crate) fn and(mut self, others: Self) -> Self {
        let before = self.distances.len();
        self.wrong
            .extend(others.wrong.into_iter().map(|wrong| Wrong {
                shot: before + wrong.shot,
                shows: wrong.shows.map(|shows| before + shows),
            }));
        self.distances.extend(others.distances);
        self
    }
}

/// Compares every photograph with every pattern; `None` if there are too few, or too
/// few pixels that follow any cell.
pub(crate) fn find(sequence: &Sequence, sampled: &Sampled) -> Option<Order> {
    let patterns = patterns(sequence);
    if patterns.len() < LEAST_SHOTS {
        return None;
    }
    let light = light(sampled);
    let unshifted = Assigned::new(&light, &patterns, Shift::NONE);
    let shifts: Vec<Shift> = Shift::all(patterns.len()).collect();
    let assigned = shifts.par_iter();
    let assigned = assigned.map(|shift| Assigned::new(&light, &patterns, *shift));
    let best = (assigned.collect::<Vec<_>>().into_iter())
        .max_by(|a, b| a.likelihood.total_cmp(&b.likelihood))
        .filter(|best| best.likelihood > LIKELIER * unshifted.likelihood)
        .unwrap_or(unshifted);
    if best.pixels.len() < LEAST_PIXELS {
        return None;
    }
    Some(best.compare(&light, &patterns))
}

/// From a place of the session on, photographs show a pattern so many later than their line.
#[derive(Clone, Copy, Debug)]
struct Shift {
    from: usize,
    by: isize,
}

impl Shift {
    const NONE: Self = Self { from: 0, by: 0 };

    /// All that are tried in a session of so many shots.
    fn all(shots: usize) -> impl Iterator<Item = Self> {
        let by = (1..=MOST_SHIFT).flat_map(|by| [by, -by]);
        by.flat_map(move |by| {
            (0..PLACES).map(move |place| Self {
                from: place * shots / PLACES,
                by,
            })
        })
    }

    /// The pattern that a shot shows.
    fn shown(self, shot: usize, patterns: &[Vec<bool>]) -> Option<&Vec<bool>> {
        let by = if shot < self.from { 0 } else { self.by };
        patterns.get(shot.checked_add_signed(by)?)
    }
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

/// Light of some of the sampled pixels, `pixels x shots`, evenly over all squares.
fn light(sampled: &Sampled) -> DMatrix<f32> {
    // An odd step takes another column of the squares each time.
    let step = (sampled.pixels.len() / MOST_PIXELS) | 1;
    let places: Vec<usize> = (0..sampled.pixels.len()).step_by(step).collect();
    DMatrix::from_fn(places.len(), sampled.shots.len(), |pixel, shot| {
        sampled.shots[shot][places[pixel]]
    })
}

/// Pixels and their cells, if photographs show the patterns of a shift.
struct Assigned {
    shift: Shift,
    /// Pixels that follow a cell, and that cell.
    pixels: Vec<(usize, usize)>,
    /// Logarithm of how likely the series of all pixels are if each follows its cell but for
    /// noise, a photograph: minus half that of what the cell leaves unexplained.
    likelihood: f64,
}

impl Assigned {
    fn new(light: &DMatrix<f32>, patterns: &[Vec<bool>], shift: Shift) -> Self {
        let cells = patterns[0].len();
        let shown = |shot: usize| shift.shown(shot, patterns);
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
        // Unlike `tr_mul` this is a blocked product.
        let alike = series.transpose() * &codes;
        let best = (alike.row_iter().enumerate()).map(|(pixel, row)| {
            let (mut cell, mut most) = (0, f32::MIN);
            for (at, &value) in row.iter().enumerate() {
                if value > most {
                    (cell, most) = (at, value);
                }
            }
            (pixel, cell, f64::from(most))
        });
        let mut best: Vec<(usize, usize, f64)> = best.collect();
        let unexplained = |b: &(usize, usize, f64)| (1.0 - b.2 * b.2).max(1e-4);
        let likelihood = best.iter().map(|b| -0.5 * unexplained(b).ln()).sum();
        best.retain(|b| b.2 > LEAST_ALIKE);
        let well = |b: &&(usize, usize, f64)| b.2 > WELL_ALIKE;
        if best.iter().filter(well).count() >= LEAST_PIXELS {
            best.retain(|b| b.2 > WELL_ALIKE);
        }
        Self {
            shift,
            likelihood,
            pixels: best
                .into_iter()
                .map(|(pixel, cell, _)| (pixel, cell))
                .collect(),
        }
    }

    /// Compares every photograph with every pattern.
    fn compare(&self, light: &DMatrix<f32>, patterns: &[Vec<bool>]) -> Order {
        let shots = patterns.len();
        let shown = |shot: usize| self.shift.shown(shot, patterns);
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
        let nearer = |shot: usize, other: usize| {
            let mut cells: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
            for (row, &(_, cell)) in rows.iter().zip(&self.pixels) {
                let own = patterns[shot][cell];
                if patterns[other][cell] != own {
                    let toward = if own {
                        1.0 - 2.0 * row[shot]
                    } else {
                        2.0 * row[shot] - 1.0
                    };
                    let sum = cells.entry(cell).or_default();
                    *sum = (sum.0 + toward, sum.1 + 1.0);
                }
            }
            significant(
                &cells
                    .into_values()
                    .map(|(sum, count)| sum / count)
                    .collect::<Vec<f64>>(),
            )
        };
        let wrong = (0..shots).filter_map(|shot| {
            let own = distances[shot];
            // What fits well needs no comparison.
            if own < 0.25 * OTHER {
                return None;
            }
            let all = (0..shots).map(|other| (other, distance(shot, &patterns[other])));
            let least = all
                .clone()
                .map(|(_, distance)| distance)
                .fold(own, f64::min);
            // Of equal patterns the one that was shown about then.
            let best = all
                .filter(|(_, distance)| *distance <= least)
                .min_by_key(|(other, _)| other.abs_diff(shot))?
                .0;
            let other = patterns[best] != patterns[shot] && nearer(shot, best);
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
        // Two that fit each other's patterns are exchanged, though a third pattern may fit as well;
        // it must not fit much better.
        let fits = |a: &Wrong, b: &Wrong| {
            let least = a
                .shows
                .map_or(0.0, |best| distance(a.shot, &patterns[best]));
            nearer(a.shot, b.shot) && distance(a.shot, &patterns[b.shot]) < least + AS_WELL
        };
        if let [a, b] = wrong.as_mut_slice()
            && fits(a, b)
            && fits(b, a)
        {
            (a.shows, b.shows) = (Some(b.shot), Some(a.shot));
        }
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

/// Whether cells say surely that a photograph shows another pattern: 1 is a cell that does,
/// -1 one that does not.
fn significant(cells: &[f64]) -> bool {
    let count = cells.len() as f64;
    if cells.len() < LEAST_CELLS {
        return false;
    }
    let mean = cells.iter().sum::<f64>() / count;
    let variance = cells.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / (count - 1.0);
    mean > OTHER && mean > SURE * (variance / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_of_one_and_two_are_tried_from_every_eighth_of_a_session() {
        let tried: Vec<(usize, isize)> = Shift::all(80).map(|s| (s.from, s.by)).collect();
        let wanted = [1, -1, 2, -2].map(|by| (0..8).map(move |eighth| (10 * eighth, by)));
        assert_eq!(tried, wanted.into_iter().flatten().collect::<Vec<_>>());
    }

    #[test]
    fn enough_cells_that_agree_are_significant_and_few_or_scattered_ones_are_not() {
        assert!(significant(&[1.0; LEAST_CELLS]));
        assert!(significant(&[0.9; 8]));
        assert!(!significant(&[1.0; LEAST_CELLS - 1]));
        assert!(!significant(&[0.2; 40]));
        // Two thirds say one thing, a third the other: .33 with a standard error of .2.
        let scattered: Vec<f64> = (0..24)
            .map(|k| if k % 3 == 0 { -1.0 } else { 1.0 })
            .collect();
        assert!(!significant(&scattered));
        // The same share of two hundred times as many is sure.
        assert!(significant(&scattered.repeat(200)));
    }
}
