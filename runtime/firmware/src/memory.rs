//! The workspace of a frame: the one large piece of memory, taken once.

use iltm_runtime::Grid;
use iltm_runtime::pipeline::{Row, Workspace};
use iltm_runtime::units::{Drive, InputCoefficient, Light};
use static_cell::ConstStaticCell;

/// Most cells of a table's grid. A board with less memory may take fewer; tables
/// with more are refused with the reason.
pub const MAX_CELLS: usize = Grid::MAX_CELLS;

/// Most pixels in a row of a frame larger than the grid.
pub const MAX_WIDTH: usize = 2_048;

const CHANNELS: usize = 3;

/// The workspace. Its size counts apart from the rest of the firmware's memory:
/// it follows the largest table and frame that a board is to take.
pub struct Memory {
    cells: [i32; MAX_CELLS],
    scratch: [i32; MAX_CELLS],
    inputs: [InputCoefficient; CHANNELS * MAX_CELLS],
    values: [i32; CHANNELS * MAX_CELLS],
    sums: [u64; CHANNELS * MAX_CELLS],
    line: [i32; MAX_WIDTH],
    spread: [i32; MAX_WIDTH],
    light: [Light; MAX_WIDTH],
    gains: [u16; MAX_WIDTH],
    drives: [Drive; MAX_WIDTH],
}

/// Its name is how the test of the firmware's size finds it.
#[unsafe(no_mangle)]
static FRAME_WORKSPACE: ConstStaticCell<Memory> = ConstStaticCell::new(Memory {
    cells: [0; MAX_CELLS],
    scratch: [0; MAX_CELLS],
    inputs: [0; CHANNELS * MAX_CELLS],
    values: [0; CHANNELS * MAX_CELLS],
    sums: [0; CHANNELS * MAX_CELLS],
    line: [0; MAX_WIDTH],
    spread: [0; MAX_WIDTH],
    light: [Light::ZERO; MAX_WIDTH],
    gains: [0; MAX_WIDTH],
    drives: [Drive::ZERO; MAX_WIDTH],
});

/// What a frame of `C` channels larger than the grid needs.
pub struct FullMemory<'m, const C: usize> {
    /// For the operator.
    pub workspace: Workspace<'m, C>,
    /// Light by cell.
    pub sums: &'m mut [[u64; C]],
    /// Interpolation along a row.
    pub row: Row<'m>,
    /// A row of one channel.
    pub light: &'m mut [Light],
    /// Its gains.
    pub gains: &'m mut [u16],
    /// Its drives.
    pub drives: &'m mut [Drive],
}

impl Memory {
    /// The workspace, once.
    #[must_use]
    pub fn take() -> Option<&'static mut Self> {
        FRAME_WORKSPACE.try_take()
    }

    /// What the operator needs for `cells` cells and `C` channels.
    pub fn workspace<const C: usize>(&mut self, cells: usize) -> Workspace<'_, C> {
        workspace(
            cells,
            &mut self.cells,
            &mut self.scratch,
            &mut self.inputs,
            &mut self.values,
        )
    }

    /// What a frame larger than the grid needs.
    pub fn full<const C: usize>(&mut self, cells: usize, width: usize) -> FullMemory<'_, C> {
        FullMemory {
            workspace: workspace(
                cells,
                &mut self.cells,
                &mut self.scratch,
                &mut self.inputs,
                &mut self.values,
            ),
            sums: first(self.sums.as_chunks_mut().0, cells),
            row: Row {
                line: &mut self.line,
                spread: first(&mut self.spread, width),
            },
            light: first(&mut self.light, width),
            gains: first(&mut self.gains, width),
            drives: first(&mut self.drives, width),
        }
    }
}

fn workspace<'m, const C: usize>(
    count: usize,
    cells: &'m mut [i32],
    scratch: &'m mut [i32],
    inputs: &'m mut [InputCoefficient],
    values: &'m mut [i32],
) -> Workspace<'m, C> {
    Workspace {
        cells: first(cells, count),
        scratch: first(scratch, count),
        inputs: first(inputs.as_chunks_mut().0, count),
        values: first(values.as_chunks_mut().0, count),
    }
}

/// The first `count` elements, or all.
fn first<T>(all: &mut [T], count: usize) -> &mut [T] {
    let count = count.min(all.len());
    all.split_at_mut(count).0
}
