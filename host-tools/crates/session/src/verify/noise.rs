//! Noise of photographs, cell by cell: what photographs of one picture differ by.
//!
//! Photographs of white say how much, and darker ones have no more. A part of it is the camera's noise,
//! which its model knows and which is smaller in darker photographs. All else (a tripod that gives, light
//! that flickers, blocks of JPEG files) is taken to be as large in every photograph as in white's.

use super::Readings;
use super::judge::LiveCells;
use iltm_capture::{CellPlanes, NoiseModel};
use iltm_picture::LightPicture;
use iltm_report::Comparison;

/// Relative error that noise makes in a photograph.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct PhotographNoise {
    /// At most: as much light is wrong as in white's.
    pub(super) most: f64,
    /// With the camera's own noise as large as its light lets expect.
    pub(super) expected: f64,
}

/// Noise of each compensated photograph; `None` with a single photograph of white.
pub(super) fn of_compensated(readings: &Readings, lit: &LiveCells) -> Option<Vec<PhotographNoise>> {
    let (first, others) = readings.revisited.white.split_first()?;
    let light = lit.light(first);
    let in_light = square(&light);
    // Relative to white, of one of the two that differ.
    let of_pair = |other| Comparison::new(&lit.light(other), &light).error.powi(2) / 2.0;
    let relative: Vec<f64> = others.iter().map(of_pair).collect();
    if relative.is_empty() || in_light <= 0.0 {
        return None;
    }
    let in_white = in_light * relative.iter().sum::<f64>() / relative.len() as f64;
    let by_camera = by_camera(readings, first, lit);
    let of_image = |seen: &CellPlanes| {
        let darker = if by_camera > 0.0 {
            self::by_camera(readings, seen, lit) / by_camera
        } else {
            1.0
        };
        let known = by_camera.min(in_white);
        let all = square(&lit.light(seen)).max(f64::MIN_POSITIVE);
        PhotographNoise {
            most: (in_white / all).sqrt(),
            expected: ((in_white - known + known * darker) / all).sqrt(),
        }
    };
    let shown = readings.shown.iter();
    Some(shown.map(|shown| of_image(&shown.seen[1])).collect())
}

/// Variance that the camera's noise makes, sum over cells and channels, each the mean of its camera
/// pixels.
fn by_camera(readings: &Readings, light: &CellPlanes, lit: &LiveCells) -> f64 {
    let revisited = &readings.revisited;
    let counts = revisited.pixels_of_cells.iter().map(Vec::len);
    let counts: Vec<f64> = counts.map(|count| count.max(1) as f64).collect();
    let of_plane = |(model, plane): (&NoiseModel, &Vec<f64>)| -> f64 {
        let cells = lit.of(plane).zip(lit.of(&counts));
        cells
            .map(|(light, count)| model.variance(light) / count)
            .sum()
    };
    revisited.noise.iter().zip(light).map(of_plane).sum()
}

/// Sum of the squares of a picture's light.
fn square(picture: &LightPicture) -> f64 {
    let light = picture.planes().iter().flatten();
    light.map(|light| f64::from(*light).powi(2)).sum()
}
