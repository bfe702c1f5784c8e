//! From cells to coefficients: `S^T x`.

use super::basis::{Basis, NodeShifts};
use super::level::{Level, Pair};
use super::{ShortSlice, front};
use crate::units::InputCoefficient;

/// Receives coefficients one after the other, in the order of the basis.
///
/// `shift` is the function's [`input_shift`](super::Function::input_shift).
pub trait Sink {
    /// A coefficient that fits 32 bits whatever the frame.
    fn put(&mut self, value: i32, shift: u32);
    /// A coefficient of two unequal halves, whose weights can make it wider.
    fn put_wide(&mut self, value: i64, shift: u32);
}

/// Computes all coefficients of `cells` and gives them to `sink`.
///
/// `cells` holds the grid row by row and is used up; `scratch` needs
/// [`Basis::scratch_len`] elements. The result is exact for any cells whose
/// magnitudes add up to less than 2^31.
///
/// # Errors
/// [`ShortSlice`] if a slice is too short; nothing has been put out then.
pub fn analyse(
    basis: &Basis,
    cells: &mut [i32],
    scratch: &mut [i32],
    sink: &mut impl Sink,
) -> Result<(), ShortSlice> {
    let mut from = front(cells, basis.grid().cells(), "cells")?;
    let mut to = front(scratch, basis.scratch_len(), "scratch")?;
    for level in basis.levels() {
        merge(level, from, to, sink);
        core::mem::swap(&mut from, &mut to);
    }
    let sum = from.first().copied().unwrap_or(0);
    sink.put(sum, super::basis::input_shift(basis.grid().cells() as u64));
    Ok(())
}

/// Computes all coefficients of one channel, each shifted right by its
/// [`input_shift`](super::Function::input_shift), and stores them in
/// `coefficients[..][channel]`.
///
/// This is one of the named rounding places: to nearest, halves upwards. `cells`
/// are [`Light`](crate::units::Light) bits, 0 to 2^15.
///
/// # Errors
/// [`ShortSlice`] if a slice is too short.
pub fn analyse_rounded<const C: usize>(
    basis: &Basis,
    cells: &mut [i32],
    scratch: &mut [i32],
    coefficients: &mut [[InputCoefficient; C]],
    channel: usize,
) -> Result<(), ShortSlice> {
    let coefficients = front(coefficients, basis.grid().cells(), "coefficient")?;
    let mut sink = Rounding {
        slots: coefficients.iter_mut(),
        channel,
    };
    analyse(basis, cells, scratch, &mut sink)
}

struct Rounding<'c, const C: usize> {
    slots: core::slice::IterMut<'c, [InputCoefficient; C]>,
    channel: usize,
}

impl<const C: usize> Rounding<'_, C> {
    #[inline]
    fn store(&mut self, value: InputCoefficient) {
        let slot = self.slots.next();
        if let Some(slot) = slot.and_then(|channels| channels.get_mut(self.channel)) {
            *slot = value;
        }
    }
}

impl<const C: usize> Sink for Rounding<'_, C> {
    #[inline]
    fn put(&mut self, value: i32, shift: u32) {
        let half = 1_i32.wrapping_shl(shift.wrapping_sub(1));
        self.store(value.wrapping_add(half).wrapping_shr(shift) as InputCoefficient);
    }

    #[inline]
    fn put_wide(&mut self, value: i64, shift: u32) {
        let half = 1_i64.wrapping_shl(shift.wrapping_sub(1));
        self.store(value.wrapping_add(half).wrapping_shr(shift) as InputCoefficient);
    }
}

/// One level: sums go from `from` to `to`, details to `sink`.
fn merge(level: &Level, from: &[i32], to: &mut [i32], sink: &mut impl Sink) {
    let mut rows = from.chunks_exact(level.cols.nodes).take(level.rows.nodes);
    let merged = to
        .chunks_exact_mut(level.merged_cols())
        .take(level.merged_rows());
    for (index, sums) in merged.enumerate() {
        let pair = level.row_pair(index);
        let top = rows.next().unwrap_or_default();
        let bottom = if pair.splits() {
            rows.next().unwrap_or_default()
        } else {
            &[]
        };
        let plain = if pair.is_plain() {
            level.plain_cols()
        } else {
            0
        };
        merge_plain(level, pair, (top, bottom), sums, plain, sink);
        for (col, sum) in sums.iter_mut().enumerate().skip(plain) {
            *sum = merge_weighted(pair, level.col_pair(col), (top, bottom), col, sink);
        }
    }
}

/// The first `plain` nodes of a row of nodes, all of equal halves.
#[inline]
fn merge_plain(
    level: &Level,
    rows: Pair,
    (top, bottom): (&[i32], &[i32]),
    sums: &mut [i32],
    plain: usize,
    sink: &mut impl Sink,
) {
    let shifts = NodeShifts::new(rows, level.col_pair(0));
    let (top, _) = top.as_chunks::<2>();
    let (bottom, _) = bottom.as_chunks::<2>();
    for ((sum, [a, b]), [c, d]) in sums.iter_mut().zip(top).zip(bottom).take(plain) {
        let (top_sum, top_difference) = (a.wrapping_add(*b), a.wrapping_sub(*b));
        let (bottom_sum, bottom_difference) = (c.wrapping_add(*d), c.wrapping_sub(*d));
        *sum = top_sum.wrapping_add(bottom_sum);
        sink.put(
            top_difference.wrapping_add(bottom_difference),
            shifts.columns,
        );
        sink.put(top_sum.wrapping_sub(bottom_sum), shifts.rows);
        sink.put(top_difference.wrapping_sub(bottom_difference), shifts.both);
    }
}

/// Any node; returns its sum.
fn merge_weighted(
    rows: Pair,
    cols: Pair,
    (top, bottom): (&[i32], &[i32]),
    col: usize,
    sink: &mut impl Sink,
) -> i32 {
    let value = |row: &[i32], at: usize| row.get(at).copied().unwrap_or(0);
    let halves = |row: &[i32]| {
        let second = if cols.splits() {
            value(row, 2 * col + 1)
        } else {
            0
        };
        (value(row, 2 * col), second)
    };
    let detail = |pair: Pair, first: i64, second: i64| {
        let (first_weight, second_weight) =
            (i64::from(pair.first_weight), i64::from(pair.second_weight));
        first_weight
            .wrapping_mul(first)
            .wrapping_sub(second_weight.wrapping_mul(second))
    };
    let ((a, b), (c, d)) = (halves(top), halves(bottom));
    let (top_sum, bottom_sum) = (a.wrapping_add(b), c.wrapping_add(d));
    let top_detail = detail(cols, i64::from(a), i64::from(b));
    let bottom_detail = detail(cols, i64::from(c), i64::from(d));
    let shifts = NodeShifts::new(rows, cols);
    if cols.splits() {
        sink.put_wide(top_detail.wrapping_add(bottom_detail), shifts.columns);
    }
    if rows.splits() {
        sink.put_wide(
            detail(rows, i64::from(top_sum), i64::from(bottom_sum)),
            shifts.rows,
        );
    }
    if rows.splits() && cols.splits() {
        sink.put_wide(detail(rows, top_detail, bottom_detail), shifts.both);
    }
    top_sum.wrapping_add(bottom_sum)
}
