//! Matrix product: the form factor matrix, in blocks, times columns of light.

use super::blocks::{BlockStorage, MatrixBlock};
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};
use rayon::prelude::*;
use std::ops::Range;

/// Columns that go through all blocks together.
const CHUNK: usize = 64;
/// Parts that the blocks are divided into, each with its own sum. More than there are
/// usually cores; a number of its own, so that the result has the same bits on any number
/// of them.
const PARTS: usize = 8;
/// Columns up to which a matrix is better applied column by column.
const FEW: usize = 3;

/// Blocks in parts of about the same work.
pub(super) fn divided(blocks: &[MatrixBlock]) -> Vec<Range<usize>> {
    let total: usize = blocks.iter().map(MatrixBlock::numbers).sum();
    let mut parts = Vec::with_capacity(PARTS);
    let (mut start, mut done) = (0, 0);
    for (index, block) in blocks.iter().enumerate() {
        done += block.numbers();
        if done * PARTS >= total * (parts.len() + 1) {
            parts.push(start..index + 1);
            start = index + 1;
        }
    }
    parts
}

/// The symmetric product, patches x columns; `order` says which patch is where in
/// the blocks.
pub(super) fn product(
    blocks: &[MatrixBlock],
    parts: &[Range<usize>],
    order: &[usize],
    light: &DMatrix<f64>,
) -> DMatrix<f64> {
    let mut result = DMatrix::zeros(light.nrows(), light.ncols());
    for first in (0..light.ncols()).step_by(CHUNK) {
        let columns = CHUNK.min(light.ncols() - first);
        // Single precision has a narrow range: every column is brought to 1 at most.
        let scales: Vec<f64> = (first..first + columns)
            .map(|c| light.column(c).amax())
            .map(|most| if most > 0.0 { most } else { 1.0 })
            .collect();
        let ordered = DMatrix::from_fn(order.len(), columns, |row, column| {
            (light[(order[row], first + column)] / scales[column]) as f32
        });
        let sums: Vec<DMatrix<f32>> = parts
            .par_iter()
            .map(|part| {
                let mut sum = DMatrix::zeros(order.len(), columns);
                for block in &blocks[part.clone()] {
                    apply(block, &ordered, &mut sum);
                }
                sum
            })
            .collect();
        for (column, scale) in scales.iter().enumerate() {
            for (row, patch) in order.iter().enumerate() {
                let sum: f64 = sums.iter().map(|s| f64::from(s[(row, column)])).sum();
                result[(*patch, first + column)] = sum * scale;
            }
        }
    }
    result
}

/// Adds a block and its transpose.
fn apply(block: &MatrixBlock, light: &DMatrix<f32>, sum: &mut DMatrix<f32>) {
    let (rows, columns) = (block.rows.clone(), block.columns.clone());
    let range = |r: &Range<usize>| (r.start, r.len());
    let ((i, m), (j, n)) = (range(&rows), range(&columns));
    match &block.content {
        BlockStorage::Dense(matrix) => {
            times(matrix, light.rows(j, n), sum.rows_mut(i, m));
            if !block.on_diagonal() {
                transposed_times(matrix, light.rows(i, m), sum.rows_mut(j, n));
            }
        }
        BlockStorage::LowRank { left, right } => {
            let terms = |matrix: &DMatrix<f32>, light: DMatrixView<'_, f32>| {
                let mut terms = DMatrix::zeros(matrix.ncols(), light.ncols());
                let whole = terms.ncols();
                transposed_times(matrix, light, terms.columns_mut(0, whole));
                terms
            };
            let there = terms(right, light.rows(j, n));
            times(left, there.columns(0, there.ncols()), sum.rows_mut(i, m));
            let back = terms(left, light.rows(i, m));
            times(right, back.columns(0, back.ncols()), sum.rows_mut(j, n));
        }
    }
}

type LightRows<'a> =
    nalgebra::MatrixView<'a, f32, nalgebra::Dyn, nalgebra::Dyn, nalgebra::U1, nalgebra::Dyn>;

fn times(matrix: &DMatrix<f32>, light: LightRows<'_>, mut sum: DMatrixViewMut<'_, f32>) {
    if light.ncols() <= FEW {
        for column in 0..light.ncols() {
            sum.column_mut(column)
                .gemv(1.0, matrix, &light.column(column), 1.0);
        }
    } else {
        sum.gemm(1.0, matrix, &light, 1.0);
    }
}

fn transposed_times(matrix: &DMatrix<f32>, light: LightRows<'_>, mut sum: DMatrixViewMut<'_, f32>) {
    if light.ncols() <= FEW {
        for column in 0..light.ncols() {
            sum.column_mut(column)
                .gemv_tr(1.0, matrix, &light.column(column), 1.0);
        }
    } else {
        // Turning it around first costs little and lets the fast product do it.
        sum.gemm(1.0, &matrix.transpose(), &light, 1.0);
    }
}
