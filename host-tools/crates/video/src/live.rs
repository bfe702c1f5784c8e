//! Live streams: the table may be replaced while a stream runs, and the tier follows a
//! budget of time. A stream without either takes the same way.
//!
//! Between two frames, and nowhere else, a newer table takes over and the runtime's
//! [`Governor`] may choose another tier, as on the device. A newer table that cannot be
//! used changes nothing.

use super::planar::{Planar, PlaneLayout};
use super::stream::{self, FrameQueue};
use super::y4m::{Header, Reader};
use super::yuv::PlaneCode;
use super::{Compensator, FrameTotals, Input, PlacedFrames, VideoError};
use iltm_picture::progress::Progress;
use iltm_runtime::{
    governor::{Governor, Reason, TierChange},
    image::{ImageError, Table, unseal},
    units::ClippedSamples,
};
use std::io::{Read, Write};
use std::time::{Duration, Instant};

/// What happens between two frames.
#[derive(Debug)]
pub enum LiveEvent {
    /// The governor chose another tier.
    Tier {
        /// Frames before it.
        frame: u64,
        /// From which to which, and why; times in microseconds.
        change: TierChange,
    },
    /// A newer table took over.
    Table {
        /// Frames before it.
        frame: u64,
        /// Its [`Table::id`].
        id: u32,
    },
    /// A newer table cannot be used, and the old one stays.
    Refused {
        /// Frames before that.
        frame: u64,
        /// Why.
        why: NewTableError,
    },
}

/// Why a newer table was not taken.
#[derive(Debug, thiserror::Error)]
pub enum NewTableError {
    /// Its bytes are no table.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// It does not suit the stream or the settings.
    #[error(transparent)]
    Video(#[from] VideoError),
}

/// What may change while a stream runs.
pub struct Live<'l> {
    /// What computing a frame may take; with a budget the tier is the governor's.
    pub budget: Option<Duration>,
    /// Asked before every frame: the bytes of a table's file that is to be used from now
    /// on.
    pub newer: &'l mut dyn FnMut() -> Option<Vec<u8>>,
    /// Told what happens.
    pub said: &'l mut dyn FnMut(&LiveEvent),
}

/// What has been done live.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LiveSummary {
    /// Frames, samples, clipped samples.
    pub frames: FrameTotals,
    /// Frames at each tier, from 0.
    pub tiers: Vec<u64>,
    /// Frames that took longer than the budget to compute.
    pub overruns: u64,
    /// Longest time that computing a frame took.
    pub slowest: Duration,
    /// Tables that took over while the stream ran.
    pub tables: u64,
    /// Newer tables that could not be used.
    pub refused: u64,
}

impl Compensator<'_, '_> {
    /// Compensates a Y4M stream as [`y4m`](Self::y4m) does, but begins with this table
    /// only, and with this tier only without a budget.
    ///
    /// # Errors
    /// Those of [`y4m`](Self::y4m), and [`VideoError::Still`] for a picture.
    pub fn live<R: Read + Send, W: Write + Send>(
        &self,
        live: Live<'_>,
        input: Input<R>,
        output: W,
        progress: &dyn Progress,
    ) -> Result<LiveSummary, VideoError> {
        match input {
            Input::Png(_) => Err(VideoError::Still),
            Input::Y4m(input) => live.run(self, input, output, progress),
        }
    }
}

impl Live<'_> {
    /// The way of every Y4M stream, whether anything may change or not.
    pub(super) fn run<R: Read + Send, W: Write + Send>(
        self,
        first: &Compensator<'_, '_>,
        input: R,
        output: W,
        progress: &dyn Progress,
    ) -> Result<LiveSummary, VideoError> {
        let reader = Reader::new(input)?;
        let given = reader.header().clone();
        let placed = first.place(given.size())?;
        let shown = given.resized(placed.shown());
        first.job(&placed, shown.colours())?;
        let mut run = Run {
            live: self,
            given,
            shown: shown.clone(),
            placed,
            progress,
            done: LiveSummary {
                frames: FrameTotals {
                    size: placed.shown(),
                    frames: 0,
                    samples: 0,
                    clipped: 0,
                    clipped_white: 0,
                    cut_short: false,
                },
                tiers: Vec::new(),
                overruns: 0,
                slowest: Duration::ZERO,
                tables: 0,
                refused: 0,
            },
        };
        progress.begin("compensate", 0);
        let result = stream::run(reader, shown, output, |frames| {
            let mut newer = run.frames(first, frames)?;
            while let Some(content) = newer {
                let table = Table::check(&content).map_err(VideoError::Table)?;
                newer = run.frames(&first.with_table(&table)?, frames)?;
            }
            Ok(())
        });
        progress.end();
        run.done.frames.cut_short = !result?;
        if run.done.frames.frames == 0 && !run.done.frames.cut_short {
            return Err(VideoError::NoFrames);
        }
        Ok(run.done)
    }
}

/// A stream under way.
struct Run<'r, 'l> {
    live: Live<'l>,
    given: Header,
    shown: Header,
    placed: PlacedFrames,
    progress: &'r dyn Progress,
    done: LiveSummary,
}

impl Run<'_, '_> {
    /// Frames through one table, until there are no more or until a newer table, which is
    /// returned, takes over.
    fn frames(
        &mut self,
        compensator: &Compensator<'_, '_>,
        frames: &mut FrameQueue,
    ) -> Result<Option<Vec<u8>>, VideoError> {
        match (compensator.table.channels(), self.shown.bits()) {
            (1, 8) => self.frames_of::<u8, 1>(compensator, frames),
            (1, _) => self.frames_of::<u16, 1>(compensator, frames),
            (_, 8) => self.frames_of::<u8, 3>(compensator, frames),
            (..) => self.frames_of::<u16, 3>(compensator, frames),
        }
    }

    /// The same for frames of such samples and a table of `C` channels.
    fn frames_of<S: PlaneCode, const C: usize>(
        &mut self,
        compensator: &Compensator<'_, '_>,
        frames: &mut FrameQueue,
    ) -> Result<Option<Vec<u8>>, VideoError> {
        let layout = PlaneLayout::<S>::new(&self.shown);
        let placed = compensator.place(self.given.size())?;
        let job = compensator.job(&placed, self.shown.colours())?;
        let mut engine = compensator.engine::<Planar<S>, C>(job)?;
        let budget = self.live.budget.map(microseconds);
        let mut governor =
            budget.map(|budget| Governor::for_table(compensator.table, job.samples(), budget));
        // Waits for a frame first, so that a table is asked for as late as can be.
        while frames.wait() {
            if let Some(newer) = self.newer(compensator) {
                return Ok(Some(newer));
            }
            let tier = governor.as_ref().map_or(job.tier, Governor::tier);
            let start = Instant::now();
            let worked = frames.work(|frame| {
                let given = std::mem::take(frame);
                let placed = self.placed.frame(&self.given, &self.shown, given);
                let mut planar = Planar::new(layout, placed);
                let clipped = engine.compensate_at(tier, &mut planar);
                *frame = planar.frame();
                clipped
            });
            let took = start.elapsed();
            let Some(clipped) = worked? else {
                break;
            };
            self.done.add(tier, took, job.counted(), clipped);
            self.progress.advance(1);
            if let Some(governor) = &mut governor {
                let overruns = governor.overruns();
                if let Some(change) = governor.frame(microseconds(took)) {
                    let frame = self.done.frames.frames;
                    (self.live.said)(&LiveEvent::Tier { frame, change });
                }
                self.done.overruns += u64::from(governor.overruns() - overruns);
            }
        }
        Ok(None)
    }

    /// A newer table that can be used.
    fn newer(&mut self, compensator: &Compensator<'_, '_>) -> Option<Vec<u8>> {
        let bytes = (self.live.newer)()?;
        let frame = self.done.frames.frames;
        match self.checked(&bytes, compensator) {
            Ok((content, id)) => {
                self.done.tables += 1;
                (self.live.said)(&LiveEvent::Table { frame, id });
                Some(content)
            }
            Err(why) => {
                self.done.refused += 1;
                (self.live.said)(&LiveEvent::Refused { frame, why });
                None
            }
        }
    }

    fn checked(
        &self,
        bytes: &[u8],
        compensator: &Compensator<'_, '_>,
    ) -> Result<(Vec<u8>, u32), NewTableError> {
        let content = unseal(bytes)?.0;
        let table = Table::check(content)?;
        let newer = compensator.with_table(&table)?;
        let placed = newer.place(self.given.size())?;
        if !placed.moves_like(&self.placed) {
            return Err(VideoError::Elsewhere.into());
        }
        newer.job(&placed, self.shown.colours())?;
        Ok((content.to_vec(), table.id()))
    }
}

impl LiveSummary {
    /// Counts a frame.
    fn add(&mut self, tier: u8, took: Duration, samples: u64, clipped: ClippedSamples) {
        self.frames.frames += 1;
        self.frames.samples += samples;
        self.frames.clipped += u64::from(clipped.total());
        self.frames.clipped_white += u64::from(clipped.white);
        self.slowest = self.slowest.max(took);
        let tier = usize::from(tier);
        self.tiers.resize(self.tiers.len().max(tier + 1), 0);
        self.tiers[tier] += 1;
    }
}

/// Ticks of the governor.
fn microseconds(time: Duration) -> u32 {
    time.as_micros().try_into().unwrap_or(u32::MAX)
}

/// Why a tier changed, in words.
#[must_use]
pub fn words(reason: Reason) -> String {
    let milliseconds = |time: u32| f64::from(time) / 1e3;
    match reason {
        Reason::OverBudget { took } => format!("a frame took {:.1} ms", milliseconds(took)),
        Reason::TimeToSpare { expected } => {
            format!("there is time: {:.1} ms expected", milliseconds(expected))
        }
    }
}
