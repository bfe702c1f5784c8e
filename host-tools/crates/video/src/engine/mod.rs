//! Engine of the compensation: frames of one size and layout through one table.
//!
//! A frame larger than the grid passes twice, in bands of rows spread over the
//! threads ([`rows`]): once to become light and to be averaged over the cells,
//! once to become drives and codes. In between the operator works on the grid,
//! which takes little time beside that. The light is kept from the one to the
//! other, and the gains of the pixels from frame to frame. A frame of one pixel a
//! cell goes through [`cells`]. With `--gpu` the larger ones go through a compute shader
//! instead ([`gpu`]).
//!
//! Averages are sums of integers, so that it does not matter which thread adds
//! which row, or how many there are.

mod cells;
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
mod gpu;
mod memory;
mod rows;

use super::VideoError;
use super::bands::Bands;
pub use memory::OperatorMemory;

use cells::Cells;
pub(super) use gpu::Gpu;
#[cfg(feature = "gpu")]
use gpu::GpuFrames;
use iltm_runtime::{
    FrameSize,
    image::Table,
    pipeline::{Encoding, FrameError, FullPipeline},
    placement::PixelArea,
    units::ClippedSamples,
};
use rayon::ThreadPool;
use rows::FullFrames;
use std::sync::Arc;

/// Compensates frames of type `P` with a table of `C` channels.
pub(super) struct Engine<'t, 'a, P: Bands, const C: usize> {
    job: EngineJob,
    operator: OperatorMemory,
    path: EnginePath<'t, 'a, P, C>,
}

/// What frames there will be and what is to be done to them.
#[derive(Clone, Copy, Debug)]
pub(super) struct EngineJob {
    pub(super) size: FrameSize,
    /// Where in a frame the cells lie; what is outside becomes black.
    pub(super) area: PixelArea,
    /// Where on the cells the picture lies, columns and rows, each from and up to; around it are
    /// bars, in which nothing counts as clipped.
    pub(super) picture: [[usize; 2]; 2],
    /// Colours of a pixel: as many as the table has channels, or three for a table
    /// of one, which is then used for each of them.
    pub(super) colours: usize,
    pub(super) tier: u8,
    pub(super) encoding: Encoding,
}

impl EngineJob {
    /// Samples of a frame.
    pub(super) const fn samples(&self) -> usize {
        self.size.pixels() * self.colours
    }

    /// Those that can count as clipped.
    pub(super) fn counted(&self) -> u64 {
        let [columns, rows] = self.picture.map(|[from, to]| to - from);
        (columns * rows * self.colours) as u64
    }
}

enum EnginePath<'t, 'a, P: Bands, const C: usize> {
    /// One pixel a cell.
    Cells(Cells<'t, 'a, P::Code, C>),
    /// More.
    Full(Box<FullFrames<'t, 'a, P, C>>),
    /// More, on a graphics processor.
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuFrames<'t, 'a, P, C>>),
}

impl<'t, 'a, P: Bands, const C: usize> Engine<'t, 'a, P, C> {
    /// Sizes everything for the frames to come and expands the gains.
    ///
    /// # Errors
    /// [`VideoError::Runtime`] if the frame is smaller than the grid, or the table has not
    /// `C` channels; [`VideoError::Gpu`] if the graphics processor has no room for it.
    pub(super) fn new(
        table: &'t Table<'a>,
        threads: &'t ThreadPool,
        gpu: Option<&Arc<Gpu>>,
        job: EngineJob,
    ) -> Result<Self, VideoError> {
        let path = if job.size == FrameSize::of_grid(table.grid()) {
            EnginePath::Cells(Cells::new(table, &job).map_err(VideoError::Runtime)?)
        } else {
            match gpu {
                #[cfg(feature = "gpu")]
                Some(gpu) => EnginePath::Gpu(Box::new(GpuFrames::new(table, gpu, threads, &job)?)),
                #[cfg(not(feature = "gpu"))]
                Some(gpu) => match **gpu {},
                None => {
                    let full = FullFrames::new(table, threads, &job);
                    EnginePath::Full(Box::new(full.map_err(VideoError::Runtime)?))
                }
            }
        };
        Ok(Self {
            job,
            operator: OperatorMemory::new(table),
            path,
        })
    }

    /// The same as [`compensate`](Self::compensate) at another tier, from now on.
    pub(super) fn compensate_at(
        &mut self,
        tier: u8,
        frame: &mut P,
    ) -> Result<ClippedSamples, VideoError> {
        self.job.tier = tier;
        self.compensate(frame)
    }

    /// Compensates a frame in place; returns how many samples were clipped.
    pub(super) fn compensate(&mut self, frame: &mut P) -> Result<ClippedSamples, VideoError> {
        let clipped = match &mut self.path {
            EnginePath::Cells(cells) => cells.compensate(&self.job, &mut self.operator, frame),
            EnginePath::Full(full) => full.compensate(&self.job, &mut self.operator, frame),
            #[cfg(feature = "gpu")]
            EnginePath::Gpu(gpu) => return gpu.compensate(&self.job, &mut self.operator, frame),
        };
        clipped.map_err(VideoError::Runtime)
    }
}

/// Turns the sums of a frame into the corrections of its cells, both colour by colour.
fn correct<const C: usize>(
    pipeline: &FullPipeline<'_, '_, C>,
    tier: u8,
    sums: &[u64],
    corrections: &mut [i32],
    operator: &mut OperatorMemory,
) -> Result<(), FrameError> {
    let group = C * pipeline.table().grid().cells();
    let groups = sums.chunks_exact(group);
    for (sums, corrections) in groups.zip(corrections.chunks_exact_mut(group)) {
        pipeline.correct(tier, sums, corrections, &mut operator.workspace())?;
    }
    Ok(())
}
