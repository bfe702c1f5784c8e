//! Haar reconstruction: the exact inverse of the analysis.

use super::ShortSlice;
use super::basis::Basis;
use super::level::NodePair;
use super::synthesis::{Rule, descend};

struct Solve;

/// The two halves that have this sum and this detail.
///
/// `sum = x + y` and `detail = first_weight x - second_weight y`; the division
/// leaves no remainder where both came from integer cells.
fn halves(pair: NodePair, sum: i64, detail: i64) -> (i64, i64) {
    if !pair.splits() {
        return (sum, 0);
    }
    let (first_weight, second_weight) =
        (i64::from(pair.first_weight), i64::from(pair.second_weight));
    let first = second_weight
        .wrapping_mul(sum)
        .wrapping_add(detail)
        .checked_div(first_weight + second_weight)
        .unwrap_or(0);
    (first, sum.wrapping_sub(first))
}

impl Rule<i64> for Solve {
    fn plain(sum: i64, columns: i64, rows: i64, both: i64) -> [i64; 4] {
        let equal = NodePair {
            first: 1,
            second: 1,
            first_weight: 1,
            second_weight: 1,
        };
        Self::weighted(sum, columns, rows, both, (equal, equal))
    }

    fn halves(sum: i64, detail: i64, pair: NodePair) -> [i64; 2] {
        halves(pair, sum, detail).into()
    }

    fn weighted(
        sum: i64,
        columns: i64,
        rows: i64,
        both: i64,
        (row_pair, col_pair): (NodePair, NodePair),
    ) -> [i64; 4] {
        let (top, bottom) = halves(row_pair, sum, rows);
        let (top_detail, bottom_detail) = halves(row_pair, columns, both);
        let (a, b) = halves(col_pair, top, top_detail);
        let (c, d) = halves(col_pair, bottom, bottom_detail);
        [a, b, c, d]
    }
}

/// Computes the cells `x`, row by row, from their exact coefficients `S^T x`.
///
/// The frame pipeline does not need this; it shows that the transform loses
/// nothing, and turns stored coefficients back into pictures. `buffers` are memory,
/// [`Basis::scratch_len`] elements each.
///
/// # Errors
/// [`ShortSlice`] if a slice is too short.
pub fn reconstruct(
    basis: &Basis,
    coefficients: &[i64],
    cells: &mut [i64],
    buffers: [&mut [i64]; 2],
) -> Result<(), ShortSlice> {
    descend::<i64, Solve>(basis, coefficients, buffers, cells)
}
