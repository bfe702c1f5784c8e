//! Fine stripe role: what a picture of `stripes.csv` was shown for, and its name there.
//!
//! The Gray code of `capture.csv` tells cells apart. Fine stripes tell the projector's own pixels
//! apart: each cell of a row or column is halved again and again, and the code goes on with the
//! bits of the halves; then waves of light [`WAVE`] pixels long are shown in four steps.

use super::manifest::{ListedRole, ManifestOf, ShotOf};
use super::role::{CodeAxis, Role};
use std::f64::consts::TAU;
use std::fmt;

/// Name of the list of fine stripes in a capture folder. It may be absent.
pub const STRIPES_FILE: &str = "stripes.csv";

/// Length of a wave in projector pixels.
///
/// Light that bounces is the same under all steps of a short wave, so that beside a crease no
/// place is drawn towards the other side of it (Gupta and Nayar, *Micro phase shifting*, 2012).
pub const WAVE: f64 = 8.0;

/// Steps in which a wave is shown, each a quarter of it further on.
pub(crate) const STEPS: u8 = 4;

/// What a picture of `stripes.csv` was shown for.
///
/// [`fmt::Display`] writes and [`StripeRole::from_name`] reads the name that stands there:
/// `column-B`, `column-B-inverse`, `row-B`, `row-B-inverse` with a bit `B` that the cells' code
/// does not have, `column-wave-K`, `row-wave-K` with a step `K` of 0 to 3.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StripeRole {
    /// A bit of the code beyond those of the cells.
    Code {
        /// Along which it changes.
        axis: CodeAxis,
        /// Bit of the Gray code, 0 the most significant.
        bit: u8,
        /// Whether lit and dark are exchanged.
        inverse: bool,
    },
    /// A step of the waves.
    Wave {
        /// Along which it changes.
        axis: CodeAxis,
        /// Quarters of a wave that it is further on.
        step: u8,
    },
}

impl StripeRole {
    /// Reads a role's name; `None` if it is not one.
    ///
    /// ```
    /// use iltm_capture::{CodeAxis, StripeRole};
    /// let (axis, step) = (CodeAxis::Row, 3);
    /// assert_eq!(StripeRole::from_name("row-wave-3"), Some(StripeRole::Wave { axis, step }));
    /// assert_eq!(StripeRole::from_name("row-wave-4"), None);
    /// ```
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        if let Some((axis, bit, inverse)) = Role::from_name(name).and_then(Role::as_stripe) {
            return Some(Self::Code { axis, bit, inverse });
        }
        let (axis, step) = name.split_once("-wave-")?;
        let axis = match axis {
            "column" => CodeAxis::Column,
            "row" => CodeAxis::Row,
            _ => return None,
        };
        let step = (0..STEPS).find(|known| known.to_string() == step)?;
        Some(Self::Wave { axis, step })
    }

    /// The axis along which it changes.
    #[must_use]
    pub const fn axis(self) -> CodeAxis {
        match self {
            Self::Code { axis, .. } | Self::Wave { axis, .. } => axis,
        }
    }

    /// Light, 0 to 1, of pixel `at` of `pixels` along the axis; `bits` is how many the code has
    /// in all, and `cells` how many cells there are.
    #[must_use]
    pub fn light(self, at: usize, pixels: usize, cells: usize, bits: u8) -> f64 {
        match self {
            Self::Code { bit, inverse, .. } => {
                let halvings = bits.saturating_sub(coarse_bits(cells));
                // Where the pixel's centre lies.
                let part = (2 * at + 1) * (cells << halvings) / (2 * pixels.max(1));
                let shift = u32::from(bits.saturating_sub(bit + 1));
                let lit = ((part ^ (part >> 1)) >> shift) & 1 == 1;
                f64::from(u8::from(lit != inverse))
            }
            Self::Wave { step, .. } => {
                let place = (at as f64 + 0.5) / WAVE - f64::from(step) / f64::from(STEPS);
                0.5 + 0.5 * (TAU * place).cos()
            }
        }
    }

    /// All fine stripes of an axis with so many cells over so many pixels, in the order of
    /// showing, and the bits of its whole code: the last halves are at most half a wave wide.
    #[must_use]
    pub fn of_axis(axis: CodeAxis, cells: usize, pixels: usize) -> (Vec<Self>, u8) {
        let coarse = coarse_bits(cells);
        let wide = |halvings: &u8| pixels as f64 > 0.5 * WAVE * (cells << halvings) as f64;
        let halvings = (0..Role::MAX_BITS - coarse).take_while(wide).count() as u8;
        let code = (coarse..coarse + halvings)
            .flat_map(|bit| [false, true].map(|inverse| Self::Code { axis, bit, inverse }));
        let waves = (0..STEPS).map(|step| Self::Wave { axis, step });
        (code.chain(waves).collect(), coarse + halvings)
    }
}

/// Bits of the Gray code that tells so many cells apart.
pub(crate) const fn coarse_bits(cells: usize) -> u8 {
    cells.next_power_of_two().trailing_zeros() as u8
}

impl fmt::Display for StripeRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Code { axis, bit, inverse } => axis.stripe(bit, inverse).fmt(f),
            Self::Wave { axis, step } => write!(f, "{axis}-wave-{step}"),
        }
    }
}

impl ListedRole for StripeRole {
    const FILE: &'static str = STRIPES_FILE;
    const NEXT_STEP: &'static str = "Use column-B, column-B-inverse, row-B or row-B-inverse, B being \
         a bit beyond those of the cells, or column-wave-K or row-wave-K with a step K from 0 to 3.";

    fn from_name(name: &str) -> Option<Self> {
        Self::from_name(name)
    }

    fn unknown(role: &str) -> String {
        format!("unknown role {role:?}")
    }
}

/// All lines of a `stripes.csv`, ordered by index.
pub type StripeManifest = ManifestOf<StripeRole>;

/// One line of `stripes.csv`.
pub type StripeShot = ShotOf<StripeRole>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::code::binary;

    #[test]
    fn every_role_is_read_back_from_its_name() {
        for axis in [CodeAxis::Column, CodeAxis::Row] {
            for role in StripeRole::of_axis(axis, 24, 1080).0 {
                assert_eq!(StripeRole::from_name(&role.to_string()), Some(role));
            }
        }
        for name in [
            "",
            "white",
            "bernoulli",
            "column-wave-",
            "column-wave-04",
            "wave-1",
        ] {
            assert_eq!(StripeRole::from_name(name), None, "{name:?}");
        }
    }

    #[test]
    fn full_hd_takes_no_more_than_forty_photographs() {
        for (rows, cols) in [(9, 16), (24, 32), (48, 64), (13, 21), (64, 64)] {
            let (columns, _) = StripeRole::of_axis(CodeAxis::Column, cols, 1920);
            let (across, _) = StripeRole::of_axis(CodeAxis::Row, rows, 1080);
            assert!(columns.len() + across.len() <= 40, "{rows} x {cols}");
        }
    }

    /// The cell's number and the bits of the halves, as a camera sees them, give the half again.
    #[test]
    fn the_code_of_the_cells_goes_on_within_them() {
        for (cells, pixels) in [(32, 1920), (21, 168), (13, 1080), (5, 63)] {
            let (roles, bits) = StripeRole::of_axis(CodeAxis::Column, cells, pixels);
            let halvings = bits - coarse_bits(cells);
            for at in 0..pixels {
                let cell = (2 * at + 1) * cells / (2 * pixels);
                let gray = cell ^ (cell >> 1);
                let word = roles.iter().fold(gray as u32, |word, role| match role {
                    StripeRole::Code { inverse: false, .. } => {
                        word << 1 | u32::from(role.light(at, pixels, cells, bits) > 0.5)
                    }
                    _ => word,
                });
                let half = (2 * at + 1) * (cells << halvings) / (2 * pixels);
                assert_eq!(binary(word) as usize, half, "{cells} {pixels} {at}");
            }
        }
    }
}
