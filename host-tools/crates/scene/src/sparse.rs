//! Sparse matrix by rows: what each pixel or patch gets from a few of many.

use nalgebra::DMatrix;
use rayon::prelude::*;

/// A sparse matrix whose rows list their entries.
#[derive(Clone, Debug, Default)]
pub(crate) struct SparseRows {
    /// Where each row ends in `entries`.
    end: Vec<usize>,
    entries: Vec<(u32, f32)>,
}

impl SparseRows {
    /// From the entries of each row: column and value.
    pub(crate) fn from_rows(rows: impl IntoIterator<Item = Vec<(u32, f64)>>) -> Self {
        let mut all = Self::default();
        for row in rows {
            all.push(row);
        }
        all
    }

    /// Adds a row below the others, from its entries: column and value.
    pub(crate) fn push(&mut self, row: impl IntoIterator<Item = (u32, f64)>) {
        let entries = row.into_iter();
        self.entries
            .extend(entries.map(|(column, value)| (column, value as f32)));
        self.end.push(self.entries.len());
    }

    /// Number of rows.
    pub(crate) fn count(&self) -> usize {
        self.end.len()
    }

    /// Number of entries.
    pub(crate) fn entries(&self) -> usize {
        self.entries.len()
    }

    /// The entries of a row: column and value.
    pub(crate) fn row(&self, row: usize) -> &[(u32, f32)] {
        let begin = row.checked_sub(1).map_or(0, |above| self.end[above]);
        &self.entries[begin..self.end[row]]
    }

    /// The product with a vector that is given by its elements.
    pub(crate) fn times(&self, row: usize, vector: impl Fn(usize) -> f64) -> f64 {
        let entries = self.row(row).iter();
        entries
            .map(|(column, value)| f64::from(*value) * vector(*column as usize))
            .sum()
    }

    /// The product with a matrix of as many rows as this one has columns.
    pub(crate) fn product(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let mut result = DMatrix::zeros(self.count(), right.ncols());
        if self.count() == 0 {
            return result;
        }
        let columns = result.as_mut_slice().par_chunks_mut(self.count());
        columns.enumerate().for_each(|(k, column)| {
            let right = right.column(k);
            for (row, value) in column.iter_mut().enumerate() {
                *value = self.times(row, |at| right[at]);
            }
        });
        result
    }
}

/// Adds up entries of the same index, in their order, and sorts them by it.
pub(super) fn merge<V: Copy>(entries: &mut Vec<(u32, V)>, add: impl Fn(&mut V, V)) {
    entries.sort_by_key(|(index, _)| *index);
    entries.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            add(&mut kept.1, next.1);
        }
        same
    });
}
