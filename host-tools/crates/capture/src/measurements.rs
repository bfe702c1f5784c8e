//! What the solver gets: projected patterns and what the camera saw of them,
//! cell by cell.

use super::{Devices, Diagnostics, NoiseModel, Registration, Role, Settings};
use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// Patterns and registered photographs of one scene.
///
/// `N` is the number of cells and `m` the number of views: patterns other than
/// black, whose photographs are already subtracted. The first view is always
/// white, then come the Gray code and the Bernoulli patterns.
#[derive(Clone, Debug)]
pub struct Measurements {
    /// Cells of the projector.
    pub grid: Grid,
    /// Projected light `L`, `N x m`, 0 or 1 (relative to the projector's white).
    pub patterns: DMatrix<f64>,
    /// Role of each column of `patterns`, length `m`; the first is
    /// [`Role::White`], none is [`Role::Black`].
    pub roles: Vec<Role>,
    /// Photographs averaged for each column of `patterns`, length `m`: more than
    /// one where a pattern was photographed again. A bracket counts as one.
    pub repeats: Vec<u32>,
    /// One entry (grey) or three (red, green, blue).
    pub channels: Vec<ChannelMeasurements>,
    /// Whether the cell was measured, length `N`; if not,
    /// [`Diagnostics::left_out`] says why and its observations are zero.
    pub live: Vec<bool>,
    /// Camera pixels kept for each cell, length `N`.
    pub pixels: Vec<u32>,
    /// Where each cell is in the photographs.
    pub registration: Registration,
    /// The flood photograph with black subtracted, one plane a channel, row by
    /// row, camera units: the size is [`Registration::camera`].
    pub flood: Vec<Vec<f32>>,
    /// The capture's `capture.toml`.
    pub settings: Settings,
    /// Projector and camera: what `capture.toml` says and what was measured.
    pub devices: Devices,
    /// What was left out and why, noise, linearity.
    pub diagnostics: Diagnostics,
}

impl Measurements {
    /// Column of the white pattern in [`Measurements::patterns`] and in every
    /// [`ChannelMeasurements::observations`].
    pub const WHITE: usize = 0;
}

/// One colour channel of [`Measurements`].
#[derive(Clone, Debug)]
pub struct ChannelMeasurements {
    /// Observed light `C`, `N x m`, in camera units (1 is the photograph's full
    /// scale, at the longest exposure if there are several), mean over the cell's pixels, ambient removed.
    pub observations: DMatrix<f64>,
    /// Observed light under black, length `N`, camera units.
    pub ambient: Vec<f64>,
    /// Standard deviation of one entry of `observations` in each cell under
    /// white, length `N`, camera units.
    pub noise: Vec<f64>,
    /// Noise of one camera pixel, for entries under other patterns: see
    /// [`ChannelMeasurements::deviation`].
    pub noise_model: NoiseModel,
}

impl ChannelMeasurements {
    /// Standard deviation, in camera units, of the observation of a cell in
    /// column `view`, when `pixels` camera pixels and `repeats` photographs were
    /// averaged for it. The subtracted ambient's own noise, which all columns
    /// share, is left out.
    #[must_use]
    pub fn deviation(&self, cell: usize, view: usize, pixels: u32, repeats: u32) -> f64 {
        let light = self.observations[(cell, view)] + self.ambient[cell];
        let averaged = f64::from(pixels.max(1)) * f64::from(repeats.max(1));
        (self.noise_model.variance(light) / averaged).sqrt()
    }
}
