//! Operator segment: one tier's entries, as they lie in the image.

use super::OperatorError;
use super::layout::{MAX_SHORT, WORD, halves, pair_words};
use crate::kernel;
use crate::yield_budget::{YieldBudget, cost};

/// Which channels a segment applies to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Channels {
    /// All of the table's channels: one index read serves them all.
    All,
    /// One channel, counted from 0.
    One(u8),
}

/// All entries of one tier, for all channels or for one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Segment<'a> {
    /// The tier that they make, 1 or above.
    pub tier: u8,
    /// The channels that they apply to.
    pub channels: Channels,
    words: &'a [[u8; WORD]],
}

/// Rows of one number of pairs, or all rows too long to have a group of their own.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Group<'a> {
    /// Pairs of each row; `None` if every row says how many it has.
    pub pairs: Option<u16>,
    /// Number of rows.
    pub count: u16,
    words: &'a [[u8; WORD]],
}

/// One row of a segment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Row<'a> {
    /// Index of the output coefficient.
    pub index: u16,
    /// Bits by which the row's sum is shifted right.
    pub shift: u16,
    pairs: u16,
    words: &'a [[u8; WORD]],
}

/// Two neighbouring entries of a row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pair {
    /// Index of the first input coefficient.
    pub index: u16,
    /// The factors `v` of that and of the next; zero where there is no entry.
    pub values: [i16; 2],
}

impl<'a> Segment<'a> {
    /// Least shift of a row: the scale of a channel takes two bits of its own.
    pub const MIN_SHIFT: u16 = 2;

    /// Largest shift of a row: the bits of an accumulator.
    pub const MAX_SHIFT: u16 = 31;

    /// A segment over the bytes of its section; [`Operator::new`](super::Operator::new)
    /// checks them.
    ///
    /// # Errors
    /// [`OperatorError::Words`] if the bytes are not whole words, or lie where the
    /// assembler loops cannot read words; `index` is the place that the error names.
    pub fn new(
        index: usize,
        tier: u8,
        channels: Channels,
        bytes: &'a [u8],
    ) -> Result<Self, OperatorError> {
        let (words, rest) = bytes.as_chunks::<WORD>();
        if !rest.is_empty() || !kernel::takes(words) {
            return Err(OperatorError::Words { segment: index });
        }
        Ok(Self {
            tier,
            channels,
            words,
        })
    }

    /// Its bytes in the image.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.words.len() * WORD
    }

    /// Its groups in ascending order of their pairs. A malformed end is left out.
    #[must_use]
    pub const fn groups(&self) -> Groups<'a> {
        Groups { words: self.words }
    }

    /// Its rows, group by group. Malformed ends are left out.
    pub fn rows(&self) -> impl Iterator<Item = Row<'a>> + use<'a> {
        self.groups().flat_map(|group| group.rows())
    }

    /// Checks every group, row and index against a grid of `cells` cells and so many inputs. That no
    /// row is in two groups is left to the proof of the bounds.
    pub(super) fn check(
        &self,
        segment: usize,
        sizes: (usize, usize),
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<(), OperatorError> {
        let mut groups = self.groups();
        let mut least = 1;
        while !groups.words.is_empty() {
            let group = groups.next().ok_or(OperatorError::Group { segment })?;
            // Longer rows share the group that states no number, and come last.
            let longest = if group.pairs.is_some() {
                MAX_SHORT
            } else {
                MAX_SHORT + 1
            };
            let pairs = group.pairs.map_or(longest, usize::from);
            if pairs < least || pairs > longest || group.count == 0 {
                return Err(OperatorError::Group { segment });
            }
            least = pairs + 1;
            group.check(segment, sizes, budget)?;
        }
        Ok(())
    }
}

impl<'a> Group<'a> {
    /// Its rows in ascending order. A malformed end is left out.
    #[must_use]
    pub const fn rows(&self) -> Rows<'a> {
        Rows {
            pairs: self.pairs,
            left: self.count,
            words: self.words,
        }
    }

    /// The words of its rows.
    pub(super) const fn words(&self) -> &'a [[u8; WORD]] {
        self.words
    }

    fn check(
        &self,
        segment: usize,
        (cells, inputs): (usize, usize),
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<(), OperatorError> {
        let mut least_row = 0;
        let mut rows = self.rows();
        for _ in 0..self.count {
            let head = rows.words.first().copied().unwrap_or_default();
            let malformed = OperatorError::Row {
                segment,
                row: usize::from(halves(head).0),
            };
            let row = rows.next().ok_or(malformed)?;
            let index = usize::from(row.index);
            let long_enough = self.pairs.is_some() || usize::from(row.pairs) > MAX_SHORT;
            let shifts = Segment::MIN_SHIFT..=Segment::MAX_SHIFT;
            if index < least_row || index >= cells || !long_enough || !shifts.contains(&row.shift) {
                return Err(malformed);
            }
            least_row = index + 1;
            row.check(segment, inputs, budget)?;
            budget.spend(1, cost::ROW);
        }
        if rows.words.is_empty() {
            Ok(())
        } else {
            Err(OperatorError::Group { segment })
        }
    }
}

impl Row<'_> {
    /// Goes through its pairs in ascending order of their index.
    #[inline]
    pub fn fold<A>(&self, start: A, mut step: impl FnMut(A, Pair) -> A) -> A {
        let pair = |index, values: [u8; WORD]| {
            let (first, second) = halves(values);
            Pair {
                index,
                values: [first.cast_signed(), second.cast_signed()],
            }
        };
        let (twos, last) = self.words.as_chunks::<3>();
        let mut result = start;
        for [first, second, indices] in twos {
            let (first_index, second_index) = halves(*indices);
            result = step(result, pair(first_index, *first));
            result = step(result, pair(second_index, *second));
        }
        match last {
            [values, index] => step(result, pair(halves(*index).0, *values)),
            _ => result,
        }
    }

    /// Number of its pairs.
    #[must_use]
    pub const fn pairs(&self) -> u16 {
        self.pairs
    }

    /// Number of its entries that are not zero.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.entries_yielding(&mut YieldBudget::new(&mut || {}))
    }

    pub(super) fn entries_yielding(
        &self,
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> usize {
        self.fold(0, |sum, pair| {
            budget.spend(1, cost::PAIR);
            sum + pair.values.iter().filter(|value| **value != 0).count()
        })
    }

    /// Sum of the magnitudes of its values.
    pub(super) fn magnitude(&self, budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>) -> u64 {
        let magnitude = |value: i16| u64::from(value.unsigned_abs());
        self.fold(0, |sum, Pair { values: [a, b], .. }| {
            budget.spend(1, cost::PAIR);
            sum + magnitude(a) + magnitude(b)
        })
    }

    /// Both coefficients of each pair are among the inputs, and pairs ascend.
    fn check(
        &self,
        segment: usize,
        inputs: usize,
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<(), OperatorError> {
        let (least, fits) = self.fold((0, true), |(least, fits), pair| {
            budget.spend(1, cost::PAIR);
            let index = usize::from(pair.index);
            (index + 1, fits && index >= least && index + 1 < inputs)
        });
        // Nothing follows the index of a last pair alone.
        let odd = self.pairs % 2 == 1;
        let ends = self
            .words
            .last()
            .is_none_or(|last| !odd || halves(*last).1 == 0);
        if least > 0 && fits && ends {
            Ok(())
        } else {
            Err(OperatorError::Index {
                segment,
                row: usize::from(self.index),
            })
        }
    }
}

/// Iterator over the groups of a [`Segment`].
#[derive(Clone, Debug)]
pub struct Groups<'a> {
    words: &'a [[u8; WORD]],
}

impl<'a> Iterator for Groups<'a> {
    type Item = Group<'a>;

    fn next(&mut self) -> Option<Group<'a>> {
        let (head, rest) = self.words.split_first()?;
        let (pairs, count) = halves(*head);
        let pairs = (pairs > 0).then_some(pairs);
        let (size, rest) = if let Some(pairs) = pairs {
            let row = 1 + pair_words(usize::from(pairs));
            (usize::from(count).checked_mul(row)?, rest)
        } else {
            let (size, rest) = rest.split_first()?;
            (u32::from_le_bytes(*size) as usize, rest)
        };
        let (words, rest) = rest.split_at_checked(size)?;
        self.words = rest;
        Some(Group {
            pairs,
            count,
            words,
        })
    }
}

/// Iterator over the rows of a [`Group`].
#[derive(Clone, Debug)]
pub struct Rows<'a> {
    pairs: Option<u16>,
    left: u16,
    words: &'a [[u8; WORD]],
}

impl Rows<'_> {
    /// The index of the row that comes next.
    pub(super) fn next_index(&self) -> Option<u16> {
        let head = self.words.first()?;
        (self.left > 0).then_some(halves(*head).0)
    }
}

impl<'a> Iterator for Rows<'a> {
    type Item = Row<'a>;

    #[inline]
    fn next(&mut self) -> Option<Row<'a>> {
        let left = self.left.checked_sub(1)?;
        let (head, rest) = self.words.split_first()?;
        let (index, shift) = halves(*head);
        let (pairs, rest) = if let Some(pairs) = self.pairs {
            (pairs, rest)
        } else {
            let (count, rest) = rest.split_first()?;
            match halves(*count) {
                (pairs, 0) => (pairs, rest),
                _ => return None,
            }
        };
        let (words, rest) = rest.split_at_checked(pair_words(usize::from(pairs)))?;
        (self.left, self.words) = (left, rest);
        Some(Row {
            index,
            shift,
            pairs,
            words,
        })
    }
}
