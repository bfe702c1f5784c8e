//! Cost model: frames of many shapes on the reference board, which it is compared with.
//!
//! Tables are made up as in [`stages`](crate::stages): what a frame takes depends on
//! grid, channels, ambient light, size of the frame and numbers of pairs in the rows,
//! and on nothing else but clipped samples. `docs/costs.csv` holds the counts, and a
//! test compares the model (`iltm::compile::cost`) with every one of them.

use crate::instructions::{Case, Count};
use crate::made_up::{MadeUp, pairs};
use iltm::compile::image::StoredRow;
use iltm_runtime::{FrameSize, Grid};
use std::fmt::Write as _;

/// See [`SHAPES`].
type Shape = (u16, u16, usize, bool, usize, u16, u16);

/// Rows, columns, channels, whether there is ambient light, pairs of a row, width and
/// height of the frames (0: the grid's).
const SHAPES: [Shape; 33] = [
    (8, 8, 1, false, 2, 0, 0),
    (8, 8, 3, true, 2, 0, 0),
    (13, 21, 1, false, 3, 0, 0),
    (13, 21, 1, true, 3, 0, 0),
    (13, 21, 3, true, 3, 0, 0),
    (16, 24, 1, true, 5, 0, 0),
    (16, 24, 3, false, 5, 0, 0),
    (17, 17, 1, true, 8, 0, 0),
    (20, 12, 3, true, 1, 0, 0),
    (7, 50, 1, false, 4, 0, 0),
    (24, 40, 1, true, 6, 0, 0),
    (24, 40, 3, true, 6, 0, 0),
    (27, 48, 3, true, 7, 0, 0),
    (30, 30, 1, true, 12, 0, 0),
    (31, 33, 3, false, 12, 0, 0),
    (32, 32, 1, false, 20, 0, 0),
    (32, 32, 3, true, 20, 0, 0),
    (45, 80, 1, true, 4, 0, 0),
    (45, 80, 3, true, 4, 0, 0),
    (48, 64, 1, false, 2, 0, 0),
    (64, 64, 3, true, 1, 0, 0),
    (63, 95, 3, true, 4, 0, 0),
    (13, 21, 1, true, 3, 64, 40),
    (13, 21, 3, true, 3, 128, 96),
    (7, 11, 1, false, 3, 21, 13),
    (16, 24, 1, true, 5, 160, 120),
    (16, 24, 3, false, 5, 320, 240),
    (32, 32, 1, false, 4, 256, 256),
    (32, 32, 1, true, 4, 256, 256),
    (32, 32, 3, true, 4, 256, 256),
    (27, 48, 3, true, 7, 320, 180),
    (24, 40, 1, true, 6, 320, 200),
    (45, 80, 3, false, 4, 160, 90),
];

/// The same without a size, and rows and columns of the neighbours' cells.
type SplitShape = (u16, u16, usize, bool, usize, u16, u16);

/// Tables of one of several projectors. The light of the neighbours' cells is bytes of the frame, of which
/// there are enough.
const SPLIT: [SplitShape; 7] = [
    (8, 8, 1, false, 2, 4, 4),
    (16, 24, 1, true, 5, 8, 12),
    (16, 24, 3, false, 5, 8, 24),
    (13, 21, 3, true, 3, 7, 18),
    (24, 40, 1, false, 6, 9, 42),
    (32, 32, 3, true, 4, 16, 32),
    (48, 64, 3, true, 2, 12, 32),
];

/// The cases of the list.
pub fn cases() -> Vec<Case> {
    let case = |&(rows, cols, channels, ambient, pairs, width, height): &Shape| {
        let table = made(rows, cols, channels, ambient, pairs);
        let size = FrameSize::new(width, height).unwrap_or(FrameSize::of_grid(table.grid));
        let (colour, light) = (
            if channels == 3 { "colour" } else { "grey" },
            if ambient { "ambient" } else { "dark" },
        );
        Case {
            name: format!("{size} over {rows}x{cols} {colour} {light} {pairs}"),
            image: table.image(),
            size,
        }
    };
    let split = |&(rows, cols, channels, ambient, pairs, down, across): &SplitShape| {
        let others = crate::grid(down, across);
        let case = case(&(rows, cols, channels, ambient, pairs, 0, 0));
        let table = made(rows, cols, channels, ambient, pairs);
        Case {
            name: format!("{} and {down}x{across} of neighbours", case.name),
            image: table.with_neighbours(others, [1, 1], 5).image(),
            ..case
        }
    };
    let all = SHAPES.iter().map(case);
    all.chain(SPLIT.iter().map(split)).collect()
}

fn made(rows: u16, cols: u16, channels: usize, ambient: bool, pairs: usize) -> MadeUp {
    let grid = crate::grid(rows, cols);
    let mut table = MadeUp::nearly_plain(grid, channels, ambient);
    table.response = true;
    table.tiers = vec![self::rows(grid, pairs)];
    table
}

/// Three of four rows, each with so many pairs at places of their own, two more or two
/// fewer.
fn rows(grid: Grid, count: usize) -> Vec<StoredRow> {
    let mut random = fastrand::Rng::with_seed(0xC057);
    let cells = grid.cells() as u16;
    let row = |index| {
        let count = (count + random.usize(..5)).saturating_sub(2).max(1);
        StoredRow {
            index,
            shift: 9,
            entries: pairs(&mut random, cells, count.min(usize::from(cells) / 4)),
        }
    };
    let rows = (0..cells).filter(|index| index % 4 != 1);
    rows.map(row).collect()
}

/// The list as `docs/costs.csv` holds it.
pub fn csv(counts: &[Count]) -> String {
    let mut text = String::from("frame,tier,first,operator,last\n");
    for count in counts {
        let [first, operator, last] = count.stages;
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "{},{},{first},{operator},{last}",
            count.case, count.tier
        );
    }
    text
}
