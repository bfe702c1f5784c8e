//! Memory for the operator that is sized once and used for every frame.

use iltm_runtime::{image::Table, pipeline::Workspace, units::InputCoefficient};

/// What the runtime's [`Workspace`] borrows.
#[derive(Clone, Debug)]
pub struct OperatorMemory {
    buffers: [Vec<i32>; 2],
    cells: Vec<i32>,
    inputs: Vec<InputCoefficient>,
    sums: Vec<i32>,
}

impl OperatorMemory {
    /// Enough for `table`.
    #[must_use]
    pub fn new(table: &Table<'_>) -> Self {
        let values = table.grid().cells() * usize::from(table.channels());
        let buffer = || vec![0; table.basis().scratch_len()];
        Self {
            buffers: [buffer(), buffer()],
            cells: vec![0; table.grid().cells()],
            inputs: vec![0; values],
            sums: vec![0; values],
        }
    }

    /// The workspace of one frame.
    pub fn workspace(&mut self) -> Workspace<'_> {
        let [first, second] = &mut self.buffers;
        Workspace {
            buffers: [first, second],
            cells: &mut self.cells,
            inputs: &mut self.inputs,
            sums: &mut self.sums,
        }
    }
}
