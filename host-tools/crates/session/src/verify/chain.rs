//! Chain: what player, device and projector made of slides on their way to the wall.
//!
//! The table read backwards says what the wall would look like if the slides had not been
//! compensated, had been compensated twice, or had been moved, scaled or mirrored afterwards.
//! What the photographs fit far better than the chain that was meant is what happened.

use super::judge::LiveCells;
use super::readings::input;
use super::{Expected, ProjectorCurves, Readings, TestImage};
use iltm_capture::CellPlanes;
use iltm_runtime::{Grid, image::Table};
use iltm_video::{Compensator, VideoError};
use std::fmt;

/// What a chain does to slides that it should only compensate.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ChainFault {
    /// It shows them as they are.
    NotCompensated,
    /// It compensates them twice.
    CompensatedTwice,
    /// It shows them with left and right, or top and bottom, exchanged.
    Mirrored,
    /// It shows them elsewhere than the table was learned.
    Shifted {
        /// Right and down, in cells.
        by: [f64; 2],
    },
    /// It shows them in another size than the table was learned in.
    Scaled {
        /// Width and height, relative to those of the table.
        by: [f64; 2],
    },
}

impl fmt::Display for ChainFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotCompensated => {
                f.write_str("The chain does not compensate: the wall shows the slides as they are.")
            }
            Self::CompensatedTwice => f.write_str(
                "The chain compensates twice: two of player, device and program do it, one after \
                 the other.",
            ),
            Self::Mirrored => f.write_str("The picture is mirrored between compensation and wall."),
            Self::Shifted { by: [x, y] } => write!(
                f,
                "The picture lies {} to the {} and {} {} of where the table was learned, in cells: \
                 a border or a shift of the picture was added or left out.",
                words(*x),
                if *x < 0.0 { "left" } else { "right" },
                words(*y),
                if *y < 0.0 { "above" } else { "below" }
            ),
            Self::Scaled { by: [x, y] } => write!(
                f,
                "The picture has {:.0} % of the width and {:.0} % of the height in which the table \
                 was learned: player or projector scales it, or a border was added or left out.",
                100.0 * x,
                100.0 * y
            ),
        }
    }
}

fn words(cells: f64) -> String {
    format!("{:.2}", cells.abs())
}

/// A chain's fault is believed if it leaves at most this part of the misfit.
const EXPLAINED: f64 = 0.6;

/// Sizes that are tried: overscan, borders, and 4:3 in 16:9 and back.
const SCALES: [f64; 13] = [
    0.75, 0.8, 0.85, 0.9, 0.93, 0.96, 1.04, 1.08, 1.12, 1.18, 1.25, 1.33, 1.0,
];

/// Shifts that are tried, in cells, to each side.
const SHIFTS: [f64; 7] = [0.0, 0.2, 0.4, 0.7, 1.0, 1.6, 2.5];

/// Steps by which the one that fits best is improved: cells of a shift, twentieths of a size.
const REFINED: [f64; 3] = [0.2, 0.1, 0.05];

/// Places and sizes that fit one image best and are compared in all.
const FINALISTS: usize = 4;

/// From a place in the slide to one in the projector's picture, both in cells, row by row.
#[derive(Clone, Copy)]
struct Warp {
    scale: [f64; 2],
    shift: [f64; 2],
}

impl Warp {
    /// A plane of cells looked at from elsewhere; black beyond its edge.
    fn sampled(self, grid: Grid, plane: &[f64], back: bool) -> Vec<f64> {
        let sides = [grid.cols(), grid.rows()];
        let place = |cell: usize| {
            let own = [cell % grid.cols(), cell / grid.cols()];
            let mut place = [0.0; 2];
            for axis in 0..2 {
                let middle = (sides[axis] as f64 - 1.0) / 2.0;
                let off = own[axis] as f64 - middle;
                place[axis] = middle
                    + if back {
                        (off - self.shift[axis]) / self.scale[axis]
                    } else {
                        off * self.scale[axis] + self.shift[axis]
                    };
            }
            place
        };
        let value = |col: f64, row: f64| {
            let within = |place: f64, side: usize| place >= 0.0 && place < side as f64;
            let inside = within(col, sides[0]) && within(row, sides[1]);
            let at = row as usize * sides[0] + col as usize;
            inside
                .then(|| plane.get(at).copied())
                .flatten()
                .unwrap_or(0.0)
        };
        let between = |cell: usize| {
            let [col, row] = place(cell);
            let (left, top) = (col.floor(), row.floor());
            let (u, v) = (col - left, row - top);
            (1.0 - v) * ((1.0 - u) * value(left, top) + u * value(left + 1.0, top))
                + v * ((1.0 - u) * value(left, top + 1.0) + u * value(left + 1.0, top + 1.0))
        };
        (0..grid.cells()).map(between).collect()
    }

    fn planes(self, grid: Grid, planes: &CellPlanes, back: bool) -> CellPlanes {
        let planes = planes.iter();
        planes
            .map(|plane| self.sampled(grid, plane, back))
            .collect()
    }

    /// Those beside it, by a step of what it already does.
    fn around(self, step: f64) -> Vec<Self> {
        let moved = |axis: usize, by: f64| {
            let mut warp = self;
            if matches!(self.fault(), ChainFault::Shifted { .. }) {
                warp.shift[axis] += by;
            } else {
                warp.scale[axis] += by / 5.0;
            }
            warp
        };
        let both = |axis| [moved(axis, step), moved(axis, -step)];
        [both(0), both(1)].concat()
    }

    fn fault(self) -> ChainFault {
        if self.scale.iter().any(|scale| *scale < 0.0) {
            ChainFault::Mirrored
        } else if self.shift.iter().any(|shift| shift.abs() > 0.0) {
            ChainFault::Shifted { by: self.shift }
        } else {
            ChainFault::Scaled { by: self.scale }
        }
    }
}

/// What the chain did, if the photographs of the wanted images show it.
///
/// # Errors
/// [`VideoError`] if the table cannot compensate its own images.
pub(super) fn find(
    table: &Table<'_>,
    images: &[TestImage],
    readings: &Readings,
    expected: &mut Expected<'_, '_>,
    lit: &LiveCells,
) -> Result<Option<ChainFault>, VideoError> {
    let curves = ProjectorCurves::new(table);
    let compensator = Compensator::new(table, iltm_video::CompensateOptions::default())?;
    let grid = table.grid();
    // Mean over the first of the images.
    let mut misfit = |inputs: &[CellPlanes], warp: Option<Warp>| -> f64 {
        let shown = readings.shown.iter().zip(inputs);
        let error = |(shown, input): (&super::Shown, &CellPlanes)| {
            let light = match warp {
                None => expected.photograph(input),
                Some(warp) => expected.photograph_elsewhere(
                    input,
                    |planes| warp.planes(grid, planes, true),
                    |planes| warp.planes(grid, planes, false),
                ),
            };
            light.map_or(1.0, |light| lit.compare(&light, &shown.seen[1]).error)
        };
        shown.map(error).sum::<f64>() / inputs.len().max(1) as f64
    };
    let half = |half: usize| -> Vec<CellPlanes> {
        let shown = readings.shown.iter();
        shown.map(|shown| shown.input[half].clone()).collect()
    };
    let twice = readings.shown.iter().map(|shown| {
        let image = images.get(usize::from(shown.image));
        let Some(mut picture) = image.map(|image| image.compensated.clone()) else {
            return Ok(shown.input[1].clone());
        };
        compensator.picture(&mut picture)?;
        Ok(input(&picture, &curves))
    });
    let twice = twice.collect::<Result<Vec<CellPlanes>, VideoError>>()?;
    let right = half(1);
    let meant = misfit(&right, None);
    let mut best = (meant * EXPLAINED, None);
    let mut offer = |misfit: f64, fault: ChainFault| {
        if misfit < best.0 {
            best = (misfit, Some(fault));
        }
    };
    offer(misfit(&half(0), None), ChainFault::NotCompensated);
    offer(misfit(&twice, None), ChainFault::CompensatedTwice);
    let mut warps: Vec<Warp> = Vec::new();
    for mirrored in [[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
        warps.push(Warp {
            scale: mirrored,
            shift: [0.0; 2],
        });
    }
    for x in SCALES {
        for y in [x, 1.0] {
            warps.extend([[x, y], [y, x]].map(|scale| Warp {
                scale,
                shift: [0.0; 2],
            }));
        }
    }
    let both = || SHIFTS.iter().flat_map(|shift| [*shift, -*shift]);
    for x in both() {
        warps.extend(both().map(|y| Warp {
            scale: [1.0; 2],
            shift: [x, y],
        }));
    }
    warps.retain(|warp| {
        let moves = warp.shift.iter().any(|shift| shift.abs() > 0.0);
        moves || warp.scale.iter().any(|scale| (scale - 1.0).abs() > 0.0)
    });
    // Most are told apart by one image.
    let mut tried: Vec<(f64, Warp)> = (warps.into_iter())
        .map(|warp| (misfit(&right[..1.min(right.len())], Some(warp)), warp))
        .collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(mut nearest) = tried.first().copied() {
        for step in REFINED {
            let around = nearest.1.around(step);
            for warp in around {
                let left = misfit(&right[..1.min(right.len())], Some(warp));
                if left < nearest.0 {
                    nearest = (left, warp);
                }
            }
        }
        tried.insert(0, nearest);
    }
    for (_, warp) in tried.into_iter().take(FINALISTS) {
        offer(misfit(&right, Some(warp)), warp.fault());
    }
    Ok(best.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: [f64; 2] = [1.0; 2];

    /// A plane that rises by 10 from row to row and by 1 from column to column.
    fn rising(grid: Grid) -> Vec<f64> {
        let value = |cell: usize| (10 * (cell / grid.cols()) + cell % grid.cols()) as f64;
        (0..grid.cells()).map(value).collect()
    }

    #[test]
    fn a_shift_takes_each_value_from_as_far_and_black_from_beyond() {
        let grid = Grid::new(3, 4).unwrap();
        let shifted = |shift: [f64; 2]| {
            let warp = Warp {
                scale: PLAIN,
                shift,
            };
            warp.sampled(grid, &rising(grid), false)
        };
        let right = [
            1.0, 2.0, 3.0, 0.0, 11.0, 12.0, 13.0, 0.0, 21.0, 22.0, 23.0, 0.0,
        ];
        assert_eq!(shifted([1.0, 0.0]), right);
        let down = [
            10.0, 11.0, 12.0, 13.0, 20.0, 21.0, 22.0, 23.0, 0.0, 0.0, 0.0, 0.0,
        ];
        assert_eq!(shifted([0.0, 1.0]), down);
        // A quarter of the way to the next column and half of that to the next row.
        let between = shifted([0.25, 0.5])[5];
        assert!((between - (11.0 + 0.25 + 5.0)).abs() < 1e-12, "{between}");
    }

    #[test]
    fn a_scale_is_about_the_middle_and_back_undoes_it() {
        let grid = Grid::new(5, 7).unwrap();
        let warp = Warp {
            scale: [0.5, 0.5],
            shift: [0.0; 2],
        };
        let smaller = warp.sampled(grid, &rising(grid), false);
        for (cell, value) in smaller.iter().enumerate() {
            let (row, col) = ((cell / 7) as f64, (cell % 7) as f64);
            let wanted = 10.0 * (2.0 + 0.5 * (row - 2.0)) + 3.0 + 0.5 * (col - 3.0);
            assert!(
                (value - wanted).abs() < 1e-12,
                "{cell}: {value}, not {wanted}"
            );
        }
        let moved = Warp {
            scale: [0.9, 1.1],
            shift: [0.3, -0.2],
        };
        let there = moved.sampled(grid, &rising(grid), false);
        let back = moved.sampled(grid, &there, true);
        // The middle has neighbours on all sides.
        assert!((back[17] - 23.0).abs() < 1e-9, "{}", back[17]);
    }
}
