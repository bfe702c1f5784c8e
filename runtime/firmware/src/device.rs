//! The frame loop.
//!
//! ```text
//! start: why it started -> slots -> table, or why none
//! round: pet watchdog -> follow source -> frame, if one waits -> serial line ->
//!        rest, if there was nothing to do
//! frame: claim -> pixels at the governor's tier -> release -> publish if it was whole
//! ```
//!
//! A frame comes before everything else, and what else there is takes a bounded
//! part of the time between two frames: at most four pieces of what came in on
//! the line a round, and no more log bytes than one message carries.

use crate::board::{Board, Clock, FrameSink, FrameSource, Peripherals, Rest, Watchdog};
use crate::fault;
use crate::logger;
use crate::memory::{MAX_CELLS, Memory};
use crate::retained::{Restart, Retained};
use crate::stack;
use crate::stage::Stage;
use crate::tables::Tables;
use crate::vitals::Vitals;
use embedded_hal::digital::OutputPin;
use embedded_io::{Read, ReadReady, Write, WriteReady};
use iltm_runtime::exchange::{Format, Lateness, psram};
use iltm_runtime::governor::{Change, Governor, Reason};
use iltm_runtime::image::Table;
use iltm_runtime::image::layout::FORMAT_VERSION;
use iltm_runtime::link::{
    Event, Fault, Hello, Limits, MAX_PAYLOAD, Mode, Name, PROTOCOL_VERSION, Session, TierReason,
    Version,
};

/// Milliseconds in which both slots must be checked: full ones take some hundred
/// million instructions.
const START_MS: u32 = 10_000;

/// Milliseconds in which the loop must come round; at least four frames at 24 a
/// second.
const WATCHDOG_MS: u32 = 250;

/// Pieces of what came in on the line that a round looks at.
const READS: usize = 4;

/// Bytes of a piece.
const PIECE: usize = 64;

/// What a self-test may do to the loop; the product runs with [`Live`].
pub trait Rehearsal {
    /// Called once a round, before a frame is looked for.
    fn round(&mut self, _clock: &impl Clock) {}

    /// The tier of the next frame, where the governor chose `tier`.
    fn tier(&mut self, tier: u8) -> u8 {
        tier
    }

    /// Called when the pixels of a frame are done and it is still claimed.
    fn during_frame(&mut self, _sequence: u32, _tier: u8, _clock: &impl Clock) {}

    /// Called after every frame.
    fn after_frame(&mut self, _outcome: Outcome, _status: &Vitals) {}
}

/// What became of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Its number.
    pub sequence: u32,
    /// Its tier.
    pub tier: u8,
    /// Ticks that it took.
    pub ticks: u32,
    /// Whether it took longer than the budget.
    pub over: bool,
    /// Whether the governor changed the tier after it.
    pub change: Option<Change>,
}

/// No rehearsal.
pub struct Live;

impl Rehearsal for Live {}

/// The device: a board and what it does with frames.
struct Device<B: Board, R> {
    board: Peripherals<B>,
    tables: &'static Tables,
    memory: &'static mut Memory,
    rehearsal: R,
    session: Session,
    vitals: Vitals,
    stream: Option<Stream>,
    /// Late frames of earlier streams.
    late: u32,
}

/// Frames of one format.
struct Stream {
    stage: Stage<'static>,
    governor: Governor,
    lateness: Lateness,
}

/// Sets the board up and runs the device for ever.
pub fn start<B: Board, R: Rehearsal>(rehearsal: impl FnOnce() -> R) -> ! {
    stack::paint();
    let Some((mut board, memory)) = B::take().zip(Memory::take()) else {
        fault::restart();
    };
    let restart = Retained::get().begin();
    board.watchdog.start(START_MS);
    defmt::info!("{=str} starts: {}", B::NAME, restart);
    let Some(tables) = Tables::take(&board.flash) else {
        fault::restart();
    };
    run(board, memory, tables, restart, rehearsal())
}

/// The loop has its stack to itself; see [`Tables::take`].
#[inline(never)]
fn run<B: Board>(
    mut board: Peripherals<B>,
    memory: &'static mut Memory,
    tables: &'static Tables,
    restart: Restart,
    rehearsal: impl Rehearsal,
) -> ! {
    board.watchdog.start(WATCHDOG_MS);
    let mut vitals = Vitals::new::<B>(restart);
    vitals.set_tables(tables.slots, tables.name);
    if let Some(fault) = tables.fault {
        vitals.set_fault(fault);
    }
    if let Err(why) = &tables.active {
        vitals.set_mode(Mode::PassThrough(*why), 0, 0, 0);
    }
    let session = Session::new(identity::<B>(board.source.capacity()));
    let mut device = Device {
        board,
        tables,
        memory,
        rehearsal,
        session,
        vitals,
        stream: None,
        late: 0,
    };
    loop {
        device.round();
    }
}

fn identity<B: Board>(frame_bytes: usize) -> Hello {
    Hello {
        protocol: PROTOCOL_VERSION,
        firmware: Version::CURRENT,
        board: Name::try_from(B::NAME).unwrap_or_default(),
        device: 0,
        table_format: FORMAT_VERSION,
        max_payload: MAX_PAYLOAD as u16,
        limits: Limits {
            cells: MAX_CELLS as u32,
            frame_bytes: frame_bytes as u32,
            table_bytes: psram::SLOT_A.len() as u32,
        },
    }
}

impl<B: Board, R: Rehearsal> Device<B, R> {
    fn round(&mut self) {
        self.board.watchdog.pet();
        self.rehearsal.round(&self.board.clock);
        self.follow();
        let worked = self.frame();
        let talked = self.talk();
        if !worked && !talked {
            self.board.rest.rest();
        }
    }

    /// Starts anew where the source announces other frames.
    fn follow(&mut self) {
        match self.board.source.follow() {
            None => {}
            Some(Ok(format)) => self.start(format),
            Some(Err(fault)) => self.fault(Fault::Source(fault)),
        }
    }

    fn start(&mut self, format: Format) {
        self.end();
        let stage = Stage::new(self.tables.active.as_ref().map_err(|why| *why), format);
        let period = ticks::<B::Clock>(format.period_us());
        let samples = format.bytes() as u32;
        // An eighth of the time is for everything else.
        let budget = u32::try_from(period - period / 8).unwrap_or(u32::MAX);
        let governor = stage.table().map_or_else(
            || Governor::new([1], budget),
            |table| Governor::for_table(table, samples as usize, budget),
        );
        let mode = match stage {
            Stage::PassThrough(why) => Mode::PassThrough(why),
            Stage::Grid(..) | Stage::Full(..) => Mode::Compensating,
        };
        let top = stage.table().map_or(0, Table::top_tier);
        self.vitals.set_mode(mode, top, samples, budget);
        // Nothing to do about a lamp that fails.
        let _ = match mode {
            Mode::Compensating => self.board.lamp.set_high(),
            Mode::PassThrough(_) => self.board.lamp.set_low(),
        };
        self.board.sink.start(format);
        defmt::info!(
            "frames of {=usize} x {=usize}, {=u8} channels, every {=u32} us; compensated: {=bool}",
            format.size().width(),
            format.size().height(),
            format.channels(),
            format.period_us(),
            mode == Mode::Compensating
        );
        self.stream = Some(Stream {
            stage,
            governor,
            lateness: Lateness::new(period),
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
        if !self.board.sink.has_room() {
            return false;
        }
        let start = self.board.clock.ticks();
        let Some(sequence) = self.board.source.claim() else {
            stream.lateness.waiting(start);
            self.count();
            return false;
        };
        stream.lateness.arrived(start);
        let chosen = stream.governor.tier();
        let tier = self.rehearsal.tier(chosen);
        let wanted = self.board.source.wanted();
        let input = self.board.sink.begin(sequence);
        let result = stream.stage.frame(tier, wanted, input, self.memory);
        self.rehearsal
            .during_frame(sequence, tier, &self.board.clock);
        let whole = self.board.source.release();
        if whole.is_ok() {
            self.board.sink.publish();
        }
        let ticks = self.board.clock.ticks().saturating_sub(start);
        let ticks = u32::try_from(ticks).unwrap_or(u32::MAX);
        let change = stream.governor.frame(ticks);
        let outcome = Outcome {
            sequence,
            tier,
            ticks,
            over: ticks > stream.governor.budget(),
            change,
        };
        match (whole, result) {
            (Ok(()), Ok(clipped)) => self.vitals.frame(ticks, tier, clipped),
            // No frame of the stage's format can fail; it was sized by it.
            (Ok(()), Err(_)) => defmt::error!("frame {=u32} could not be worked on", sequence),
            // Counted by the source.
            (Err(_), _) => {}
        }
        self.count();
        self.rehearsal.after_frame(outcome, &self.vitals);
        if let Some(change) = change {
            self.changed(sequence, change);
        }
        true
    }

    fn changed(&mut self, sequence: u32, change: Change) {
        let reason = match change.reason {
            Reason::OverBudget { took } => {
                defmt::warn!(
                    "tier {=u8} -> {=u8}: a frame took {=u32} ticks",
                    change.from,
                    change.to,
                    took
                );
                TierReason::OverBudget
            }
            Reason::TimeToSpare { expected } => {
                defmt::info!(
                    "tier {=u8} -> {=u8}: {=u32} ticks expected",
                    change.from,
                    change.to,
                    expected
                );
                TierReason::TimeToSpare
            }
        };
        self.session.event(&Event::TierChanged {
            from: change.from,
            to: change.to,
            reason,
            frame: sequence.wrapping_add(1),
        });
    }

    fn fault(&mut self, fault: Fault) {
        match fault {
            Fault::Frame { sequence, cause } => {
                defmt::warn!("frame {=u32} is broken, cause {=u8}", sequence, cause as u8);
            }
            Fault::Source(cause) => {
                defmt::warn!("the source cannot be followed, cause {=u8}", cause as u8);
            }
            Fault::Table { .. } | Fault::Watchdog | Fault::Crash => {}
        }
        self.vitals.set_fault(fault);
        self.session.event(&Event::Fault(fault));
    }

    /// Brings the counts up to date, and reports what has broken since.
    fn count(&mut self) {
        let now = self
            .stream
            .as_ref()
            .map_or(0, |stream| stream.lateness.late());
        let late = self.late.saturating_add(now);
        let counts = self.board.source.counts();
        let more_broken = counts.broken != self.vitals.frame_counts().broken;
        self.vitals.set_inputs(counts, late);
        if let Some((sequence, broken)) = counts.last_broken.filter(|_| more_broken) {
            self.fault(Fault::Frame {
                sequence,
                cause: broken.into(),
            });
        }
    }

    /// A bounded part of the conversation on the serial line; says whether bytes
    /// went one way or the other. Errors of the line are the line's: what does not
    /// arrive is asked for again.
    fn talk(&mut self) -> bool {
        let mut talked = false;
        let now = self.board.clock.ticks() * 1_000 / u64::from(B::Clock::HERTZ);
        logger::set_time(now);
        self.vitals.set_uptime(now);
        let mut piece = [0; PIECE];
        for _ in 0..READS {
            if !matches!(self.board.serial.read_ready(), Ok(true)) {
                break;
            }
            let count = self.board.serial.read(&mut piece).unwrap_or(0);
            let bytes = piece.get(..count).unwrap_or_default();
            self.session.receive(bytes, now, &self.vitals);
            talked |= count > 0;
        }
        self.session.poll(now, &self.vitals);
        if self.session.is_subscribed() && self.session.pending().is_empty() {
            let mut frames = [0; MAX_PAYLOAD];
            let used = logger::take(&mut frames);
            // There is room for this one now.
            let dropped = logger::take_dropped();
            if dropped > 0 {
                defmt::warn!("{=u32} log messages found no room", dropped);
            }
            if used > 0 {
                self.session.log(frames.get(..used).unwrap_or_default());
            }
        }
        while !self.session.pending().is_empty()
            && matches!(self.board.serial.write_ready(), Ok(true))
        {
            match self.board.serial.write(self.session.pending()) {
                Ok(count) if count > 0 => self.session.sent(count),
                _ => break,
            }
            talked = true;
        }
        talked
    }
}

fn ticks<C: Clock>(microseconds: u32) -> u64 {
    u64::from(microseconds) * u64::from(C::HERTZ) / 1_000_000
}
