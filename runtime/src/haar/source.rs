//! Cells of a grid, in memory or computed as they are read.

use crate::kernel::{Block, levels};
use crate::units::InputCoefficient;

/// The cells of a grid.
///
/// They can be computed as they are read, from pixels for instance, so that a
/// frame's light is not stored before it is transformed.
pub trait CellSource {
    /// One row of them.
    type Row<'r>: CellRow
    where
        Self: 'r;

    /// The rows, first to last.
    fn rows(&self) -> impl Iterator<Item = Self::Row<'_>>;

    /// Merges nodes of two by two cells: their sums to `sums`, their details, whose
    /// input shift is `shift`, to `details`. `false`, and nothing done, where there is
    /// no faster way than to ask for the values.
    #[inline]
    fn merge(
        &self,
        block: Block,
        shift: u32,
        sums: &mut [i32],
        details: &mut [[InputCoefficient; 3]],
    ) -> bool {
        let _ = (block, shift, sums, details);
        false
    }
}

/// A row of cells.
pub trait CellRow: Copy {
    /// The values two by two, without a last odd one.
    fn pairs(self) -> impl Iterator<Item = [i32; 2]>;
    /// The value at an index; 0 past the end.
    fn at(self, index: usize) -> i32;
}

impl CellRow for &[i32] {
    #[inline]
    fn pairs(self) -> impl Iterator<Item = [i32; 2]> {
        self.as_chunks::<2>().0.iter().copied()
    }

    #[inline]
    fn at(self, index: usize) -> i32 {
        self.get(index).copied().unwrap_or(0)
    }
}

/// Cells in memory, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Cells<'c> {
    /// The values.
    pub values: &'c [i32],
    /// Columns of the grid.
    pub cols: usize,
}

impl CellSource for Cells<'_> {
    type Row<'r>
        = &'r [i32]
    where
        Self: 'r;

    #[inline]
    fn rows(&self) -> impl Iterator<Item = &[i32]> {
        self.values.chunks_exact(self.cols.max(1))
    }

    #[inline]
    fn merge(
        &self,
        block: Block,
        shift: u32,
        sums: &mut [i32],
        details: &mut [[InputCoefficient; 3]],
    ) -> bool {
        levels::merge(self.values, block, shift, sums, details)
    }
}
