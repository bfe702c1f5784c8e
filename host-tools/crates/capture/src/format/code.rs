//! Gray code of one axis, as the patterns themselves have it.
//!
//! `iltm patterns` begins its code at 0. Others centre it, so that the first of 768 rows
//! is number 128 of 1024, or leave away the finest stripes, which their camera cannot
//! see. Which of these it is, the patterns say.

use super::role::Role;

/// Finest bits that may be missing where a code does not begin at 0.
const MOST_MISSING: u8 = 8;

/// A stripe pattern along its axis.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Stripes {
    pub(crate) bit: u8,
    pub(crate) inverse: bool,
    /// Whether each column (or row) is lit.
    pub(crate) lit: Vec<bool>,
}

/// How columns, or rows, are numbered.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Code {
    /// Bits of the whole code, whether all were photographed or not.
    pub bits: u8,
    /// Number of the first column.
    pub offset: usize,
}

impl Code {
    /// The code of `cells` columns that shows all `stripes`, of which `given` bits were
    /// photographed; one that begins at 0 if none does.
    pub(crate) fn find(stripes: &[Stripes], given: u8, cells: usize) -> Self {
        let needed = cells.next_power_of_two().trailing_zeros() as u8;
        let least = needed.max(given);
        // The first column's own stripes say where the code begins, but for bits that
        // nobody photographed.
        let first = (0..given).fold(0, |word, bit| word << 1 | first_bit(stripes, bit));
        let codes = (least..=least + 1).flat_map(|bits| {
            let missing = (bits - given).min(MOST_MISSING);
            let from = (binary(first) as usize) << missing;
            (from..from + (1 << missing))
                .filter(move |offset| offset + cells <= 1 << bits)
                .map(move |offset| Self { bits, offset })
        });
        let shows = |code: &Self| {
            (stripes.iter()).all(|s| {
                (s.lit.iter().enumerate())
                    .all(|(at, lit)| code.lit(at, s.bit, s.inverse) == Some(*lit))
            })
        };
        codes.into_iter().find(shows).unwrap_or(Self {
            bits: least,
            offset: 0,
        })
    }

    /// Whether column `at` is lit; `None` beyond the code's bits.
    #[must_use]
    pub fn lit(self, at: usize, bit: u8, inverse: bool) -> Option<bool> {
        let shift = u32::from(self.bits.checked_sub(bit.checked_add(1)?)?);
        let number = at + self.offset;
        Some(((number ^ (number >> 1)) >> shift) & 1 == usize::from(!inverse))
    }

    /// The code without its finest `steps` bits.
    pub(crate) fn coarser(self, steps: u8) -> Self {
        Self {
            bits: self.bits.saturating_sub(steps),
            offset: self.offset >> steps,
        }
    }

    /// First of the columns that have each number of the coarser code, for `cells`
    /// columns.
    pub(crate) fn firsts(self, steps: u8, cells: usize) -> Vec<usize> {
        let number = |at: usize| (at + self.offset) >> steps;
        (0..cells)
            .filter(|&at| at == 0 || number(at) != number(at - 1))
            .collect()
    }
}

/// The number that a Gray code word stands for.
pub(crate) fn binary(gray: u32) -> u32 {
    let mut number = gray;
    for shift in [1, 2, 4, 8, 16] {
        number ^= number >> shift;
    }
    number
}

/// Whether a cell is lit in the pattern of a role, given the codes of columns and rows;
/// `None` of a Bernoulli pattern and of a bit beyond its code.
pub(crate) fn lit_by_role(role: Role, codes: [Code; 2], row: usize, col: usize) -> Option<bool> {
    match role {
        Role::White => Some(true),
        Role::Black => Some(false),
        Role::Column { bit, inverse } => codes[0].lit(col, bit, inverse),
        Role::Row { bit, inverse } => codes[1].lit(row, bit, inverse),
        Role::Bernoulli | Role::Image => None,
    }
}

/// A bit of the first column's word; 0 if nothing says it.
fn first_bit(stripes: &[Stripes], bit: u8) -> u32 {
    let of_bit = stripes.iter().find(|stripes| stripes.bit == bit);
    let lit = of_bit.and_then(|s| s.lit.first().map(|lit| *lit != s.inverse));
    u32::from(lit == Some(true))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shown(code: Code, cells: usize, given: u8) -> Vec<Stripes> {
        let stripes = |bit| Stripes {
            bit,
            inverse: bit % 2 == 1,
            lit: (0..cells)
                .map(|at| code.lit(at, bit, bit % 2 == 1).unwrap())
                .collect(),
        };
        (0..given).map(stripes).collect()
    }

    #[test]
    fn binary_undoes_the_gray_code() {
        for number in 0..5000_u32 {
            assert_eq!(binary(number ^ (number >> 1)), number);
        }
    }

    #[test]
    fn a_centred_code_is_recognised_also_without_its_finest_bits() {
        let code = Code {
            bits: 10,
            offset: 128,
        };
        for given in [10, 7] {
            assert_eq!(Code::find(&shown(code, 768, given), given, 768), code);
        }
    }

    #[test]
    fn stripes_of_no_code_are_compared_with_one_that_begins_at_0() {
        let stripes = [Stripes {
            bit: 0,
            inverse: false,
            lit: vec![true, false, true, false, true],
        }];
        let plain = Code { bits: 3, offset: 0 };
        assert_eq!(Code::find(&stripes, 1, 5), plain);
        assert_eq!(plain.lit(0, 3, false), None);
    }

    proptest! {
        #[test]
        fn a_code_is_told_by_its_stripes(cells in 2_usize..200, extra in 0_u8..2, at in 0.0..1.0_f64) {
            let bits = cells.next_power_of_two().trailing_zeros() as u8 + extra;
            let offset = (at * ((1 << bits) - cells + 1) as f64) as usize;
            let code = Code { bits, offset };
            let found = Code::find(&shown(code, cells, bits), bits, cells);
            // The finest stripes are all that a short axis may show; any code that shows
            // them tells the same columns apart.
            prop_assert_eq!(shown(found, cells, bits), shown(code, cells, bits));
        }

        #[test]
        fn blocks_of_columns_have_the_coarser_code(cells in 2_usize..200, steps in 0_u8..4, at in 0.0..1.0_f64) {
            let bits = cells.next_power_of_two().trailing_zeros() as u8;
            let offset = (at * ((1 << bits) - cells + 1) as f64) as usize;
            let code = Code { bits, offset };
            let steps = steps.min(bits);
            let coarse = code.coarser(steps);
            for (block, first) in code.firsts(steps, cells).into_iter().enumerate() {
                for bit in 0..coarse.bits {
                    prop_assert_eq!(coarse.lit(block, bit, false), code.lit(first, bit, false));
                }
            }
        }
    }
}
