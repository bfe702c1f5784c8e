//! Exposure merging: one photograph from those of a bracket, averaged with weights of
//! inverse variance, saturated samples left out.

use super::photo::Photo;

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
pub(crate) fn merge(photos: &[Photo], times: &[f64], bits: u8, saturated: f32) -> Photo {
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
    use super::*;
    use crate::test_capture::Dice;

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

    #[test]
    fn rounding_is_uniform_over_a_step_of_the_file() {
        // 16 bits at most are told apart.
        for (bits, step) in [(8, 1.0 / 255.0), (12, 1.0 / 4095.0), (32, 1.0 / 65_535.0)] {
            let wanted: f64 = step * step / 12.0;
            assert!((rounding(bits) / wanted - 1.0).abs() < 1e-12, "{bits}");
        }
    }
}
