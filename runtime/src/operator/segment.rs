//! One tier's entries, as they lie in the image.

use super::OperatorError;
use crate::image::layout::segment::{WORD, halves};
use crate::units::InputCoefficient;

/// Which channels a segment applies to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Channels {
    /// All of the table's channels: one index read serves them all.
    All,
    /// One channel, counted from 0.
    One(u8),
}

/// The entries that one tier adds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Segment<'a> {
    /// The tier that first needs them, 1 or above.
    pub tier: u8,
    /// The channels that they apply to.
    pub channels: Channels,
    words: &'a [[u8; WORD]],
}

/// One row of a segment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Row<'a> {
    /// Index of the output coefficient.
    pub index: u16,
    entries: &'a [[u8; WORD]],
}

/// One entry of a row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Entry {
    /// Index of the input coefficient.
    pub index: u16,
    /// Its factor `v`.
    pub value: i16,
}

impl<'a> Segment<'a> {
    /// A segment over the bytes of its section; [`Operator::new`](super::Operator::new)
    /// checks them.
    ///
    /// # Errors
    /// [`OperatorError::Words`] if the bytes are not whole words; `index` is the
    /// place that the error names.
    pub fn new(
        index: usize,
        tier: u8,
        channels: Channels,
        bytes: &'a [u8],
    ) -> Result<Self, OperatorError> {
        let (words, rest) = bytes.as_chunks::<WORD>();
        if !rest.is_empty() {
            return Err(OperatorError::Words { segment: index });
        }
        Ok(Self {
            tier,
            channels,
            words,
        })
    }

    /// Its rows in ascending order. A malformed end is left out.
    #[must_use]
    pub const fn rows(&self) -> Rows<'a> {
        Rows { words: self.words }
    }

    /// Checks every row and index against a grid of `cells` cells.
    pub(super) fn check(&self, segment: usize, cells: usize) -> Result<(), OperatorError> {
        let mut rows = self.rows();
        let mut least_row = 0;
        while let Some([head, ..]) = rows.words.first_chunk::<1>() {
            let row = usize::from(halves(*head).0);
            let malformed = OperatorError::Row { segment, row };
            let entries = rows.next().ok_or(malformed)?.entries();
            if entries.len() == 0 || row < least_row || row >= cells {
                return Err(malformed);
            }
            least_row = row + 1;
            let mut least_index = 0;
            for entry in entries {
                let index = usize::from(entry.index);
                if index < least_index || index >= cells {
                    return Err(OperatorError::Index { segment, row });
                }
                least_index = index + 1;
            }
        }
        Ok(())
    }

    /// Adds the products of every row to its sums, all channels at once.
    pub(super) fn accumulate<const C: usize>(
        &self,
        inputs: &[[InputCoefficient; C]],
        sums: &mut [[i32; C]],
    ) {
        for row in self.rows() {
            let Some(sum) = sums.get_mut(usize::from(row.index)) else {
                continue;
            };
            let mut total = *sum;
            for entry in row.entries() {
                if let Some(input) = inputs.get(usize::from(entry.index)) {
                    for (total, input) in total.iter_mut().zip(input) {
                        let product = i32::from(entry.value).wrapping_mul(i32::from(*input));
                        *total = total.wrapping_add(product);
                    }
                }
            }
            *sum = total;
        }
    }

    /// Adds the products of every row to its sum in one channel.
    pub(super) fn accumulate_one<const C: usize>(
        &self,
        inputs: &[[InputCoefficient; C]],
        sums: &mut [[i32; C]],
        channel: usize,
    ) {
        for row in self.rows() {
            let sum = sums.get_mut(usize::from(row.index));
            let Some(sum) = sum.and_then(|channels| channels.get_mut(channel)) else {
                continue;
            };
            for entry in row.entries() {
                let input = inputs.get(usize::from(entry.index));
                if let Some(input) = input.and_then(|channels| channels.get(channel)) {
                    let product = i32::from(entry.value).wrapping_mul(i32::from(*input));
                    *sum = sum.wrapping_add(product);
                }
            }
        }
    }
}

impl<'a> Row<'a> {
    /// Its entries in ascending order of their index.
    #[must_use]
    pub fn entries(&self) -> impl ExactSizeIterator<Item = Entry> + use<'a> {
        self.entries.iter().map(|word| {
            let (index, value) = halves(*word);
            Entry {
                index,
                value: value.cast_signed(),
            }
        })
    }

    /// Sum of the magnitudes of its values.
    #[must_use]
    pub fn magnitude(&self) -> u64 {
        self.entries()
            .map(|entry| u64::from(entry.value.unsigned_abs()))
            .sum()
    }
}

/// Iterator over the rows of a [`Segment`].
#[derive(Clone, Debug)]
pub struct Rows<'a> {
    words: &'a [[u8; WORD]],
}

impl<'a> Iterator for Rows<'a> {
    type Item = Row<'a>;

    #[inline]
    fn next(&mut self) -> Option<Row<'a>> {
        let (head, rest) = self.words.split_first()?;
        let (index, count) = halves(*head);
        let (entries, rest) = rest.split_at_checked(usize::from(count))?;
        self.words = rest;
        Some(Row { index, entries })
    }
}
