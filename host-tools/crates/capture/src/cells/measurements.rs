//! Measurements: what the solver gets, projected patterns and what the camera saw of
//! them, cell by cell.

use super::cell_pixels::LeftOut;
use super::even_light::EvenLight;
use super::noise::{NoiseModel, NoiseSource};
use super::pixel_light::PixelLight;
use crate::devices::Devices;
use crate::format::picture_file::FileFormat;
use crate::format::role::Role;
use crate::format::settings::Settings;
use crate::gate::Gate;
use crate::registration::cell_map::Registration;
use crate::registration::projector_map::{MapError, ProjectorMap};
use crate::registration::{PixelCount, RegistrationMethod};
use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// Patterns and registered photographs of one scene.
///
/// `N` is the number of cells and `m` the number of views: patterns other than
/// black, whose photographs are already subtracted. The first view is always
/// white, then come the Gray code, the Bernoulli patterns and the images.
#[derive(Clone, Debug)]
pub struct Measurements {
    /// Cells of the projector.
    pub grid: Grid,
    /// Role of each view, length `m`; the first is
    /// [`Role::White`], none is [`Role::Black`].
    pub roles: Vec<Role>,
    /// Photographs averaged for each view, length `m`: more than
    /// one where a pattern was photographed again. A bracket counts as one.
    pub repeats: Vec<u32>,
    /// One entry (grey) or three (red, green, blue).
    pub channels: Vec<ChannelMeasurements>,
    /// Whether the cell was measured, length `N`; if not,
    /// [`Diagnostics::left_out`] says why and its observations are zero.
    pub live: Vec<bool>,
    /// Camera pixels kept for each cell, length `N`.
    pub pixels: Vec<u32>,
    /// Light of some camera pixels in each view.
    pub pixel_light: PixelLight,
    /// Where each cell is in the photographs.
    pub registration: Registration,
    /// White's light with black subtracted, one plane a channel, row by row, camera units: the
    /// size is [`Registration::camera`]. The mean of the photographs of white, and of the sums of
    /// patterns with their inverses.
    pub flood: Vec<Vec<f32>>,
    /// How many photographs of white `flood` is as good as.
    pub flood_photographs: usize,
    /// The same for an even light; `None` without a projector map.
    pub even: Option<EvenLight>,
    /// The projector map of stripes finer than the cells, or why they give none; `None` without
    /// any.
    pub map: Option<Result<ProjectorMap, MapError>>,
    /// The capture's `capture.toml`.
    pub settings: Settings,
    /// Projector and camera: what `capture.toml` says and what was measured.
    pub devices: Devices,
    /// What was left out and why, noise, linearity.
    pub diagnostics: Diagnostics,
}

impl Measurements {
    /// Column of the white pattern in every [`ChannelMeasurements::patterns`] and
    /// [`ChannelMeasurements::observations`].
    pub const WHITE: usize = 0;

    /// Light of each cell under white in one channel, length `N`; of several projectors, under white
    /// of all together.
    #[must_use]
    pub fn white(&self, channel: usize) -> Vec<f64> {
        let observations = &self.channels[channel].observations;
        let views = self.roles.iter().enumerate();
        let whites = views.filter(|(_, role)| **role == Role::White);
        let mut sum = vec![0.0; observations.nrows()];
        for (view, _) in whites {
            let light = observations.column(view);
            sum.iter_mut()
                .zip(&light)
                .for_each(|(sum, light)| *sum += light);
        }
        sum
    }
}

/// One colour channel of [`Measurements`].
#[derive(Clone, Debug)]
pub struct ChannelMeasurements {
    /// Projected light `L`, `N x m`, relative to the projector's white: 0 or 1, but for images.
    pub patterns: DMatrix<f64>,
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

/// What was used, what was left out and why.
#[derive(Clone, PartialEq, Debug)]
pub struct Diagnostics {
    /// What the photographs' files are.
    pub file: FileFormat,
    /// Bits of a sample in them, 32 for floating point.
    pub bits: u8,
    /// Photographs used, of every role.
    pub photographs: usize,
    /// Photographs of images used.
    pub images: usize,
    /// Bernoulli photographs used.
    pub bernoulli: usize,
    /// Bernoulli photographs in the capture.
    pub bernoulli_taken: usize,
    /// How camera pixels were given to cells.
    pub method: RegistrationMethod,
    /// Camera pixels by what became of them.
    pub pixels: PixelCount,
    /// Cells that were not measured, in order.
    pub left_out: Vec<LeftOut>,
    /// 95th percentile of the flood photograph in the brightest channel, of full
    /// scale: about 0.8 is a good exposure.
    pub exposure: f64,
    /// Where the noise estimate comes from.
    pub noise: NoiseSource,
    /// How far patterns and their inverses together exceed white and black
    /// together, relative to white, signed, median over the pairs; `None`
    /// without inverses. A linear camera has 0; automatic exposure or an
    /// undeclared response shows here.
    pub superposition: Option<f64>,
    /// What the gates said; those that fail were ignored on purpose.
    pub gates: Vec<Gate>,
}
