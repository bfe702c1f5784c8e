//! CRC-32 (ISO-HDLC, as in zip and Ethernet), half a byte at a time: with a table of 64
//! bytes instead of 1 KiB, which a device's flash has better uses for.

/// The remainders of all half bytes.
static REMAINDERS: [u32; 16] = [
    remainder(0),
    remainder(1),
    remainder(2),
    remainder(3),
    remainder(4),
    remainder(5),
    remainder(6),
    remainder(7),
    remainder(8),
    remainder(9),
    remainder(10),
    remainder(11),
    remainder(12),
    remainder(13),
    remainder(14),
    remainder(15),
];

/// What half a byte leaves behind.
const fn remainder(half: u32) -> u32 {
    let mut remainder = half;
    let mut bit = 0;
    while bit < 4 {
        remainder = (remainder >> 1) ^ (0xEDB8_8320 * (remainder & 1));
        bit += 1;
    }
    remainder
}

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
