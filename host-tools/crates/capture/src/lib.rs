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
//!                              revisit                cells in pictures that are no patterns
//! calibration.csv           -> calibration            what measures the devices
//! reference_T.npy           -> reference              the transport itself, where it is known
//! ```
//!
//! A capture may come from a stranger: paths stay inside the folder, sizes are
//! checked before memory is taken, and whatever is wrong is a [`CaptureError`]
//! with its place.

// Test captures are shared with the tests outside of the crate, by its name.
#[cfg(test)]
extern crate self as iltm_capture;

pub mod calibration;
mod cell_model;
mod code;
mod diagnostics;
mod drift;
mod error;
mod exposed;
mod file_format;
mod find;
mod fine_flood;
mod frame;
#[cfg(test)]
mod gate_tests;
mod gates;
mod gray_code;
mod light;
mod lists;
mod manifest;
mod measure;
mod measurements;
mod noise;
mod noise_samples;
mod pattern;
mod photo;
mod photographs;
mod picture;
#[cfg(test)]
mod picture_tests;
mod place;
mod reference;
#[cfg(test)]
mod refusal_tests;
mod registration;
mod regression;
mod revisit;
mod role;
mod sampled;
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
    CALIBRATION_FILE, CalibrationManifest, CalibrationRole, CalibrationShot, Devices, Probe,
    RampChannel,
};
pub use code::Code;
pub use diagnostics::{Diagnostics, LeftOut, Why};
pub use error::CaptureError;
pub use exposed::Exposed;
pub use file_format::FileFormat;
pub use find::find_photo;
pub use find::pictures_of_stem;
pub use fine_flood::FineFlood;
pub use gates::{Evidence, Gate, GateName, Verdict};
pub use lists::{RoleName, VERIFY_FILE, listed};
pub use manifest::{ListedRole, MANIFEST_FILE, Manifest, ManifestOf, Shot, ShotOf, numbered};
pub use measurements::{ChannelMeasurements, Measurements};
pub use noise::{NoiseModel, NoiseSource};
pub use pattern::Pattern;
pub use reference::{REFERENCE_FILE, ReferenceError, parse_reference, read_reference};
pub use registration::{MIN_REGRESSION, NO_CELL, PixelCount, Registration, RegistrationMethod};
pub use revisit::{CellPlanes, Revisited, revisit};
pub use role::Role;
pub use sequence::{Axis, MIN_BERNOULLI};
pub use settings::{CameraSettings, ProjectorSettings, SETTINGS_FILE, SceneSettings, Settings};
pub use shot_light::ShotLight;
pub use shown::{columns, shown};

use gates::cause;
use gates::superposition::Sums;
use iltm_picture::progress::Progress;
use light::Light;
use measure::CellPixels;
use nalgebra::DMatrix;
use sampled::Sampled;
use sequence::{Chosen, Sequence};
use std::path::Path;

/// How to read a capture.
#[derive(Clone, PartialEq, Debug)]
pub struct CaptureOptions {
    /// Use only this many Bernoulli photographs, the first ones, beside all
    /// others; `None` for all.
    pub bernoulli: Option<usize>,
    /// Fewer Bernoulli photographs than this are refused.
    pub min_bernoulli: usize,
    /// Of stripes finer than a table or the camera can have, without Bernoulli
    /// patterns, the finest are left out, so that a cell is a block of the patterns'.
    pub coarsen: bool,
    /// Gates that may fail: [`read`] goes on despite them, as far as it can.
    pub ignore: Vec<GateName>,
}

impl Default for CaptureOptions {
    fn default() -> Self {
        Self {
            bernoulli: None,
            min_bernoulli: MIN_BERNOULLI,
            coarsen: false,
            ignore: Vec::new(),
        }
    }
}

/// What the gates say of a capture, and what was measured in it.
#[derive(Clone, Debug)]
pub struct Examined {
    /// All gates that could be judged, what explains others first.
    pub gates: Vec<Gate>,
    /// What was measured; `None` if the photographs do not allow it.
    pub measurements: Option<Measurements>,
}

/// Reads a capture folder and measures every cell under every pattern.
///
/// # Errors
/// A [`CaptureError`] for whatever is missing, contradictory or unusable;
/// [`CaptureError::Refused`] if gates fail that `options` do not ignore.
pub fn read(
    folder: &Path,
    options: &CaptureOptions,
    progress: &dyn Progress,
) -> Result<Measurements, CaptureError> {
    let examined = examine(folder, options, progress)?;
    let fails = |gate: &&Gate| gate.fails() && !options.ignore.contains(&gate.name);
    let failed: Vec<Gate> = examined.gates.iter().filter(fails).cloned().collect();
    match examined.measurements {
        Some(mut measurements) if failed.is_empty() => {
            measurements.diagnostics.gates = examined.gates;
            Ok(measurements)
        }
        // Without cells there is nothing to go on with, whatever is ignored.
        _ => Err(CaptureError::Refused {
            path: folder.to_owned(),
            gates: if failed.is_empty() {
                let failed = examined.gates.into_iter().filter(Gate::fails);
                failed.collect()
            } else {
                failed
            },
        }),
    }
}

/// Looks at a capture as closely as [`read`] and says what every gate says of it.
///
/// # Errors
/// A [`CaptureError`] for what is not a well-formed capture. Files are looked at in
/// this order: `capture.csv`, `capture.toml`, patterns, photographs.
pub fn examine(
    folder: &Path,
    options: &CaptureOptions,
    progress: &dyn Progress,
) -> Result<Examined, CaptureError> {
    let manifest = Manifest::read(folder)?;
    let settings = Settings::read(folder)?;
    let mut chosen = Chosen::new(folder, &manifest.shots, options)?;
    let complete = gates::complete::judge(folder, &mut chosen.frames)?;
    let mut gates = vec![complete];
    // What is there says more, if it is enough to go on with.
    let sequence = match Sequence::read(folder, chosen) {
        Err(_) if gates[0].fails() => {
            let measurements = None;
            return Ok(Examined {
                gates,
                measurements,
            });
        }
        sequence => sequence?,
    };
    let measured = measure_all(folder, &sequence, &settings, &mut gates, progress);
    let mut measurements = match measured {
        Err(error @ (CaptureError::PhotoSize { .. } | CaptureError::PhotoChannels { .. })) => {
            gates.push(gates::format::refused(&error));
            None
        }
        measured => measured?,
    };
    gates::settle(&mut gates, None);
    let is_bernoulli = |shot: &&Shot| shot.role == Role::Bernoulli;
    if let Some(measurements) = &mut measurements {
        let taken = manifest.shots.iter().filter(is_bernoulli).count();
        measurements.diagnostics.bernoulli_taken = taken;
    }
    Ok(Examined {
        gates,
        measurements,
    })
}

/// Measures the photographs of a sequence and judges them; `None` if no cell is found.
#[allow(
    clippy::too_many_lines,
    reason = "each gate stands after the step that it judges, which is the order to read in"
)]
fn measure_all(
    folder: &Path,
    sequence: &Sequence,
    settings: &Settings,
    gates: &mut Vec<Gate>,
    progress: &dyn Progress,
) -> Result<Option<Measurements>, CaptureError> {
    let mut light = Light::read(folder, sequence, settings, progress)?;
    let format = &light.photographs.format;
    gates.push(gates::format::judge(format.file, format.bits));
    // In the camera's own channels, where a ceiling is one value.
    let clipped = light.find_clipped(sequence, progress)?;
    let mut devices = light.measure_devices(folder, sequence, settings, progress)?;
    let Light {
        mut photographs,
        mut flood,
        black,
        saturated,
        taken,
        ..
    } = light;
    let count = |shots: usize| shots as u64;
    progress.begin(
        "comparing photographs and patterns",
        count(sequence.shots.len()),
    );
    let sampled = Sampled::take(&mut photographs, sequence.shots.len(), progress)?;
    let order = gates::order::find(sequence, &sampled);
    gates.push(gates::order::judge(sequence, order.as_ref()));
    progress.end();
    let coded: usize = sequence.views[sequence.coded()]
        .iter()
        .map(|v| v.shots.len())
        .sum();
    progress.begin("decoding the Gray code", count(coded));
    let gray = gray_code::decode(sequence, &mut photographs, &flood, &black, progress)?;
    progress.end();

    progress.begin(
        "registering camera pixels",
        count(sequence.bernoulli().len()),
    );
    let registered = registration::register(sequence, &mut photographs, &gray, progress)?;
    progress.end();

    let cells = CellPixels::choose(&registered.registration, &saturated);
    let counts = cells.counts();
    let live = cells.live.iter().filter(|live| **live).count();
    gates.push(gates::saturation::judge(&clipped, &cells.left_out, live));
    gates.push(gates::coverage::judge(
        sequence.grid,
        sequence.coarser,
        &cells.live,
        &counts,
        &cells.left_out,
    ));
    if live == 0 {
        return Ok(None);
    }
    progress.begin("measuring cells", count(sequence.shots.len()));
    let light = measure::observe(sequence, &mut photographs, &cells, progress)?;
    progress.end();
    let steadiness = drift::assess(sequence, &cells.live, &light.channels);
    let observed = measure::average(sequence, &light, &cells, &steadiness.drift);

    let channels = &observed.channels;
    let registration = &registered.registration;
    let moved = gates::movement::find(sequence, &sampled, registration);
    gates.push(gates::movement::judge(sequence, moved.as_ref()));
    gates.push(gates::drift::judge(sequence, &steadiness));
    gates.push(gates::flicker::judge(sequence, registration, &steadiness));
    // Before one white there is nothing to follow the light by: what bends it would be
    // taken for drift, and the sums for sound.
    let single = sequence.white().shots.len() == 1;
    let plain =
        single.then(|| measure::average(sequence, &light, &cells, &drift::Drift::default()));
    let summed = plain.as_ref().map_or(channels, |plain| &plain.channels);
    let superposition =
        gates::superposition::median(gates::superposition::excesses(sequence, summed));
    let sums = Sums::new(sequence, summed, &cells.live);
    let wrong = sums.as_ref().is_some_and(Sums::fail);
    let cause = wrong.then(|| cause::find(sequence, &cells.live, &light.channels, &sampled));
    gates.push(gates::superposition::judge(
        sequence,
        sums.as_ref(),
        cause,
        steadiness.excess,
    ));
    gates.push(gates::noise::judge(
        sequence.grid,
        channels,
        &cells.live,
        &counts,
    ));
    for (flood, black) in flood.iter_mut().zip(&black) {
        for (flood, black) in flood.iter_mut().zip(black) {
            *flood -= black;
        }
    }
    if let Some((probe, lit)) = &taken.probe {
        let flood = gray_code::channel_sum(&flood);
        let probe = Probe::measure(sequence.grid, lit, registration, probe, &flood);
        devices.take_probe(probe, settings.projector.blur);
    }
    gates.push(gates::response::judge(&devices, cause));
    gates::settle(gates, cause);
    let diagnostics = Diagnostics {
        file: photographs.format.file,
        bits: photographs.format.bits,
        photographs: sequence.frames.iter().map(|frame| frame.shots.len()).sum(),
        bernoulli: sequence.bernoulli().len(),
        bernoulli_taken: sequence.bernoulli().len(),
        method: registered.method,
        pixels: registered.count,
        exposure: exposure(&observed.channels, &cells.live),
        noise: observed.noise,
        superposition,
        left_out: cells.left_out.clone(),
        gates: Vec::new(),
    };
    let views = &sequence.views;
    Ok(Some(Measurements {
        grid: sequence.grid,
        patterns: DMatrix::from_fn(sequence.grid.cells(), views.len(), |cell, view| {
            f64::from(views[view].lit[cell])
        }),
        roles: views.iter().map(|view| view.role).collect(),
        repeats: views.iter().map(|view| view.shots.len() as u32).collect(),
        channels: observed.channels,
        pixels: counts,
        live: cells.live,
        registration: registered.registration,
        flood,
        devices,
        settings: settings.clone(),
        diagnostics,
    }))
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
