//! One frame through a table, or past it.

use crate::memory::{MAX_CELLS, MAX_PIXELS, MAX_WIDTH, Memory};
use iltm_runtime::FrameSize;
use iltm_runtime::exchange::Format;
use iltm_runtime::image::Table;
use iltm_runtime::link::PassThrough;
use iltm_runtime::pipeline::{Encoding, FrameError, FullPipeline, GridPipeline};

/// What is done to the frames of a format.
#[derive(Clone, Copy)]
pub enum Stage {
    /// They are shown as they are.
    PassThrough(PassThrough),
    /// They have one pixel a cell.
    Grid(Encoding),
    /// They are larger than the grid.
    Full(Encoding, FrameSize),
}

impl Stage {
    /// What can be done to frames of `format` with a table, and if nothing, why.
    #[must_use]
    pub fn new(table: Result<&Table<'_>, PassThrough>, format: Format) -> Self {
        let table = match table {
            Ok(table) => table,
            Err(why) => return Self::PassThrough(why),
        };
        let size = format.size();
        if table.channels() != format.channels() || !size.holds(table.grid()) {
            return Self::PassThrough(PassThrough::OtherFrames);
        }
        if table.grid().cells() > MAX_CELLS {
            return Self::PassThrough(PassThrough::Memory);
        }
        if size == FrameSize::of_grid(table.grid()) {
            return Self::Grid(format.encoding());
        }
        if size.width() > MAX_WIDTH || size.pixels() > MAX_PIXELS {
            return Self::PassThrough(PassThrough::Memory);
        }
        Self::Full(format.encoding(), size)
    }

    /// Makes the projector's input of a wanted frame with the table that the stage
    /// was made for; returns how many samples were clipped.
    ///
    /// # Errors
    /// [`FrameError`], which no frame of the stage's format gives.
    pub fn frame(
        &self,
        table: Option<&Table<'static>>,
        tier: u8,
        wanted: &[u8],
        input: &mut [u8],
        memory: &mut Memory,
    ) -> Result<u32, FrameError> {
        match (*self, table) {
            (Self::PassThrough(_), _) | (_, None) => {
                for (input, wanted) in input.iter_mut().zip(wanted) {
                    *input = *wanted;
                }
                Ok(0)
            }
            (Self::Grid(encoding), Some(table)) => match table.channels() {
                1 => grid::<1>(table, tier, encoding, wanted, input, memory),
                _ => grid::<3>(table, tier, encoding, wanted, input, memory),
            },
            (Self::Full(encoding, size), Some(table)) => match table.channels() {
                1 => full::<1>(table, size, (tier, encoding), wanted, input, memory),
                _ => full::<3>(table, size, (tier, encoding), wanted, input, memory),
            },
        }
    }
}

fn grid<const C: usize>(
    table: &Table<'static>,
    tier: u8,
    encoding: Encoding,
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut Memory,
) -> Result<u32, FrameError> {
    GridPipeline::<C>::new(table)?.compensate(
        tier,
        encoding,
        wanted.as_chunks().0,
        input.as_chunks_mut().0,
        &mut memory.workspace(),
    )
}

fn full<const C: usize>(
    table: &Table<'static>,
    size: FrameSize,
    (tier, encoding): (u8, Encoding),
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut Memory,
) -> Result<u32, FrameError> {
    let pipeline = FullPipeline::<C>::new(table, size)?;
    let prepared = memory.is_prepared(table, size);
    let (mut frame, mut workspace) = memory.full::<C>(table.grid().cells(), size.width());
    if !prepared {
        pipeline.prepare(&mut frame)?;
    }
    pipeline.compensate(
        (tier, encoding),
        wanted.as_chunks().0,
        input.as_chunks_mut().0,
        &mut frame,
        &mut workspace,
    )
}
