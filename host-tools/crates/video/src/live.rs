//! A stream whose table may be replaced while it runs, and whose tier follows a budget of
//! time.
//!
//! Between two frames, and nowhere else, a newer table takes over and the runtime's
//! [`Governor`] may choose another tier, as on the device. A newer table that cannot be
//! used changes nothing.

use super::engine::{Engine, Work};
use super::planar::{Layout, Planar};
use super::stream::{self, Frames};
use super::y4m::Reader;
use super::{Compensator, Settings, Summary, VideoError};
use iltm_picture::progress::Progress;
use iltm_runtime::{
    governor::{Governor, Reason, TierChange},
    image::{ImageError, Table, layout::MAX_TIERS, unseal},
};
use rayon::ThreadPool;
use std::io::{Read, Write};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What happens between two frames.
#[derive(Debug)]
pub enum Event {
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
        why: Refusal,
    },
}

/// Why a newer table was not taken.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// Its bytes are no table.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// It does not suit the stream or the settings.
    #[error(transparent)]
    Video(#[from] VideoError),
}

/// How a stream is compensated live.
pub struct Live<'l> {
    /// Tier, encoding and threads; with a budget the tier is the governor's.
    pub settings: Settings,
    /// What computing a frame may take.
    pub budget: Option<Duration>,
    /// Asked before every frame: the bytes of a table's file that is to be used from now
    /// on.
    pub newer: &'l mut dyn FnMut() -> Option<Vec<u8>>,
    /// Told what happens.
    pub said: &'l mut dyn FnMut(&Event),
}

/// What has been done live.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LiveSummary {
    /// Frames, samples, clipped samples.
    pub frames: Summary,
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

/// How a table's turn ended.
enum Turn {
    /// There are no more frames.
    End,
    /// A newer table, checked, takes over.
    Newer(Vec<u8>),
}

impl Live<'_> {
    /// Compensates a Y4M stream, beginning with the table in the file's bytes `image`.
    ///
    /// `progress` advances by one a frame.
    ///
    /// # Errors
    /// Those of [`Compensator::y4m`]; [`VideoError::Table`] if `image` is no table.
    pub fn y4m<R: Read + Send, W: Write + Send>(
        mut self,
        image: &[u8],
        input: R,
        output: W,
        progress: &dyn Progress,
    ) -> Result<LiveSummary, VideoError> {
        let reader = Reader::new(input)?;
        let layout = Layout::new(reader.header());
        let size = reader.header().size();
        let threads = Arc::new(super::compensate::threads(self.settings.threads)?);
        let mut content = unseal(image).map_err(VideoError::Table)?.0.to_vec();
        let mut done = Done::new(size, layout.colours());
        progress.begin("compensate", 0);
        let frames = stream::run(reader, output, |frames| {
            loop {
                let turn = self.table(&content, layout, &threads, frames, &mut done, progress)?;
                match turn {
                    Turn::End => return Ok(()),
                    Turn::Newer(newer) => content = newer,
                }
            }
        });
        progress.end();
        done.frames = frames?;
        Ok(done.summary())
    }

    /// Frames with one table, `content`, until it is replaced or there are no more.
    fn table(
        &mut self,
        content: &[u8],
        layout: Layout,
        threads: &Arc<ThreadPool>,
        frames: &mut Frames,
        done: &mut Done,
        progress: &dyn Progress,
    ) -> Result<Turn, VideoError> {
        let table = Table::check(content).map_err(VideoError::Table)?;
        let compensator = Compensator::on(&table, self.settings, Arc::clone(threads))?;
        let work = compensator.work(done.size, done.colours)?;
        match table.channels() {
            1 => self.turn::<1>(&table, work, layout, threads, frames, done, progress),
            _ => self.turn::<3>(&table, work, layout, threads, frames, done, progress),
        }
    }

    /// The same for a table of `C` channels.
    #[allow(
        clippy::too_many_arguments,
        reason = "what a stream has in all and what one table has are different things"
    )]
    fn turn<const C: usize>(
        &mut self,
        table: &Table<'_>,
        work: Work,
        layout: Layout,
        threads: &Arc<ThreadPool>,
        frames: &mut Frames,
        done: &mut Done,
        progress: &dyn Progress,
    ) -> Result<Turn, VideoError> {
        let engine = Engine::<Planar, C>::new(table, threads, work);
        let mut engine = engine.map_err(VideoError::Runtime)?;
        let samples = work.size.pixels() * work.colours;
        let budget = self.budget.map(microseconds);
        let mut governor = budget.map(|budget| Governor::for_table(table, samples, budget));
        // Waits for a frame first, so that a table is asked for as late as can be.
        while frames.wait() {
            if let Some(newer) = self.newer(work, threads, done) {
                return Ok(Turn::Newer(newer));
            }
            let tier = governor.as_ref().map_or(work.tier, Governor::tier);
            let start = Instant::now();
            let worked = frames.work(|frame| {
                let mut planar = Planar {
                    layout,
                    frame: std::mem::take(frame),
                };
                let clipped = engine.compensate_at(tier, &mut planar);
                *frame = planar.frame;
                clipped
            });
            let took = start.elapsed();
            let Some(clipped) = worked? else {
                return Ok(Turn::End);
            };
            done.frame(tier, took, clipped);
            progress.advance(1);
            if let Some(governor) = &mut governor {
                let overruns = governor.overruns();
                if let Some(change) = governor.frame(microseconds(took)) {
                    let frame = done.frames;
                    (self.said)(&Event::Tier { frame, change });
                }
                done.overruns += u64::from(governor.overruns() - overruns);
            }
        }
        Ok(Turn::End)
    }

    /// A newer table that can be used.
    fn newer(&mut self, work: Work, threads: &Arc<ThreadPool>, done: &mut Done) -> Option<Vec<u8>> {
        let bytes = (self.newer)()?;
        let frame = done.frames;
        match self.checked(&bytes, work, threads) {
            Ok((content, id)) => {
                done.tables += 1;
                (self.said)(&Event::Table { frame, id });
                Some(content)
            }
            Err(why) => {
                done.refused += 1;
                (self.said)(&Event::Refused { frame, why });
                None
            }
        }
    }

    fn checked(
        &self,
        bytes: &[u8],
        work: Work,
        threads: &Arc<ThreadPool>,
    ) -> Result<(Vec<u8>, u32), Refusal> {
        let content = unseal(bytes)?.0;
        let table = Table::check(content)?;
        let compensator = Compensator::on(&table, self.settings, Arc::clone(threads))?;
        compensator.work(work.size, work.colours)?;
        Ok((content.to_vec(), table.id()))
    }
}

/// What has been done so far.
struct Done {
    size: iltm_runtime::FrameSize,
    colours: usize,
    frames: u64,
    clipped: u64,
    tiers: [u64; MAX_TIERS],
    overruns: u64,
    slowest: Duration,
    tables: u64,
    refused: u64,
}

impl Done {
    const fn new(size: iltm_runtime::FrameSize, colours: usize) -> Self {
        Self {
            size,
            colours,
            frames: 0,
            clipped: 0,
            tiers: [0; MAX_TIERS],
            overruns: 0,
            slowest: Duration::ZERO,
            tables: 0,
            refused: 0,
        }
    }

    fn frame(&mut self, tier: u8, took: Duration, clipped: u64) {
        self.frames += 1;
        self.clipped += clipped;
        self.slowest = self.slowest.max(took);
        if let Some(count) = self.tiers.get_mut(usize::from(tier)) {
            *count += 1;
        }
    }

    fn summary(&self) -> LiveSummary {
        let used = self.tiers.iter().rposition(|count| *count > 0);
        LiveSummary {
            frames: Summary {
                size: self.size,
                frames: self.frames,
                samples: self.frames * (self.size.pixels() * self.colours) as u64,
                clipped: self.clipped,
            },
            tiers: self.tiers[..used.map_or(0, |top| top + 1)].to_vec(),
            overruns: self.overruns,
            slowest: self.slowest,
            tables: self.tables,
            refused: self.refused,
        }
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
