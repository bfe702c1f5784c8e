//! Recheck: whether bytes that were checked are still what they were, piece by piece.

use super::Crc32;

/// Bytes of a piece: some thousand instructions.
const PIECE: usize = 256;

/// Goes over the bytes of a file again and again.
#[derive(Clone, Debug)]
pub struct Recheck<'a> {
    file: &'a [u8],
    left: &'a [u8],
    digest: Crc32,
    /// CRC-32 of the first time.
    first: Option<u32>,
}

impl<'a> Recheck<'a> {
    /// Before the first time over a file, which says what the others must find.
    #[must_use]
    pub fn new(file: &'a [u8]) -> Self {
        Self {
            file,
            left: file,
            digest: Crc32::new(),
            first: None,
        }
    }

    /// Goes over the next piece. At the end says whether everything was as it was the
    /// first time.
    pub fn step(&mut self) -> Option<bool> {
        let (piece, left) = self.left.split_at(self.left.len().min(PIECE));
        self.digest.update(piece);
        self.left = left;
        if !left.is_empty() {
            return None;
        }
        let crc = core::mem::replace(&mut self.digest, Crc32::new()).finish();
        self.left = self.file;
        Some(*self.first.get_or_insert(crc) == crc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;

    #[test]
    fn a_bit_that_changes_is_found_the_next_time_round() {
        let before = vec![7_u8; 1_000];
        for bit in [0, 4_095, 7_999] {
            let mut after = before.clone();
            after[bit / 8] ^= 1 << (bit % 8);
            let mut recheck = Recheck::new(&before);
            let pass = |recheck: &mut Recheck<'_>| (0..4).find_map(|_| recheck.step());
            assert_eq!(pass(&mut recheck), Some(true));
            assert_eq!(pass(&mut recheck), Some(true));
            recheck.file = &after;
            recheck.left = &after;
            assert_eq!(pass(&mut recheck), Some(false));
        }
        let mut empty = Recheck::new(&[]);
        assert_eq!((empty.step(), empty.step()), (Some(true), Some(true)));
    }
}
