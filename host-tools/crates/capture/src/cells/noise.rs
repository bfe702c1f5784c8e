//! Camera noise: shot noise and floor of a pixel, from photographs that should add up.

/// Noise of one camera pixel in one photograph: shot noise grows with the light,
/// the floor (reading, quantisation) does not.
///
/// Variance `shot * light + floor`, all in camera units: the usual
/// Poisson-Gaussian model (Foi, Trimeche, Katkovnik, Egiazarian, *Practical
/// Poissonian-Gaussian noise modeling and fitting for single-image raw-data*,
/// IEEE Trans. Image Processing 2008).
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct NoiseModel {
    /// Variance for each unit of light.
    pub shot: f64,
    /// Variance in the dark.
    pub floor: f64,
}

impl NoiseModel {
    /// Variance of one pixel that sees `light` (1 is full scale).
    #[must_use]
    pub fn variance(self, light: f64) -> f64 {
        self.shot * light.max(0.0) + self.floor
    }
}

/// What the noise was estimated from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NoiseSource {
    /// Sums of a Gray code pattern and its inverse, which all show the same
    /// light: their scatter is noise and nothing else.
    Pairs {
        /// Number of sums, at least 2.
        pairs: usize,
    },
    /// Several photographs of white.
    Repeats {
        /// Number of photographs, at least 2.
        photographs: usize,
    },
    /// Differences between neighbouring pixels of the flood photograph, because
    /// nothing was photographed twice: an upper bound, as it takes texture for
    /// noise.
    Texture,
}

/// Groups of pixels of similar brightness that a model is fitted to.
const GROUPS: usize = 24;

/// Fits the noise model to the scatter of photographs of the same light, each of which has
/// one value a pixel and is the sum of so many.
///
/// Each pixel gives its mean light and its variance between the entries (unbiased,
/// divided by the photographs summed). Pixels are grouped by light; the line goes
/// through the group means by least squares, weighted for the variance of a
/// variance, both coefficients kept from going below zero.
pub(crate) fn fit(photographs: &[Vec<f32>], summed: usize) -> NoiseModel {
    let (entries, summed) = (photographs.len() as f64, summed as f64);
    let pixels = photographs.first().map_or(0, Vec::len);
    if entries < 2.0 || pixels == 0 {
        return NoiseModel::default();
    }
    let sample = |pixel: usize| {
        let values = || photographs.iter().map(|p| f64::from(p[pixel]));
        let mean = values().sum::<f64>() / entries;
        let scatter: f64 = values().map(|v| (v - mean) * (v - mean)).sum();
        (mean / summed, scatter / (entries - 1.0) / summed)
    };
    line((0..pixels).map(sample).collect())
}

/// Fits the model to half the squared differences between neighbouring pixels:
/// `pairs` are their values in one photograph.
pub(crate) fn fit_neighbours(pairs: impl Iterator<Item = (f32, f32)>) -> NoiseModel {
    let sample = |(a, b): (f32, f32)| {
        let (a, b) = (f64::from(a), f64::from(b));
        (0.5 * (a + b), 0.5 * (a - b) * (a - b))
    };
    line(pairs.map(sample).collect())
}

/// Non-negative line through `(light, variance)` samples.
fn line(mut samples: Vec<(f64, f64)>) -> NoiseModel {
    if samples.is_empty() {
        return NoiseModel::default();
    }
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = samples.len().div_ceil(GROUPS);
    let groups: Vec<(f64, f64, f64)> = samples.chunks(size).map(group_mean).collect();
    // A variance of n samples has a standard deviation proportional to itself.
    let mean_variance = groups.iter().map(|g| g.1).sum::<f64>() / groups.len() as f64;
    if mean_variance <= 0.0 {
        return NoiseModel::default();
    }
    let weight = |g: &(f64, f64, f64)| g.2 / (g.1 + 0.1 * mean_variance).powi(2);
    let (mut s, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let top = groups.iter().map(weight).fold(f64::MIN_POSITIVE, f64::max);
    for group in &groups {
        let (x, y, w) = (group.0, group.1, weight(group) / top);
        s += w;
        sx += w * x;
        sy += w * y;
        sxx += w * x * x;
        sxy += w * x * y;
    }
    let determinant = s * sxx - sx * sx;
    let (shot, floor) = if determinant > 1e-9 * s * sxx {
        (
            (s * sxy - sx * sy) / determinant,
            (sxx * sy - sx * sxy) / determinant,
        )
    } else {
        // All pixels equally bright: nothing tells the two apart.
        (0.0, sy / s)
    };
    if shot < 0.0 {
        NoiseModel {
            shot: 0.0,
            floor: sy / s,
        }
    } else if floor < 0.0 {
        NoiseModel {
            shot: sxy / sxx,
            floor: 0.0,
        }
    } else {
        NoiseModel { shot, floor }
    }
}

/// Mean light and variance of a group, and its size.
fn group_mean(group: &[(f64, f64)]) -> (f64, f64, f64) {
    let n = group.len() as f64;
    let light = group.iter().map(|s| s.0).sum::<f64>() / n;
    let variance = group.iter().map(|s| s.1).sum::<f64>() / n;
    (light, variance, n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_capture::Dice;

    #[test]
    fn the_noise_of_a_simulated_camera_is_found_again() {
        let truth = NoiseModel {
            shot: 5e-5,
            floor: 2e-6,
        };
        let mut dice = Dice::new(3);
        let light: Vec<f64> = (0..4000)
            .map(|i| 0.05 + 0.7 * f64::from(i) / 4000.0)
            .collect();
        let mut entry = || -> Vec<f32> {
            let noisy = |l: &f64| {
                (2.0 * l + truth.variance(*l).sqrt() * 2_f64.sqrt() * dice.normal()) as f32
            };
            light.iter().map(noisy).collect()
        };
        let photographs: Vec<_> = (0..9).map(|_| entry()).collect();
        let found = fit(&photographs, 2);
        // 36,000 samples with 32,000 degrees of freedom: 0.8 % on a variance.
        for light in [0.1, 0.4, 0.7] {
            let ratio = found.variance(light) / truth.variance(light);
            assert!((ratio - 1.0).abs() < 0.04, "{light}: {ratio}");
        }
    }

    #[test]
    fn photographs_without_noise_or_pixels_have_none() {
        let still = vec![vec![0.25; 100]; 3];
        assert_eq!(fit(&still, 1), NoiseModel::default());
        assert_eq!(fit(&[], 1), NoiseModel::default());
        assert_eq!(fit_neighbours(std::iter::empty()), NoiseModel::default());
    }

    #[test]
    fn neither_part_of_a_model_is_negative() {
        let rising = line(
            (1..100)
                .map(|i| (f64::from(i), f64::from(i) - 1.0))
                .collect(),
        );
        let falling = line(
            (1..100)
                .map(|i| (f64::from(i), f64::from(100 - i)))
                .collect(),
        );
        for model in [rising, falling] {
            assert!(model.shot >= 0.0 && model.floor >= 0.0, "{model:?}");
        }
    }
}
