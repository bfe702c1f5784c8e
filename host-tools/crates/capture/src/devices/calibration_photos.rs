//! Calibration photographs: the light of those of `calibration.csv`, as far as taken.

use super::RampPoint;
use super::samples::used_pixels;
use crate::format::bracket::Bracket;
use crate::format::calibration_role::{CalibrationManifest, CalibrationRole, CalibrationShot};
use crate::format::error::CaptureError;
use crate::format::manifest::{CALIBRATION_FILE, MANIFEST_FILE};
use crate::format::photo_files::find_photo;
use crate::format::picture_file::{Opened, Samples, Source};
use crate::format::sequence::{Sequence, another_grid};
use crate::photographs::linearise::LinearPhotographs;
use iltm_picture::progress::{Progress, Silent};
use iltm_runtime::Grid;
use std::path::Path;

/// Share of the used pixels that may be saturated in a photograph of the ramp.
const SATURATED: f64 = 0.001;

/// Light of the probe, channels added, black subtracted, and which cells it lights.
pub(super) type ProbeLight = (Vec<f32>, Vec<bool>);

/// What was photographed for the devices.
#[derive(Default)]
pub(super) struct CalibrationPhotos {
    /// Lines of `calibration.csv`.
    pub(super) listed: usize,
    /// Those whose photographs are there.
    pub(super) found: usize,
    pub(super) ramp: Vec<RampPoint>,
    pub(super) probe: Option<ProbeLight>,
}

impl CalibrationPhotos {
    /// Reads what there is; nothing if there is no `calibration.csv` or not one of
    /// its photographs.
    ///
    /// # Errors
    /// A manifest's or a photograph's own error;
    /// [`CaptureError::Unlike`] if they are not of the capture's kind.
    pub(super) fn read(
        folder: &Path,
        sequence: &Sequence,
        linear: &mut LinearPhotographs<'_>,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        let Some(manifest) = CalibrationManifest::read_if_there(folder)? else {
            return Ok(Self::default());
        };
        let mut taken = Self {
            listed: manifest.shots.len(),
            ..Self::default()
        };
        let mut shots = Vec::new();
        for mut shot in manifest.shots {
            if let Some(found) = find_photo(folder, &shot.photo)? {
                shot.photo = found;
                shots.push(shot);
            }
        }
        taken.found = shots.len();
        if shots.is_empty() {
            return Ok(taken);
        }
        let used = used_pixels(linear);
        let whites = whites(sequence, linear, &used)?;
        let list = folder.join(CALIBRATION_FILE);
        let brackets = Bracket::of_list(&shots, &list, sequence.longest)?;
        let mut photographs = linear.others(folder, brackets)?.read_once();
        progress.begin("reading the calibration", shots.len() as u64);
        let black = mean_of(&linear.black, &used);
        let all: Vec<usize> = (0..shots.len()).collect();
        let saturated = photographs.saturated;
        let mut probes: Vec<(usize, Vec<f32>)> = Vec::new();
        photographs.for_batches(&all, progress, |photos| {
            for &(at, photo) in photos {
                match shots[at].role {
                    CalibrationRole::Ramp { channel, level } => {
                        if saturates(&photo.planes, &used, saturated) {
                            continue;
                        }
                        let drift = drift(&whites, shots[at].index);
                        let light = mean_of(&photo.planes, &used);
                        let light = light.iter().zip(&black);
                        let light = light.map(|(light, black)| (light - black) / drift);
                        taken.ramp.push(RampPoint {
                            channel,
                            level,
                            light: light.collect(),
                        });
                    }
                    CalibrationRole::Probe => {
                        probes.push((at, sum_without(&photo.planes, &linear.black)));
                    }
                }
            }
        })?;
        progress.end();
        taken.probe = merged_probes(folder, sequence.grid, &shots, probes)?;
        Ok(taken)
    }
}

/// Index and light of each photograph of white, to follow drift by.
fn whites(
    sequence: &Sequence,
    linear: &mut LinearPhotographs<'_>,
    used: &[usize],
) -> Result<Vec<(u32, f64)>, CaptureError> {
    let black: f64 = mean_of(&linear.black, used).iter().sum();
    let mut whites = Vec::new();
    let shots = &sequence.white().shots;
    linear.photographs.for_batches(shots, &Silent, |photos| {
        for &(at, photo) in photos {
            let light = mean_of(&photo.planes, used).iter().sum::<f64>() - black;
            whites.push((sequence.shots[at].index, light));
        }
    })?;
    Ok(whites)
}

/// Mean of each plane over the used pixels.
fn mean_of(planes: &[Vec<f32>], used: &[usize]) -> Vec<f64> {
    let mean = |plane: &Vec<f32>| {
        let sum: f64 = used.iter().map(|&at| f64::from(plane[at])).sum();
        sum / used.len().max(1) as f64
    };
    planes.iter().map(mean).collect()
}

/// Whether too many of the used pixels are saturated in any channel.
fn saturates(planes: &[Vec<f32>], used: &[usize], saturated: f32) -> bool {
    let clipped = |at: usize| planes.iter().any(|plane| plane[at] >= saturated);
    let count = used.iter().filter(|&&at| clipped(at)).count();
    count as f64 > SATURATED * used.len() as f64
}

/// White's light at a place in the order of showing, relative to its mean: straight
/// lines between the photographs of white.
fn drift(whites: &[(u32, f64)], index: u32) -> f64 {
    let mean = whites.iter().map(|white| white.1).sum::<f64>() / whites.len().max(1) as f64;
    let before = whites
        .iter()
        .filter(|white| white.0 <= index)
        .max_by_key(|white| white.0);
    let after = whites
        .iter()
        .filter(|white| white.0 >= index)
        .min_by_key(|white| white.0);
    let light = match (before, after) {
        (Some(a), Some(b)) if a.0 < b.0 => {
            let part = f64::from(index - a.0) / f64::from(b.0 - a.0);
            a.1 + part * (b.1 - a.1)
        }
        (Some(one), _) | (None, Some(one)) => one.1,
        (None, None) => return 1.0,
    };
    if mean > 0.0 && light > 0.0 {
        light / mean
    } else {
        1.0
    }
}

/// All planes added, less black.
fn sum_without(planes: &[Vec<f32>], black: &[Vec<f32>]) -> Vec<f32> {
    let mut sum = vec![0.0; planes.first().map_or(0, Vec::len)];
    for (plane, black) in planes.iter().zip(black) {
        for ((sum, light), black) in sum.iter_mut().zip(plane).zip(black) {
            *sum += light - black;
        }
    }
    sum
}

/// The mean of all probe photographs, which must show one pattern: others than the
/// first one's are left out.
fn merged_probes(
    folder: &Path,
    grid: Grid,
    shots: &[CalibrationShot],
    probes: Vec<(usize, Vec<f32>)>,
) -> Result<Option<ProbeLight>, CaptureError> {
    let mut merged: Option<ProbeLight> = None;
    let mut count = 0.0;
    for (at, light) in probes {
        let lit = lit_cells(folder, grid, &shots[at])?;
        match &mut merged {
            None => merged = Some((light, lit)),
            Some((sum, known)) if *known == lit => {
                sum.iter_mut()
                    .zip(light)
                    .for_each(|(sum, light)| *sum += light);
            }
            Some(_) => continue,
        }
        count += 1.0;
    }
    Ok(merged.map(|(mut light, lit)| {
        for light in &mut light {
            *light /= count;
        }
        (light, lit)
    }))
}

/// Which cells a calibration picture lights.
fn lit_cells(folder: &Path, grid: Grid, shot: &CalibrationShot) -> Result<Vec<bool>, CaptureError> {
    let picture = Opened::open(Source {
        path: &folder.join(&shot.pattern),
        what: "pattern",
        line: shot.line,
    })?;
    let (width, height) = picture.size();
    let found = (height as usize, width as usize);
    let expected = (grid.rows(), grid.cols());
    if found != expected {
        let first = (Path::new(MANIFEST_FILE), expected);
        return Err(another_grid(folder, &shot.pattern, found, first));
    }
    let channels = picture.channels();
    Ok(match picture.decode()? {
        Samples::Eight(samples) => lit(&samples, channels, &128),
        Samples::Sixteen(samples) => lit(&samples, channels, &32_768),
        Samples::Float(samples) => lit(&samples, channels, &0.5),
    })
}

fn lit<T: PartialOrd>(samples: &[T], channels: usize, from: &T) -> Vec<bool> {
    let pixels = samples.chunks_exact(channels);
    pixels
        .map(|pixel| pixel.iter().any(|value| value >= from))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_follows_straight_lines_between_whites() {
        let whites = [(0, 0.9), (10, 1.1)];
        let near = |index, wanted: f64| (drift(&whites, index) - wanted).abs() < 1e-12;
        assert!(near(0, 0.9) && near(5, 1.0) && near(10, 1.1) && near(40, 1.1));
        assert_eq!((drift(&[], 3), drift(&[(2, 0.5)], 3)), (1.0, 1.0));
    }
}
