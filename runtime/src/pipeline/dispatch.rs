//! Frames as a device has them: bytes, channels of a pixel side by side, as many as
//! the table has.

use super::full::FullPipeline;
use super::grid::GridPipeline;
use super::sample::Encoding;
use super::stages::Workspace;
use super::{FrameError, FullMemory};
use crate::FrameSize;
use crate::image::Table;

/// Compensates a frame of one pixel a cell at a tier; returns how many samples were
/// clipped.
///
/// # Errors
/// As [`GridPipeline::compensate`].
pub fn compensate_cells(
    table: &Table<'_>,
    how: (u8, Encoding),
    wanted: &[u8],
    input: &mut [u8],
    workspace: &mut Workspace<'_>,
) -> Result<u32, FrameError> {
    match table.channels() {
        1 => cells::<1>(table, how, wanted, input, workspace),
        _ => cells::<3>(table, how, wanted, input, workspace),
    }
}

fn cells<const C: usize>(
    table: &Table<'_>,
    (tier, encoding): (u8, Encoding),
    wanted: &[u8],
    input: &mut [u8],
    workspace: &mut Workspace<'_>,
) -> Result<u32, FrameError> {
    GridPipeline::<C>::new(table)?.compensate(
        tier,
        encoding,
        wanted.as_chunks().0,
        input.as_chunks_mut().0,
        workspace,
    )
}

/// Compensates a frame larger than the grid at a tier, preparing the memory for table
/// and size first unless it is; returns how many samples were clipped.
///
/// # Errors
/// As [`FullPipeline::new`] and [`FullPipeline::compensate`].
pub fn compensate_pixels(
    (table, size, prepared): (&Table<'_>, FrameSize, bool),
    how: (u8, Encoding),
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut FullMemory<'_>,
    workspace: &mut Workspace<'_>,
) -> Result<u32, FrameError> {
    let what = (table, size, prepared);
    match table.channels() {
        1 => pixels::<1>(what, how, wanted, input, memory, workspace),
        _ => pixels::<3>(what, how, wanted, input, memory, workspace),
    }
}

fn pixels<const C: usize>(
    (table, size, prepared): (&Table<'_>, FrameSize, bool),
    how: (u8, Encoding),
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut FullMemory<'_>,
    workspace: &mut Workspace<'_>,
) -> Result<u32, FrameError> {
    let pipeline = FullPipeline::<C>::new(table, size)?;
    if !prepared {
        pipeline.prepare(memory)?;
    }
    let (wanted, input) = (wanted.as_chunks().0, input.as_chunks_mut().0);
    pipeline.compensate(how, wanted, input, memory, workspace)
}
