//! Inverse transports for tests.

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
        shared: DMatrix::from_fn(cells, cells, shared),
        channels: (0..channels).map(channel).collect(),
    }
}
