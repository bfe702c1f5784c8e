//! Frame samples: from codes to light, and from drive to codes.

use super::response::{Response, linear_code};
use super::srgb;
use crate::units::{Drive, Light};

/// What the codes of a frame mean.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Encoding {
    /// Video: sRGB codes in, codes for the projector's response out.
    Display,
    /// Codes in proportion to light in, in proportion to drive out.
    Linear,
}

/// One sample of a frame: `u8`, or `u16` with full scale 65,535.
///
/// Both conversions round to nearest; they are named rounding places.
pub trait Sample: Copy + Default {
    /// Light of a code.
    fn light(self, encoding: Encoding) -> Light;
    /// Code of a drive between 0 and 1.
    fn code(drive: Drive, encoding: Encoding, response: Response<'_, '_>) -> Self;
}

impl Sample for u8 {
    #[inline]
    fn light(self, encoding: Encoding) -> Light {
        match encoding {
            Encoding::Display => srgb::decode(self),
            Encoding::Linear => Light::from_bits(((u32::from(self) * 32_768 + 127) / 255) as u16),
        }
    }

    #[inline]
    fn code(drive: Drive, encoding: Encoding, response: Response<'_, '_>) -> Self {
        let code = match encoding {
            Encoding::Display => response.code(drive),
            Encoding::Linear => linear_code(drive),
        };
        // 65,535 / 255 = 257 codes a step.
        ((u32::from(code) + 128) / 257) as Self
    }
}

impl Sample for u16 {
    #[inline]
    fn light(self, encoding: Encoding) -> Light {
        match encoding {
            Encoding::Linear => {
                Light::from_bits(((u32::from(self) * 32_768 + 32_767) / 65_535) as Self)
            }
            Encoding::Display => {
                let (below, rest) = ((self / 257) as u8, u32::from(self % 257));
                let lower = u32::from(srgb::decode(below).to_bits());
                let upper = u32::from(srgb::decode(below.saturating_add(1)).to_bits());
                Light::from_bits((lower + ((upper - lower) * rest + 128) / 257) as Self)
            }
        }
    }

    #[inline]
    fn code(drive: Drive, encoding: Encoding, response: Response<'_, '_>) -> Self {
        match encoding {
            Encoding::Display => response.fine_code(drive),
            Encoding::Linear => linear_code(drive),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_codes_round_to_the_nearest_light() {
        for code in 0..=u8::MAX {
            let exact = f64::from(code) / 255.0;
            assert!((code.light(Encoding::Linear).to_num::<f64>() - exact).abs() <= 0.5 / 32_768.0);
        }
        for code in 0..=u16::MAX {
            let exact = f64::from(code) / 65_535.0;
            assert!((code.light(Encoding::Linear).to_num::<f64>() - exact).abs() <= 0.5 / 32_768.0);
        }
    }

    #[test]
    fn wide_codes_decode_like_the_narrow_ones_they_extend() {
        for code in 0..=u8::MAX {
            for encoding in [Encoding::Display, Encoding::Linear] {
                assert_eq!(
                    (u16::from(code) * 257).light(encoding),
                    code.light(encoding)
                );
            }
        }
    }
}
