//! Coarser operator under the same gains: `K' = A K U`.
//!
//! `A` averages cells of the original grid over those of a coarser one, `U` interpolates
//! between their centres; both are the runtime's. A frame then takes the runtime's way
//! for frames larger than the grid, `p = g .* d - U K' A d`, with a gain for each cell of
//! the original grid.

use iltm_compile::FineGains;
use iltm_picture::Lattice;
use iltm_runtime::{FrameSize, Grid};
use iltm_solve::{ChannelInverse, Interreflection, InverseTransport};
use nalgebra::DMatrix;

/// The grid with one cell where there were `factor` along each side, rounded up; `None`
/// if that leaves a side of one cell, or the grid as it was.
pub(super) fn coarser(grid: Grid, factor: usize) -> Option<Grid> {
    let side = |side: usize| side.div_ceil(factor) as u16;
    let coarse = Grid::new(side(grid.rows()), side(grid.cols())).ok()?;
    (coarse != grid && coarse.rows() > 1 && coarse.cols() > 1).then_some(coarse)
}

/// The inverse on a coarser grid, and the original's gains. `None` if the grid is not
/// coarser.
pub(super) fn averaged(
    inverse: &InverseTransport,
    coarse: Grid,
) -> Option<(InverseTransport, FineGains)> {
    let size = FrameSize::of_grid(inverse.grid);
    let lattice = Lattice::new(coarse, size)?;
    let mean = |values: &[f64]| {
        let values: Vec<f32> = values.iter().map(|value| *value as f32).collect();
        lattice.average(&values)
    };
    let live: Vec<f64> = inverse
        .live
        .iter()
        .map(|live| f64::from(u8::from(*live)))
        .collect();
    let live_share = mean(&live);
    let channel = |channel: &ChannelInverse| ChannelInverse {
        gain: {
            let sums = mean(&channel.gain).into_iter().zip(&live_share);
            // Of the cells that have a gain.
            sums.map(|(sum, share)| if *share > 0.0 { sum / share } else { 0.0 })
                .collect()
        },
        scale: channel.scale,
        deviation: channel
            .deviation
            .as_ref()
            .map(|k| average_operator(k, &lattice)),
        ambient: mean(&channel.ambient),
    };
    let fine = FineGains {
        size,
        channels: inverse
            .channels
            .iter()
            .map(|channel| channel.gain.clone())
            .collect(),
    };
    let inverse = InverseTransport {
        grid: coarse,
        live: live_share.iter().map(|share| *share > 0.0).collect(),
        shared: average_operator(&inverse.shared, &lattice),
        channels: inverse.channels.iter().map(channel).collect(),
    };
    Some((inverse, fine))
}

/// `A K U`, coarse cells by coarse cells.
fn average_operator(operator: &Interreflection, lattice: &Lattice) -> Interreflection {
    /// Columns at a time.
    const COLUMNS: usize = 64;
    let (cells, pixels) = (lattice.cells(), operator.cells());
    let mut averaged = DMatrix::zeros(cells, cells);
    for first in (0..cells).step_by(COLUMNS) {
        let count = COLUMNS.min(cells - first);
        let mut spread = DMatrix::zeros(pixels, count);
        for (column, mut spread) in spread.column_iter_mut().enumerate() {
            let mut one = vec![0.0; cells];
            one[first + column] = 1.0;
            let expanded = lattice.expand(&one);
            spread.copy_from_slice(&expanded.into_iter().map(f64::from).collect::<Vec<_>>());
        }
        let received = operator * &spread;
        for (column, received) in received.column_iter().enumerate() {
            let received: Vec<f32> = received.iter().map(|light| *light as f32).collect();
            let means = lattice.average(&received);
            averaged.column_mut(first + column).copy_from_slice(&means);
        }
    }
    averaged.into()
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Small whole numbers are exact.
mod tests {
    use super::*;
    use crate::test_scene;

    fn inverse(rows: u16, cols: u16, value: impl Fn(usize, usize) -> f64) -> InverseTransport {
        let grid = Grid::new(rows, cols).unwrap();
        let mut inverse = test_scene::inverse(grid, 1, |cell, _| 1.0 + cell as f64, value);
        inverse.channels[0].ambient.fill(0.25);
        inverse
    }

    #[test]
    fn an_operator_that_is_the_same_everywhere_stays_so_with_as_much_light() {
        // Every cell receives 0.01 of every one of 4 x 6: of 2 x 3, four times that.
        let (averaged, fine) =
            averaged(&inverse(4, 6, |_, _| 0.01), Grid::new(2, 3).unwrap()).unwrap();
        let light = averaged.shared.dense().column_sum();
        assert!(light.iter().all(|light| (light - 0.24).abs() < 1e-6));
        assert_eq!(fine.size, FrameSize::new(6, 4).unwrap());
        assert_eq!(fine.channels[0][5], 6.0);
        assert!(
            averaged.channels[0]
                .ambient
                .iter()
                .all(|a| (a - 0.25).abs() < 1e-6)
        );
        // Cells 0, 1, 6 and 7 have gains 1, 2, 7 and 8.
        assert!((averaged.channels[0].gain[0] - 4.5).abs() < 1e-6);
    }

    #[test]
    fn averaging_is_the_mean_of_what_the_cells_of_a_coarse_one_receive() {
        let given = inverse(4, 4, |i, j| ((i * 7 + j * 3) % 11) as f64);
        let coarse = Grid::new(2, 2).unwrap();
        let (averaged, _) = averaged(&given, coarse).unwrap();
        let (given, averaged) = (given.shared.dense(), averaged.shared.dense());
        // By hand: centres at 0.5 and 2.5 cells of four, so the interpolation weights of
        // the first are 1, 3/4, 1/4 and 0.
        let along = [[1.0, 0.75, 0.25, 0.0], [0.0, 0.25, 0.75, 1.0]];
        for (row, col) in [(0, 0), (0, 3), (2, 1)] {
            let mut expected = 0.0;
            for i in [0, 1, 4, 5].map(|i| i + row / 2 * 8 + row % 2 * 2) {
                for j in 0..16 {
                    let weight = along[col / 2][j / 4] * along[col % 2][j % 4];
                    expected += given[(i, j)] * weight / 4.0;
                }
            }
            let found = averaged[(row, col)];
            assert!(
                (found - expected).abs() < 1e-5,
                "{row}, {col}: {found}, {expected}"
            );
        }
    }

    #[test]
    fn a_grid_that_would_have_one_cell_along_a_side_is_not_averaged() {
        assert_eq!(
            coarser(Grid::new(13, 21).unwrap(), 2),
            Grid::new(7, 11).ok()
        );
        assert_eq!(coarser(Grid::new(13, 21).unwrap(), 4), Grid::new(4, 6).ok());
        assert_eq!(coarser(Grid::new(2, 21).unwrap(), 2), None);
    }
}
