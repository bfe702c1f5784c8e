//! Haar analysis: from cells to coefficients, `S^T x`.

use super::basis::{Basis, NodeShifts, input_shift};
use super::level::{Level, NodePair};
use super::source::{CellRow, CellSource, Cells};
use super::{ShortSlice, front};
use crate::kernel::Block;
use crate::units::InputCoefficient;

/// A coefficient as it is stored. `shift` is its function's
/// [`input_shift`](super::Function::input_shift).
pub trait Coefficient: Copy {
    /// From a value that fits 32 bits whatever the frame.
    fn narrow(value: i32, shift: u32) -> Self;
    /// From the value of two unequal halves, whose weights can make it wider.
    fn wide(value: i64, shift: u32) -> Self;

    /// Details as input coefficients, if that is what they are.
    #[inline]
    fn inputs(details: &mut [[Self; 3]]) -> Option<&mut [[InputCoefficient; 3]]> {
        let _ = details;
        None
    }
}

/// Exact.
impl Coefficient for i64 {
    fn narrow(value: i32, _shift: u32) -> Self {
        value.into()
    }

    fn wide(value: i64, _shift: u32) -> Self {
        value
    }
}

/// A named rounding place: shifted right, to nearest, halves upwards.
impl Coefficient for InputCoefficient {
    #[inline]
    fn narrow(value: i32, shift: u32) -> Self {
        let half = 1_i32.wrapping_shl(shift.wrapping_sub(1));
        value.wrapping_add(half).wrapping_shr(shift) as Self
    }

    #[inline]
    fn wide(value: i64, shift: u32) -> Self {
        let half = 1_i64.wrapping_shl(shift.wrapping_sub(1));
        value.wrapping_add(half).wrapping_shr(shift) as Self
    }

    #[inline]
    fn inputs(details: &mut [[Self; 3]]) -> Option<&mut [[InputCoefficient; 3]]> {
        Some(details)
    }
}

/// Computes all coefficients of one channel: exact as `i64`, rounded as
/// [`InputCoefficient`].
///
/// `buffers` are memory for the sums of the levels, [`Basis::scratch_len`] elements
/// each. Exact for any values whose magnitudes add up to less than 2^31.
///
/// # Errors
/// [`ShortSlice`] if a slice is too short.
pub fn analyse<T: Coefficient>(
    basis: &Basis,
    cells: &impl CellSource,
    [to, from]: [&mut [i32]; 2],
    coefficients: &mut [T],
) -> Result<(), ShortSlice> {
    let mut to = front(to, basis.scratch_len(), "first buffer")?;
    let mut from = front(from, basis.scratch_len(), "second buffer")?;
    let mut rest = front(coefficients, basis.grid().cells(), "coefficient")?;
    let mut levels = basis.levels().iter();
    let sum = if let Some(finest) = levels.next() {
        rest = merge(finest, cells, to, rest);
        for level in levels {
            core::mem::swap(&mut from, &mut to);
            let values = Cells {
                values: from.get(..level.nodes()).unwrap_or_default(),
                cols: level.cols.nodes,
            };
            rest = merge(level, &values, to, rest);
        }
        to.first().copied().unwrap_or(0)
    } else {
        cells.rows().next().map_or(0, |row| row.at(0))
    };
    if let Some(constant) = rest.first_mut() {
        *constant = T::narrow(sum, input_shift(basis.grid().cells() as u64));
    }
    Ok(())
}

/// One level: sums of its nodes go to `to`, details to the front of `details`;
/// returns what is left of them.
fn merge<'c, T: Coefficient>(
    level: &Level,
    values: &impl CellSource,
    to: &mut [i32],
    details: &'c mut [T],
) -> &'c mut [T] {
    let cols = level.cols.nodes;
    let all = Block {
        row: 0,
        cols,
        nodes: level.merged_cols(),
        rows: level.merged_rows(),
    };
    if level.is_plain() && merge_block(all, *level.shifts(0, 0), values, to, details) {
        return details.get_mut(level.details()..).unwrap_or_default();
    }
    let mut details = details;
    let mut rows = values.rows().take(level.rows.nodes);
    let merged = to.chunks_exact_mut(level.merged_cols().max(1));
    for (index, sums) in merged.take(level.merged_rows()).enumerate() {
        let pair = level.row_pair(index);
        let Some(top) = rows.next() else { break };
        let bottom = if pair.splits() { rows.next() } else { None };
        let mut plain = 0;
        if let (Some(bottom), true) = (bottom, pair.is_plain()) {
            plain = level.plain_cols().min(details.len() / 3);
            let (own, rest) = details.split_at_mut(3 * plain);
            details = rest;
            let shifts = level.shifts(index, 0);
            let block = Block {
                row: 2 * index,
                cols,
                nodes: plain,
                rows: 1,
            };
            if !merge_block(block, *shifts, values, sums, own) {
                merge_plain(*shifts, (top, bottom), sums, own);
            }
        }
        for (col, sum) in sums.iter_mut().enumerate().skip(plain) {
            let (cols, shifts) = (level.col_pair(col), level.shifts(index, col));
            // Nodes at the border are mostly two equal halves, or one alone.
            let halves = match (pair.splits(), cols.splits()) {
                (true, false) if pair.is_plain() => Some((bottom, 2 * col, shifts.rows)),
                (false, true) if cols.is_plain() => Some((Some(top), 2 * col + 1, shifts.columns)),
                (false, false) => Some((None, 0, 0)),
                _ => None,
            };
            if let Some((row, at, shift)) = halves {
                let first = top.at(2 * col);
                *sum = first;
                if let Some(row) = row {
                    let second = row.at(at);
                    *sum = first.wrapping_add(second);
                    let detail = T::narrow(first.wrapping_sub(second), shift.into());
                    details = put_first(details, detail);
                }
                continue;
            }
            let node = merge_weighted((*pair, *cols), *shifts, (top, bottom), col);
            *sum = node.sum;
            for (value, shift) in node.details.into_iter().flatten() {
                details = put_first(details, T::wide(value, shift.into()));
            }
        }
    }
    details
}

/// Nodes of four equal quarters, if there is a faster way for them.
#[inline]
fn merge_block<T: Coefficient>(
    block: Block,
    shifts: NodeShifts,
    values: &impl CellSource,
    sums: &mut [i32],
    details: &mut [T],
) -> bool {
    let count = block.nodes * block.rows;
    let alike = shifts.columns == shifts.both && shifts.rows == shifts.both;
    let details = details.as_chunks_mut::<3>().0.get_mut(..count);
    match (details.and_then(T::inputs), sums.get_mut(..count)) {
        (Some(inputs), Some(sums)) if alike => {
            values.merge(block, shifts.both.into(), sums, inputs)
        }
        _ => false,
    }
}

/// Stores one detail and returns the rest.
fn put_first<T>(details: &mut [T], value: T) -> &mut [T] {
    match details.split_first_mut() {
        Some((slot, rest)) => {
            *slot = value;
            rest
        }
        None => &mut [],
    }
}

/// Nodes of four equal quarters, as many as `details` has room for.
#[inline]
fn merge_plain<R: CellRow, T: Coefficient>(
    shifts: NodeShifts,
    (top, bottom): (R, R),
    sums: &mut [i32],
    details: &mut [T],
) {
    let (details, _) = details.as_chunks_mut::<3>();
    let quarters = top.pairs().zip(bottom.pairs());
    for ((slots, sum), ([a, b], [c, d])) in details.iter_mut().zip(sums).zip(quarters) {
        let (top_sum, top_difference) = (a.wrapping_add(b), a.wrapping_sub(b));
        let (bottom_sum, bottom_difference) = (c.wrapping_add(d), c.wrapping_sub(d));
        *sum = top_sum.wrapping_add(bottom_sum);
        *slots = [
            T::narrow(
                top_difference.wrapping_add(bottom_difference),
                shifts.columns.into(),
            ),
            T::narrow(top_sum.wrapping_sub(bottom_sum), shifts.rows.into()),
            T::narrow(
                top_difference.wrapping_sub(bottom_difference),
                shifts.both.into(),
            ),
        ];
    }
}

/// A merged node: its sum, and its details with their shifts.
struct Merged {
    sum: i32,
    details: [Option<(i64, u8)>; 3],
}

/// Any node.
fn merge_weighted<R: CellRow>(
    (rows, cols): (NodePair, NodePair),
    shifts: NodeShifts,
    (top, bottom): (R, Option<R>),
    col: usize,
) -> Merged {
    let halves = |row: R| {
        let second = if cols.splits() {
            row.at(2 * col + 1)
        } else {
            0
        };
        (row.at(2 * col), second)
    };
    let detail = |pair: NodePair, first: i64, second: i64| {
        let (first_weight, second_weight) =
            (i64::from(pair.first_weight), i64::from(pair.second_weight));
        first_weight
            .wrapping_mul(first)
            .wrapping_sub(second_weight.wrapping_mul(second))
    };
    let ((a, b), (c, d)) = (halves(top), bottom.map_or((0, 0), halves));
    let (top_sum, bottom_sum) = (a.wrapping_add(b), c.wrapping_add(d));
    let top_detail = detail(cols, i64::from(a), i64::from(b));
    let bottom_detail = detail(cols, i64::from(c), i64::from(d));
    let columns = (top_detail.wrapping_add(bottom_detail), shifts.columns);
    let along_rows = detail(rows, i64::from(top_sum), i64::from(bottom_sum));
    let both = detail(rows, top_detail, bottom_detail);
    Merged {
        sum: top_sum.wrapping_add(bottom_sum),
        details: [
            cols.splits().then_some(columns),
            rows.splits().then_some((along_rows, shifts.rows)),
            (rows.splits() && cols.splits()).then_some((both, shifts.both)),
        ],
    }
}
