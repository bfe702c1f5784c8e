//! Operator entries as the runtime multiplies them: `i16`, a power of two a row.
//!
//! With the runtime's integer basis `S` and norms `n`, `K = S M S^T` where
//! `M_ij = K^_ij / (n_i n_j)`. The runtime multiplies
//! `v_ij = M_ij 2^(input_shift_j + guard + shift_i)` with the input coefficient
//! and shifts the row's sum right by `shift_i`; so `shift_i` is chosen as large as
//! the value's 16 bits and the proof against overflow allow.

use super::ladder::{Entry, Part};
use iltm_runtime::haar::{Basis, Function};
use iltm_runtime::operator::{Bounds, Operator};
use iltm_runtime::units::{CORRECTION_GUARD_BITS, INPUT_COEFFICIENT_MAX};

/// One entry as it is stored.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stored {
    /// The operator.
    pub part: Part,
    /// Tier that first needs it.
    pub tier: u8,
    /// Output coefficient.
    pub row: u16,
    /// Input coefficient.
    pub col: u16,
    /// `v`.
    pub value: i16,
}

/// Entries and shifts of an operator.
#[derive(Clone, Debug)]
pub struct Quantised {
    /// In the order of segments: by tier, part, row, column.
    pub entries: Vec<Stored>,
    /// One shift a row.
    pub row_shifts: Vec<u8>,
}

/// Quantises entries given with their tier. `scale(part)` is what an entry's value
/// must be multiplied by to reach drive per reference light, before the channel's
/// own scale.
///
/// Entries that round to zero are left out.
///
/// # Errors
/// The row whose values are too large for any shift.
pub fn quantise(
    basis: &Basis,
    entries: &[(u8, Entry)],
    scale: impl Fn(Part) -> f64,
) -> Result<Quantised, usize> {
    let functions: Vec<Function> = basis.functions().collect();
    let norm = |index: usize| (functions[index].squared_norm() as f64).sqrt();
    let norms: Vec<f64> = (0..functions.len()).map(norm).collect();
    let mut rows: Vec<Vec<(u8, Entry, f64)>> = vec![Vec::new(); functions.len()];
    for (tier, entry) in entries {
        let shift = functions[entry.col].input_shift() + CORRECTION_GUARD_BITS;
        let unit = (f64::from(shift)).exp2() / (norms[entry.row] * norms[entry.col]);
        let value = entry.value * scale(entry.part) * unit;
        rows[entry.row].push((*tier, *entry, value));
    }
    let mut quantised = Quantised {
        entries: Vec::with_capacity(entries.len()),
        row_shifts: Vec::with_capacity(rows.len()),
    };
    for (index, row) in rows.iter().enumerate() {
        let shift = row_shift(row).ok_or(index)?;
        quantised.row_shifts.push(shift);
        let factor = f64::from(shift).exp2();
        for (tier, entry, value) in row {
            let value = (value * factor).round() as i16;
            if value != 0 {
                quantised.entries.push(Stored {
                    part: entry.part,
                    tier: *tier,
                    row: entry.row as u16,
                    col: entry.col as u16,
                    value,
                });
            }
        }
    }
    quantised.entries.sort_by_key(|stored| {
        let channel = match stored.part {
            Part::Shared => 0,
            Part::Channel(channel) => channel + 1,
        };
        // The selector of a segment is its tier plus 256 times the channel number.
        (channel, stored.tier, stored.row, stored.col)
    });
    Ok(quantised)
}

/// The largest shift with which every value fits and the sum cannot overflow;
/// 0 for a row without entries.
fn row_shift(row: &[(u8, Entry, f64)]) -> Option<u8> {
    let magnitude = |part: Part| -> f64 {
        let own = row.iter().filter(|(_, entry, _)| entry.part == part);
        own.map(|(.., value)| value.abs()).sum()
    };
    let widest = (0..3)
        .map(|channel| magnitude(Part::Channel(channel)))
        .fold(0.0, f64::max);
    let sum = magnitude(Part::Shared) + widest;
    let largest = row
        .iter()
        .map(|(.., value)| value.abs())
        .fold(0.0, f64::max);
    if largest == 0.0 {
        return Some(0);
    }
    (0..=Operator::MAX_ROW_SHIFT).rev().find(|shift| {
        let factor = f64::from(*shift).exp2();
        // Rounding can add half to every value.
        let rounded = sum * factor + 0.5 * row.len() as f64;
        let bound = rounded * f64::from(INPUT_COEFFICIENT_MAX) + factor / 2.0;
        (largest * factor).round() <= f64::from(i16::MAX) && bound <= Bounds::MAX_ACCUMULATOR as f64
    })
}
