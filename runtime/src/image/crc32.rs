//! CRC-32 (ISO-HDLC, as in zip and Ethernet), half a byte at a time: with a table of 64
//! bytes instead of 1 KiB, which a device's flash has better uses for.

/// The remainders of all half bytes.
static REMAINDERS: [u32; 16] = [
    0x0000_0000,
    0x1db7_1064,
    0x3b6e_20c8,
    0x26d9_30ac,
    0x76dc_4190,
    0x6b6b_51f4,
    0x4db2_6158,
    0x5005_713c,
    0xedb8_8320,
    0xf00f_9344,
    0xd6d6_a3e8,
    0xcb61_b38c,
    0x9b64_c2b0,
    0x86d3_d2d4,
    0xa00a_e278,
    0xbdbd_f21c,
];

/// A CRC-32 of bytes that come piece by piece.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crc32(u32);

impl Crc32 {
    /// Of no bytes yet.
    pub(crate) const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Takes the next bytes.
    #[inline(never)]
    pub(crate) fn update(&mut self, bytes: &[u8]) {
        let step = |crc: u32, half: u8| {
            let index = (crc ^ u32::from(half)) & 15;
            let remainder = REMAINDERS.get(index as usize).copied();
            (crc >> 4) ^ remainder.unwrap_or(0)
        };
        for byte in bytes {
            self.0 = step(step(self.0, *byte), byte >> 4);
        }
    }

    /// The CRC of all of them.
    pub(crate) const fn finish(self) -> u32 {
        !self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_of_the_catalogue_comes_out_in_one_piece_or_two() {
        for cut in 0..=9 {
            let (first, second) = b"123456789".split_at(cut);
            let mut crc = Crc32::new();
            crc.update(first);
            crc.update(second);
            assert_eq!(crc.finish(), 0xCBF4_3926);
        }
    }
}
