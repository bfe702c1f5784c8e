//! Haar synthesis: from coefficients to cells, level by level from the coarsest.

use super::basis::Basis;
use super::level::{Level, NodePair};
use super::{ShortSlice, front};
use crate::kernel::{Block, levels};

/// How the values of a node's four quarters follow from the node's own value and
/// its details. Quarters: top left, top right, bottom left, bottom right.
pub(super) trait Rule<T> {
    /// A node of four equal quarters.
    fn plain(value: T, columns: T, rows: T, both: T) -> [T; 4];
    /// A node of two halves; a detail that it does not have is zero.
    fn halves(value: T, detail: T, pair: NodePair) -> [T; 2];
    /// Any node; quarters and details that it does not have are ignored.
    fn weighted(value: T, columns: T, rows: T, both: T, pairs: (NodePair, NodePair)) -> [T; 4];
    /// The nodes of `block`, all of four equal quarters; `false`, and nothing done,
    /// where there is no faster way than node by node.
    fn split(block: Block, values: &[T], details: &[[T; 3]], to: &mut [T]) -> bool {
        let _ = (block, values, details, to);
        false
    }
}

/// Applies `R` from the coarsest level to the finest, whose values go to `cells`.
///
/// `buffers` are memory for the values of the levels, [`Basis::scratch_len`]
/// elements each.
pub(super) fn descend<T: Copy + Default, R: Rule<T>>(
    basis: &Basis,
    coefficients: &[T],
    [to, from]: [&mut [T]; 2],
    cells: &mut [T],
) -> Result<(), ShortSlice> {
    let count = basis.grid().cells();
    let coefficients = coefficients.get(..count).ok_or(ShortSlice {
        what: "coefficient",
        needed: count,
        given: coefficients.len(),
    })?;
    let mut to = front(to, basis.scratch_len(), "first buffer")?;
    let mut from = front(from, basis.scratch_len(), "second buffer")?;
    let cells = front(cells, count, "cells")?;
    let constant = coefficients.last().copied().unwrap_or_default();
    let Some((finest, coarser)) = basis.levels().split_first() else {
        cells.fill(constant);
        return Ok(());
    };
    if let Some(root) = to.first_mut() {
        *root = constant;
    }
    for level in coarser.iter().rev() {
        core::mem::swap(&mut to, &mut from);
        split::<T, R>(level, from, coefficients, to);
    }
    split::<T, R>(finest, to, coefficients, cells);
    Ok(())
}

/// One level, from `from` to `to`.
fn split<T: Copy + Default, R: Rule<T>>(
    level: &Level,
    from: &[T],
    coefficients: &[T],
    to: &mut [T],
) {
    let mut details = coefficients.get(level.first..).unwrap_or_default();
    if level.is_plain() {
        let nodes = level.merged_nodes();
        let own = details.as_chunks::<3>().0.get(..nodes);
        let (values, to) = (from.get(..nodes), to.get_mut(..level.nodes()));
        let all = Block {
            row: 0,
            cols: level.cols.nodes,
            nodes: level.merged_cols(),
            rows: level.merged_rows(),
        };
        if let (Some(own), Some(values), Some(to)) = (own, values, to)
            && R::split(all, values, own, to)
        {
            return;
        }
    }
    let cols = level.cols.nodes;
    let mut pairs = to.chunks_mut(2 * cols);
    let merged = from.chunks_exact(level.merged_cols().max(1));
    for (index, values) in merged.take(level.merged_rows()).enumerate() {
        let pair = level.row_pair(index);
        let to = pairs.next().unwrap_or_default();
        let mut plain = 0;
        if pair.is_plain() {
            plain = level.plain_cols().min(details.len() / 3);
            let (own, rest) = details.split_at(3 * plain);
            details = rest;
            let block = Block {
                row: 0,
                cols,
                nodes: plain,
                rows: 1,
            };
            let (own, _) = own.as_chunks::<3>();
            if !R::split(block, values, own, to) {
                let (top, bottom) = to.split_at_mut(cols.min(to.len()));
                split_plain::<T, R>(values, own, (top, bottom));
            }
        }
        let (top, bottom) = to.split_at_mut(cols.min(to.len()));
        for (col, value) in values.iter().enumerate().skip(plain) {
            let cols = level.col_pair(col);
            let mut take = |exists: bool| match details.split_first() {
                Some((value, rest)) if exists => {
                    details = rest;
                    *value
                }
                _ => T::default(),
            };
            // Nodes at the border are mostly one half along one axis, or both.
            if !pair.splits() || !cols.splits() {
                let (along, place) = if pair.splits() {
                    (pair, bottom.get_mut(2 * col))
                } else {
                    (cols, None)
                };
                let [first, second] = R::halves(*value, take(along.splits()), *along);
                if let Some(slot) = place {
                    *slot = second;
                } else if let (true, Some(slot)) = (along.splits(), top.get_mut(2 * col + 1)) {
                    *slot = second;
                }
                if let Some(slot) = top.get_mut(2 * col) {
                    *slot = first;
                }
                continue;
            }
            let columns = take(cols.splits());
            let rows = take(pair.splits());
            let both = take(cols.splits() && pair.splits());
            let quarters = R::weighted(*value, columns, rows, both, (*pair, *cols));
            store(quarters, (&mut *top, &mut *bottom), col, *cols);
        }
    }
}

/// Nodes of four equal quarters, as many as there are details for.
#[inline]
fn split_plain<T: Copy, R: Rule<T>>(
    values: &[T],
    details: &[[T; 3]],
    (top, bottom): (&mut [T], &mut [T]),
) {
    let (top, _) = top.as_chunks_mut::<2>();
    let (bottom, _) = bottom.as_chunks_mut::<2>();
    let nodes = values.iter().zip(details);
    for (((value, [columns, rows, both]), top), bottom) in nodes.zip(top).zip(bottom) {
        let [a, b, c, d] = R::plain(*value, *columns, *rows, *both);
        (*top, *bottom) = ([a, b], [c, d]);
    }
}

fn store<T: Copy>(
    quarters: [T; 4],
    (top, bottom): (&mut [T], &mut [T]),
    col: usize,
    cols: NodePair,
) {
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

    #[inline]
    fn halves(value: i32, detail: i32, pair: NodePair) -> [i32; 2] {
        [
            value.wrapping_add(i32::from(pair.first_weight).wrapping_mul(detail)),
            value.wrapping_sub(i32::from(pair.second_weight).wrapping_mul(detail)),
        ]
    }

    fn weighted(
        value: i32,
        columns: i32,
        rows: i32,
        both: i32,
        (row_pair, col_pair): (NodePair, NodePair),
    ) -> [i32; 4] {
        let [top, bottom] = Self::halves(value, rows, row_pair);
        let [top_detail, bottom_detail] = Self::halves(columns, both, row_pair);
        let [a, b] = Self::halves(top, top_detail, col_pair);
        let [c, d] = Self::halves(bottom, bottom_detail, col_pair);
        [a, b, c, d]
    }

    #[inline]
    fn split(block: Block, values: &[i32], details: &[[i32; 3]], to: &mut [i32]) -> bool {
        levels::split(block, values, details, to)
    }
}

/// Computes the cells of one channel, `S z`.
///
/// Exact where the sums fit 32 bits, which a checked table has proved for every
/// frame ([`Table`](crate::image::Table)); elsewhere they wrap. `cells` receives the
/// grid row by row; `buffers` are memory, [`Basis::scratch_len`] elements each.
///
/// # Errors
/// [`ShortSlice`] if a slice is too short.
pub fn synthesise(
    basis: &Basis,
    coefficients: &[i32],
    buffers: [&mut [i32]; 2],
    cells: &mut [i32],
) -> Result<(), ShortSlice> {
    descend::<i32, Weigh>(basis, coefficients, buffers, cells)
}
