//! Frame path: one frame through a table, or past it.

use crate::memory::{MAX_CELLS, MAX_PIXELS, MAX_WIDTH, Memory};
use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::Table;
use iltm_runtime::link::PassThrough;
use iltm_runtime::pipeline::{Encoding, FrameError, FrameJob, compensate_cells};
use iltm_runtime::placement::PixelArea;
use iltm_runtime::units::{ClippedSamples, Halfword};
use iltm_runtime::{FrameSize, features};

/// What is done to the frames of a format.
#[derive(Clone, Copy)]
pub enum FramePath {
    /// They are shown as they are.
    PassThrough(PassThrough),
    /// They have one pixel a cell.
    Grid(Encoding),
    /// They are larger than the grid, and cells cover this area of them.
    Full(Encoding, FrameSize, PixelArea),
}

impl FramePath {
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
        if table.inputs() > MAX_CELLS {
            return Self::PassThrough(PassThrough::Memory);
        }
        if size == FrameSize::of_grid(table.grid()) {
            return Self::Grid(format.encoding());
        }
        if !features::Stage::FullResolution.is_built() {
            return Self::PassThrough(PassThrough::OtherFrames);
        }
        let Some(area) = table.area(size) else {
            return Self::PassThrough(PassThrough::OtherFrames);
        };
        if size.width() > MAX_WIDTH || size.pixels() > MAX_PIXELS {
            return Self::PassThrough(PassThrough::Memory);
        }
        Self::Full(format.encoding(), size, area)
    }

    /// Size of the area that cells cover, in frames larger than the grid.
    #[must_use]
    pub const fn area(&self) -> Option<FrameSize> {
        match self {
            Self::Full(_, _, area) => Some(area.size),
            Self::PassThrough(_) | Self::Grid(_) => None,
        }
    }

    /// Makes the projector's input of a wanted frame, and of the neighbours' light that came with it, with the table that the stage
    /// was made for; returns how many samples were clipped.
    ///
    /// # Errors
    /// [`FrameError`], which no frame of the stage's format gives.
    pub fn frame(
        &self,
        table: Option<&Table<'static>>,
        tier: u8,
        wanted: &[u8],
        heard: Option<&[Halfword]>,
        input: &mut [u8],
        memory: &mut Memory,
    ) -> Result<ClippedSamples, FrameError> {
        match (*self, table) {
            (Self::PassThrough(_), _) | (_, None) => {
                for (input, wanted) in input.iter_mut().zip(wanted) {
                    *input = *wanted;
                }
                Ok(ClippedSamples::default())
            }
            (Self::Grid(encoding), Some(table)) => {
                let mut workspace = memory.workspace(heard);
                compensate_cells(table, tier, encoding, wanted, input, &mut workspace)
            }
            (Self::Full(encoding, size, area), Some(table)) => {
                let job = FrameJob {
                    table,
                    size,
                    area,
                    tier,
                    encoding,
                };
                memory.compensate(&job, wanted, heard, input)
            }
        }
    }
}
