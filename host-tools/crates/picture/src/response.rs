//! Response curves of cameras and projectors: which light belongs to which value.

use serde::de::{self, Deserialize, Deserializer, Visitor};
use serde::{Serialize, Serializer};
use std::fmt;

/// Response curve of a camera or a projector: value and light both run from 0
/// to 1, of full scale.
///
/// In `capture.toml` it is `"linear"`, `"srgb"` or a gamma number such as `2.2`.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Response {
    /// The value is the light.
    #[default]
    Linear,
    /// The curve of IEC 61966-2-1.
    Srgb,
    /// `light = value^gamma`.
    Gamma(f64),
}

impl Response {
    /// Smallest and largest gamma that is taken for one: outside of it a number
    /// is a slip of the pen, and 1/2.2 for 2.2 is inside on purpose, since
    /// nothing tells it from a curve that brightens.
    pub const GAMMA: std::ops::RangeInclusive<f64> = 0.2..=5.0;

    /// Light of a value, both 0 to 1; what is outside is clamped.
    #[must_use]
    pub fn light(self, value: f64) -> f64 {
        let value = value.clamp(0.0, 1.0);
        match self {
            Self::Linear => value,
            Self::Srgb if value <= 0.040_45 => value / 12.92,
            Self::Srgb => ((value + 0.055) / 1.055).powf(2.4),
            Self::Gamma(gamma) => value.powf(gamma),
        }
    }

    /// Value that makes (or is made by) this light, the inverse of
    /// [`Response::light`].
    #[must_use]
    pub fn value(self, light: f64) -> f64 {
        let light = light.clamp(0.0, 1.0);
        match self {
            Self::Linear => light,
            Self::Srgb if light <= 0.003_130_8 => light * 12.92,
            Self::Srgb => 1.055 * light.powf(1.0 / 2.4) - 0.055,
            Self::Gamma(gamma) => light.powf(1.0 / gamma),
        }
    }
}

impl fmt::Display for Response {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Linear => f.write_str("linear"),
            Self::Srgb => f.write_str("srgb"),
            Self::Gamma(gamma) => write!(f, "{gamma}"),
        }
    }
}

impl Serialize for Response {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Gamma(gamma) => serializer.serialize_f64(*gamma),
            Self::Linear | Self::Srgb => serializer.collect_str(self),
        }
    }
}

/// What `capture.toml` says of a response.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Declared {
    /// Nothing.
    #[default]
    Unsaid,
    /// `"measure"`: it shall be measured from photographs.
    Measure,
    /// What it is.
    As(Response),
}

impl Declared {
    /// The response, if one was declared.
    #[must_use]
    pub const fn known(self) -> Option<Response> {
        match self {
            Self::As(response) => Some(response),
            Self::Unsaid | Self::Measure => None,
        }
    }

    /// Whether nothing was said.
    // serde hands a reference.
    #[allow(clippy::trivially_copy_pass_by_ref)]
    #[must_use]
    pub fn is_unsaid(&self) -> bool {
        *self == Self::Unsaid
    }
}

impl From<Response> for Declared {
    fn from(response: Response) -> Self {
        Self::As(response)
    }
}

impl Serialize for Declared {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::As(response) => response.serialize(serializer),
            Self::Measure => serializer.serialize_str(MEASURE),
            Self::Unsaid => serializer.serialize_none(),
        }
    }
}

/// Name of [`Declared::Measure`].
const MEASURE: &str = "measure";

impl<'de> Deserialize<'de> for Declared {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Name { measure: true })
    }
}

impl<'de> Deserialize<'de> for Response {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = Name { measure: false };
        let declared = deserializer.deserialize_any(name)?;
        // Without `measure` the visitor makes nothing else.
        declared.known().ok_or_else(|| de::Error::custom(name))
    }
}

/// Reads a response, and also [`MEASURE`] where that may stand.
#[derive(Clone, Copy)]
struct Name {
    measure: bool,
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (low, high) = (Response::GAMMA.start(), Response::GAMMA.end());
        let measure = if self.measure { "\"measure\", " } else { "" };
        write!(
            f,
            "\"linear\", \"srgb\", {measure}or a gamma from {low} to {high}"
        )
    }
}

impl Visitor<'_> for Name {
    type Value = Declared;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<Declared, E> {
        match name {
            "linear" => Ok(Response::Linear.into()),
            "srgb" => Ok(Response::Srgb.into()),
            MEASURE if self.measure => Ok(Declared::Measure),
            _ => Err(E::invalid_value(de::Unexpected::Str(name), &self)),
        }
    }

    fn visit_f64<E: de::Error>(self, gamma: f64) -> Result<Declared, E> {
        if Response::GAMMA.contains(&gamma) {
            Ok(Response::Gamma(gamma).into())
        } else {
            Err(E::invalid_value(de::Unexpected::Float(gamma), &self))
        }
    }

    fn visit_i64<E: de::Error>(self, gamma: i64) -> Result<Declared, E> {
        self.visit_f64(gamma as f64)
    }

    fn visit_u64<E: de::Error>(self, gamma: u64) -> Result<Declared, E> {
        self.visit_f64(gamma as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn srgb_matches_the_values_tabulated_in_its_standard() {
        // 8-bit 128 and 255/12.92/... from IEC 61966-2-1's own formula, worked
        // by hand to six digits.
        assert!((Response::Srgb.light(128.0 / 255.0) - 0.215_861).abs() < 1e-6);
        assert!((Response::Srgb.light(10.0 / 255.0) - 0.003_035).abs() < 1e-6);
        assert!((Response::Srgb.light(1.0) - 1.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn value_undoes_light(value in 0.0..=1.0_f64, gamma in Response::GAMMA) {
            for response in [Response::Linear, Response::Srgb, Response::Gamma(gamma)] {
                let back = response.value(response.light(value));
                // The sRGB standard's own two pieces miss each other by 1e-7.
                prop_assert!((back - value).abs() < 1e-6, "{response}: {value} became {back}");
            }
        }
    }
}
