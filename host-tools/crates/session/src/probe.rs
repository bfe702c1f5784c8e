//! A few lit cells, far from each other: how far the projector's light spreads.

use iltm_runtime::Grid;

/// Cells from one lit cell to the next. A blur that makes a solve worthwhile is at
/// most a cell or two, and its light is gone after three times that.
const PITCH: usize = 8;

/// Cells of each probe picture, `true` where lit: four pictures whose lit cells lie
/// between each other's, fewer on a grid too small for that. Every lit cell has
/// neighbours on all sides if the grid has room for it.
pub(super) fn probes(grid: Grid) -> Vec<Vec<bool>> {
    let half = PITCH / 2;
    let mut probes: Vec<Vec<bool>> = Vec::new();
    for (down, right) in [(0, 0), (half, half), (0, half), (half, 0)] {
        let rows = lit_lines(grid.rows(), down);
        let cols = lit_lines(grid.cols(), right);
        let lit: Vec<bool> = (0..grid.cells())
            .map(|cell| {
                rows.contains(&(cell / grid.cols())) && cols.contains(&(cell % grid.cols()))
            })
            .collect();
        if !probes.contains(&lit) {
            probes.push(lit);
        }
    }
    probes
}

/// Rows or columns that are lit, of `count`: every [`PITCH`]th, as far from both
/// ends as can be, moved on by `shift`.
fn lit_lines(count: usize, shift: usize) -> Vec<usize> {
    let first = count.saturating_sub(1) % PITCH / 2;
    let lines: Vec<usize> = (first + shift..count)
        .step_by(PITCH)
        // Moved to the very edge, a cell would lack neighbours.
        .filter(|line| count < 3 || (1..count - 1).contains(line))
        .collect();
    if lines.is_empty() {
        return vec![count / 2];
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lit_cells_are_a_pitch_apart_and_not_at_an_edge() {
        for (rows, cols) in [(13, 21), (3, 3), (5, 40), (16, 24), (64, 64), (9, 9)] {
            let grid = Grid::new(rows, cols).unwrap();
            let probes = probes(grid);
            assert!(!probes.is_empty());
            for lit in &probes {
                let cells: Vec<(usize, usize)> = (0..grid.cells())
                    .filter(|cell| lit[*cell])
                    .map(|cell| (cell / grid.cols(), cell % grid.cols()))
                    .collect();
                assert!(!cells.is_empty());
                for (at, a) in cells.iter().enumerate() {
                    assert!((1..grid.rows() - 1).contains(&a.0), "{a:?} of {grid}");
                    assert!((1..grid.cols() - 1).contains(&a.1), "{a:?} of {grid}");
                    for b in &cells[at + 1..] {
                        let apart = a.0.abs_diff(b.0).max(a.1.abs_diff(b.1));
                        assert!(apart >= PITCH, "{a:?} and {b:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_grid_has_a_probe_and_a_large_one_has_four_different_ones() {
        for rows in 1..4 {
            for cols in 1..4 {
                let probes = probes(Grid::new(rows, cols).unwrap());
                assert!(probes.iter().all(|lit| lit.contains(&true)));
            }
        }
        assert_eq!(probes(Grid::new(13, 21).unwrap()).len(), 4);
    }
}
