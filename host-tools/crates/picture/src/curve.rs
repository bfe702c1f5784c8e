//! A measured response: light at some values, monotone and smooth between them.

use crate::Response;
use std::fmt;

/// A rising curve through measured points, value and light both from 0 to 1.
///
/// Between the points it is a monotone cubic (Fritsch and Carlson, *Monotone
/// piecewise cubic interpolation*, SIAM J. Numer. Anal. 1980) of the values that
/// the nearest formula gives the light: sRGB or a power. That is almost a straight
/// line, so that few points do, and what is darker than the darkest point follows
/// the formula.
#[derive(Clone, PartialEq, Debug)]
pub struct Curve {
    /// The formula that is nearest to the points.
    nearest: Response,
    /// The power that is.
    gamma: f64,
    /// Values, ascending from 0 to 1.
    values: Vec<f64>,
    /// The formula's value for the light at each of them, not falling.
    straight: Vec<f64>,
    /// Slope of these at each of them.
    slopes: Vec<f64>,
}

impl Curve {
    /// A curve through `(value, light)` points in any order. Points of one value
    /// are averaged, light that falls is levelled ([`level`]), and light is
    /// scaled to be 0 at the lowest value and 1 at the highest, which become 0
    /// and 1.
    ///
    /// `None` if there are fewer than two values, a number is not finite, or the
    /// light does not rise from the lowest to the highest.
    #[must_use]
    pub fn new(points: &[(f64, f64)]) -> Option<Self> {
        if points.iter().any(|p| !p.0.is_finite() || !p.1.is_finite()) {
            return None;
        }
        let mut points = points.to_vec();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let same = points.chunk_by(|a, b| a.0.total_cmp(&b.0).is_eq());
        let mean = |of: &[(f64, f64)]| of.iter().map(|p| p.1).sum::<f64>() / of.len() as f64;
        let (values, light): (Vec<f64>, Vec<f64>) = same.map(|of| (of[0].0, mean(of))).unzip();
        let light = level(&light);
        let (low, high) = (*values.first()?, *values.last()?);
        let (dark, bright) = (*light.first()?, *light.last()?);
        if high <= low || bright <= dark {
            return None;
        }
        let values: Vec<f64> = values.iter().map(|v| (v - low) / (high - low)).collect();
        let light: Vec<f64> = light.iter().map(|l| (l - dark) / (bright - dark)).collect();
        let gamma = nearest_gamma(&values, &light);
        let off = |formula: Response| -> f64 {
            let points = values.iter().zip(&light);
            points.map(|(v, l)| (formula.light(*v) - l).powi(2)).sum()
        };
        let power = Response::Gamma(gamma);
        let nearest = if off(Response::Srgb) < off(power) {
            Response::Srgb
        } else {
            power
        };
        let straight: Vec<f64> = light.iter().map(|l| nearest.value(*l)).collect();
        let slopes = slopes(&values, &straight);
        Some(Self {
            nearest,
            gamma,
            values,
            straight,
            slopes,
        })
    }

    /// Light of a value, both 0 to 1; what is outside is clamped.
    #[must_use]
    pub fn light(&self, value: f64) -> f64 {
        let value = value.clamp(0.0, 1.0);
        let after = self.values.partition_point(|&v| v <= value);
        let right = after.clamp(1, self.values.len() - 1);
        let (x0, x1) = (self.values[right - 1], self.values[right]);
        let (y0, y1) = (self.straight[right - 1], self.straight[right]);
        let (m0, m1) = (self.slopes[right - 1], self.slopes[right]);
        let width = x1 - x0;
        let t = (value - x0) / width;
        let (t2, t3) = (t * t, t * t * t);
        let straight = (2.0 * t3 - 3.0 * t2 + 1.0) * y0
            + (t3 - 2.0 * t2 + t) * width * m0
            + (3.0 * t2 - 2.0 * t3) * y1
            + (t3 - t2) * width * m1;
        self.nearest.light(straight)
    }

    /// The lowest value that makes this light, the inverse of [`Curve::light`].
    #[must_use]
    pub fn value(&self, light: f64) -> f64 {
        let light = light.clamp(0.0, 1.0);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..52 {
            let middle = 0.5 * (low + high);
            if self.light(middle) < light {
                low = middle;
            } else {
                high = middle;
            }
        }
        if light <= 0.0 { 0.0 } else { high }
    }

    /// The power `light = value^gamma` that is nearest to the points.
    #[must_use]
    pub fn gamma(&self) -> f64 {
        self.gamma
    }
}

/// What turns a device's values into light: a known formula or a measurement.
#[derive(Clone, PartialEq, Debug)]
pub enum DeviceResponse {
    /// By a formula.
    Known(Response),
    /// By points that were measured.
    Measured(Curve),
}

impl DeviceResponse {
    /// Light of a value, both 0 to 1; what is outside is clamped.
    #[must_use]
    pub fn light(&self, value: f64) -> f64 {
        match self {
            Self::Known(response) => response.light(value),
            Self::Measured(curve) => curve.light(value),
        }
    }

    /// Value of a light, the inverse of [`DeviceResponse::light`].
    #[must_use]
    pub fn value(&self, light: f64) -> f64 {
        match self {
            Self::Known(response) => response.value(light),
            Self::Measured(curve) => curve.value(light),
        }
    }

    /// Largest difference to `other` in the values for one light, in steps of an
    /// 8-bit value. Light below a hundredth of full light, where ramps are dark
    /// and curves differ most, does not count.
    #[must_use]
    pub fn steps_from(&self, other: &Self) -> f64 {
        const SEEN: f64 = 0.01;
        let light = (0..=255).map(|step| self.light(f64::from(step) / 255.0));
        light
            .filter(|light| *light >= SEEN)
            .map(|light| 255.0 * (self.value(light) - other.value(light)).abs())
            .fold(0.0, f64::max)
    }
}

impl From<Response> for DeviceResponse {
    fn from(response: Response) -> Self {
        Self::Known(response)
    }
}

impl fmt::Display for DeviceResponse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known(Response::Gamma(gamma)) => write!(f, "gamma {gamma:.2}"),
            Self::Known(response) => response.fmt(f),
            Self::Measured(curve) if curve.nearest == Response::Srgb => {
                f.write_str("measured, about sRGB")
            }
            Self::Measured(curve) => write!(f, "measured, about gamma {:.2}", curve.gamma),
        }
    }
}

/// A projector's response: one for all its channels, or one each.
#[derive(Clone, PartialEq, Debug)]
pub struct ProjectorResponse(Vec<DeviceResponse>);

impl ProjectorResponse {
    /// One response a channel; `None` without any.
    #[must_use]
    pub fn of_channels(channels: Vec<DeviceResponse>) -> Option<Self> {
        (!channels.is_empty()).then_some(Self(channels))
    }

    /// The response of a channel.
    #[must_use]
    pub fn channel(&self, channel: usize) -> &DeviceResponse {
        self.0.get(channel).unwrap_or(&self.0[0])
    }

    /// All of them: one for all channels, or one each.
    #[must_use]
    pub fn channels(&self) -> &[DeviceResponse] {
        &self.0
    }

    /// Whether codes are in proportion to light in every channel.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        let linear = DeviceResponse::Known(Response::Linear);
        self.0.iter().all(|response| *response == linear)
    }
}

impl Default for ProjectorResponse {
    fn default() -> Self {
        Response::Linear.into()
    }
}

impl<R: Into<DeviceResponse>> From<R> for ProjectorResponse {
    fn from(response: R) -> Self {
        Self(vec![response.into()])
    }
}

/// The rising sequence that is nearest in least squares (pool adjacent
/// violators; Barlow, Bartholomew, Bremner, Brunk 1972).
#[must_use]
pub fn level(light: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for &light in light {
        let mut pool = (light, 1);
        while let Some(&(before, count)) = pools.last().filter(|last| last.0 > pool.0) {
            let both = count + pool.1;
            pool.0 = (before * count as f64 + pool.0 * pool.1 as f64) / both as f64;
            pool.1 = both;
            pools.pop();
        }
        pools.push(pool);
    }
    let each = |(light, count): (f64, usize)| std::iter::repeat_n(light, count);
    pools.into_iter().flat_map(each).collect()
}

/// The power that fits the points best on logarithmic scales; 1 if none can be
/// told.
fn nearest_gamma(values: &[f64], light: &[f64]) -> f64 {
    let inner = |&(&v, &l): &(&f64, &f64)| v > 0.05 && v < 1.0 && l > 0.0;
    let (mut top, mut bottom) = (0.0, 0.0);
    for (value, light) in values.iter().zip(light).filter(inner) {
        // Weighted by the light: the darks are all noise in a photograph.
        top += light * value.ln() * light.ln();
        bottom += light * value.ln().powi(2);
    }
    let gamma = if bottom > 0.0 { top / bottom } else { 1.0 };
    gamma.clamp(*Response::GAMMA.start(), *Response::GAMMA.end())
}

/// Slopes that keep a cubic between rising points rising.
fn slopes(values: &[f64], straight: &[f64]) -> Vec<f64> {
    let last = values.len() - 1;
    let secant = |k: usize| (straight[k + 1] - straight[k]) / (values[k + 1] - values[k]);
    let slope = |k: usize| {
        if k == 0 {
            return secant(0);
        }
        if k == last {
            return secant(last - 1);
        }
        let (before, after) = (secant(k - 1), secant(k));
        if before <= 0.0 || after <= 0.0 {
            return 0.0;
        }
        // Weighted harmonic mean: Fritsch and Butland 1984.
        let (h0, h1) = (values[k] - values[k - 1], values[k + 1] - values[k]);
        let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
        (w0 + w1) / (w0 / before + w1 / after)
    };
    (0..=last).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sampled(response: Response, count: u32) -> Vec<(f64, f64)> {
        let value = |k| f64::from(k) / f64::from(count - 1);
        (0..count)
            .map(|k| (value(k), response.light(value(k))))
            .collect()
    }

    #[test]
    fn seventeen_points_of_a_projectors_curve_give_it_back_within_half_a_step() {
        for response in [Response::Srgb, Response::Gamma(2.2), Response::Linear] {
            let curve = Curve::new(&sampled(response, 17)).unwrap();
            let steps = DeviceResponse::from(response).steps_from(&DeviceResponse::Measured(curve));
            assert!(steps < 0.5, "{response}: {steps}");
        }
    }

    /// Light of the darkest codes, which no ramp measures, decides how dark scenes look.
    #[test]
    fn codes_darker_than_the_darkest_of_nine_points_follow_the_nearest_formula() {
        for response in [Response::Srgb, Response::Gamma(2.2), Response::Gamma(1.8)] {
            for noise in [0.0, 0.001] {
                let mut points = sampled(response, 9);
                for (k, point) in points.iter_mut().enumerate().skip(1) {
                    point.1 *= 1.0 + if k % 2 == 0 { noise } else { -noise };
                }
                let curve = Curve::new(&points).unwrap();
                for code in 0..32 {
                    let light = response.light(f64::from(code) / 255.0);
                    let off = 255.0 * curve.value(light) - f64::from(code);
                    assert!(off.abs() < 0.5, "{response}: {off:.2} at {code}");
                }
            }
        }
    }

    #[test]
    fn points_that_do_not_rise_make_no_curve() {
        assert_eq!(Curve::new(&[]), None);
        assert_eq!(Curve::new(&[(0.0, 0.0)]), None);
        assert_eq!(Curve::new(&[(0.0, 1.0), (1.0, 0.5)]), None);
        assert_eq!(Curve::new(&[(0.0, 0.0), (1.0, f64::NAN)]), None);
    }

    #[test]
    fn levelling_averages_what_falls() {
        assert_eq!(level(&[1.0, 3.0, 2.0, 4.0]), [1.0, 2.5, 2.5, 4.0]);
        assert_eq!(level(&[3.0, 2.0, 1.0]), [2.0, 2.0, 2.0]);
    }

    proptest! {
        #[test]
        fn any_points_make_a_rising_curve_that_its_inverse_undoes(
            light in proptest::collection::vec(0.0..1.0_f64, 2..20),
        ) {
            let points: Vec<_> = light.iter().enumerate().map(|(k, &l)| (k as f64, l)).collect();
            let Some(curve) = Curve::new(&points) else { return Ok(()) };
            let mut before = 0.0;
            for step in 0..=1000 {
                let light = curve.light(f64::from(step) / 1000.0);
                prop_assert!(light >= before - 1e-12);
                before = light;
                prop_assert!((curve.light(curve.value(light)) - light).abs() < 1e-6);
            }
        }
    }
}
