//! Calibration pictures: ramps of even light, which show how projector and camera respond,
//! and probes of a few lit cells, which show how far the projector's light spreads.

use iltm_capture::{CalibrationRole, RampChannel};
use iltm_picture::{Picture, Samples};
use iltm_runtime::{FrameSize, Grid};

/// Input values that a ramp of `levels` levels has, as far apart as can be: first
/// 0, last 255.
///
/// ```
/// # use iltm_session::ramp_levels;
/// assert_eq!(ramp_levels(5), [0, 64, 128, 191, 255]);
/// ```
#[must_use]
pub fn ramp_levels(levels: u16) -> Vec<u8> {
    let last = f64::from(levels.max(2) - 1);
    let mut values: Vec<u8> = (0..levels)
        .map(|step| (255.0 * f64::from(step) / last).round() as u8)
        .collect();
    values.dedup();
    values
}

/// All roles of the ramps: white first, then each channel alone, dark to bright.
/// Black is shown once, as the first level of white.
pub(super) fn ramp_roles(levels: u16) -> Vec<CalibrationRole> {
    let levels = ramp_levels(levels);
    let of_channel = |channel: RampChannel| {
        let shown = levels.iter().copied();
        shown
            .filter(move |level| *level > 0 || channel == RampChannel::White)
            .map(move |level| CalibrationRole::Ramp { channel, level })
    };
    RampChannel::ALL.into_iter().flat_map(of_channel).collect()
}

/// One pixel a cell, all of `input`; grey where its channels are alike.
pub(super) fn even(grid: Grid, input: [u8; 3]) -> Option<Picture> {
    let [red, green, blue] = input;
    let samples = if red == green && green == blue {
        vec![red; grid.cells()]
    } else {
        input.repeat(grid.cells())
    };
    Picture::new(FrameSize::of_grid(grid), Samples::Eight(samples))
}

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
    fn levels_rise_from_black_to_white_without_repetition() {
        for levels in 2..=400 {
            let values = ramp_levels(levels);
            assert_eq!((values[0], values[values.len() - 1]), (0, 255));
            assert!(values.windows(2).all(|pair| pair[0] < pair[1]), "{levels}");
            assert_eq!(values.len(), usize::from(levels.min(256)));
        }
        assert!(ramp_levels(0).is_empty());
    }

    #[test]
    fn black_is_shown_once_and_each_channel_reaches_full() {
        let roles = ramp_roles(9);
        assert_eq!(roles.len(), 9 + 3 * 8);
        let ramp = |channel, level| CalibrationRole::Ramp { channel, level };
        for channel in RampChannel::ALL {
            assert!(roles.contains(&ramp(channel, 255)));
            assert_eq!(
                roles.contains(&ramp(channel, 0)),
                channel == RampChannel::White
            );
        }
    }

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
