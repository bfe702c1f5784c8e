//! CRC-32 (ISO-HDLC), piece by piece.

/// Remainders of four bits: a table of whole bytes would take a kilobyte of flash.
const REMAINDERS: [u32; 16] = {
    let mut remainders = [0; 16];
    let mut nibble = 0;
    while nibble < 16 {
        let mut remainder = nibble as u32;
        let mut bit = 0;
        while bit < 4 {
            remainder = (remainder >> 1) ^ (0xEDB8_8320 * (remainder & 1));
            bit += 1;
        }
        #[allow(clippy::indexing_slicing, reason = "evaluated when compiled")]
        {
            remainders[nibble] = remainder;
        }
        nibble += 1;
    }
    remainders
};

/// The CRC-32 of the bytes so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crc32(u32);

impl Crc32 {
    pub(crate) const fn new() -> Self {
        Self(u32::MAX)
    }

    pub(crate) fn update(&mut self, bytes: &[u8]) {
        // An index of four bits is in the table: the compiler sees that it cannot fail.
        #[allow(clippy::indexing_slicing)]
        let step = |crc: u32| (crc >> 4) ^ REMAINDERS[(crc & 15) as usize];
        self.0 = bytes
            .iter()
            .fold(self.0, |crc, byte| step(step(crc ^ u32::from(*byte))));
    }

    pub(crate) const fn finish(self) -> u32 {
        !self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn it_is_the_catalogues() {
        // The check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRCs.
        let mut crc = Crc32::new();
        crc.update(b"1234");
        crc.update(b"");
        crc.update(b"56789");
        assert_eq!(crc.finish(), 0xCBF4_3926);
    }

    proptest! {
        #[test]
        fn it_is_that_of_the_bits_one_by_one(bytes: Vec<u8>) {
            let mut crc = Crc32::new();
            crc.update(&bytes);
            let plain = bytes.iter().fold(u32::MAX, |crc, byte| {
                (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
                    (crc >> 1) ^ (0xEDB8_8320 * (crc & 1))
                })
            });
            prop_assert_eq!(crc.finish(), !plain);
        }
    }
}
