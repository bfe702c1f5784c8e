//! A small scene for tests: textured cells that light each other.

use iltm_runtime::Grid;
use iltm_solve::{ChannelInverse, InverseTransport};
use nalgebra::DMatrix;

/// A textured scene whose cells light each other the more the nearer they are.
pub(crate) fn scene(channels: usize) -> InverseTransport {
    let grid = Grid::new(5, 8).unwrap();
    let cells = grid.cells();
    let kernel = |i: usize, j: usize| {
        let rows = (i / 8).abs_diff(j / 8) as f64;
        let cols = (i % 8).abs_diff(j % 8) as f64;
        if i == j {
            0.0
        } else {
            0.25 / (1.0 + rows * rows + cols * cols)
        }
    };
    let texture = |cell: usize, channel: usize| 6.0 + 2.0 * ((cell * (channel + 3)) as f64).sin();
    let channel = |channel: usize| ChannelInverse {
        gain: (0..cells).map(|cell| texture(cell, channel)).collect(),
        scale: 1.0 - 0.2 * channel as f64,
        deviation: None,
        ambient: vec![0.004; cells],
    };
    InverseTransport {
        grid,
        live: vec![true; cells],
        shared: DMatrix::from_fn(cells, cells, kernel),
        channels: (0..channels).map(channel).collect(),
    }
}
