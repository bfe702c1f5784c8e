//! Memory that is sized once and used for every frame.

use super::super::bands::STRIP;
use super::EngineJob;
use iltm_runtime::{
    haar::Basis,
    image::Table,
    pipeline::{RowBuffers, Workspace},
    units::{Drive, Halfword, InputCoefficient},
};
use std::sync::{Mutex, PoisonError};

/// What the runtime's [`Workspace`] borrows.
#[derive(Clone, Debug)]
pub struct OperatorMemory {
    buffers: [Vec<i32>; 2],
    cells: Vec<i32>,
    inputs: Vec<InputCoefficient>,
    sums: Vec<i32>,
    heard: Option<Vec<Halfword>>,
    neighbours: Option<Basis>,
}

impl OperatorMemory {
    /// Enough for `table`.
    #[must_use]
    pub fn new(table: &Table<'_>) -> Self {
        let values = table.grid().cells() * usize::from(table.channels());
        let others = table.neighbours().map(|others| Basis::new(others.grid()));
        let others = others.map_or(0, |basis| basis.scratch_len());
        let buffer = || vec![0; table.basis().scratch_len().max(others)];
        Self {
            buffers: [buffer(), buffer()],
            cells: vec![0; table.grid().cells()],
            inputs: vec![0; table.inputs() * usize::from(table.channels())],
            sums: vec![0; values],
            heard: None,
            neighbours: None,
        }
    }

    /// Light of the neighbours' cells for the frames to come ([`Workspace::heard`]).
    pub fn hear(&mut self, light: Option<Vec<Halfword>>) {
        self.heard = light;
    }

    /// The workspace of one frame.
    pub fn workspace(&mut self) -> Workspace<'_> {
        let [first, second] = &mut self.buffers;
        Workspace {
            buffers: [first, second],
            cells: &mut self.cells,
            inputs: &mut self.inputs,
            sums: &mut self.sums,
            heard: self.heard.as_deref(),
            neighbours: &mut self.neighbours,
        }
    }
}

/// What one thread needs beside the frame.
pub(super) struct BandMemory<S, M> {
    /// Of the frame's layout.
    pub(super) conversion: M,
    /// The rows of a strip, in a row colour by colour.
    pub(super) codes: Vec<S>,
    pub(super) row: RowMemory,
    /// Sums of the light of each cell, colour by colour.
    pub(super) sums: Vec<u64>,
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
    pub(super) fn split(&mut self) -> (RowBuffers<'_>, &mut [Drive]) {
        let row = RowBuffers {
            line: &mut self.line,
            spread: &mut self.spread,
        };
        (row, &mut self.drives)
    }
}

/// As many memories as threads have worked at the same time.
pub(super) struct Memories<S, M> {
    free: Mutex<Vec<BandMemory<S, M>>>,
    line: usize,
    job: EngineJob,
    cells: usize,
}

impl<S: Copy + Default, M: Default> Memories<S, M> {
    /// For rows whose [`RowBuffers::line`] needs `line` elements.
    pub(super) fn new(line: usize, cells: usize, job: EngineJob) -> Self {
        Self {
            free: Mutex::default(),
            line,
            job,
            cells,
        }
    }

    /// Lends one to `job`.
    pub(super) fn lend<T>(&self, job: impl FnOnce(&mut BandMemory<S, M>) -> T) -> T {
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

    fn create(&self) -> BandMemory<S, M> {
        let (width, colours) = (self.job.size.width(), self.job.colours);
        BandMemory {
            conversion: M::default(),
            codes: vec![S::default(); STRIP * width * colours],
            row: RowMemory::new(self.line, self.job.area.size.width()),
            sums: vec![0; self.cells * colours],
        }
    }

    /// Moves the sums of all threads into `total`.
    pub(super) fn take_sums(&self, total: &mut [u64]) {
        total.fill(0);
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        for memory in free.iter_mut() {
            for (total, sum) in total.iter_mut().zip(&mut memory.sums) {
                *total += std::mem::take(sum);
            }
        }
    }
}
