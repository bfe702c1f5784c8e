//! Memory that is sized once and used for every frame.

use super::super::bands::STRIP;
use super::Work;
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::{Row, Workspace};
use iltm_runtime::units::{Drive, InputCoefficient};
use std::sync::{Mutex, PoisonError};

/// What the operator needs beside its values.
pub(super) struct OperatorMemory<const C: usize> {
    cells: Vec<i32>,
    scratch: Vec<i32>,
    inputs: Vec<[InputCoefficient; C]>,
}

impl<const C: usize> OperatorMemory<C> {
    pub(super) fn new(table: &Table<'_>) -> Self {
        let cells = table.grid().cells();
        Self {
            cells: vec![0; cells],
            scratch: vec![0; table.basis().scratch_len()],
            inputs: vec![[0; C]; cells],
        }
    }

    /// The runtime's workspace, with `values` to work on.
    pub(super) fn workspace<'w>(&'w mut self, values: &'w mut [[i32; C]]) -> Workspace<'w, C> {
        Workspace {
            cells: &mut self.cells,
            scratch: &mut self.scratch,
            inputs: &mut self.inputs,
            values,
        }
    }
}

/// What one thread needs beside the frame.
pub(super) struct BandMemory<S, M, const C: usize> {
    /// Of the frame's layout.
    pub(super) conversion: M,
    /// The rows of a strip, in a row colour by colour.
    pub(super) codes: Vec<S>,
    pub(super) row: RowMemory,
    /// Sums of the light of each cell, for each group of `C` colours.
    pub(super) sums: Vec<Vec<[u64; C]>>,
}

/// What one row needs.
pub(super) struct RowMemory {
    line: Vec<i32>,
    spread: Vec<i32>,
    drives: Vec<Drive>,
}

impl RowMemory {
    pub(super) fn new(line: usize, width: usize) -> Self {
        Self {
            line: vec![0; line],
            spread: vec![0; width],
            drives: vec![Drive::ZERO; width],
        }
    }

    /// The runtime's part of it, and the drives.
    pub(super) fn split(&mut self) -> (Row<'_>, &mut [Drive]) {
        let row = Row {
            line: &mut self.line,
            spread: &mut self.spread,
        };
        (row, &mut self.drives)
    }
}

/// As many memories as threads have worked at the same time.
pub(super) struct Memories<S, M, const C: usize> {
    free: Mutex<Vec<BandMemory<S, M, C>>>,
    line: usize,
    work: Work,
    cells: usize,
}

impl<S: Copy + Default, M: Default, const C: usize> Memories<S, M, C> {
    /// For rows whose [`Row::line`] needs `line` elements.
    pub(super) fn new(line: usize, cells: usize, work: Work) -> Self {
        Self {
            free: Mutex::default(),
            line,
            work,
            cells,
        }
    }

    /// Lends one to `job`.
    pub(super) fn lend<T>(&self, job: impl FnOnce(&mut BandMemory<S, M, C>) -> T) -> T {
        // A thread that panicked took its memory with it: the list is whole.
        let taken = self
            .free
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .pop();
        let mut memory = taken.unwrap_or_else(|| self.create());
        let result = job(&mut memory);
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(memory);
        result
    }

    fn create(&self) -> BandMemory<S, M, C> {
        let (width, colours) = (self.work.size.width(), self.work.colours);
        BandMemory {
            conversion: M::default(),
            codes: vec![S::default(); STRIP * width * colours],
            row: RowMemory::new(self.line, width),
            sums: vec![vec![[0; C]; self.cells]; colours / C],
        }
    }

    /// Moves the sums of all threads for one group into `total`.
    pub(super) fn take_sums(&self, group: usize, total: &mut [[u64; C]]) {
        total.fill([0; C]);
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        for memory in free.iter_mut() {
            for (total, sum) in total.iter_mut().zip(&mut memory.sums[group]) {
                for (total, sum) in total.iter_mut().zip(sum) {
                    *total += std::mem::take(sum);
                }
            }
        }
    }
}
