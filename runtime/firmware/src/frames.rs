//! Frame loop: from the source through the table in use to the display.
//!
//! ```text
//! round: pet watchdog -> follow source -> frame, if one waits
//! frame: claim -> pixels at the governor's tier -> release -> publish if it was whole
//! ```
//!
//! What takes longer than a frame, such as the check of a new table, calls
//! [`Frames::round`] now and then (see [`TableSlots::yield_now`](iltm_runtime::store::TableSlots)),
//! so that no frame waits for it.

use crate::board::{Board, Clock, FrameSink, FrameSource, Peripherals, Watchdog};
use crate::frame_path::FramePath;
use crate::hooks::{FrameHooks, FrameOutcome};
use crate::memory::Memory;
use crate::table_slots::Tables;
use crate::telemetry::Telemetry;
use embedded_hal::digital::OutputPin;
use heapless::Deque;
use iltm_runtime::frame_buffers::{Format, Lateness};
use iltm_runtime::governor::{Governor, Reason, TierChange};
use iltm_runtime::image::{Neighbours, Recheck, Table};
use iltm_runtime::link::{Event, Fault, Mode, PassThrough, TableName, TableReason, TierReason};
use iltm_runtime::store::Slot;

/// Things to tell the host that may wait for a round: more happen only while a
/// table is checked.
const NOTICES: usize = 8;

/// Milliseconds from the end of a recheck of the table in use to the next.
const RECHECK_MS: u64 = 60_000;

/// The board's frame side, and what is done with frames.
pub struct Frames<B: Board, H> {
    pub(crate) clock: B::Clock,
    source: B::Source,
    sink: B::Sink,
    watchdog: B::Watchdog,
    lamp: B::Lamp,
    memory: &'static mut Memory,
    hooks: H,
    pub(crate) tables: &'static mut Tables,
    pub(crate) in_use: Result<Slot, PassThrough>,
    /// The files of the tables, gone over again and again.
    pub(crate) rechecks: [Option<Recheck<'static>>; 2],
    /// When that begins anew.
    recheck_ms: u64,
    pub(crate) telemetry: Telemetry,
    stream: Option<Stream>,
    /// Late frames of earlier streams.
    late: u32,
    notices: Deque<Notice, NOTICES>,
    /// Number of the next frame.
    next: u32,
    /// Whether frames are worked on: not before the tables have been looked at, so
    /// that none is shown that will be compensated a moment later.
    live: bool,
}

/// Frames of one format.
struct Stream {
    format: Format,
    path: FramePath,
    governor: Governor,
    lateness: Lateness,
}

/// Something to tell the host.
#[derive(Clone, Copy)]
enum Notice {
    Tier(TierChange, u32),
    Fault(Fault),
    Table(Option<TableName>, TableReason, u32),
}

impl<B: Board, H: FrameHooks> Frames<B, H> {
    pub(crate) fn new(
        board: FrameSide<B>,
        memory: &'static mut Memory,
        tables: &'static mut Tables,
        hooks: H,
        telemetry: Telemetry,
    ) -> Self {
        Self {
            clock: board.clock,
            source: board.source,
            sink: board.sink,
            watchdog: board.watchdog,
            lamp: board.lamp,
            memory,
            hooks,
            tables,
            in_use: Err(PassThrough::NoTable),
            rechecks: [None, None],
            recheck_ms: 0,
            telemetry,
            stream: None,
            late: 0,
            notices: Deque::new(),
            next: 0,
            live: false,
        }
    }

    /// Frames are worked on from now on, and the loop comes round within the watchdog's
    /// time.
    pub(crate) fn begin(&mut self) {
        self.watchdog.start(B::WATCHDOG_MS);
        self.live = true;
    }

    /// Looks after the next frame, if there is one; says whether there was.
    pub fn round(&mut self) -> bool {
        self.watchdog.pet();
        if !self.live {
            return false;
        }
        self.hooks.round(&self.clock);
        self.follow();
        self.frame()
    }

    /// Bytes of the largest frame there is memory for.
    pub(crate) fn capacity(&self) -> usize {
        self.source.capacity()
    }

    /// The next thing to tell the host.
    pub(crate) fn take_event(&mut self) -> Option<Event> {
        Some(match self.notices.pop_front()? {
            Notice::Tier(change, frame) => Event::TierChanged {
                from: change.from,
                to: change.to,
                reason: match change.reason {
                    Reason::OverBudget { .. } => TierReason::OverBudget,
                    Reason::TimeToSpare { .. } => TierReason::TimeToSpare,
                },
                frame,
            },
            Notice::Fault(fault) => Event::Fault(fault),
            Notice::Table(table, reason, frame) => Event::TableChanged {
                table,
                reason,
                frame,
            },
        })
    }

    /// Another table is in use from the next frame on.
    pub(crate) fn table_changed(&mut self, table: Option<TableName>, reason: TableReason) {
        defmt::info!(
            "table {=u32:08x} from frame {=u32} on, reason {=u8}",
            table.map_or(0, |table| table.id),
            self.next,
            reason as u8
        );
        self.notice(Notice::Table(table, reason, self.next));
    }

    /// Computes what the table of a slot needs for frames like those that come now, row by
    /// row while they go on, so that none of them waits for it when the table is used.
    pub(crate) fn prepare(&mut self, slot: Slot) {
        while let Some((table, format)) = slot
            .of(self.tables)
            .as_ref()
            .zip(self.stream.as_ref().map(|stream| stream.format))
            && let FramePath::Full(_, _, area) = FramePath::new(Ok(table), format)
            && !self.memory.is_ready(table, area.size)
        {
            let used = self.stream.as_ref().and_then(|stream| stream.path.area());
            let in_use = self.table().ok().map(Table::id).zip(used);
            // No frame of the path's format can fail; it was sized by it.
            let _ = self.memory.prepare(table, area.size, in_use);
            self.round();
        }
    }

    /// Goes over the next piece of the table in use, once a minute over all of it. Says
    /// whether it is no longer what was checked.
    pub(crate) fn recheck(&mut self, now_ms: u64) -> bool {
        let Ok(slot) = self.in_use else {
            return false;
        };
        if now_ms < self.recheck_ms {
            return false;
        }
        let file = slot.of_mut(&mut self.rechecks).as_mut();
        let Some(same) = file.and_then(Recheck::step) else {
            return false;
        };
        self.recheck_ms = now_ms.saturating_add(RECHECK_MS);
        !same
    }

    /// The table in use, or why there is none.
    fn table(&self) -> Result<&Table<'static>, PassThrough> {
        let slot = self.in_use?;
        let table = slot.of(self.tables).as_ref();
        table.ok_or(PassThrough::BrokenTable)
    }

    /// Starts anew where the source announces other frames.
    fn follow(&mut self) {
        match self.source.follow() {
            None => {}
            Some(Ok(format)) => {
                self.end();
                self.start(format);
            }
            Some(Err(fault)) => self.fault(Fault::Source(fault)),
        }
    }

    fn start(&mut self, format: Format) {
        self.sink.start(format);
        self.telemetry.set_input(format);
        let lateness = Lateness::new(ticks::<B::Clock>(format.period_us()));
        self.stage(format, lateness);
        defmt::info!(
            "frames of {=usize} x {=usize}, {=u8} channels, every {=u32} us",
            format.size().width(),
            format.size().height(),
            format.channels(),
            format.period_us()
        );
    }

    /// The table in use is another one; frames stay as they are.
    pub(crate) fn restage(&mut self) {
        if let Some(stream) = self.stream.take() {
            self.stage(stream.format, stream.lateness);
            return;
        }
        let mode = self.in_use;
        let mode = mode.map_or_else(Mode::PassThrough, |_| Mode::Compensating);
        self.telemetry.set_mode(mode, 0, 0, 0);
    }

    fn stage(&mut self, format: Format, lateness: Lateness) {
        let table = self.table();
        let path = FramePath::new(table, format);
        let period = ticks::<B::Clock>(format.period_us());
        let samples = format.bytes() as u32;
        // An eighth of the time is for everything else.
        let budget = u32::try_from(period - period / 8).unwrap_or(u32::MAX);
        let (governor, mode, top) = match (path, table) {
            (FramePath::PassThrough(why), _) | (_, Err(why)) => {
                (Governor::new([1], budget), Mode::PassThrough(why), 0)
            }
            (FramePath::Grid(_) | FramePath::Full(..), Ok(table)) => (
                Governor::for_table(table, samples as usize, budget),
                Mode::Compensating,
                table.top_tier(),
            ),
        };
        self.telemetry.set_mode(mode, top, samples, budget);
        // Nothing to do about a lamp that fails.
        let _ = match mode {
            Mode::Compensating | Mode::Alone => self.lamp.set_high(),
            Mode::PassThrough(_) => self.lamp.set_low(),
        };
        defmt::info!("compensated: {=bool}", mode == Mode::Compensating);
        self.stream = Some(Stream {
            format,
            path,
            governor,
            lateness,
        });
    }

    /// Ends the frames of the last format.
    fn end(&mut self) {
        if let Some(stream) = self.stream.take() {
            self.late = self.late.saturating_add(stream.lateness.late());
        }
    }

    /// Works on the next frame, if there is one and a buffer for what becomes of
    /// it; says whether there was.
    fn frame(&mut self) -> bool {
        let Some(stream) = &mut self.stream else {
            return false;
        };
        let table = self
            .in_use
            .ok()
            .and_then(|slot| slot.of(self.tables).as_ref());
        // After a start, or where frames of another size begin: the display keeps what it
        // shows until all is ready.
        if let (FramePath::Full(_, _, area), Some(table)) = (stream.path, table)
            && !self.memory.is_ready(table, area.size)
        {
            let _ = self.memory.prepare(table, area.size, None);
            return true;
        }
        if !self.sink.has_room() {
            return false;
        }
        let start = self.clock.ticks();
        let Some(sequence) = self.source.claim() else {
            stream.lateness.waiting(start);
            self.count();
            return false;
        };
        stream.lateness.arrived(start);
        self.next = sequence.wrapping_add(1);
        let chosen = stream.governor.tier();
        let tier = self.hooks.tier(chosen);
        let wanted = self.source.wanted();
        // The light of other cells than the table's neighbours have is of no use to it.
        let others = table.and_then(Table::neighbours).map(Neighbours::grid);
        let alike = others.is_some() && stream.format.neighbours() == others;
        let heard = self.source.heard().filter(|_| alike);
        let alone = others.is_some() && heard.is_none();
        let input = self.sink.begin(sequence);
        let result = stream
            .path
            .frame(table, tier, wanted, heard, input, self.memory);
        self.hooks.during_frame(sequence, tier, &self.clock);
        let whole = self.source.release();
        if whole.is_ok() {
            self.sink.publish();
        }
        let ticks = self.clock.ticks().saturating_sub(start);
        let ticks = u32::try_from(ticks).unwrap_or(u32::MAX);
        let change = stream.governor.frame(ticks);
        let outcome = FrameOutcome {
            sequence,
            tier,
            ticks,
            over: ticks > stream.governor.budget(),
            change,
        };
        match (whole, result) {
            (Ok(()), Ok(clipped)) => self.telemetry.frame(ticks, tier, clipped),
            // No frame of the stage's format can fail; it was sized by it.
            (Ok(()), Err(_)) => defmt::error!("frame {=u32} could not be worked on", sequence),
            // Counted by the source.
            (Err(_), _) => {}
        }
        self.count();
        if self.telemetry.set_alone(alone) {
            self.fault(Fault::Neighbours { sequence });
        }
        self.hooks.after_frame(outcome, &self.telemetry);
        if let Some(change) = change {
            self.changed(sequence, change);
        }
        true
    }

    fn changed(&mut self, sequence: u32, change: TierChange) {
        match change.reason {
            Reason::OverBudget { took } => defmt::warn!(
                "tier {=u8} -> {=u8}: a frame took {=u32} ticks",
                change.from,
                change.to,
                took
            ),
            Reason::TimeToSpare { expected } => defmt::info!(
                "tier {=u8} -> {=u8}: {=u32} ticks expected",
                change.from,
                change.to,
                expected
            ),
        }
        self.notice(Notice::Tier(change, sequence.wrapping_add(1)));
    }

    /// Tells of something that went wrong.
    pub(crate) fn fault(&mut self, fault: Fault) {
        match fault {
            Fault::Frame { sequence, cause } => {
                defmt::warn!("frame {=u32} is broken, cause {=u8}", sequence, cause as u8);
            }
            Fault::Source(cause) => {
                defmt::warn!("the source cannot be followed, cause {=u8}", cause as u8);
            }
            Fault::Neighbours { sequence } => {
                defmt::warn!("frame {=u32} came without its neighbours' light", sequence);
            }
            Fault::Table { .. } | Fault::Watchdog | Fault::Crash | Fault::KeyLost => {}
        }
        self.telemetry.set_fault(fault);
        self.notice(Notice::Fault(fault));
    }

    /// Keeps the latest where there is no room for all.
    fn notice(&mut self, notice: Notice) {
        if self.notices.is_full() {
            self.notices.pop_front();
        }
        let _ = self.notices.push_back(notice);
    }

    /// Brings the counts up to date, and reports what has broken since.
    fn count(&mut self) {
        let now = self
            .stream
            .as_ref()
            .map_or(0, |stream| stream.lateness.late());
        let late = self.late.saturating_add(now);
        let counts = self.source.counts();
        let more_broken = counts.broken != self.telemetry.frame_counts().broken;
        self.telemetry.set_inputs(counts, late);
        if let Some((sequence, broken)) = counts.last_broken.filter(|_| more_broken) {
            self.fault(Fault::Frame {
                sequence,
                cause: broken.into(),
            });
        }
    }
}

/// What of a board is about frames.
pub(crate) struct FrameSide<B: Board> {
    clock: B::Clock,
    source: B::Source,
    sink: B::Sink,
    watchdog: B::Watchdog,
    lamp: B::Lamp,
}

/// Parts a board: frames, and the serial line, flash and idling.
pub(crate) fn part<B: Board>(
    board: Peripherals<B>,
) -> (FrameSide<B>, B::Serial, B::Flash, B::Idle) {
    let frames = FrameSide {
        clock: board.clock,
        source: board.source,
        sink: board.sink,
        watchdog: board.watchdog,
        lamp: board.lamp,
    };
    (frames, board.serial, board.flash, board.idle)
}

fn ticks<C: Clock>(microseconds: u32) -> u64 {
    u64::from(microseconds) * u64::from(C::HERTZ) / 1_000_000
}
