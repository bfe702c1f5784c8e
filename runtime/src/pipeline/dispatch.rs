//! Dispatch by channels: frames as a device has them, bytes with the channels of a pixel side
//! by side.

use super::full::FullPipeline;
use super::grid::GridPipeline;
use super::sample::Encoding;
use super::stages::Workspace;
use super::{FrameError, FullMemory};
use crate::FrameSize;
use crate::features::Stage;
use crate::image::Table;
use crate::placement::PixelArea;
use crate::units::ClippedSamples;

/// Compensates a frame of one pixel a cell at a tier; returns how many samples were
/// clipped.
///
/// # Errors
/// As [`GridPipeline::compensate`].
pub fn compensate_cells(
    table: &Table<'_>,
    tier: u8,
    encoding: Encoding,
    wanted: &[u8],
    input: &mut [u8],
    workspace: &mut Workspace<'_>,
) -> Result<ClippedSamples, FrameError> {
    match table.channels() {
        1 => cells::<1>(table, tier, encoding, wanted, input, workspace),
        _ => cells::<3>(table, tier, encoding, wanted, input, workspace),
    }
}

fn cells<const C: usize>(
    table: &Table<'_>,
    tier: u8,
    encoding: Encoding,
    wanted: &[u8],
    input: &mut [u8],
    workspace: &mut Workspace<'_>,
) -> Result<ClippedSamples, FrameError> {
    let (wanted, input) = (wanted.as_chunks().0, input.as_chunks_mut().0);
    GridPipeline::<C>::new(table)?.compensate(tier, encoding, wanted, input, workspace)
}

/// What is done to a frame larger than the grid.
#[derive(Clone, Copy, Debug)]
pub struct FrameJob<'t, 'a> {
    /// The table that it goes through.
    pub table: &'t Table<'a>,
    /// Its size.
    pub size: FrameSize,
    /// Where in it the cells lie.
    pub area: PixelArea,
    /// The tier that it goes through.
    pub tier: u8,
    /// What its codes mean.
    pub encoding: Encoding,
}

/// Prepares one row of the memory for frames larger than the grid whose cells lie in an area
/// of this size; all its rows are to be, before a frame is compensated.
///
/// # Errors
/// [`FrameError`] if the area is smaller than the grid, or this build takes none larger.
/// Slices that are too short are filled as far as they go.
pub fn prepare_pixels(
    table: &Table<'_>,
    area: FrameSize,
    row: usize,
    memory: &mut FullMemory<'_>,
) -> Result<(), FrameError> {
    if !Stage::FullResolution.is_built() {
        return Err(FrameError::NotBuilt(Stage::FullResolution));
    }
    let pipeline = FullPipeline::<1>::of_any(table, area)?;
    pipeline.prepare_row_of(table.channels().into(), row, memory);
    Ok(())
}

/// Compensates a frame larger than the grid with memory that was
/// [prepared](prepare_pixels) for table and area; returns how many samples were clipped.
///
/// # Errors
/// As [`FullPipeline::within`] and [`FullPipeline::compensate`].
pub fn compensate_pixels(
    job: &FrameJob<'_, '_>,
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut FullMemory<'_>,
    workspace: &mut Workspace<'_>,
) -> Result<ClippedSamples, FrameError> {
    match job.table.channels() {
        1 => pixels::<1>(job, wanted, input, memory, workspace),
        _ => pixels::<3>(job, wanted, input, memory, workspace),
    }
}

fn pixels<const C: usize>(
    job: &FrameJob<'_, '_>,
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut FullMemory<'_>,
    workspace: &mut Workspace<'_>,
) -> Result<ClippedSamples, FrameError> {
    let pipeline = FullPipeline::<C>::within(job.table, job.size, job.area)?;
    let (wanted, input) = (wanted.as_chunks().0, input.as_chunks_mut().0);
    pipeline.compensate(job.tier, job.encoding, wanted, input, memory, workspace)
}
