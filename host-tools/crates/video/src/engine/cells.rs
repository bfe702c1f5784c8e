//! Cell by cell: frames of one pixel a cell.

use super::super::bands::{Band, Bands, STRIP};
use super::super::curves::Code;
use super::{EngineJob, OperatorMemory};
use iltm_runtime::{
    image::Table,
    pipeline::{FrameError, GridPipeline},
    units::ClippedSamples,
};

/// Compensates frames of the grid's own size.
pub(super) struct Cells<'t, 'a, S, const C: usize> {
    pipeline: GridPipeline<'t, 'a, C>,
    /// Codes row by row, in a row colour by colour.
    codes: Vec<S>,
    wanted: Vec<[S; C]>,
    input: Vec<[S; C]>,
}

impl<'t, 'a, S: Code, const C: usize> Cells<'t, 'a, S, C> {
    pub(super) fn new(table: &'t Table<'a>, job: &EngineJob) -> Result<Self, FrameError> {
        let cells = table.grid().cells();
        Ok(Self {
            pipeline: GridPipeline::new(table)?,
            codes: vec![S::default(); cells * job.colours],
            wanted: vec![[S::default(); C]; cells],
            input: vec![[S::default(); C]; cells],
        })
    }

    /// Compensates a frame in place; returns how many samples were clipped.
    pub(super) fn compensate<P: Bands<Code = S>>(
        &mut self,
        job: &EngineJob,
        operator: &mut OperatorMemory,
        frame: &mut P,
    ) -> Result<ClippedSamples, FrameError> {
        let (width, colours) = (job.size.width(), job.colours);
        let strip_len = STRIP * width * colours;
        let rows = job.size.height().next_multiple_of(STRIP);
        let mut memory = P::Memory::default();
        let mut bands = frame.bands(rows);
        for band in &bands {
            for (strip, codes) in self.codes.chunks_mut(strip_len).enumerate() {
                band.unpack(strip, &mut memory, codes);
            }
        }
        let mut clipped = ClippedSamples::default();
        for group in 0..colours / C {
            let place = |cell: usize, channel: usize| {
                let (row, col) = (cell / width, cell % width);
                (row * colours + group * C + channel) * width + col
            };
            for (cell, wanted) in self.wanted.iter_mut().enumerate() {
                *wanted = std::array::from_fn(|channel| self.codes[place(cell, channel)]);
            }
            let workspace = &mut operator.workspace();
            let of_group = self.pipeline.compensate(
                job.tier,
                job.encoding,
                &self.wanted,
                &mut self.input,
                workspace,
            )?;
            clipped += of_group;
            for (cell, input) in self.input.iter().enumerate() {
                for (channel, code) in input.iter().enumerate() {
                    self.codes[place(cell, channel)] = *code;
                }
            }
        }
        for band in &mut bands {
            for (strip, codes) in self.codes.chunks(strip_len).enumerate() {
                band.pack(strip, &mut memory, codes);
            }
        }
        Ok(clipped)
    }
}
