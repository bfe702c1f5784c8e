//! From drive to the codes that a projector is sent.
//!
//! A projector's light is not proportional to its code. The table holds the
//! codes for [`RESPONSE_KNOTS`] drives, dense in the darks where the curve is
//! steep: every drive below 1/16, every sixteenth above. With that, an 8-bit code
//! is within one of the exact one for any response up to twice as steep as sRGB.

use crate::image::Table;
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

/// The knot nearest to a drive between 0 and 1.
#[inline]
#[must_use]
pub const fn nearest_knot(drive: Drive) -> usize {
    let bits = drive.to_bits() as u32;
    if bits < DENSE {
        bits as usize
    } else {
        (OFFSET + ((bits + (1 << (COARSE_SHIFT - 1))) >> COARSE_SHIFT)) as usize
    }
}

/// The response of one channel.
#[derive(Clone, Copy, Debug)]
pub struct Response<'t, 'a> {
    table: &'t Table<'a>,
    channel: usize,
}

impl<'t, 'a> Response<'t, 'a> {
    /// The response of a channel of a table; without one in the table, codes are
    /// proportional to drives.
    #[must_use]
    pub const fn new(table: &'t Table<'a>, channel: usize) -> Self {
        Self { table, channel }
    }

    /// Code, full scale 65,535, at the knot nearest to `drive`.
    #[inline]
    #[must_use]
    pub fn code(&self, drive: Drive) -> u16 {
        self.table
            .response_code(nearest_knot(drive), self.channel)
            .unwrap_or_else(|| linear_code(drive))
    }

    /// Code, full scale 65,535, interpolated between the knots around `drive`.
    #[must_use]
    pub fn fine_code(&self, drive: Drive) -> u16 {
        let bits = u32::from(drive.to_bits());
        let at = |knot: usize| self.table.response_code(knot, self.channel);
        if bits < DENSE {
            return at(bits as usize).unwrap_or_else(|| linear_code(drive));
        }
        let knot = (OFFSET + (bits >> COARSE_SHIFT)) as usize;
        let Some(below) = at(knot) else {
            return linear_code(drive);
        };
        let above = at((knot + 1).min(RESPONSE_KNOTS - 1)).unwrap_or(below);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_knot_is_the_nearest() {
        for bits in 0..=Drive::ONE.to_bits() {
            let knot = nearest_knot(Drive::from_bits(bits));
            assert!(knot < RESPONSE_KNOTS);
            let distance = |knot| knot_drive(knot).to_bits().abs_diff(bits);
            assert!(distance(knot) <= distance(knot.saturating_sub(1)));
            assert!(distance(knot) <= distance((knot + 1).min(RESPONSE_KNOTS - 1)));
        }
    }

    #[test]
    fn knots_rise_from_zero_to_one() {
        assert_eq!(knot_drive(0), Drive::ZERO);
        assert_eq!(knot_drive(RESPONSE_KNOTS - 1), Drive::ONE);
        for knot in 1..RESPONSE_KNOTS {
            assert!(knot_drive(knot) > knot_drive(knot - 1));
        }
    }
}
