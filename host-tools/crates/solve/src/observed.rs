//! What a solve looks at: the part of [`Measurements`] that light made, without
//! where in the camera it was seen.

use iltm_capture::{ChannelMeasurements, Measurements, Role};
use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// Patterns and the light that cells gave back, borrowed from wherever they are:
/// from photographs ([`Observed::from`] a [`Measurements`]) or from a simulation.
///
/// `N` is the number of cells, `m` that of patterns other than black.
#[derive(Clone, Debug)]
pub struct Observed<'a> {
    /// Cells of the projector.
    pub grid: Grid,
    /// Role of each pattern, length `m`, none [`Role::Black`].
    pub roles: &'a [Role],
    /// Whether the cell was measured, length `N`.
    pub live: &'a [bool],
    /// One entry (grey) or three (red, green, blue).
    pub channels: Vec<ObservedChannel<'a>>,
    /// Standard deviation of the projector's blur in cells; 0 for none.
    pub blur: f64,
}

/// One colour channel of [`Observed`].
#[derive(Clone, Debug)]
pub struct ObservedChannel<'a> {
    /// Projected light `L` of the channel, `N x m`, relative to the projector's white.
    pub patterns: &'a DMatrix<f64>,
    /// Light of each cell `C`, `N x m`, camera units, ambient removed.
    pub light: &'a DMatrix<f64>,
    /// Light under black, length `N`, camera units.
    pub ambient: &'a [f64],
    /// Standard deviation of an element of `light`, by cell.
    pub noise: Vec<CellNoise>,
}

/// Noise of one cell's observations, camera units: light brings its own noise.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CellNoise {
    /// Root mean square over the patterns that light the cell.
    pub lit: f64,
    /// Root mean square over those that do not.
    pub unlit: f64,
}

impl<'a> From<&'a Measurements> for Observed<'a> {
    fn from(measurements: &'a Measurements) -> Self {
        let channels = measurements.channels.iter();
        Self {
            grid: measurements.grid,
            roles: &measurements.roles,
            live: &measurements.live,
            channels: channels
                .map(|channel| ObservedChannel {
                    patterns: &channel.patterns,
                    light: &channel.observations,
                    ambient: &channel.ambient,
                    noise: (0..measurements.grid.cells())
                        .map(|cell| cell_noise(measurements, channel, cell))
                        .collect(),
                })
                .collect(),
            blur: measurements.devices.blur,
        }
    }
}

fn cell_noise(
    measurements: &Measurements,
    channel: &ChannelMeasurements,
    cell: usize,
) -> CellNoise {
    let (mut sums, mut counts) = ([0.0; 2], [0_u32; 2]);
    for (view, repeats) in measurements.repeats.iter().enumerate() {
        let lit = usize::from(is_lit(&channel.patterns, cell, view));
        let deviation = channel.deviation(cell, view, measurements.pixels[cell], *repeats);
        sums[lit] += deviation * deviation;
        counts[lit] += 1;
    }
    let [unlit, lit] = [0, 1].map(|k| (sums[k] / f64::from(counts[k].max(1))).sqrt());
    CellNoise { lit, unlit }
}

/// Whether a pattern lights a cell, or a picture more than half.
fn is_lit(patterns: &DMatrix<f64>, cell: usize, view: usize) -> bool {
    patterns[(cell, view)] > 0.5
}
