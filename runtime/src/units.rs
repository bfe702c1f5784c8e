//! Units: fixed-point quantities and the places where they are rounded.
//!
//! Everything between the decoded frame and the encoded one is one of these
//! types. A value changes type, and is rounded, only in a function that says so
//! in its documentation.

use core::ops::AddAssign;
use fixed::types::{I9F23, U1F15};
use serde::{Deserialize, Serialize};

/// Linear light at a cell or pixel relative to the table's reference white:
/// 0 to 1 inclusive, in steps of 2^-15.
pub type Light = U1F15;

/// Linear projector input relative to the projector's white: 0 to 1 inclusive,
/// in steps of 2^-15.
pub type Drive = U1F15;

/// Interreflected light to take away, in units of [`Drive`]: -256 to 256 in
/// steps of 2^-23. A checked table cannot leave that range.
pub type Correction = I9F23;

/// Fraction bits that a [`Correction`] has beyond a [`Drive`].
pub const CORRECTION_GUARD_BITS: u32 = Correction::FRAC_NBITS - Drive::FRAC_NBITS;

/// Fraction bits that gains have beyond their own while they are interpolated.
pub const GAIN_GUARD_BITS: u32 = 12;

/// A Haar coefficient of the input frame as the operator multiplies it. Its
/// magnitude is at most [`INPUT_COEFFICIENT_MAX`], whatever the frame.
pub type InputCoefficient = i16;

/// Largest magnitude of an [`InputCoefficient`].
///
/// One bit below the type's own limit, so that a full-scale frame, whose mean is
/// exactly 1, still fits.
pub const INPUT_COEFFICIENT_MAX: u32 = 1 << 14;

/// One `u16` of a table, little-endian.
pub type Halfword = [u8; 2];

/// Samples of a frame that were clipped, by the end at which they were.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct ClippedSamples {
    /// [`Drive`]s below 0: more light arrives from elsewhere than is wanted.
    pub black: u32,
    /// [`Drive`]s above 1: the projector does not make as much light as is wanted.
    pub white: u32,
}

impl ClippedSamples {
    /// Those at either end.
    #[must_use]
    pub const fn total(self) -> u32 {
        self.black.saturating_add(self.white)
    }

    /// Counts a drive that is not yet clipped, in units of [`Drive`].
    #[allow(
        clippy::inline_always,
        reason = "a host compiles rows for its widest vectors, which a call would leave"
    )]
    #[inline(always)]
    pub(crate) fn count(&mut self, wanted: i32) {
        self.black += u32::from(wanted < 0);
        self.white += u32::from(wanted > i32::from(Drive::ONE.to_bits()));
    }
}

impl AddAssign for ClippedSamples {
    fn add_assign(&mut self, other: Self) {
        self.black = self.black.saturating_add(other.black);
        self.white = self.white.saturating_add(other.white);
    }
}
