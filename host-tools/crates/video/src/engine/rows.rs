//! Row by row: frames larger than the grid, in bands of rows.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

use super::super::bands::{Band, Bands, STRIP};
use super::super::curves::{Code, Curves};
use super::memory::{BandMemory, Memories, RowMemory};
use super::{EngineJob, OperatorMemory, correct};
use iltm_runtime::{
    image::Table,
    pipeline::{
        FrameError, FullPipeline, RowBuffers,
        stages::{drive_row, subtract_ambient},
    },
    placement::PixelArea,
    units::{ClippedSamples, Light},
};
use pulp::{Arch, NullaryFnOnce};
use rayon::ThreadPool;
use rayon::prelude::*;

/// Rows that a thread takes at a time: few enough that the threads end together,
/// many enough that taking them costs nothing.
pub(super) const BAND_ROWS: usize = 16;

/// Compensates frames larger than the grid.
pub(super) struct FullFrames<'t, 'a, P: Bands, const C: usize> {
    stages: RowStages<'t, 'a, P::Code, C>,
    threads: &'t ThreadPool,
    arch: Arch,
    memories: Memories<P::Code, P::Memory>,
    /// Light without ambient: row by row, in a row colour by colour.
    light: Vec<Light>,
    /// Of the cells, colour by colour.
    sums: Vec<u64>,
    /// Of the cells, colour by colour.
    corrections: Vec<i32>,
}

/// What is done to every row.
struct RowStages<'t, 'a, S: Code, const C: usize> {
    pipeline: FullPipeline<'t, 'a, C>,
    /// Pixels of a row of a frame.
    width: usize,
    /// Colours of a pixel.
    colours: usize,
    curves: Curves<S>,
    /// Gains of every pixel: row by row, in a row channel by channel.
    gains: Vec<u16>,
    /// Ambient light of every pixel in the same way; nothing in a dark room.
    ambient: Vec<u16>,
    /// Where on the cells the picture lies.
    picture: [[usize; 2]; 2],
}

impl<'t, 'a, P: Bands, const C: usize> FullFrames<'t, 'a, P, C> {
    pub(super) fn new(
        table: &'t Table<'a>,
        threads: &'t ThreadPool,
        job: &EngineJob,
    ) -> Result<Self, FrameError> {
        let pipeline = FullPipeline::within(table, job.size, job.area)?;
        let (cells, pixels) = (table.grid().cells(), job.size.pixels());
        let (gains, ambient) = threads.install(|| expand(&pipeline));
        Ok(Self {
            stages: RowStages {
                pipeline,
                width: job.size.width(),
                colours: job.colours,
                curves: Curves::new(table, job.encoding),
                gains,
                ambient,
                picture: job.picture,
            },
            threads,
            arch: Arch::new(),
            memories: Memories::new(pipeline.line_len(), cells, *job),
            light: vec![Light::ZERO; pixels * job.colours],
            sums: vec![0; cells * job.colours],
            corrections: vec![0; cells * job.colours],
        })
    }

    /// Compensates a frame in place; returns how many samples were clipped.
    pub(super) fn compensate(
        &mut self,
        job: &EngineJob,
        operator: &mut OperatorMemory,
        frame: &mut P,
    ) -> Result<ClippedSamples, FrameError> {
        self.read(frame);
        self.memories.take_sums(&mut self.sums);
        let (pipeline, corrections) = (&self.stages.pipeline, &mut self.corrections);
        correct(pipeline, job.tier, &self.sums, corrections, operator)?;
        Ok(self.write(frame))
    }

    /// Elements of the light, the codes and the drives of a band.
    fn band_len(&self) -> usize {
        BAND_ROWS * self.stages.row_len()
    }

    fn read(&mut self, frame: &mut P) {
        let band_len = self.band_len();
        let (stages, arch, memories) = (&self.stages, self.arch, &self.memories);
        let light = &mut self.light;
        self.threads.install(|| {
            let bands = frame.bands(BAND_ROWS).into_par_iter();
            let bands = bands.zip(light.par_chunks_mut(band_len)).enumerate();
            bands.for_each(|(index, (band, light))| {
                let first_row = BAND_ROWS * index;
                memories.lend(|memory| {
                    arch.dispatch(ReadBand {
                        stages,
                        first_row,
                        band: &band,
                        light,
                        memory,
                    });
                });
            });
        });
    }

    fn write(&self, frame: &mut P) -> ClippedSamples {
        let (stages, arch, memories) = (&self.stages, self.arch, &self.memories);
        let corrections = &self.corrections;
        self.threads.install(|| {
            let bands = frame.bands(BAND_ROWS).into_par_iter();
            let bands = bands
                .zip(self.light.par_chunks(self.band_len()))
                .enumerate();
            let clipped = bands.map(|(index, (mut band, light))| {
                let first_row = BAND_ROWS * index;
                memories.lend(|memory| {
                    arch.dispatch(WriteBand {
                        stages,
                        first_row,
                        light,
                        corrections,
                        band: &mut band,
                        memory,
                    })
                })
            });
            clipped.reduce(ClippedSamples::default, |mut all, of_band| {
                all += of_band;
                all
            })
        })
    }
}

impl<S: Code, const C: usize> RowStages<'_, '_, S, C> {
    /// Samples of a row.
    fn row_len(&self) -> usize {
        self.width * self.colours
    }

    /// The row of cells' pixels that row `y` of a frame is; `None` outside of them.
    #[inline(always)]
    fn row_of_area(&self, y: usize) -> Option<usize> {
        let area = self.pipeline.area();
        y.checked_sub(area.top).filter(|y| *y < area.size.height())
    }

    /// Row `y` of one channel of a value that every pixel has.
    #[inline(always)]
    fn row_of_channel<'v, T>(&self, values: &'v [T], y: usize, channel: usize) -> &'v [T] {
        let width = self.pipeline.frame().width();
        &values[(y * C + channel) * width..][..width]
    }

    /// Cells of the grid.
    fn cells(&self) -> usize {
        self.pipeline.table().grid().cells()
    }
}

/// From the samples of a band to its light, which is added to the sums.
///
/// A struct with a method and not a closure, because only a method can be made to
/// be compiled into its caller, which is what makes it use the processor's widest
/// vectors; so is all that it calls.
struct ReadBand<'w, 't, 'a, B: Band, const C: usize> {
    stages: &'w RowStages<'t, 'a, B::Code, C>,
    first_row: usize,
    band: &'w B,
    light: &'w mut [Light],
    memory: &'w mut BandMemory<B::Code, B::Memory>,
}

impl<B: Band, const C: usize> NullaryFnOnce for ReadBand<'_, '_, '_, B, C> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let (stages, memory) = (self.stages, self.memory);
        let (width, colours) = (stages.width, stages.colours);
        let PixelArea { left, size, .. } = stages.pipeline.area();
        let cells = stages.cells();
        let strips = self.light.chunks_mut(STRIP * stages.row_len());
        for (strip, light) in strips.enumerate() {
            let codes = &mut memory.codes[..light.len()];
            self.band.unpack(strip, &mut memory.conversion, codes);
            let lines = codes.chunks_exact(width).zip(light.chunks_exact_mut(width));
            for (line, (codes, light)) in lines.enumerate() {
                let y = self.first_row + STRIP * strip + line / colours;
                let Some(y) = stages.row_of_area(y) else {
                    continue;
                };
                let codes = &codes[left..][..size.width()];
                let light = &mut light[left..][..size.width()];
                let (colour, channel) = (line % colours, line % colours % C);
                stages.curves.decode(codes, light);
                if !stages.ambient.is_empty() {
                    let ambient = stages.row_of_channel(&stages.ambient, y, channel);
                    for (light, ambient) in light.iter_mut().zip(ambient) {
                        *light = subtract_ambient(*light, Light::from_bits(*ambient));
                    }
                }
                let sums = &mut memory.sums[colour * cells..][..cells];
                stages.pipeline.average_row(y, light, sums);
            }
        }
    }
}

/// From the light of a band to its samples; returns how many were clipped. A
/// struct for the same reason as [`ReadBand`].
struct WriteBand<'w, 't, 'a, B: Band, const C: usize> {
    stages: &'w RowStages<'t, 'a, B::Code, C>,
    first_row: usize,
    light: &'w [Light],
    corrections: &'w [i32],
    band: &'w mut B,
    memory: &'w mut BandMemory<B::Code, B::Memory>,
}

impl<B: Band, const C: usize> NullaryFnOnce for WriteBand<'_, '_, '_, B, C> {
    type Output = ClippedSamples;

    #[inline(always)]
    fn call(self) -> ClippedSamples {
        let (stages, memory) = (self.stages, self.memory);
        let (width, colours) = (stages.width, stages.colours);
        let PixelArea { left, size, .. } = stages.pipeline.area();
        let bordered = size.width() < width;
        let cells = stages.cells();
        let [[from, to], [from_row, to_row]] = stages.picture;
        let columns = from..to;
        let fraction = u32::from(stages.pipeline.table().gain_fraction());
        let strips = self.light.chunks(STRIP * stages.row_len());
        let mut clipped = ClippedSamples::default();
        for (strip, light) in strips.enumerate() {
            let codes = &mut memory.codes[..light.len()];
            let lines = codes.chunks_exact_mut(width).zip(light.chunks_exact(width));
            for (line, (codes, light)) in lines.enumerate() {
                let y = self.first_row + STRIP * strip + line / colours;
                let Some(y) = stages.row_of_area(y) else {
                    codes.fill(B::Code::default());
                    continue;
                };
                if bordered {
                    codes[..left].fill(B::Code::default());
                    codes[left + size.width()..].fill(B::Code::default());
                }
                let codes = &mut codes[left..][..size.width()];
                let light = &light[left..][..size.width()];
                let (colour, channel) = (line % colours, line % colours % C);
                let gain = stages.row_of_channel(&stages.gains, y, channel);
                let (mut row, drives) = memory.row.split();
                let of_row = stages.pipeline.finish_row(
                    y,
                    light,
                    gain,
                    &self.corrections[colour * cells..][..cells],
                    &mut row,
                    drives,
                );
                if !(from_row..to_row).contains(&y) {
                    // A bar.
                } else if columns.len() == size.width() {
                    clipped += of_row;
                } else {
                    let columns = columns.clone();
                    clipped += drive_row(
                        &light[columns.clone()],
                        &gain[columns.clone()],
                        fraction,
                        &row.spread[columns.clone()],
                        &mut drives[columns],
                    );
                }
                stages.curves.encode(channel, drives, codes);
            }
            self.band.pack(strip, &mut memory.conversion, codes);
        }
        clipped
    }
}

/// Gains and ambient light of every pixel: row by row, in a row channel by channel. In a dark room
/// there is no ambient light.
pub(super) fn expand<const C: usize>(pipeline: &FullPipeline<'_, '_, C>) -> (Vec<u16>, Vec<u16>) {
    let mut gains = vec![0; C * pipeline.frame().pixels()];
    each_row(pipeline, &mut gains, |y, channel, row, gains| {
        pipeline.gain_row(y, channel, row, gains);
    });
    let is_lit = pipeline.table().ambient_row(0, 0).is_some();
    let mut ambient = if is_lit { gains.clone() } else { Vec::new() };
    each_row(pipeline, &mut ambient, |y, channel, row, ambient| {
        pipeline.ambient_row(y, channel, row, ambient);
    });
    (gains, ambient)
}

/// Gives every row of every channel to `fill`.
fn each_row<const C: usize>(
    pipeline: &FullPipeline<'_, '_, C>,
    values: &mut [u16],
    fill: impl Fn(usize, usize, &mut RowBuffers<'_>, &mut [u16]) + Sync,
) {
    let (width, line) = (pipeline.frame().width(), pipeline.line_len());
    values.par_chunks_mut(width).enumerate().for_each_init(
        || RowMemory::new(line, width),
        |memory, (index, values)| {
            let (mut row, _) = memory.split();
            fill(index / C, index % C, &mut row, values);
        },
    );
}
