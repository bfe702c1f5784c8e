//! Units: fixed-point quantities and the places where they are rounded.
//!
//! Everything between the decoded frame and the encoded one is one of these
//! types. A value changes type, and is rounded, only in a function that says so
//! in its documentation.

use fixed::types::{I9F23, U1F15};

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
