//! Projector response: from drive to the codes that a projector is sent.
//!
//! A projector's light is not proportional to its code. The table holds the
//! codes for [`RESPONSE_KNOTS`] drives, dense in the darks where the curve is
//! steep: every drive below 1/16, every sixteenth above, and interpolates between.
//!
//! 8-bit frames use the same curve at fewer drives: their codes are looked up by the upper
//! 13 bits of the drive. That is what a response as steep as sRGB's in the darks needs: a
//! code is within one of the exact one for any response up to twice as steep.

use crate::units::Drive;

/// Drives below this have a knot each.
const DENSE: u32 = 1 << 11;

/// Above [`DENSE`], knots are `2^COARSE_SHIFT` apart.
const COARSE_SHIFT: u32 = 4;

const OFFSET: u32 = DENSE - (DENSE >> COARSE_SHIFT);

/// Number of knots of a response.
pub const RESPONSE_KNOTS: usize =
    (OFFSET + ((Drive::ONE.to_bits() as u32) >> COARSE_SHIFT)) as usize + 1;

/// Drive of a knot; the last one is 1.
#[must_use]
pub const fn knot_drive(knot: usize) -> Drive {
    let knot = knot as u32;
    let bits = if knot < DENSE {
        knot
    } else {
        (knot.saturating_sub(OFFSET)) << COARSE_SHIFT
    };
    if bits > Drive::ONE.to_bits() as u32 {
        Drive::ONE
    } else {
        Drive::from_bits(bits as u16)
    }
}

/// The response of one channel.
#[derive(Clone, Copy, Debug)]
pub struct ResponseCurve<'a> {
    knots: &'a [[u8; 2]],
}

impl<'a> ResponseCurve<'a> {
    /// The response with these little-endian codes, full scale 65,535, at its
    /// [`RESPONSE_KNOTS`] knots; without any, codes are proportional to drives.
    #[must_use]
    pub const fn new(knots: &'a [[u8; 2]]) -> Self {
        Self { knots }
    }

    fn knot(&self, knot: usize) -> Option<u16> {
        self.knots.get(knot).copied().map(u16::from_le_bytes)
    }

    /// Code, full scale 65,535, interpolated between the knots around `drive`.
    #[must_use]
    pub fn fine_code(&self, drive: Drive) -> u16 {
        let bits = u32::from(drive.to_bits());
        if bits < DENSE {
            return self
                .knot(bits as usize)
                .unwrap_or_else(|| linear_code(drive));
        }
        let knot = (OFFSET + (bits >> COARSE_SHIFT)) as usize;
        let Some(below) = self.knot(knot) else {
            return linear_code(drive);
        };
        let above = self.knot((knot + 1).min(RESPONSE_KNOTS - 1));
        let above = above.unwrap_or(below);
        let rest = bits & ((1 << COARSE_SHIFT) - 1);
        let rise = u32::from(above.saturating_sub(below)) * rest;
        let half = 1 << (COARSE_SHIFT - 1);
        below.saturating_add(((rise + half) >> COARSE_SHIFT) as u16)
    }
}

/// Code, full scale 65,535, proportional to a drive between 0 and 1; to nearest.
#[inline]
#[must_use]
pub const fn linear_code(drive: Drive) -> u16 {
    const HALF: u32 = 1 << (Drive::FRAC_NBITS - 1);
    ((drive.to_bits() as u32 * 65_535 + HALF) >> Drive::FRAC_NBITS) as u16
}

/// Codes of a curve.
pub const CODES: usize = 1 << INDEX_BITS;

const INDEX_BITS: u32 = 13;

/// Bits of a drive that its index does not have.
pub const INDEX_SHIFT: u32 = Drive::FRAC_NBITS - INDEX_BITS;

/// The drive in the middle of those that have this index.
#[must_use]
pub const fn middle_drive(index: usize) -> Drive {
    const HALF: usize = 1 << (INDEX_SHIFT - 1);
    Drive::from_bits(((index << INDEX_SHIFT) + HALF) as u16)
}

/// A code of full scale 65,535 as one of full scale 255, to nearest.
#[must_use]
pub const fn narrow(code: u16) -> u8 {
    // 65,535 / 255 = 257 codes a step.
    ((code as u32 + 128) / 257) as u8
}

/// The code at an index of [`SectionKind::Codes`](crate::image::layout::SectionKind),
/// as its response has it.
#[must_use]
pub fn code_of_index(index: usize, response: ResponseCurve<'_>) -> u8 {
    narrow(response.fine_code(middle_drive(index)))
}

/// The code of a drive where codes are in proportion to drives: to nearest.
#[inline]
#[must_use]
pub const fn linear_code_8(drive: Drive) -> u8 {
    const HALF: u32 = 1 << (Drive::FRAC_NBITS - 1);
    ((drive.to_bits() as u32 * u8::MAX as u32 + HALF) >> Drive::FRAC_NBITS) as u8
}

/// The code of a drive.
#[inline]
#[must_use]
pub fn code_at(codes: &[u8; CODES], drive: Drive) -> u8 {
    let index = usize::from(drive.to_bits() >> INDEX_SHIFT).min(CODES - 1);
    codes.get(index).copied().unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knots_rise_from_zero_to_one() {
        assert_eq!(knot_drive(0), Drive::ZERO);
        assert_eq!(knot_drive(RESPONSE_KNOTS - 1), Drive::ONE);
        for knot in 1..RESPONSE_KNOTS {
            assert!(knot_drive(knot) > knot_drive(knot - 1));
        }
    }

    #[test]
    fn proportional_codes_are_the_nearest_ones() {
        for bits in 0..=Drive::ONE.to_bits() {
            let exact = f64::from(bits) / 32_768.0 * 255.0;
            let code = linear_code_8(Drive::from_bits(bits));
            assert!((f64::from(code) - exact).abs() <= 0.5);
        }
    }
}
