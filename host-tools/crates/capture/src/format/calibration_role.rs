//! Calibration role: what a picture of `calibration.csv` was shown for, and its name there.

use super::manifest::{CALIBRATION_FILE, ListedRole, ManifestOf, ShotOf};
use std::fmt;

/// Channels of the projector that a ramp is shown in.
#[derive(
    Clone, Copy, PartialEq, Eq, Debug, Hash, PartialOrd, Ord, strum::Display, strum::EnumString,
)]
#[strum(serialize_all = "lowercase")]
pub enum RampChannel {
    /// All of them alike.
    White,
    /// Red alone.
    Red,
    /// Green alone.
    Green,
    /// Blue alone.
    Blue,
}

impl RampChannel {
    /// Every channel, in the order in which ramps are shown.
    pub const ALL: [Self; 4] = [Self::White, Self::Red, Self::Green, Self::Blue];

    /// The projector's input of every cell at `level`: red, green, blue.
    ///
    /// ```
    /// use iltm_capture::RampChannel;
    /// assert_eq!(RampChannel::Green.input(96), [0, 96, 0]);
    /// ```
    #[must_use]
    pub const fn input(self, level: u8) -> [u8; 3] {
        match self {
            Self::White => [level; 3],
            Self::Red => [level, 0, 0],
            Self::Green => [0, level, 0],
            Self::Blue => [0, 0, level],
        }
    }
}

/// What a picture of `calibration.csv` was shown for.
///
/// [`fmt::Display`] writes and [`CalibrationRole::from_name`] reads the name that
/// stands there: `ramp-white-LLL`, `ramp-red-LLL`, `ramp-green-LLL`,
/// `ramp-blue-LLL`, `probe`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum CalibrationRole {
    /// All cells alike.
    Ramp {
        /// Channels that are lit.
        channel: RampChannel,
        /// Their input value; the others' is 0.
        level: u8,
    },
    /// A few lit cells, far from each other.
    Probe,
}

impl CalibrationRole {
    /// Reads a role's name; `None` if it is not one.
    ///
    /// ```
    /// use iltm_capture::{CalibrationRole, RampChannel};
    /// let role = CalibrationRole::from_name("ramp-red-064");
    /// let (channel, level) = (RampChannel::Red, 64);
    /// assert_eq!(role, Some(CalibrationRole::Ramp { channel, level }));
    /// assert_eq!(CalibrationRole::from_name("ramp-red-64"), None);
    /// ```
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        if name == "probe" {
            return Some(Self::Probe);
        }
        let (channel, digits) = name.strip_prefix("ramp-")?.split_once('-')?;
        let channel = channel.parse().ok()?;
        // `parse` alone would also take "+64" and "64".
        let level: u8 = digits.parse().ok()?;
        (digits == format!("{level:03}")).then_some(Self::Ramp { channel, level })
    }
}

impl fmt::Display for CalibrationRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Ramp { channel, level } => write!(f, "ramp-{channel}-{level:03}"),
            Self::Probe => f.write_str("probe"),
        }
    }
}

impl ListedRole for CalibrationRole {
    const FILE: &'static str = CALIBRATION_FILE;

    fn from_name(name: &str) -> Option<Self> {
        Self::from_name(name)
    }

    fn unknown(role: &str) -> String {
        format!(
            "unknown role \"{role}\"; it must be probe, or ramp-white-LLL, ramp-red-LLL, \
             ramp-green-LLL or ramp-blue-LLL with a level LLL from 000 to 255"
        )
    }
}

/// All lines of a `calibration.csv`, ordered by index.
pub type CalibrationManifest = ManifestOf<CalibrationRole>;

/// One line of `calibration.csv`.
pub type CalibrationShot = ShotOf<CalibrationRole>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_role_is_read_back_from_its_name() {
        let ramps = RampChannel::ALL.into_iter().flat_map(|channel| {
            (0..=u8::MAX).map(move |level| CalibrationRole::Ramp { channel, level })
        });
        for role in ramps.chain([CalibrationRole::Probe]) {
            assert_eq!(CalibrationRole::from_name(&role.to_string()), Some(role));
        }
    }

    #[test]
    fn names_that_only_look_like_roles_are_refused() {
        for name in [
            "",
            "Probe",
            "probe-1",
            "ramp",
            "ramp-white",
            "ramp-white-",
            "ramp-white-64",
            "ramp-white-256",
            "ramp-white-+64",
            "ramp-white-0064",
            "ramp-grey-064",
            "white-064",
        ] {
            assert_eq!(CalibrationRole::from_name(name), None, "{name:?}");
        }
    }

    #[test]
    fn a_colour_ramp_lights_one_channel_and_a_white_one_lights_all() {
        let lit = RampChannel::ALL.map(|channel| channel.input(9));
        assert_eq!(lit, [[9, 9, 9], [9, 0, 0], [0, 9, 0], [0, 0, 9]]);
    }
}
