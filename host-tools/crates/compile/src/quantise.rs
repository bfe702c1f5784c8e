//! Quantisation: operator entries as the runtime multiplies them: `i16`, a power of two a row.
//!
//! With the runtime's integer basis `S` and norms `n`, `K = S M S^T` where
//! `M_ij = K^_ij / (n_i n_j)`. The runtime multiplies
//! `v_ij = M_ij 2^(input_shift_j + guard + shift_i)` with the input coefficient
//! and shifts the row's sum right by `shift_i`; so `shift_i` is chosen as large as
//! the value's 16 bits and the proof against overflow allow.

use super::ladder::{Entry, Part};
use iltm_runtime::{
    haar::Function,
    operator::{Bounds, Segment},
    units::{CORRECTION_GUARD_BITS, INPUT_COEFFICIENT_MAX},
};

/// The entries of one tier in one operator, as they are stored.
#[derive(Clone, Debug)]
pub struct Quantised {
    /// The operator.
    pub part: Part,
    /// The tier.
    pub tier: u8,
    /// Rows that have entries, in ascending order of their index.
    pub rows: Vec<StoredRow>,
}

/// One row of an operator as a segment stores it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StoredRow {
    /// Index of the output coefficient.
    pub index: u16,
    /// Bits by which its sum is shifted right.
    pub shift: u16,
    /// Index of the input coefficient and value of each entry, ascending.
    pub entries: Vec<(u16, i16)>,
}

impl StoredRow {
    /// Its entries two by two where they are neighbours: index of the first, and
    /// the values of that and of the next.
    pub(super) fn pairs(&self, inputs: usize) -> Vec<(u16, [i16; 2])> {
        let last = inputs.saturating_sub(2) as u16;
        let mut pairs: Vec<(u16, [i16; 2])> = Vec::new();
        for &(index, value) in &self.entries {
            match pairs.last_mut() {
                Some((first, values)) if *first + 1 == index => values[1] = value,
                // The very last coefficient has no next one.
                _ if index > last => pairs.push((last, [0, value])),
                _ => pairs.push((index, [value, 0])),
            }
        }
        pairs
    }
}

/// A row too strong for any shift.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TooStrong {
    /// Row of the operator.
    pub row: usize,
}

/// Quantises all entries of one tier. `functions` are those of the grid, and any inputs behind them. `scale(part)` is what an entry's value must be
/// multiplied by to reach drive per reference light, before the channel's own scale.
///
/// Entries that round to zero are left out.
///
/// # Errors
/// [`TooStrong`] with the row whose values are too large for any shift.
pub fn quantise(
    functions: &[Function],
    tier: u8,
    entries: &[Entry],
    scale: impl Fn(Part) -> f64,
) -> Result<Vec<Quantised>, TooStrong> {
    let norm = |function: &Function| (function.squared_norm() as f64).sqrt();
    let norms: Vec<f64> = functions.iter().map(norm).collect();
    let place = |entry: &Entry| {
        let channel = match entry.part {
            Part::Shared => 0,
            Part::Channel(channel) => channel + 1,
        };
        (channel, entry.row, entry.col)
    };
    let mut entries = entries.to_vec();
    entries.sort_by_key(place);
    let of_part = entries.chunk_by(|a, b| a.part == b.part);
    let quantise_part = |entries: &[Entry]| {
        let part = entries[0].part;
        let of_row = entries.chunk_by(|a, b| a.row == b.row);
        let rows = of_row.map(|row| {
            let values = row.iter().map(|entry| {
                let (row, col) = (entry.row as usize, entry.col as usize);
                let shift = functions[col].input_shift() + CORRECTION_GUARD_BITS;
                let unit = f64::from(shift).exp2() / (norms[row] * norms[col]);
                (entry.col as u16, entry.value * scale(part) * unit)
            });
            quantise_row(row[0].row as usize, &values.collect::<Vec<_>>())
        });
        let rows: Result<Vec<StoredRow>, TooStrong> = rows.collect();
        Ok(Quantised {
            part,
            tier,
            rows: rows?
                .into_iter()
                .filter(|row| !row.entries.is_empty())
                .collect(),
        })
    };
    of_part.map(quantise_part).collect()
}

fn quantise_row(row: usize, values: &[(u16, f64)]) -> Result<StoredRow, TooStrong> {
    let shift = row_shift(values).ok_or(TooStrong { row })?;
    let factor = f64::from(shift).exp2();
    let stored = values
        .iter()
        .map(|(col, value)| (*col, (value * factor).round() as i16));
    Ok(StoredRow {
        index: row as u16,
        shift,
        entries: stored.filter(|(_, value)| *value != 0).collect(),
    })
}

/// The largest shift with which every value fits and the sum cannot overflow.
fn row_shift(values: &[(u16, f64)]) -> Option<u16> {
    let magnitudes = || values.iter().map(|(_, value)| value.abs());
    let (sum, largest) = (magnitudes().sum::<f64>(), magnitudes().fold(0.0, f64::max));
    (Segment::MIN_SHIFT..=Segment::MAX_SHIFT)
        .rev()
        .find(|shift| {
            let factor = f64::from(*shift).exp2();
            // Rounding can add half to every value.
            let rounded = sum * factor + 0.5 * values.len() as f64;
            let bound = rounded * f64::from(INPUT_COEFFICIENT_MAX);
            (largest * factor).round() <= f64::from(i16::MAX)
                && bound <= Bounds::MAX_ACCUMULATOR as f64
        })
}
