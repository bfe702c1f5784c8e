//! Workspace of a frame: the one large piece of memory, taken once.

use core::mem::offset_of;
use iltm_runtime::features::Stage;
use iltm_runtime::haar::Basis;
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::{
    FrameError, FrameJob, FullMemory, RowBuffers, Workspace, compensate_pixels, prepare_pixels,
};
use iltm_runtime::units::{ClippedSamples, Halfword, InputCoefficient};
use iltm_runtime::{FrameSize, Grid};
use static_cell::ConstStaticCell;

/// Most cells of a table's grid. A board with less memory may take fewer; tables
/// with more are refused with the reason.
pub const MAX_CELLS: usize = Grid::MAX_CELLS;

/// Most pixels of a frame larger than the grid.
pub const MAX_PIXELS: usize = 320 * 240;

/// Most pixels in a row of such a frame: those of full HD.
pub const MAX_WIDTH: usize = 1_920;

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
///
/// The order of the fields matters: see `STRAY`.
#[repr(C)]
pub struct Memory {
    inputs: [InputCoefficient; CHANNELS * MAX_CELLS],
    coefficients: [i32; CHANNELS * MAX_CELLS],
    corrections: [i32; CHANNELS * MAX_CELLS],
    sums: [u64; CHANNELS * MAX_CELLS],
    buffers: [[i32; MAX_CELLS / 2 + 1]; 2],
    cells: [i32; MAX_CELLS],
    columns: [u32; 2 * CHANNELS * MAX_WIDTH],
    line: [i32; MAX_WIDTH],
    spread: [i32; MAX_WIDTH],
    values: [u16; MAX_WIDTH],
    /// Of the neighbours' cells.
    neighbours: Option<Basis>,
    /// Of the table in use, and of the one that comes next.
    pixels: [PixelMaps; 2],
}

/// Gains and ambient light of all pixels of frames larger than the grid.
struct PixelMaps {
    gains: [Halfword; CHANNELS * PIXELS],
    ambient: [Halfword; CHANNELS * PIXELS],
    /// The table and the size of the area of cells that they are for.
    of: Option<(u32, FrameSize)>,
    /// Rows that are done.
    rows: usize,
}

impl PixelMaps {
    fn is_ready(&self, table: &Table<'_>, area: FrameSize) -> bool {
        self.of == Some((table.id(), area)) && self.rows == area.height()
    }
}

/// Bytes behind the start of a channel's coefficients that the operator's assembler loops
/// can write, whatever the table says: a row's index has sixteen bits. The check of a table
/// keeps them in their place, but flash may rot after it.
const STRAY: usize = (u16::MAX as usize + 1) * size_of::<i32>();

const _: () = assert!(
    offset_of!(Memory, coefficients) + (CHANNELS - 1) * MAX_CELLS * size_of::<i32>() + STRAY
        <= offset_of!(Memory, pixels),
    "what a rotten table makes of a frame stays in the workspace"
);

/// Its name is how the tests find its size.
#[unsafe(no_mangle)]
static FRAME_WORKSPACE: ConstStaticCell<Memory> = ConstStaticCell::new(Memory {
    inputs: [0; CHANNELS * MAX_CELLS],
    coefficients: [0; CHANNELS * MAX_CELLS],
    corrections: [0; CHANNELS * MAX_CELLS],
    sums: [0; CHANNELS * MAX_CELLS],
    buffers: [[0; MAX_CELLS / 2 + 1]; 2],
    cells: [0; MAX_CELLS],
    columns: [0; 2 * CHANNELS * MAX_WIDTH],
    line: [0; MAX_WIDTH],
    spread: [0; MAX_WIDTH],
    values: [0; MAX_WIDTH],
    neighbours: None,
    pixels: [
        PixelMaps {
            gains: [[0; 2]; CHANNELS * PIXELS],
            ambient: [[0; 2]; CHANNELS * PIXELS],
            of: None,
            rows: 0,
        },
        PixelMaps {
            gains: [[0; 2]; CHANNELS * PIXELS],
            ambient: [[0; 2]; CHANNELS * PIXELS],
            of: None,
            rows: 0,
        },
    ],
});

impl Memory {
    /// The workspace, once.
    #[must_use]
    pub fn take() -> Option<&'static mut Self> {
        FRAME_WORKSPACE.try_take()
    }

    /// What the operator needs, and the neighbours' light that came.
    pub fn workspace<'m>(&'m mut self, heard: Option<&'m [Halfword]>) -> Workspace<'m> {
        let [first, second] = &mut self.buffers;
        Workspace {
            buffers: [first, second],
            cells: &mut self.cells,
            inputs: &mut self.inputs,
            sums: &mut self.coefficients,
            heard,
            neighbours: &mut self.neighbours,
        }
    }

    /// Whether gains and ambient light are those of this table and an area of this size.
    #[must_use]
    pub fn is_ready(&self, table: &Table<'_>, area: FrameSize) -> bool {
        self.pixels.iter().any(|maps| maps.is_ready(table, area))
    }

    /// Computes the next row of the gains and ambient light for this table and an area of
    /// this size; those `in_use`, of that table and area, stay.
    ///
    /// # Errors
    /// As [`prepare_pixels`].
    pub fn prepare(
        &mut self,
        table: &Table<'_>,
        area: FrameSize,
        in_use: Option<(u32, FrameSize)>,
    ) -> Result<(), FrameError> {
        let wanted = Some((table.id(), area));
        let [first, second] = &self.pixels;
        let is_used = first.of.is_some() && first.of == in_use;
        let at = usize::from(second.of == wanted || first.of != wanted && is_used);
        let Some(maps) = self.pixels.get_mut(at) else {
            return Ok(());
        };
        if maps.of != wanted {
            maps.of = wanted;
            maps.rows = 0;
        }
        let row = maps.rows;
        maps.rows += 1;
        let (channels, cells) = (table.channels().into(), table.grid().cells());
        let (mut frame, _) = self.full(at, channels, cells, area.width());
        prepare_pixels(table, area, row, &mut frame)
    }

    /// Compensates a frame larger than the grid, for which everything
    /// [is ready](Self::is_ready).
    ///
    /// # Errors
    /// As [`compensate_pixels`].
    pub fn compensate(
        &mut self,
        job: &FrameJob<'_, '_>,
        wanted: &[u8],
        heard: Option<&[Halfword]>,
        input: &mut [u8],
    ) -> Result<ClippedSamples, FrameError> {
        let [first, _] = &self.pixels;
        let at = usize::from(!first.is_ready(job.table, job.area.size));
        let (channels, cells) = (job.table.channels().into(), job.table.grid().cells());
        let (mut frame, mut workspace) = self.full(at, channels, cells, job.area.size.width());
        workspace.heard = heard;
        compensate_pixels(job, wanted, input, &mut frame, &mut workspace)
    }

    /// What a frame larger than the grid needs, with the first or the second maps.
    pub fn full(
        &mut self,
        at: usize,
        channels: usize,
        cells: usize,
        width: usize,
    ) -> (FullMemory<'_>, Workspace<'_>) {
        let [first, second] = &mut self.buffers;
        let [maps, other] = &mut self.pixels;
        let maps = if at == 0 { maps } else { other };
        let frame = FullMemory {
            gains: &mut maps.gains,
            ambient: &mut maps.ambient,
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
            heard: None,
            neighbours: &mut self.neighbours,
        };
        (frame, workspace)
    }
}

/// The first `count` elements, or all.
fn leading<T>(all: &mut [T], count: usize) -> &mut [T] {
    let count = count.min(all.len());
    all.split_at_mut(count).0
}
