//! From a folder of photographs to [`Measurements`].
//!
//! ```text
//! capture.csv, capture.toml -> manifest, settings     which pattern each photograph shows
//! patterns/*.png            -> sequence               checked against their roles and each other
//! photos/*.png              -> photographs            linear light, bounded memory
//!                              gray_code              first guess of each camera pixel's cell
//!                              registration           better cells, by
//!                              regression             fitting each pixel's series
//!                              sharing                pixels that see two cells are left out
//!                              measure                one observation a cell and pattern, noise
//!                              place                  where between the cells a pixel lies
//!                              fine_flood             the flood photograph on a finer grid
//!                              shot_light             one photograph to look at
//! calibration.csv           -> calibration            what measures the devices
//! reference_T.npy           -> reference              the transport itself, where it is known
//! ```
//!
//! A capture may come from a stranger: paths stay inside the folder, sizes are
//! checked before memory is taken, and whatever is wrong is a [`CaptureError`]
//! with its place.

mod calibration;
mod diagnostics;
mod error;
mod exposed;
mod fine_flood;
mod gray_code;
mod manifest;
mod measure;
mod measurements;
mod noise;
mod noise_samples;
mod pattern;
mod photo;
mod photographs;
mod picture;
mod place;
mod reference;
#[cfg(test)]
mod refusal_tests;
mod registration;
mod regression;
mod response;
mod role;
mod sequence;
mod settings;
mod sharing;
mod shot_light;
mod shown;
#[cfg(test)]
mod test_capture;
#[cfg(test)]
mod tests;

pub use calibration::{
    CALIBRATION_FILE, CalibrationManifest, CalibrationRole, CalibrationShot, RampChannel,
};
pub use diagnostics::{Diagnostics, LeftOut, Why};
pub use error::CaptureError;
pub use exposed::Exposed;
pub use fine_flood::FineFlood;
pub use manifest::{ListedRole, MANIFEST_FILE, Manifest, ManifestOf, Shot, ShotOf};
pub use measurements::{ChannelMeasurements, Measurements};
pub use noise::{NoiseModel, NoiseSource};
pub use pattern::Pattern;
pub use reference::{REFERENCE_FILE, ReferenceError, parse_reference, read_reference};
pub use registration::{MIN_REGRESSION, NO_CELL, PixelCount, Registration, RegistrationMethod};
pub use response::Response;
pub use role::Role;
pub use sequence::{Axis, MIN_BERNOULLI};
pub use settings::{CameraSettings, ProjectorSettings, SETTINGS_FILE, SceneSettings, Settings};
pub use shot_light::ShotLight;
pub use shown::{columns, shown};

use crate::progress::Progress;
use measure::CellPixels;
use nalgebra::DMatrix;
use photographs::Photographs;
use sequence::Sequence;
use std::path::Path;

/// How to read a capture.
#[derive(Clone, PartialEq, Debug)]
pub struct CaptureOptions {
    /// Use only this many Bernoulli photographs, the first ones, beside all
    /// others; `None` for all.
    pub bernoulli: Option<usize>,
    /// Fewer Bernoulli photographs than this are refused.
    pub min_bernoulli: usize,
    /// Largest magnitude of [`Diagnostics::superposition`] that is accepted. On
    /// real rigs a linear camera stays below 0.02 and camera JPEGs taken for
    /// linear are off by 0.14 to 0.24.
    pub max_superposition: f64,
}

impl Default for CaptureOptions {
    fn default() -> Self {
        Self {
            bernoulli: None,
            min_bernoulli: MIN_BERNOULLI,
            max_superposition: 0.08,
        }
    }
}

/// Share of the lit pixels that may be saturated before the capture is refused
/// without looking for cells.
const SATURATED_LIT: f64 = 0.1;

/// Reads a capture folder and measures every cell under every pattern.
///
/// # Errors
/// A [`CaptureError`] for whatever is missing, contradictory or unusable. Files
/// are checked in this order: `capture.csv`, `capture.toml`, patterns,
/// photographs.
pub fn read(
    folder: &Path,
    options: &CaptureOptions,
    progress: &dyn Progress,
) -> Result<Measurements, CaptureError> {
    let manifest_path = folder.join(MANIFEST_FILE);
    let manifest = Manifest::read(folder)?;
    let settings = Settings::read(folder)?;
    let sequence = Sequence::read(folder, &manifest.shots, options)?;
    let mut photographs = Photographs::new(folder, &sequence.shots, settings.camera.response)?;
    let white = &sequence.white().shots;
    let white_path = photographs.path(white[0]);

    photographs.prefetch(progress)?;
    let count = |shots: usize| shots as u64;
    let coded: usize = sequence.views[sequence.coded()]
        .iter()
        .map(|v| v.shots.len())
        .sum();
    progress.begin(
        "decoding the Gray code",
        count(white.len() + sequence.black.len() + coded),
    );
    let (mut flood, saturated) = photographs.mean(white, progress)?;
    let (black, _) = photographs.mean(&sequence.black, progress)?;
    check_exposure(&flood, &black, &saturated, &white_path)?;
    let gray = gray_code::decode(&sequence, &mut photographs, &flood, &black, progress)?;
    progress.end();

    progress.begin(
        "registering camera pixels",
        count(sequence.bernoulli().len()),
    );
    let registered = registration::register(&sequence, &mut photographs, &gray, progress)?;
    progress.end();

    let cells = CellPixels::choose(
        &registered.registration,
        &saturated,
        &manifest_path,
        &white_path,
    )?;
    progress.begin(
        "measuring cells",
        count(sequence.shots.len() - sequence.black.len()),
    );
    let observed = measure::observe(&sequence, &mut photographs, &cells, &black, progress)?;
    progress.end();

    let superposition = measure::superposition(&sequence, &observed.channels);
    if let Some(excess) = superposition.filter(|e| e.abs() > options.max_superposition) {
        return Err(CaptureError::NotLinear {
            path: manifest_path,
            percent: 100.0 * excess,
            limit: 100.0 * options.max_superposition,
        });
    }
    for (flood, black) in flood.iter_mut().zip(&black) {
        for (flood, black) in flood.iter_mut().zip(black) {
            *flood -= black;
        }
    }
    let is_bernoulli = |shot: &&Shot| shot.role == Role::Bernoulli;
    let diagnostics = Diagnostics {
        photographs: sequence.shots.len(),
        bernoulli: sequence.bernoulli().len(),
        bernoulli_taken: manifest.shots.iter().filter(is_bernoulli).count(),
        method: registered.method,
        pixels: registered.count,
        exposure: exposure(&observed.channels, &cells.live),
        noise: observed.noise,
        superposition,
        left_out: cells.left_out.clone(),
    };
    let views = &sequence.views;
    Ok(Measurements {
        grid: sequence.grid,
        patterns: DMatrix::from_fn(sequence.grid.cells(), views.len(), |cell, view| {
            f64::from(views[view].lit[cell])
        }),
        roles: views.iter().map(|view| view.role).collect(),
        repeats: views.iter().map(|view| view.shots.len() as u32).collect(),
        channels: observed.channels,
        pixels: cells.counts(),
        live: cells.live,
        registration: registered.registration,
        flood,
        settings,
        diagnostics,
    })
}

/// Refuses a flood photograph so overexposed that cells could not be told apart.
fn check_exposure(
    flood: &[Vec<f32>],
    black: &[Vec<f32>],
    saturated: &[bool],
    path: &Path,
) -> Result<(), CaptureError> {
    let (flood, black) = (gray_code::channel_sum(flood), gray_code::channel_sum(black));
    let light: Vec<f32> = flood.iter().zip(&black).map(|(f, b)| f - b).collect();
    let least = 0.05 * gray_code::percentile(&light, 0.95);
    // A lamp in view is saturated under black too and says nothing about white.
    let lit = || {
        light
            .iter()
            .zip(saturated)
            .filter(|&(&light, _)| light > least)
    };
    let (seen, clipped) = (lit().count(), lit().filter(|&(_, &s)| s).count());
    if clipped as f64 > SATURATED_LIT * seen as f64 {
        return Err(CaptureError::Overexposed {
            path: path.to_owned(),
            saturated: clipped,
            seen,
            of: "lit pixels",
        });
    }
    Ok(())
}

/// 95th percentile of the flood light over the live cells, in the brightest
/// channel, ambient included.
fn exposure(channels: &[ChannelMeasurements], live: &[bool]) -> f64 {
    let of_channel = |channel: &ChannelMeasurements| {
        let flood = channel.observations.column(Measurements::WHITE);
        let light: Vec<f32> = (flood.iter().zip(&channel.ambient).zip(live))
            .filter(|(_, live)| **live)
            .map(|((flood, ambient), _)| (flood + ambient) as f32)
            .collect();
        f64::from(gray_code::percentile(&light, 0.95))
    };
    channels.iter().map(of_channel).fold(0.0, f64::max)
}
