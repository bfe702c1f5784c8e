//! Layout of an operator section: its words, `u32` each.
//!
//! Entries stand in pairs: the values `v` of two neighbouring input coefficients,
//! zero where one of them has no entry, so that a device multiplies both at once.
//! Rows of one number of pairs stand together, so that a device runs through them
//! without counting. For each number there is, in ascending order, a group: a word
//! with the number of pairs in the low half and the number of rows in the high half,
//! then the rows in ascending order of their index.
//!
//! A row is a word with its index in the low half and its shift in the high half,
//! then its pairs in ascending order, two by two: the values of the first pair
//! (`i16` each, the first in the low half), those of the second, and a word with the
//! index of the first pair's first coefficient in the low half and that of the
//! second's in the high half. A last pair alone has its values and a word with its
//! index.
//!
//! Rows longer than [`MAX_SHORT`] pairs share one group, the
//! last, whose stated number is 0. The words of all its rows are counted in a word
//! of their own, before the rows; and the first word of each row is followed by one
//! with the number of its pairs in the low half and zero in the high half.

/// Most operator segments of a table: a shared one and one a channel for some tiers.
pub const MAX_SEGMENTS: usize = 48;

/// Length of a word in bytes.
pub const WORD: usize = 4;

/// Most pairs of rows that have a group of their own.
pub const MAX_SHORT: usize = 8;

/// Words of `pairs` pairs.
#[must_use]
pub const fn pair_words(pairs: usize) -> usize {
    pairs + pairs.div_ceil(2)
}

/// A word from its halves.
#[must_use]
pub const fn word(low: u16, high: u16) -> [u8; WORD] {
    let [a, b] = low.to_le_bytes();
    let [c, d] = high.to_le_bytes();
    [a, b, c, d]
}

/// The halves of a word, low first.
#[must_use]
pub const fn halves(word: [u8; WORD]) -> (u16, u16) {
    let [a, b, c, d] = word;
    (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]))
}
