//! One frame through a table, or past it.

use crate::memory::{MAX_CELLS, MAX_WIDTH, Memory};
use iltm_runtime::FrameSize;
use iltm_runtime::exchange::Format;
use iltm_runtime::image::Table;
use iltm_runtime::link::PassThrough;
use iltm_runtime::pipeline::{Encoding, FrameError, FullPipeline, GridPipeline, Response, Sample};

/// What is done to the frames of a format.
#[derive(Clone, Copy)]
pub enum Stage<'t> {
    /// They are shown as they are.
    PassThrough(PassThrough),
    /// They have one pixel a cell.
    Grid(&'t Table<'static>, Encoding),
    /// They are larger than the grid.
    Full(&'t Table<'static>, Encoding, FrameSize),
}

impl<'t> Stage<'t> {
    /// What can be done to frames of `format`, and if nothing, why.
    #[must_use]
    pub fn new(table: Result<&'t Table<'static>, PassThrough>, format: Format) -> Self {
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
            return Self::Grid(table, format.encoding());
        }
        if size.width() > MAX_WIDTH {
            return Self::PassThrough(PassThrough::Memory);
        }
        Self::Full(table, format.encoding(), size)
    }

    /// The table that frames go through.
    #[must_use]
    pub const fn table(&self) -> Option<&'t Table<'static>> {
        match self {
            Self::PassThrough(_) => None,
            Self::Grid(table, _) | Self::Full(table, _, _) => Some(table),
        }
    }

    /// Makes the projector's input of a wanted frame; returns how many samples
    /// were clipped.
    ///
    /// # Errors
    /// [`FrameError`], which no frame of the stage's format gives.
    pub fn frame(
        &self,
        tier: u8,
        wanted: &[u8],
        input: &mut [u8],
        memory: &mut Memory,
    ) -> Result<u32, FrameError> {
        match *self {
            Self::PassThrough(_) => {
                for (input, wanted) in input.iter_mut().zip(wanted) {
                    *input = *wanted;
                }
                Ok(0)
            }
            Self::Grid(table, encoding) => match table.channels() {
                1 => grid::<1>(table, tier, encoding, wanted, input, memory),
                _ => grid::<3>(table, tier, encoding, wanted, input, memory),
            },
            Self::Full(table, encoding, size) => match table.channels() {
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
        &mut memory.workspace(table.grid().cells()),
    )
}

/// Rows are read twice, once for the cells' averages and once for the result:
/// keeping the light of a frame would take twice the memory of the frame.
fn full<const C: usize>(
    table: &Table<'static>,
    size: FrameSize,
    (tier, encoding): (u8, Encoding),
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut Memory,
) -> Result<u32, FrameError> {
    let pipeline = FullPipeline::<C>::new(table, size)?;
    let mut memory = memory.full::<C>(table.grid().cells(), size.width());
    let wanted = wanted.as_chunks::<C>().0;
    let input = input.as_chunks_mut::<C>().0;
    memory.sums.fill([0; C]);
    for (y, line) in wanted.chunks_exact(size.width()).enumerate() {
        for channel in 0..C {
            decode(line, channel, encoding, memory.light);
            pipeline.remove_ambient(y, channel, memory.light, &mut memory.row);
            pipeline.average_row(y, channel, memory.light, memory.sums);
        }
    }
    pipeline.correct(tier, memory.sums, &mut memory.workspace)?;
    let mut clipped = 0;
    let lines = wanted.chunks_exact(size.width());
    for (y, (line, out)) in lines.zip(input.chunks_exact_mut(size.width())).enumerate() {
        for channel in 0..C {
            decode(line, channel, encoding, memory.light);
            pipeline.remove_ambient(y, channel, memory.light, &mut memory.row);
            pipeline.gain_row(y, channel, &mut memory.row, memory.gains);
            clipped += pipeline.finish_row(
                y,
                channel,
                (memory.light, memory.gains),
                memory.workspace.values,
                &mut memory.row,
                memory.drives,
            );
            let response = Response::new(table, channel);
            for (pixel, drive) in out.iter_mut().zip(memory.drives.iter()) {
                if let Some(sample) = pixel.get_mut(channel) {
                    *sample = u8::code(*drive, encoding, response);
                }
            }
        }
    }
    Ok(clipped)
}

fn decode<const C: usize>(
    line: &[[u8; C]],
    channel: usize,
    encoding: Encoding,
    light: &mut [iltm_runtime::units::Light],
) {
    for (light, pixel) in light.iter_mut().zip(line) {
        let sample = pixel.get(channel).copied().unwrap_or(0);
        *light = sample.light(encoding);
    }
}
