//! Workspace of a frame: the one large piece of memory, taken once.

use iltm_runtime::features::Stage;
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::{FullMemory, RowBuffers, Workspace};
use iltm_runtime::units::{Halfword, InputCoefficient};
use iltm_runtime::{FrameSize, Grid};
use static_cell::ConstStaticCell;

/// Most cells of a table's grid. A board with less memory may take fewer; tables
/// with more are refused with the reason.
pub const MAX_CELLS: usize = Grid::MAX_CELLS;

/// Most pixels of a frame larger than the grid.
pub const MAX_PIXELS: usize = 320 * 240;

/// Most pixels in a row of such a frame.
pub const MAX_WIDTH: usize = 2_048;

const CHANNELS: usize = if Stage::Colour.is_built() { 3 } else { 1 };

/// Pixels of larger frames that there is memory for: none where there are no such
/// frames.
const PIXELS: usize = if Stage::FullResolution.is_built() {
    MAX_PIXELS
} else {
    0
};

/// The workspace. Its size counts apart from the rest of the firmware's memory:
/// it follows the largest table and frame that a board is to take.
pub struct Memory {
    buffers: [[i32; MAX_CELLS / 2 + 1]; 2],
    cells: [i32; MAX_CELLS],
    inputs: [InputCoefficient; CHANNELS * MAX_CELLS],
    coefficients: [i32; CHANNELS * MAX_CELLS],
    corrections: [i32; CHANNELS * MAX_CELLS],
    sums: [u64; CHANNELS * MAX_CELLS],
    gains: [Halfword; CHANNELS * PIXELS],
    ambient: [Halfword; CHANNELS * PIXELS],
    columns: [u32; 2 * CHANNELS * MAX_WIDTH],
    line: [i32; MAX_WIDTH],
    spread: [i32; MAX_WIDTH],
    values: [u16; MAX_WIDTH],
    /// The table and the frames whose gains and ambient light are there.
    prepared: Option<(u32, FrameSize)>,
}

/// Its name is how the tests find its size.
#[unsafe(no_mangle)]
static FRAME_WORKSPACE: ConstStaticCell<Memory> = ConstStaticCell::new(Memory {
    buffers: [[0; MAX_CELLS / 2 + 1]; 2],
    cells: [0; MAX_CELLS],
    inputs: [0; CHANNELS * MAX_CELLS],
    coefficients: [0; CHANNELS * MAX_CELLS],
    corrections: [0; CHANNELS * MAX_CELLS],
    sums: [0; CHANNELS * MAX_CELLS],
    gains: [[0; 2]; CHANNELS * PIXELS],
    ambient: [[0; 2]; CHANNELS * PIXELS],
    columns: [0; 2 * CHANNELS * MAX_WIDTH],
    line: [0; MAX_WIDTH],
    spread: [0; MAX_WIDTH],
    values: [0; MAX_WIDTH],
    prepared: None,
});

impl Memory {
    /// The workspace, once.
    #[must_use]
    pub fn take() -> Option<&'static mut Self> {
        FRAME_WORKSPACE.try_take()
    }

    /// What the operator needs.
    pub fn workspace(&mut self) -> Workspace<'_> {
        let [first, second] = &mut self.buffers;
        Workspace {
            buffers: [first, second],
            cells: &mut self.cells,
            inputs: &mut self.inputs,
            sums: &mut self.coefficients,
        }
    }

    /// Whether gains and ambient light are those of this table and size of frames;
    /// from now on they are taken to be.
    pub fn is_prepared(&mut self, table: &Table<'_>, size: FrameSize) -> bool {
        let wanted = Some((table.id(), size));
        core::mem::replace(&mut self.prepared, wanted) == wanted
    }

    /// What a frame larger than the grid needs.
    pub fn full(
        &mut self,
        channels: usize,
        cells: usize,
        width: usize,
    ) -> (FullMemory<'_>, Workspace<'_>) {
        let [first, second] = &mut self.buffers;
        let frame = FullMemory {
            gains: &mut self.gains,
            ambient: &mut self.ambient,
            sums: leading(&mut self.sums, channels * cells),
            corrections: leading(&mut self.corrections, channels * cells),
            columns: &mut self.columns,
            row: RowBuffers {
                line: &mut self.line,
                spread: leading(&mut self.spread, width),
            },
            values: leading(&mut self.values, width),
        };
        let workspace = Workspace {
            buffers: [first, second],
            cells: &mut self.cells,
            inputs: &mut self.inputs,
            sums: &mut self.coefficients,
        };
        (frame, workspace)
    }
}

/// The first `count` elements, or all.
fn leading<T>(all: &mut [T], count: usize) -> &mut [T] {
    let count = count.min(all.len());
    all.split_at_mut(count).0
}
