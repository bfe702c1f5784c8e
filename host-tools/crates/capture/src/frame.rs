//! What was photographed more than once, with different exposures, as one.
//!
//! Photographs of one pattern are a bracket if their exposures differ: the k-th
//! of each exposure belong together. Their light is averaged with weights of
//! inverse variance, saturated samples left out. Light is in units of the full
//! scale at the longest exposure of the capture, so that of a short one may be
//! above 1.

use super::photo::Photo;
use super::{CaptureError, Pattern, Shot};
use std::path::Path;

/// Photographs that become one.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Frame {
    /// The photographs, the longest exposure first; at least one.
    pub(super) shots: Vec<Shot>,
    /// Exposure of each, relative to the longest of the capture.
    pub(super) times: Vec<f64>,
}

impl Frame {
    /// A frame for each shot. `longest` is the exposure that light is relative to;
    /// without one, exposures do not count.
    pub(super) fn of_each(shots: &[Shot], longest: Option<f64>) -> Vec<Self> {
        let each = shots
            .iter()
            .map(|shot| Self::new(vec![shot.clone()], longest));
        each.collect()
    }

    fn new(shots: Vec<Shot>, longest: Option<f64>) -> Self {
        let time = |shot: &Shot| match (shot.exposure, longest) {
            (Some(exposure), Some(longest)) => exposure / longest,
            _ => 1.0,
        };
        Self {
            times: shots.iter().map(time).collect(),
            shots,
        }
    }
}

/// The longest exposure of the shots; `None` if none is given.
///
/// # Errors
/// [`CaptureError::ManifestLine`] with the first shot that has none, if others
/// have: their light could not be compared.
pub(super) fn longest(shots: &[Shot], manifest: &Path) -> Result<Option<f64>, CaptureError> {
    let given = shots.iter().filter_map(|shot| shot.exposure);
    let Some(longest) = given.reduce(f64::max) else {
        return Ok(None);
    };
    match shots.iter().find(|shot| shot.exposure.is_none()) {
        Some(shot) => Err(CaptureError::ManifestLine {
            path: manifest.to_owned(),
            line: shot.line,
            reason: "no exposure is given here, though other lines have one".to_owned(),
        }),
        None => Ok(Some(longest)),
    }
}

/// Puts the photographs of each bracket together. `patterns` are those of `shots`;
/// the frames are in the order of their first photographs.
pub(super) fn bracketed(shots: &[Shot], patterns: &[Pattern], longest: f64) -> Vec<Frame> {
    let alike = |a: usize, b: usize| shots[a].role == shots[b].role && patterns[a] == patterns[b];
    let exposed = |a: usize, b: usize| shots[a].exposure == shots[b].exposure;
    let mut brackets: Vec<Vec<usize>> = Vec::new();
    for shot in 0..shots.len() {
        // The first bracket of this pattern that lacks this exposure.
        let open = brackets.iter_mut().find(|bracket| {
            alike(bracket[0], shot) && !bracket.iter().any(|&other| exposed(other, shot))
        });
        match open {
            Some(bracket) => bracket.push(shot),
            None => brackets.push(vec![shot]),
        }
    }
    let frame = |bracket: Vec<usize>| {
        let mut of: Vec<Shot> = bracket.into_iter().map(|at| shots[at].clone()).collect();
        of.sort_by(|a, b| {
            b.exposure
                .partial_cmp(&a.exposure)
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        Frame::new(of, Some(longest))
    };
    brackets.into_iter().map(frame).collect()
}

/// Noise that the weights of a bracket are chosen for: a sensor of 10,000
/// electrons, three of which reading adds, and the steps of the file. Weights
/// that are somewhat off cost a little noise and never the right mean.
const SHOT: f64 = 1e-4;
const READING: f64 = 1e-7;

/// Variance of rounding to the steps of a file.
fn rounding(bits: u8) -> f64 {
    let step = 1.0 / (f64::from(bits.min(16)).exp2() - 1.0);
    step * step / 12.0
}

/// One photograph from those of a bracket, in the order of `times`, each read as
/// 0 to 1 of its own full scale from files of `bits`. What is saturated in all of
/// them becomes `saturated`.
pub(super) fn merge(photos: &[Photo], times: &[f64], bits: u8, saturated: f32) -> Photo {
    let floor = READING + rounding(bits);
    let pixel = |channel: usize, at: usize| {
        let samples = || {
            let value = photos.iter().map(move |photo| photo.planes[channel][at]);
            let usable = value
                .zip(times)
                .filter(|(value, _)| *value < Photo::SATURATED);
            usable.map(|(value, &time)| (f64::from(value) / time, time))
        };
        // The longest exposure has the least noise; weights must not follow each
        // sample's own.
        let Some((guess, _)) = samples().next() else {
            return saturated;
        };
        let (mut sum, mut weights) = (0.0, 0.0);
        for (light, time) in samples() {
            let weight = time * time / (SHOT * guess.max(0.0) * time + floor);
            sum += weight * light;
            weights += weight;
        }
        (sum / weights) as f32
    };
    let channels = photos.first().map_or(0, |photo| photo.planes.len());
    let plane = |channel: usize| {
        let pixels = photos
            .first()
            .map_or(0, |photo| photo.planes[channel].len());
        (0..pixels).map(|at| pixel(channel, at)).collect()
    };
    Photo {
        planes: (0..channels).map(plane).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Role;
    use super::super::test_capture::Dice;
    use super::*;

    fn shot(index: u32, role: Role, exposure: Option<f64>) -> Shot {
        Shot {
            index,
            role,
            pattern: "p".into(),
            photo: "q".into(),
            exposure,
            line: u64::from(index) + 2,
        }
    }

    fn pattern(lit: bool) -> Pattern {
        Pattern {
            rows: 1,
            cols: 1,
            lit: vec![lit],
        }
    }

    #[test]
    fn the_kth_photographs_of_each_exposure_are_a_bracket() {
        let exposures = [1.0, 4.0, 1.0, 1.0, 4.0, 4.0];
        let roles = [
            Role::White,
            Role::White,
            Role::Black,
            Role::White,
            Role::White,
            Role::Black,
        ];
        let shots: Vec<Shot> = (0..6)
            .map(|k| shot(k as u32, roles[k], Some(exposures[k])))
            .collect();
        let patterns: Vec<_> = roles
            .iter()
            .map(|role| pattern(*role == Role::White))
            .collect();
        let longest = longest(&shots, Path::new("c")).unwrap().unwrap();
        let frames = bracketed(&shots, &patterns, longest);
        let indices = |frame: &Frame| frame.shots.iter().map(|s| s.index).collect::<Vec<_>>();
        assert_eq!(
            frames.iter().map(indices).collect::<Vec<_>>(),
            [[1, 0], [5, 2], [4, 3]]
        );
        assert!(frames.iter().all(|frame| frame.times == [1.0, 0.25]));
    }

    #[test]
    fn an_exposure_that_only_some_lines_have_is_refused() {
        let shots = [shot(0, Role::White, Some(1.0)), shot(1, Role::Black, None)];
        let error = longest(&shots, Path::new("c.csv")).unwrap_err().to_string();
        assert!(error.starts_with("c.csv, line 3: no exposure"), "{error}");
        assert_eq!(longest(&shots[1..], Path::new("c.csv")).unwrap(), None);
    }

    fn photo(values: &[f32]) -> Photo {
        Photo {
            planes: vec![values.to_vec()],
        }
    }

    #[test]
    fn saturated_samples_are_left_out_and_light_goes_beyond_the_longest_exposures_scale() {
        let long = photo(&[0.4, Photo::SATURATED, Photo::SATURATED]);
        let short = photo(&[0.1, 0.5, Photo::SATURATED]);
        let merged = merge(&[long, short], &[1.0, 0.25], 16, 4.0);
        assert_eq!(merged, photo(&[0.4, 2.0, 4.0]));
    }

    /// The variance of a mean with weights of inverse variance is one over the sum
    /// of the inverse variances.
    #[test]
    fn the_noise_of_a_merged_pixel_is_that_of_the_best_weights() {
        let (light, times) = (0.05, [1.0, 0.5]);
        let floor = READING + rounding(16);
        let variance = |time: f64| (SHOT * light * time + floor) / (time * time);
        let mut dice = Dice::new(5);
        let mut exposed = |time: f64| {
            let mut value = || time * (light + variance(time).sqrt() * dice.normal());
            photo(&(0..20_000).map(|_| value() as f32).collect::<Vec<_>>())
        };
        let photos = times.map(&mut exposed);
        let merged = &merge(&photos, &times, 16, 2.0).planes[0];
        let count = merged.len() as f64;
        let mean = merged.iter().map(|v| f64::from(*v)).sum::<f64>() / count;
        let scatter = merged
            .iter()
            .map(|v| (f64::from(*v) - mean).powi(2))
            .sum::<f64>()
            / count;
        let best = 1.0 / times.iter().map(|t| 1.0 / variance(*t)).sum::<f64>();
        // A variance of 20,000 samples is known to 1 %.
        assert!((scatter / best - 1.0).abs() < 0.04, "{}", scatter / best);
        assert!((mean - light).abs() < 4.0 * (best / count).sqrt());
    }
}
