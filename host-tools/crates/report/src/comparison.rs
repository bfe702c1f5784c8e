//! Error of a photograph: how far it is from the wanted image, brightness aside.

use iltm_picture::LightPicture;

/// A photograph compared with the wanted image at the scale that flatters it
/// most: what matters on the wall is contrast and colour, not the projector's
/// brightness.
///
/// The error is the paper's `min_s |photo - s wanted| / |s wanted|`, one `s` for
/// all pixels and channels. With `t = 1/s` it is `min_t |t photo - wanted| /
/// |wanted|`, so `t = <photo, wanted> / <photo, photo>`.
#[derive(Clone, PartialEq, Debug)]
pub struct Comparison {
    /// `t`: what the photograph is multiplied by.
    pub scale: f64,
    /// The error, 0 for the wanted image itself.
    pub error: f64,
    /// Root mean square over the channels of `t photo - wanted` at each pixel,
    /// relative to reference white.
    pub map: Vec<f32>,
}

impl Comparison {
    /// Compares two pictures of the same size and channels; with a dark photograph
    /// or wanted image the error is 1.
    #[must_use]
    pub fn new(photograph: &LightPicture, wanted: &LightPicture) -> Self {
        let product = |a: &LightPicture, b: &LightPicture| -> f64 {
            let planes = a.planes().iter().zip(b.planes());
            let pixels = planes.flat_map(|(a, b)| a.iter().zip(b));
            pixels.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let light = product(photograph, photograph);
        let scale = if light > 0.0 {
            product(photograph, wanted) / light
        } else {
            0.0
        };
        let mut squares = vec![0.0; wanted.size().pixels()];
        for (photograph, wanted) in photograph.planes().iter().zip(wanted.planes()) {
            for ((square, seen), wanted) in squares.iter_mut().zip(photograph).zip(wanted) {
                *square += (scale * f64::from(*seen) - f64::from(*wanted)).powi(2);
            }
        }
        let norm = product(wanted, wanted);
        let error = if norm > 0.0 {
            (squares.iter().sum::<f64>() / norm).sqrt()
        } else {
            1.0
        };
        let channels = wanted.planes().len().max(1) as f64;
        let rms = |square: f64| (square / channels).sqrt() as f32;
        Self {
            scale,
            error,
            map: squares.into_iter().map(rms).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::FrameSize;

    fn grey(light: [f32; 2]) -> LightPicture {
        let size = FrameSize::new(2, 1).unwrap();
        LightPicture::new(size, vec![light.to_vec()]).unwrap()
    }

    #[test]
    fn brightness_alone_is_no_error() {
        let comparison = Comparison::new(&grey([0.1, 0.3]), &grey([0.2, 0.6]));
        assert!((comparison.scale - 2.0).abs() < 1e-6);
        assert!(comparison.error < 1e-6);
    }

    #[test]
    fn the_error_is_the_sine_of_the_angle_between_the_images() {
        // (1, 1) against (1, 0): 45 degrees.
        let comparison = Comparison::new(&grey([1.0, 1.0]), &grey([1.0, 0.0]));
        assert!((comparison.scale - 0.5).abs() < 1e-6);
        assert!((comparison.error - 0.5_f64.sqrt()).abs() < 1e-6);
        assert_eq!(comparison.map, [0.5, 0.5]);
    }

    #[test]
    fn a_dark_photograph_is_all_wrong() {
        let dark = Comparison::new(&grey([0.0, 0.0]), &grey([0.2, 0.6]));
        assert!((dark.error - 1.0).abs() < 1e-12);
    }
}
