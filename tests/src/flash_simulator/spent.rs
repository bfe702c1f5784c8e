//! Spent write units: which may not be programmed any more before they are erased.
//!
//! What a unit reads as does not say: an all-ones word that was programmed, or a
//! program that was cut before its first bit moved, reads as erased.

use std::iter;
use std::ops::Range;

/// One bit a unit.
#[derive(Clone, Debug)]
pub(super) struct Spent {
    words: Vec<u64>,
}

impl Spent {
    pub(super) fn new(units: usize) -> Self {
        Self {
            words: vec![0; units.div_ceil(64)],
        }
    }

    pub(super) fn any(&self, units: Range<usize>) -> bool {
        masks(units).any(|(at, mask)| self.words.get(at).is_some_and(|word| word & mask != 0))
    }

    pub(super) fn set(&mut self, units: Range<usize>) {
        for (at, mask) in masks(units) {
            if let Some(word) = self.words.get_mut(at) {
                *word |= mask;
            }
        }
    }

    pub(super) fn clear(&mut self, units: Range<usize>) {
        for (at, mask) in masks(units) {
            if let Some(word) = self.words.get_mut(at) {
                *word &= !mask;
            }
        }
    }
}

/// The words that hold these units, and which of their bits.
fn masks(units: Range<usize>) -> impl Iterator<Item = (usize, u64)> {
    let mut next = units.start;
    iter::from_fn(move || {
        let left = units.end.checked_sub(next).filter(|left| *left > 0)?;
        let (word, low) = (next / 64, next % 64);
        let count = left.min(64 - low);
        next += count;
        Some((word, (u64::MAX >> (64 - count)) << low))
    })
}
