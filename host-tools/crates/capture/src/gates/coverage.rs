//! Gate `coverage`: which cells the camera sees.

use crate::cells::cell_pixels::{LeftOut, Why};
use crate::format::sequence::Sequence;
use crate::gate::{Evidence, Gate, GateName, Verdict};
use iltm_runtime::Grid;

/// Share of the cells that must be found.
const LEAST: f64 = 0.1;

/// Share of missing cells from which it is worth a word.
const WARN: f64 = 0.1;

/// Judges the cells that were found, each of which stands for 2^`sequence.coarser` columns and
/// rows of the patterns.
pub(super) fn judge(
    sequence: &Sequence,
    live: &[bool],
    pixels: &[u32],
    left_out: &[LeftOut],
) -> Gate {
    let grid = sequence.grid;
    let cells = grid.cells();
    let found = live.iter().filter(|live| **live).count();
    let missing = (cells - found) as f64 / cells as f64;
    let unseen: Vec<usize> = (left_out.iter())
        .filter(|out| matches!(out.why, Why::TooFewPixels { .. }))
        .map(|out| out.cell)
        .collect();
    let mut verdict = Verdict::of(missing, WARN, 1.0 - LEAST);
    if found == 0 {
        verdict = Verdict::Fail;
    }
    let what = match (verdict, unseen.is_empty()) {
        (Verdict::Fail, _) => {
            format!("only {found} of {cells} cells were found in the photographs")
        }
        (_, true) => format!("{found} of {cells} cells were found"),
        (_, false) => format!(
            "{found} of {cells} cells were found; the camera does not see the others alone: {}",
            region(grid, &unseen)
        ),
    };
    let what = match sequence.coarser {
        0 => what,
        steps => format!(
            "{what} ({} x {} blocks of {side} x {side} pixels: finer stripes are left out, a \
             table has at most {} cells)",
            grid.rows(),
            grid.cols(),
            Grid::MAX_CELLS,
            side = 1_u32 << steps,
        ),
    };
    let value = |cell: usize| {
        if live[cell] {
            f64::from(pixels[cell])
        } else {
            f64::NAN
        }
    };
    let next_step = match verdict {
        Verdict::Fail => {
            "Check that the camera sees the projection, that nothing moved, and that the \
             photographs belong to the patterns of their lines."
        }
        _ => {
            "Check that the whole projection is in the camera's view and in focus; what it \
             cannot see is left dark."
        }
    };
    let values = (0..cells).map(value).collect();
    Gate {
        what,
        evidence: Evidence::cells("camera pixels used for each cell", grid, values, 0.0),
        ..Gate::of_share(
            GateName::Coverage,
            verdict,
            (missing, 1.0 - LEAST),
            next_step,
        )
    }
}

/// Where most of some cells lie, in words.
fn region(grid: Grid, cells: &[usize]) -> String {
    let (rows, cols) = (grid.rows(), grid.cols());
    let thirds = |at: usize, of: usize| (3 * at / of.max(1)).min(2);
    let mut counts = [[0_usize; 3]; 3];
    for &cell in cells {
        counts[thirds(cell / cols, rows)][thirds(cell % cols, cols)] += 1;
    }
    let names = [
        ["top left", "top", "top right"],
        ["left", "middle", "right"],
        ["bottom left", "bottom", "bottom right"],
    ];
    let mut parts: Vec<(usize, &str)> = (0..9)
        .map(|k| (counts[k / 3][k % 3], names[k / 3][k % 3]))
        .filter(|(count, _)| *count > 0)
        .collect();
    parts.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    let named: Vec<String> = parts
        .iter()
        .map(|(count, name)| format!("{count} {name}"))
        .collect();
    named.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_corner_is_named() {
        let grid = Grid::new(9, 9).unwrap();
        assert_eq!(region(grid, &[78, 79, 80, 71, 4]), "4 bottom right, 1 top");
    }
}
