//! Camera noise of one photograph: what a bounce has to exceed to be seen.

use super::bounce_operator::BounceOperator;
use iltm_capture::{LinearPhotograph, Measurements, NoiseSource};

/// Groups of pixels of similar brightness: light brings its own noise.
const GROUPS: usize = 16;

/// The camera's noise in one photograph, black's own noise included: root mean squares
/// over the wall and all channels, camera units.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PhotographNoise {
    /// Of one pixel.
    pub pixel: f64,
    /// Of the mean over a cell's pixels, which is what bounces after the first are made
    /// from.
    pub cell: f64,
}

/// From the capture's noise model where photographs of the same light tell it. Where
/// nothing was photographed twice that model takes texture for noise; then the smaller
/// of it and of [`by_curvature`], which takes less of it, counts.
pub(super) fn noise(
    wall: &BounceOperator,
    measurements: &Measurements,
    photograph: &LinearPhotograph,
) -> PhotographNoise {
    let (averaged, blacks) = (photograph.averaged as f64, photograph.blacks as f64);
    let (mut pixels, mut cells) = (0.0, 0.0);
    for (channel, measured) in measurements.channels.iter().enumerate() {
        let model = measured.noise_model;
        let (light, black) = (&photograph.planes[channel], &photograph.black[channel]);
        let variance = |pixel: usize| {
            let (light, black) = (f64::from(light[pixel]), f64::from(black[pixel]));
            (model.variance(light + black) / averaged + model.variance(black) / blacks) as f32
        };
        let variances: Vec<f32> = wall.pixels().map(variance).collect();
        pixels += variances.iter().copied().map(f64::from).sum::<f64>();
        cells += wall.mean_variance(&variances);
    }
    let channels = measurements.channels.len() as f64;
    let count = wall.pixels().count().max(1) as f64;
    let modelled = PhotographNoise {
        pixel: (pixels / count / channels).sqrt(),
        cell: (cells / channels).sqrt(),
    };
    if measurements.diagnostics.noise != NoiseSource::Texture || modelled.pixel <= 0.0 {
        return modelled;
    }
    let found = by_curvature(wall, &photograph.planes).unwrap_or(modelled.pixel);
    let scale = (found / modelled.pixel).min(1.0);
    PhotographNoise {
        pixel: scale * modelled.pixel,
        cell: scale * modelled.cell,
    }
}

/// Noise of a picture from itself: what the mask `1 -2 1 / -2 4 -2 / 1 -2 1` leaves of
/// it, which is nothing of any light that is linear along rows or columns (Immerkaer,
/// *Fast Noise Variance Estimation*, Computer Vision and Image Understanding 1996). The
/// median over pixels of similar brightness keeps edges out. `None` if the wall has too
/// few pixels with all eight neighbours.
fn by_curvature(wall: &BounceOperator, planes: &[Vec<f32>]) -> Option<f64> {
    /// Root of the sum of the mask's squares.
    const MASK_NORM: f64 = 6.0;
    /// Median of the magnitude of a standard normal variable.
    const MEDIAN: f64 = 0.674_489_75;
    let (mut sum, mut groups) = (0.0, 0_usize);
    for plane in planes {
        let mut seen = around(wall, plane);
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        if seen.len() < GROUPS {
            return None;
        }
        let size = seen.len().div_ceil(GROUPS);
        for group in seen.chunks_mut(size) {
            group.sort_by(|a, b| a.1.total_cmp(&b.1));
            let deviation = group[group.len() / 2].1 / MEDIAN / MASK_NORM;
            sum += deviation * deviation;
            groups += 1;
        }
    }
    Some((sum / groups as f64).sqrt())
}

/// Mean light and magnitude of the mask's answer of each pixel whose eight neighbours
/// are on the wall too.
fn around(wall: &BounceOperator, plane: &[f32]) -> Vec<(f64, f64)> {
    let (width, height) = wall.size();
    let mut on_wall = vec![false; width * height];
    for pixel in wall.pixels() {
        on_wall[pixel] = true;
    }
    let mut seen = Vec::new();
    for pixel in wall.pixels() {
        let (x, y) = (pixel % width, pixel / width);
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            continue;
        }
        let rows = [pixel - width, pixel, pixel + width];
        if rows.iter().any(|p| on_wall[p - 1..=p + 1].contains(&false)) {
            continue;
        }
        let row = |at: usize, side: f64, middle: f64| {
            let light = |at: usize| f64::from(plane[at]);
            side * (light(at - 1) + light(at + 1)) + middle * light(at)
        };
        let answer = row(rows[0], 1.0, -2.0) + row(rows[1], -2.0, 4.0) + row(rows[2], 1.0, -2.0);
        let mean = rows.iter().map(|at| row(*at, 1.0, 1.0)).sum::<f64>() / 9.0;
        seen.push((mean, answer.abs()));
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::super::tests::{known_wall, normal};
    use super::*;

    #[test]
    fn noise_is_found_under_slopes_and_edges() {
        let wall = known_wall(40, 60);
        let mut random = fastrand::Rng::with_seed(4);
        let plane: Vec<f32> = (0..40 * 60)
            .map(|at| {
                let (x, y) = (at % 60, at / 60);
                let step = if x < 33 { 0.3 } else { 0.7 };
                (step + 0.004 * f64::from(y) + 0.01 * normal(&mut random)) as f32
            })
            .collect();
        let found = by_curvature(&wall, &[plane]).unwrap();
        assert!((found / 0.01 - 1.0).abs() < 0.15, "{found}");
    }
}
