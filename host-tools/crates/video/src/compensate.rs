//! Compensation of frames with a table: pictures, and video as a stream.
//!
//! | frame | table of one channel | table of three |
//! |---|---|---|
//! | grey | as it is | refused: grey light needs a coloured input, which a grey frame has no room for |
//! | colour | each colour like grey: gain and geometry are common to all | as it is |
//!
//! A frame of one pixel a cell is compensated cell by cell, any larger one at
//! full resolution; a smaller one is refused. The result has the size and the
//! kind of the input; [`PlacedFrames`] says where a frame goes on a projector, and when
//! its size changes.

use super::bands::{Bands, Interleaved};
use super::engine::{Engine, EngineJob, Gpu};
use super::live::Live;
use super::{Fit, Input, PlacedFrames, VideoError};
use iltm_picture::{Picture, Samples, WholeFile, png, progress::Progress};
use iltm_runtime::{FrameSize, image::Table, pipeline::Encoding, units::ClippedSamples};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;

/// How frames are to be compensated.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CompensateOptions {
    /// The tier; by default the table's top one.
    pub tier: Option<u8>,
    /// What the codes of the frames mean.
    pub encoding: Encoding,
    /// Threads that work on the rows, 0 for one a core. A stream has two more,
    /// which read and write. The result is the same for any number.
    pub threads: usize,
    /// What becomes of frames whose aspect is not the projector's; they are refused if
    /// this is unsaid.
    pub fit: Option<Fit>,
    /// Whether frames larger than the grid are worked on by a graphics processor. The result
    /// is the same.
    pub gpu: bool,
}

impl Default for CompensateOptions {
    fn default() -> Self {
        Self {
            tier: None,
            encoding: Encoding::Display,
            threads: 0,
            fit: None,
            gpu: false,
        }
    }
}

/// What has been done.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameTotals {
    /// Size of the frames that came out.
    pub size: FrameSize,
    /// How many frames there were.
    pub frames: u64,
    /// Samples of all frames, without those of bars and borders: three a pixel, or one where they
    /// are grey.
    pub samples: u64,
    /// Samples that the projector would have had to show darker than black or
    /// brighter than white.
    pub clipped: u64,
    /// Those of them that would have had to be brighter than white.
    pub clipped_white: u64,
    /// Whether whoever takes the frames has stopped before the last one.
    pub cut_short: bool,
}

/// Compensates frames with one table.
#[derive(Debug)]
pub struct Compensator<'t, 'a> {
    pub(super) table: &'t Table<'a>,
    settings: CompensateOptions,
    tier: u8,
    threads: Arc<ThreadPool>,
    gpu: Option<Arc<Gpu>>,
}

impl<'t, 'a> Compensator<'t, 'a> {
    /// A compensator for `table`.
    ///
    /// # Errors
    /// [`VideoError::NoSuchTier`], [`VideoError::Threads`] if the threads cannot be
    /// started, [`VideoError::Gpu`] or [`VideoError::WithoutGpu`] if there is no graphics
    /// processor.
    pub fn new(table: &'t Table<'a>, settings: CompensateOptions) -> Result<Self, VideoError> {
        let threads = ThreadPoolBuilder::new().num_threads(settings.threads);
        let threads = threads.build().map_err(|error| VideoError::Threads {
            threads: settings.threads,
            reason: error.to_string(),
        })?;
        let gpu = settings.gpu.then(Gpu::find).transpose()?;
        Self::on(table, settings, Arc::new(threads), gpu.map(Arc::new))
    }

    /// The same on this graphics processor.
    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn with_gpu(&self, gpu: &Arc<Gpu>) -> Result<Self, VideoError> {
        let gpu = Some(Arc::clone(gpu));
        Self::on(self.table, self.settings, Arc::clone(&self.threads), gpu)
    }

    /// The graphics processor that works on frames of this size, by its name; frames of one pixel
    /// a cell are the processor's.
    #[must_use]
    pub fn gpu(&self, frame: FrameSize) -> Option<&str> {
        let gpu = self.gpu.as_ref()?;
        (frame != FrameSize::of_grid(self.table.grid())).then(|| gpu.name())
    }

    /// One for another table, with the same settings, on the same threads.
    pub(super) fn with_table<'u, 'b>(
        &self,
        table: &'u Table<'b>,
    ) -> Result<Compensator<'u, 'b>, VideoError> {
        let gpu = self.gpu.clone();
        Compensator::on(table, self.settings, Arc::clone(&self.threads), gpu)
    }

    fn on(
        table: &'t Table<'a>,
        settings: CompensateOptions,
        threads: Arc<ThreadPool>,
        gpu: Option<Arc<Gpu>>,
    ) -> Result<Self, VideoError> {
        let top = table.top_tier();
        let tier = settings.tier.unwrap_or(top);
        if tier > top {
            return Err(VideoError::NoSuchTier { tier, top });
        }
        Ok(Self {
            table,
            settings,
            tier,
            threads,
            gpu,
        })
    }

    /// Compensates a file into another, PNG or Y4M by the first bytes of the
    /// input. The output is there whole or not at all, and may replace the input.
    ///
    /// # Errors
    /// [`VideoError`] if the input is unusable or a file cannot be read or written.
    pub fn file(
        &self,
        input: &Path,
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<FrameTotals, VideoError> {
        let opened = Input::open(input)?;
        let mut whole = WholeFile::create(output)?;
        let summary = self.input(opened, whole.file(), progress)?;
        whole.finish()?;
        Ok(summary)
    }

    /// Compensates a picture or a stream, PNG or Y4M by its first bytes.
    ///
    /// # Errors
    /// As [`png`](Self::png) and [`y4m`](Self::y4m), and
    /// [`VideoError::UnknownFormat`].
    pub fn stream<R: Read + Send, W: Write + Send>(
        &self,
        input: R,
        output: W,
        progress: &dyn Progress,
    ) -> Result<FrameTotals, VideoError> {
        self.input(Input::of(input)?, output, progress)
    }

    /// Compensates an input that has been told apart.
    ///
    /// # Errors
    /// As [`png`](Self::png) and [`y4m`](Self::y4m).
    pub fn input<R: Read + Send, W: Write + Send>(
        &self,
        input: Input<R>,
        output: W,
        progress: &dyn Progress,
    ) -> Result<FrameTotals, VideoError> {
        match input {
            Input::Png(input) => self.png(input, output),
            Input::Y4m(input) => self.y4m(input, output, progress),
        }
    }

    /// Compensates a PNG picture.
    ///
    /// # Errors
    /// [`VideoError`] if the input is no readable picture, is smaller than the
    /// grid, is grey with a table of three channels, or the output cannot be
    /// written.
    pub fn png(&self, input: impl Read, output: impl Write) -> Result<FrameTotals, VideoError> {
        let (picture, totals) = self.frame(png::read(input)?)?;
        png::write(output, &picture)?;
        Ok(totals)
    }

    /// Compensates a frame for the projector: its cells are where the table has them, and
    /// what is outside becomes black.
    ///
    /// # Errors
    /// [`VideoError`] if it has another aspect than the projector, is smaller than the grid,
    /// or grey with a table of three channels.
    pub fn frame(&self, picture: Picture) -> Result<(Picture, FrameTotals), VideoError> {
        let placed = self.place(picture.size())?;
        let frame = picture.size();
        let grid = self.table.grid();
        let mut picture = placed
            .picture(picture)
            .ok_or(VideoError::SmallerThanGrid { frame, grid })?;
        let totals = self.placed(&placed, &mut picture)?;
        Ok((picture, totals))
    }

    /// Compensates a picture of the cells and nothing around them, in place.
    ///
    /// # Errors
    /// [`VideoError`] if it is smaller than the grid, or grey with a table of three
    /// channels.
    pub fn picture(&self, picture: &mut Picture) -> Result<FrameTotals, VideoError> {
        self.placed(&PlacedFrames::whole(picture.size()), picture)
    }

    /// Compensates a picture that is in its place.
    fn placed(
        &self,
        placed: &PlacedFrames,
        picture: &mut Picture,
    ) -> Result<FrameTotals, VideoError> {
        let (size, channels) = (picture.size(), picture.channels());
        let job = self.job(placed, channels)?;
        let width = size.width();
        let clipped = match picture.samples_mut() {
            Samples::Eight(samples) => self.one(
                job,
                &mut Interleaved {
                    width,
                    channels,
                    samples,
                },
            ),
            Samples::Sixteen(samples) => self.one(
                job,
                &mut Interleaved {
                    width,
                    channels,
                    samples,
                },
            ),
        };
        let clipped = clipped?;
        Ok(FrameTotals {
            size,
            frames: 1,
            samples: job.counted(),
            clipped: clipped.total().into(),
            clipped_white: clipped.white.into(),
            cut_short: false,
        })
    }

    /// Compensates a Y4M stream, frame by frame: memory does not depend on its
    /// length. Reading, computing and writing overlap.
    ///
    /// `progress` advances by one a frame. A reader of the output that ends, such as a player
    /// that is closed, ends the stream: [`FrameTotals::cut_short`].
    ///
    /// # Errors
    /// [`VideoError`] if the stream is malformed, its frames are smaller than the
    /// grid, it is mono and the table has three channels, or the output cannot be
    /// written. Frames before the fault have been written.
    pub fn y4m<R: Read + Send, W: Write + Send>(
        &self,
        input: R,
        output: W,
        progress: &dyn Progress,
    ) -> Result<FrameTotals, VideoError> {
        let unwatched = Live {
            budget: None,
            newer: &mut || None,
            said: &mut |_| (),
        };
        let summary = unwatched.run(self, input, output, progress)?;
        Ok(summary.frames)
    }

    /// What is to be done to frames in this place and of this number of colours, if that is
    /// possible.
    pub(super) fn job(
        &self,
        placed: &PlacedFrames,
        colours: usize,
    ) -> Result<EngineJob, VideoError> {
        if colours < usize::from(self.table.channels()) {
            return Err(VideoError::GreyFrame);
        }
        let area = placed.area();
        if !area.size.holds(self.table.grid()) {
            return Err(VideoError::SmallerThanGrid {
                frame: area.size,
                grid: self.table.grid(),
            });
        }
        Ok(EngineJob {
            size: placed.shown(),
            area,
            picture: placed.on_area(),
            colours,
            tier: self.tier,
            encoding: self.settings.encoding,
        })
    }

    /// Where frames of this size go.
    pub(super) fn place(&self, size: FrameSize) -> Result<PlacedFrames, VideoError> {
        PlacedFrames::new(self.table, size, self.settings.fit)
    }

    /// A single frame in place; how many samples were clipped.
    fn one<P: Bands>(&self, job: EngineJob, frame: &mut P) -> Result<ClippedSamples, VideoError> {
        match self.table.channels() {
            1 => self.engine::<P, 1>(job)?.compensate(frame),
            _ => self.engine::<P, 3>(job)?.compensate(frame),
        }
    }

    pub(super) fn engine<P: Bands, const C: usize>(
        &self,
        job: EngineJob,
    ) -> Result<Engine<'_, 'a, P, C>, VideoError> {
        Engine::new(self.table, &self.threads, self.gpu.as_ref(), job)
    }
}
