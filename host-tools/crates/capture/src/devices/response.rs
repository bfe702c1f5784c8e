//! Camera response calibration: the response recovered from photographs that must add up.
//!
//! First the member of a family of one parameter that adds up best (a gamma, or
//! sRGB), then a smooth correction of it where that adds up much better, as in
//! Mitsunaga and Nayar, *Radiometric self calibration*, CVPR 1999, whose polynomial
//! has the same two conditions: no light at 0 and full light at 1.

use super::balance::{Balance, Balances, Lookup};
use iltm_picture::{Curve, DeviceResponse, Response};
use nalgebra::{DMatrix, DVector};

/// What a camera's response was recovered from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CameraSource {
    /// Gray code patterns and their inverses against white and black.
    Pairs {
        /// How many pairs.
        pairs: usize,
    },
    /// Photographs of one pattern with different exposures.
    Brackets {
        /// How many pairs of exposures.
        pairs: usize,
    },
}

/// How well photographs add up, as declared and at best.
#[derive(Clone, PartialEq, Debug)]
pub struct CameraFit {
    /// What was added up.
    pub source: CameraSource,
    /// The response that the photographs were read with.
    pub declared: DeviceResponse,
    /// How far sums are off with it, relative to white, root mean square over
    /// groups of similar pixels.
    pub declared_misfit: f64,
    /// The response with which the photographs add up best.
    pub best: DeviceResponse,
    /// How far sums are off with that.
    pub best_misfit: f64,
    /// Misfit of the worse of a linear camera and one with a gamma of 2.2: where
    /// it is small, the photographs do not tell responses apart.
    pub contrast: f64,
    /// Misfit that a curve of 1.3 times the best one's gamma, or of as much less, adds
    /// to the best one's: where it is small, such a camera would pass.
    pub sharpness: f64,
}

/// What a camera's gamma is off for `iltm check` to name it, as a factor.
const NOTICED: f64 = 1.3;

/// Misfit below which photographs add up: what rounding to 8 bits leaves.
const GOOD: f64 = 0.005;

/// Responses must differ by this many times the best misfit to be told apart: noise
/// that is clipped at black alone looks like a little curvature.
const TELLING: f64 = 4.0;

/// A misfit must be this many times another for the difference to be believed.
const CLEARLY: f64 = 2.0;

/// Difference of misfits that is believed whatever they are; good sessions of the gates' study stay
/// below.
const PLAIN: f64 = 0.008;

impl CameraFit {
    /// Recovers the response from balances of pixels that were read with
    /// `declared` and whose values are those of the files; `None` if there are too
    /// few.
    pub(crate) fn new(
        balances: &[Balance],
        source: CameraSource,
        declared: &DeviceResponse,
    ) -> Option<Self> {
        let balances = Balances::new(balances)?;
        let misfit = |response: Response| balances.misfit_of(&response.into());
        let gamma = best_gamma(|gamma| misfit(Response::Gamma(gamma)));
        let family = [Response::Linear, Response::Srgb, Response::Gamma(gamma)];
        let least = family.map(misfit).into_iter().fold(f64::INFINITY, f64::min);
        // The plainest name that is about as good: a gamma of 1.01 is linear.
        let good = |response: &Response| misfit(*response) <= (1.1 * least).max(0.5 * GOOD);
        let plain = family.into_iter().find(good).unwrap_or(family[2]);
        let (mut best, mut best_misfit) = (plain.into(), misfit(plain));
        if best_misfit > GOOD
            && let Some(curve) = corrected(&balances, plain)
        {
            let curve = DeviceResponse::Measured(curve);
            let misfit = balances.misfit_of(&curve);
            if CLEARLY * misfit < best_misfit {
                (best, best_misfit) = (curve, misfit);
            }
        }
        let powered = |power: f64| {
            let light = |value: f64| best.light(value).powf(power);
            balances.misfit(&Lookup::new(light)) - best_misfit
        };
        let sharpness = powered(NOTICED).min(powered(1.0 / NOTICED));
        Some(Self {
            source,
            sharpness,
            declared_misfit: balances.misfit_of(declared),
            declared: declared.clone(),
            best,
            best_misfit,
            contrast: misfit(Response::Linear).max(misfit(Response::Gamma(2.2))),
        })
    }

    /// Once the photographs are read with the best response, that is the declared
    /// one.
    pub(super) fn adopted(mut self) -> Self {
        self.declared = self.best.clone();
        self.declared_misfit = self.best_misfit;
        self
    }

    /// Whether the photographs tell one response from another at all: pixels that
    /// are only black or white add up with any.
    #[must_use]
    pub fn tells(&self) -> bool {
        self.contrast > TELLING * self.best_misfit.max(GOOD)
    }

    /// Whether another response than the declared one adds up clearly better.
    #[must_use]
    pub fn contradicts(&self) -> bool {
        self.tells()
            && self.declared_misfit > GOOD
            && (self.declared_misfit > CLEARLY * self.best_misfit
                || self.declared_misfit > self.best_misfit + PLAIN)
    }

    /// Whether a gamma off by [`NOTICED`] would be noticed: it must stand out as much as a
    /// difference that is believed.
    pub(crate) fn would_notice(&self) -> bool {
        self.tells() && self.sharpness > PLAIN
    }

    /// The power that turns light as read into light by the best response, at half the range.
    pub(crate) fn power(&self) -> f64 {
        let half = |response: &DeviceResponse| response.light(0.5).ln();
        half(&self.best) / half(&self.declared)
    }

    /// The finding in a sentence.
    #[must_use]
    pub fn words(&self) -> String {
        let percent = |misfit: f64| format!("{:.1} %", 100.0 * misfit);
        let declared = percent(self.declared_misfit);
        if !self.tells() {
            return format!(
                "the photographs do not tell the camera's response; as read ({}) they add up \
                 within {declared}",
                self.declared
            );
        }
        if !self.contradicts() && !self.would_notice() {
            return format!(
                "the photographs hardly tell the camera's response: as read ({}) they add up \
                 within {declared}, and with a gamma off by a factor of {NOTICED} nearly as well",
                self.declared
            );
        }
        if !self.contradicts() {
            return format!(
                "the photographs add up with the camera's response as read ({}, misfit {declared})",
                self.declared
            );
        }
        format!(
            "the photographs add up best with a camera response of {} (misfit {} against \
             {declared} with {})",
            self.best,
            percent(self.best_misfit),
            self.declared,
        )
    }
}

/// The gamma of least misfit.
fn best_gamma(misfit: impl Fn(f64) -> f64) -> f64 {
    let (low, high) = (0.3_f64.ln(), Response::GAMMA.end().ln());
    least((low, high - low), 24, 20, |gamma| misfit(gamma.exp())).exp()
}

/// Where from `low` to `low + range` a function is least: the best of `steps` coarse
/// steps, then `rounds` of golden section search.
pub(super) fn least(
    (low, range): (f64, f64),
    steps: usize,
    rounds: usize,
    of: impl Fn(f64) -> f64,
) -> f64 {
    let place = |k: usize| low + range * k as f64 / steps as f64;
    let coarse = (0..=steps).min_by(|a, b| of(place(*a)).total_cmp(&of(place(*b))));
    let at = coarse.unwrap_or(0);
    let (mut from, mut to) = (place(at.saturating_sub(1)), place((at + 1).min(steps)));
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..rounds {
        let (a, b) = (to - golden * (to - from), from + golden * (to - from));
        if of(a) < of(b) {
            to = b;
        } else {
            from = a;
        }
    }
    0.5 * (from + to)
}

/// Terms of the correction.
const TERMS: usize = 3;

/// Steps of a corrected response.
const KNOTS: u32 = 64;

/// `u + u (1 - u) (c0 + c1 u + c2 u^2)` with `u` the light of `plain`, with the
/// coefficients that add up best; `None` if that does not rise.
fn corrected(balances: &Balances, plain: Response) -> Option<Curve> {
    let term = |k: usize, value: f64| {
        let u = plain.light(value);
        u * (1.0 - u) * u.powi(k as i32)
    };
    let base = Lookup::new(|value| plain.light(value));
    let (sums, light) = (balances.sums(&base), balances.light(&base));
    let terms = (0..TERMS).map(|k| balances.sums(&Lookup::new(|value| term(k, value))));
    // The last unknown is white's own factor, which no curve is to explain.
    let columns: Vec<Vec<f64>> = terms.chain([balances.white(&base)]).collect();
    let unknowns = columns.len();
    let matrix = DMatrix::from_fn(sums.len(), unknowns, |g, k| {
        columns[k][g] / light[g].max(1e-9)
    });
    let wanted = DVector::from_fn(sums.len(), |g, _| -sums[g] / light[g].max(1e-9));
    // A slight preference for no correction where nothing speaks for one.
    let normal = matrix.transpose() * &matrix + DMatrix::identity(unknowns, unknowns) * 1e-4;
    let found = normal.cholesky()?.solve(&(matrix.transpose() * wanted));
    let light = |value: f64| {
        plain.light(value) + (0..TERMS).map(|k| found[k] * term(k, value)).sum::<f64>()
    };
    let points: Vec<(f64, f64)> = (0..=KNOTS)
        .map(|k| f64::from(k) / f64::from(KNOTS))
        .map(|value| (value, light(value)))
        .collect();
    let rises = points.windows(2).all(|two| two[0].1 <= two[1].1);
    if rises { Curve::new(&points) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_capture::Dice;

    /// Pairs of a pattern and its inverse: `own` of a pixel's light comes with the
    /// pattern, the rest with the inverse, as seen by a camera of this response.
    fn pairs(encode: impl Fn(f64) -> f64, noise: f64, step: f64) -> Vec<Balance> {
        let mut dice = Dice::new(8);
        let mut value = |light: f64| {
            let value = encode((light + noise * dice.normal()).clamp(0.0, 1.0));
            ((value / step).round() * step) as f32
        };
        let mut each = |k: u32| {
            let white = 0.2 + 0.6 * f64::from(k % 61) / 61.0;
            let (own, black) = (f64::from(k % 37) / 37.0, 0.01);
            let lit = white - black;
            Balance {
                values: [
                    value(black + own * lit),
                    value(black + (1.0 - own) * lit),
                    value(white),
                    value(black),
                ],
                weights: [1.0, 1.0, -1.0, -1.0],
            }
        };
        (0..20_000).map(&mut each).collect()
    }

    fn fit(balances: &[Balance], declared: Response) -> CameraFit {
        let source = CameraSource::Pairs { pairs: 9 };
        CameraFit::new(balances, source, &declared.into()).unwrap()
    }

    #[test]
    fn an_eight_bit_camera_of_gamma_2_2_is_found_though_declared_linear() {
        let gamma = Response::Gamma(2.2);
        let found = fit(
            &pairs(|l| gamma.value(l), 0.004, 1.0 / 255.0),
            Response::Linear,
        );
        let DeviceResponse::Known(Response::Gamma(best)) = found.best else {
            panic!("{:?}", found.best)
        };
        assert!((best - 2.2).abs() < 0.03, "{best}");
        assert!(
            found.best_misfit < 0.005 && found.declared_misfit > 10.0 * found.best_misfit,
            "{found:?}"
        );
        assert!(found.contradicts());
        let words = found.words();
        assert!(
            words.contains("best with a camera response of gamma 2.2"),
            "{words}"
        );
    }

    #[test]
    fn a_camera_that_is_what_was_declared_is_not_contradicted() {
        for response in [Response::Linear, Response::Srgb] {
            let found = fit(&pairs(|l| response.value(l), 0.004, 1.0 / 255.0), response);
            assert_eq!(found.best, response.into());
            assert!(found.tells() && !found.contradicts(), "{found:?}");
        }
    }

    /// Photographs of a path tracer, or of a camera at high gain: groups by a pixel's own values
    /// gathered those whose noise was high, and a linear camera was accused of a gamma of 0.8.
    #[test]
    fn noise_that_grows_with_the_light_is_no_curve() {
        let mut dice = Dice::new(3);
        let mut balances = pairs(|light| light, 0.0, 1.0 / 4095.0);
        for value in balances.iter_mut().flat_map(|balance| &mut balance.values) {
            *value *= 1.0 + 0.06 * dice.normal() as f32;
        }
        let found = fit(&balances, Response::Linear);
        assert!(found.tells() && !found.contradicts(), "{found:?}");
        assert_eq!(found.best, Response::Linear.into());
    }

    /// Of an even screen, nearly all pixels are only black or white: a lamp that has lost light
    /// since white was taken looked like a gamma of 0.3.
    #[test]
    fn a_lamp_that_loses_light_after_white_is_no_curve() {
        let mut balances = pairs(|light| light, 0.004, 1.0 / 4095.0);
        for (at, balance) in balances.iter_mut().enumerate() {
            let [white, black] = [balance.values[2], balance.values[3]];
            if at % 8 > 0 {
                balance.values = [white, black, white, black];
            }
            balance.values[2] *= 1.08;
        }
        let found = fit(&balances, Response::Linear);
        assert!(!found.contradicts(), "{found:?}");
        assert!(found.declared_misfit < 0.01, "{found:?}");
    }

    #[test]
    fn a_curve_of_no_family_is_found_by_its_correction() {
        // An S: light = v^2 (3 - 2 v) mixed with v^2.
        let light = |v: f64| 0.5 * v * v * (3.0 - 2.0 * v) + 0.5 * v * v;
        let encode = |light_wanted: f64| {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..50 {
                let middle = 0.5 * (low + high);
                if light(middle) < light_wanted {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            high
        };
        let found = fit(&pairs(encode, 0.001, 1.0 / 65_535.0), Response::Linear);
        assert!(
            matches!(found.best, DeviceResponse::Measured(_)),
            "{found:?}"
        );
        // A response is known up to a factor: compared at the brightest value seen.
        let top = encode(0.8);
        for value in [0.2, 0.4, 0.6] {
            let wanted = light(value) / light(top);
            let measured = found.best.light(value) / found.best.light(top);
            assert!(
                (measured - wanted).abs() < 0.01,
                "{value}: {measured} {wanted}"
            );
        }
    }

    #[test]
    fn pixels_that_are_only_black_or_white_tell_nothing() {
        let only = Balance {
            values: [0.5, 0.01, 0.5, 0.01],
            weights: [1.0, 1.0, -1.0, -1.0],
        };
        let found = fit(&vec![only; 1000], Response::Linear);
        assert!(!found.tells() && !found.contradicts(), "{found:?}");
        let source = CameraSource::Pairs { pairs: 1 };
        assert_eq!(
            CameraFit::new(&[only; 10], source, &Response::Linear.into()),
            None
        );
    }

    #[test]
    fn two_exposures_give_the_response_of_a_pixel_of_any_light() {
        let bracket = |k: u32| {
            let light = 0.02 + 0.9 * f64::from(k) / 5000.0;
            let value = |l: f64| (Response::Srgb.value(l) * 255.0).round() / 255.0;
            Balance {
                values: [value(light) as f32, value(light / 4.0) as f32, 0.0, 0.0],
                weights: [1.0, -4.0, 0.0, 0.0],
            }
        };
        let source = CameraSource::Brackets { pairs: 1 };
        let balances: Vec<Balance> = (0..5000).map(bracket).collect();
        let found = CameraFit::new(&balances, source, &Response::Gamma(1.8).into()).unwrap();
        assert_eq!(found.best, Response::Srgb.into(), "{found:?}");
        assert!(found.contradicts());
    }
}
