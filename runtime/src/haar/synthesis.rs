//! From coefficients to cells, level by level from the coarsest.

use super::basis::Basis;
use super::level::{Level, Pair};
use super::{ShortSlice, front};

/// How the values of a node's four quarters follow from the node's own value and
/// its details. Quarters: top left, top right, bottom left, bottom right.
pub(super) trait Rule<T> {
    /// A node of four equal quarters.
    fn plain(value: T, columns: T, rows: T, both: T) -> [T; 4];
    /// Any node; quarters and details that it does not have are ignored.
    fn weighted(value: T, columns: T, rows: T, both: T, pairs: (Pair, Pair)) -> [T; 4];
}

/// Applies `R` from the coarsest level to the cells. `coefficient` gives the
/// coefficients by index.
pub(super) fn descend<T: Copy + Default, R: Rule<T>>(
    basis: &Basis,
    cells: &mut [T],
    scratch: &mut [T],
    coefficient: impl Fn(usize) -> T + Copy,
) -> Result<(), ShortSlice> {
    let count = basis.grid().cells();
    let mut to = front(cells, count, "cells")?;
    let mut from = front(scratch, basis.scratch_len(), "scratch")?;
    // Level k writes into `cells` for even k, so the last one, 0, ends there.
    if !basis.depth().is_multiple_of(2) {
        core::mem::swap(&mut to, &mut from);
    }
    if let Some(root) = to.first_mut() {
        *root = coefficient(count - 1);
    }
    for level in basis.levels().iter().rev() {
        core::mem::swap(&mut to, &mut from);
        split::<T, R>(level, from, to, coefficient);
    }
    Ok(())
}

/// One level, from `from` to `to`.
fn split<T: Copy + Default, R: Rule<T>>(
    level: &Level,
    from: &[T],
    to: &mut [T],
    coefficient: impl Fn(usize) -> T + Copy,
) {
    let mut next = level.first;
    let merged = from.chunks_exact(level.merged_cols());
    let mut rows = to.chunks_exact_mut(level.cols.nodes).take(level.rows.nodes);
    for (index, values) in merged.take(level.merged_rows()).enumerate() {
        let pair = level.row_pair(index);
        let top = rows.next().unwrap_or_default();
        let bottom = if pair.splits() {
            rows.next().unwrap_or_default()
        } else {
            &mut []
        };
        let plain = if pair.is_plain() {
            level.plain_cols()
        } else {
            0
        };
        let (top_plain, _) = top.as_chunks_mut::<2>();
        let (bottom_plain, _) = bottom.as_chunks_mut::<2>();
        let quarters = top_plain.iter_mut().zip(bottom_plain);
        for ((value, top), bottom) in values
            .iter()
            .zip(quarters)
            .take(plain)
            .map(|(v, (t, b))| ((v, t), b))
        {
            let [a, b, c, d] = R::plain(
                *value,
                coefficient(next),
                coefficient(next + 1),
                coefficient(next + 2),
            );
            (*top, *bottom) = ([a, b], [c, d]);
            next += 3;
        }
        for (col, value) in values.iter().enumerate().skip(plain) {
            let cols = level.col_pair(col);
            let mut take = |exists: bool| {
                let value = if exists {
                    coefficient(next)
                } else {
                    T::default()
                };
                next += usize::from(exists);
                value
            };
            let columns = take(cols.splits());
            let rows = take(pair.splits());
            let both = take(cols.splits() && pair.splits());
            let quarters = R::weighted(*value, columns, rows, both, (pair, cols));
            store(quarters, (top, bottom), col, cols);
        }
    }
}

fn store<T: Copy>(quarters: [T; 4], (top, bottom): (&mut [T], &mut [T]), col: usize, cols: Pair) {
    let [a, b, c, d] = quarters;
    for (row, first, second) in [(top, a, b), (bottom, c, d)] {
        if let Some(slot) = row.get_mut(2 * col) {
            *slot = first;
        }
        if cols.splits()
            && let Some(slot) = row.get_mut(2 * col + 1)
        {
            *slot = second;
        }
    }
}

struct Weigh;

impl Rule<i32> for Weigh {
    #[inline]
    fn plain(value: i32, columns: i32, rows: i32, both: i32) -> [i32; 4] {
        let (top, bottom) = (value.wrapping_add(rows), value.wrapping_sub(rows));
        let (top_detail, bottom_detail) = (columns.wrapping_add(both), columns.wrapping_sub(both));
        [
            top.wrapping_add(top_detail),
            top.wrapping_sub(top_detail),
            bottom.wrapping_add(bottom_detail),
            bottom.wrapping_sub(bottom_detail),
        ]
    }

    fn weighted(
        value: i32,
        columns: i32,
        rows: i32,
        both: i32,
        (row_pair, col_pair): (Pair, Pair),
    ) -> [i32; 4] {
        let along = |pair: Pair, value: i32, detail: i32| {
            (
                value.wrapping_add((pair.first_weight as i32).wrapping_mul(detail)),
                value.wrapping_sub((pair.second_weight as i32).wrapping_mul(detail)),
            )
        };
        let (top, bottom) = along(row_pair, value, rows);
        let (top_detail, bottom_detail) = along(row_pair, columns, both);
        let (a, b) = along(col_pair, top, top_detail);
        let (c, d) = along(col_pair, bottom, bottom_detail);
        [a, b, c, d]
    }
}

/// Computes the cells of one channel, `S z`, with `z = coefficients[..][channel]`.
///
/// Exact where the sums fit 32 bits, which a checked table has proved for every
/// frame ([`Table`](crate::image::Table)); elsewhere they wrap. `cells` receives
/// the grid row by row; `scratch` needs [`Basis::scratch_len`] elements.
///
/// # Errors
/// [`ShortSlice`] if a slice is too short.
pub fn synthesise<const C: usize>(
    basis: &Basis,
    coefficients: &[[i32; C]],
    channel: usize,
    cells: &mut [i32],
    scratch: &mut [i32],
) -> Result<(), ShortSlice> {
    let needed = basis.grid().cells();
    let coefficients = coefficients.get(..needed).ok_or(ShortSlice {
        what: "coefficient",
        needed,
        given: coefficients.len(),
    })?;
    descend::<i32, Weigh>(basis, cells, scratch, |index| {
        coefficients
            .get(index)
            .and_then(|channels| channels.get(channel))
            .copied()
            .unwrap_or(0)
    })
}
