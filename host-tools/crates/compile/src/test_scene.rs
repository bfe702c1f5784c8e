//! Inverse transports for tests, also for those of the crates that build on this one.

use iltm_runtime::Grid;
use iltm_solve::{ChannelInverse, InverseTransport};
use nalgebra::DMatrix;

/// An inverse without ambient light from its gains, by cell and channel, and the operator
/// that its channels share, by row and column.
pub(crate) fn inverse(
    grid: Grid,
    channels: usize,
    gain: impl Fn(usize, usize) -> f64,
    shared: impl Fn(usize, usize) -> f64,
) -> InverseTransport {
    let cells = grid.cells();
    let channel = |channel: usize| ChannelInverse {
        gain: (0..cells).map(|cell| gain(cell, channel)).collect(),
        scale: 1.0,
        deviation: None,
        ambient: vec![0.0; cells],
    };
    InverseTransport {
        grid,
        live: vec![true; cells],
        shared: DMatrix::from_fn(cells, cells, shared).into(),
        channels: (0..channels).map(channel).collect(),
    }
}

/// A textured scene whose cells light each other the more the nearer they are.
pub(crate) fn scene(channels: usize) -> InverseTransport {
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
    let mut inverse = inverse(Grid::new(5, 8).unwrap(), channels, texture, kernel);
    for (index, channel) in inverse.channels.iter_mut().enumerate() {
        channel.scale = 1.0 - 0.2 * index as f64;
        channel.ambient.fill(0.004);
    }
    inverse
}
