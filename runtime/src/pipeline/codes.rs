//! 8-bit projector codes by drive.
//!
//! A frame's samples are looked up by the upper 13 bits of the drive. That is what
//! a response as steep as sRGB's in the darks needs: a code is within one of the
//! exact one for any response up to twice as steep.

use super::response::Response;
use crate::units::Drive;

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
pub fn code(index: usize, response: Response<'_>) -> u8 {
    narrow(response.fine_code(middle_drive(index)))
}

/// The code of a drive where codes are in proportion to drives: to nearest.
#[inline]
#[must_use]
pub const fn proportional(drive: Drive) -> u8 {
    const HALF: u32 = 1 << (Drive::FRAC_NBITS - 1);
    ((drive.to_bits() as u32 * u8::MAX as u32 + HALF) >> Drive::FRAC_NBITS) as u8
}

/// The code of a drive.
#[inline]
#[must_use]
pub fn at(codes: &[u8; CODES], drive: Drive) -> u8 {
    let index = usize::from(drive.to_bits() >> INDEX_SHIFT).min(CODES - 1);
    codes.get(index).copied().unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proportional_codes_are_the_nearest_ones() {
        for bits in 0..=Drive::ONE.to_bits() {
            let exact = f64::from(bits) / 32_768.0 * 255.0;
            let code = proportional(Drive::from_bits(bits));
            assert!((f64::from(code) - exact).abs() <= 0.5);
        }
    }
}
