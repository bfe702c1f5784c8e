//! Colour mixing: how much of each projector channel each camera channel sees.
//!
//! A camera's filters are not the projector's: some of the projector's green is in
//! the camera's red. With `M` (camera by projector, diagonal 1) measured from
//! photographs of each projector channel alone, `M^-1` turns every photograph into
//! one of projector primaries: what the solve then finds, and a table then holds,
//! is a gain and an operator for each primary of the projector, and a colour means
//! the projector's.

use nalgebra::Matrix3;

/// Mixing below this is not told from stray light and rounding.
const LEAST_MIXING: f64 = 0.005;

/// Mixing matrices worse than this cannot be undone without drowning in noise.
const MOST_CONDITION: f64 = 20.0;

/// Light in the camera's channels by the projector's.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ColourMixingMatrix {
    /// `[camera][projector]`: light of a projector channel in a camera channel,
    /// relative to that in the camera's channel of the same name.
    pub matrix: [[f64; 3]; 3],
    /// Standard deviation of the elements beside the diagonal, from the noise of
    /// the photographs.
    pub deviation: f64,
    /// Light of white against that of red, green and blue together, in the
    /// camera's channels: 1 if the projector adds its colours up. More where it
    /// has a white segment or a "brilliant colour" mode.
    pub white: Option<[f64; 3]>,
}

/// Which mixing is undone in the photographs of a capture.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Unmixing<'m> {
    /// The one that its own photographs tell, if they do.
    Measured,
    /// This one, or none: the light of several projectors must be in the same channels.
    As(Option<&'m ColourMixingMatrix>),
}

impl ColourMixingMatrix {
    /// The mixing found in light of each projector channel alone, `[camera]
    /// [projector]`, black subtracted; `white` is the light of all three together.
    /// `None` if a camera channel sees nothing of its own colour.
    #[must_use]
    pub fn new(light: [[f64; 3]; 3], deviation: f64, white: Option<[f64; 3]>) -> Option<Self> {
        let own = [0, 1, 2].map(|channel| light[channel][channel]);
        if own
            .iter()
            .any(|own| !own.is_finite() || *own <= 4.0 * deviation)
        {
            return None;
        }
        let least = own.iter().copied().fold(f64::INFINITY, f64::min);
        let sum = |camera: usize| light[camera].iter().sum::<f64>();
        Some(Self {
            matrix: light.map(|row| [0, 1, 2].map(|projector| row[projector] / own[projector])),
            deviation: deviation / least,
            white: white.map(|white| [0, 1, 2].map(|camera| white[camera] / sum(camera))),
        })
    }

    /// The largest element beside the diagonal, by magnitude.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let beside = (0..9).filter(|at| at / 3 != at % 3);
        let element = beside.map(|at| self.matrix[at / 3][at % 3].abs());
        element.fold(0.0, f64::max)
    }

    /// Whether there is more mixing than noise hides and a table would not notice.
    #[must_use]
    pub fn matters(&self) -> bool {
        self.largest() > LEAST_MIXING.max(4.0 * self.deviation)
    }

    /// The matrix that undoes the mixing, `[projector][camera]`; `None` if the mixing does
    /// not matter or cannot be undone.
    #[must_use]
    pub(crate) fn inverse(&self) -> Option<[[f32; 3]; 3]> {
        let matrix = Matrix3::from_fn(|camera, projector| self.matrix[camera][projector]);
        let values = matrix.singular_values();
        let condition = values.max() / values.min();
        if !self.matters() || condition.is_nan() || condition > MOST_CONDITION {
            return None;
        }
        let inverse = matrix.try_inverse()?;
        Some([0, 1, 2].map(|row| [0, 1, 2].map(|col| inverse[(row, col)] as f32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photographs::photo::Photo;

    const LIGHT: [[f64; 3]; 3] = [[0.8, 0.1, 0.0], [0.04, 0.5, 0.03], [0.0, 0.05, 0.6]];

    #[test]
    fn mixing_is_relative_to_the_cameras_own_channel() {
        let mixing = ColourMixingMatrix::new(LIGHT, 1e-4, Some([0.9, 0.57, 0.65])).unwrap();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(mixing.matrix[0][1], 0.2) && near(mixing.matrix[1][0], 0.05));
        assert!((0..3).all(|k| near(mixing.matrix[k][k], 1.0)));
        assert!(mixing.white.unwrap().iter().all(|white| near(*white, 1.0)));
        assert!(near(mixing.largest(), 0.2) && mixing.matters());
    }

    #[test]
    fn what_was_mixed_is_unmixed_and_saturation_spreads() {
        let mixing = ColourMixingMatrix::new(LIGHT, 1e-4, None).unwrap();
        let primaries = [0.3_f32, 0.2, 0.4];
        let seen = mixing.matrix.map(|row| {
            let sum: f64 = row
                .iter()
                .zip(primaries)
                .map(|(m, p)| m * f64::from(p))
                .sum();
            vec![sum as f32, 0.5]
        });
        let mut photo = Photo {
            planes: seen.to_vec(),
        };
        photo.planes[1][1] = 1.0;
        photo.unmix(&mixing.inverse().unwrap(), 1.0);
        for (plane, primary) in photo.planes.iter().zip(primaries) {
            assert!((plane[0] - primary).abs() < 1e-6);
            assert!(plane[1] >= 1.0);
        }
    }

    #[test]
    fn mixing_that_noise_hides_or_that_cannot_be_undone_is_left_alone() {
        let slight = [[1.0, 0.004, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(
            ColourMixingMatrix::new(slight, 1e-4, None)
                .unwrap()
                .inverse(),
            None
        );
        let noisy = [[1.0, 0.02, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(
            ColourMixingMatrix::new(noisy, 0.01, None)
                .unwrap()
                .inverse(),
            None
        );
        let grey = [[1.0, 0.99, 0.99], [0.99, 1.0, 0.99], [0.99, 0.99, 1.0]];
        assert_eq!(
            ColourMixingMatrix::new(grey, 1e-4, None).unwrap().inverse(),
            None
        );
        assert_eq!(ColourMixingMatrix::new([[0.0; 3]; 3], 1e-4, None), None);
    }
}
