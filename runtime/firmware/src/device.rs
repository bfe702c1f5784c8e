//! Main loop: frames first, then the serial line.
//!
//! ```text
//! start: why it started -> slots -> table, or why none
//! round: frame, if one waits -> serial line -> idle, if there was nothing to do
//! ```
//!
//! A frame comes before everything else, and what else there is takes a bounded
//! part of the time between two frames: at most four pieces of what came in on
//! the line a round, with a frame after every answer, and no more log bytes than one
//! message carries. What takes longer lets frames through meanwhile.

use crate::board::{Board, Clock, Idle, Peripherals, TableFlash, Watchdog};
use crate::fault;
use crate::frames::{Frames, part};
use crate::hooks::FrameHooks;
use crate::logger;
use crate::memory::{MAX_CELLS, Memory};
use crate::retained::{Restart, Retained};
use crate::stack;
use crate::table_slots;
use crate::telemetry::Telemetry;
use embedded_io::{Read, ReadReady, Write, WriteReady};
use iltm_runtime::image::layout::FORMAT_VERSION;
use iltm_runtime::link::{
    Device, Fault, Hello, Limits, MAX_PAYLOAD, Name, PROTOCOL_VERSION, Request, Response, Session,
    Status, Version,
};
use iltm_runtime::store::{Map, Updater};

/// Milliseconds in which both slots must be checked: full ones take some hundred
/// million instructions.
const START_MS: u32 = 10_000;

/// Crashes in a row after which the device starts without its table.
const CRASHES: u32 = 3;

/// What a device must have done since its start for the crashes before to count no more:
/// milliseconds and frames.
const GOOD: (u64, u32) = (60_000, 600);

/// Pieces of what came in on the line that a round looks at.
const READS: usize = 4;

/// Bytes of a piece.
const PIECE: usize = 64;

/// The device: a board and what it does with frames.
struct MainLoop<'a, B: Board, H> {
    serial: B::Serial,
    idle: B::Idle,
    session: Session,
    handler: RequestHandler<'a, B, H>,
}

/// What a host can ask about.
struct RequestHandler<'a, B: Board, H> {
    updater: Updater<B::Flash>,
    frames: &'a mut Frames<B, H>,
}

/// Sets the board up and runs the device for ever.
pub fn start<B: Board, H: FrameHooks>(hooks: impl FnOnce() -> H) -> ! {
    const {
        assert!(
            B::Flash::LONGEST_MS < B::WATCHDOG_MS,
            "the watchdog restarts the board while its flash is at work"
        );
    }
    stack::paint();
    let Some((mut board, memory)) = B::take().zip(Memory::take()) else {
        fault::restart();
    };
    let restart = Retained::get().begin();
    board.watchdog.start(START_MS);
    defmt::info!("{=str} starts: {}", B::NAME, restart);
    let Ok(map) = board.flash.map() else {
        // The board's own numbers are wrong: a defect of its port.
        fault::restart();
    };
    run(board, map, memory, restart, hooks())
}

fn run<B: Board>(
    board: Peripherals<B>,
    map: Map,
    memory: &'static mut Memory,
    restart: Restart,
    hooks: impl FrameHooks,
) -> ! {
    let Some(tables) = table_slots::take() else {
        fault::restart();
    };
    let (side, serial, flash, idle) = part(board);
    let telemetry = Telemetry::new::<B>(restart);
    let mut frames = Frames::<B, _>::new(side, memory, tables, hooks, telemetry);
    let crashes = restart.crashes >= CRASHES;
    let updater = Updater::start_after(crashes, flash, map, &mut frames);
    if let Some(fault) = updater.fault() {
        match fault {
            Fault::Table { slot, .. } => {
                defmt::error!("the table in slot {=u8} is refused", slot);
            }
            Fault::KeyLost => defmt::error!("the key cannot be read"),
            _ => {}
        }
        frames.telemetry.set_fault(fault);
    }
    frames.begin();
    let mut main_loop = MainLoop {
        serial,
        idle,
        session: Session::new(),
        handler: RequestHandler {
            updater,
            frames: &mut frames,
        },
    };
    loop {
        main_loop.round();
    }
}

impl<B: Board, H: FrameHooks> Device for RequestHandler<'_, B, H> {
    fn identity(&self) -> Hello {
        Hello {
            protocol: PROTOCOL_VERSION,
            firmware: Version::CURRENT,
            board: Name::try_from(B::NAME).unwrap_or_default(),
            device: self.updater.trust().device,
            table_format: FORMAT_VERSION,
            max_payload: MAX_PAYLOAD as u16,
            limits: Limits {
                cells: MAX_CELLS as u32,
                frame_bytes: self.frames.capacity() as u32,
                table_bytes: self.updater.map().slot_bytes(),
            },
        }
    }

    fn status(&self) -> Status {
        Status {
            table: self.updater.table(),
            slots: self.updater.states(),
            ..self.frames.telemetry.status()
        }
    }

    fn carry_out(&mut self, request: Request<'_>, now_ms: u64) -> Response {
        self.updater.answer(request, now_ms, self.frames)
    }

    fn answered(&mut self) {
        self.frames.round();
    }
}

impl<B: Board, H: FrameHooks> RequestHandler<'_, B, H> {
    /// What happens to tables by itself.
    fn poll(&mut self, now_ms: u64) {
        self.updater.poll(now_ms, self.frames);
        if self.frames.recheck(now_ms) {
            self.updater.abandon(self.frames);
            if let Some(fault) = self.updater.fault() {
                self.frames.fault(fault);
            }
        }
        let (time, frames) = GOOD;
        if now_ms >= time && self.frames.telemetry.frame_counts().shown >= frames {
            Retained::get().forget_crashes();
        }
        if let Some(change) = self.updater.take_change() {
            self.frames.table_changed(change.table, change.reason);
        }
    }
}

impl<B: Board, H: FrameHooks> MainLoop<'_, B, H> {
    fn round(&mut self) {
        let worked = self.handler.frames.round();
        let talked = self.talk();
        if !worked && !talked {
            self.idle.idle();
        }
    }

    /// A bounded part of the conversation on the serial line; says whether bytes
    /// went one way or the other. Errors of the line are the line's: what does not
    /// arrive is asked for again.
    fn talk(&mut self) -> bool {
        let now = self.handler.frames.clock.ticks() * 1_000 / u64::from(B::Clock::HERTZ);
        logger::set_time(now);
        self.handler.frames.telemetry.set_uptime(now);
        let heard = self.listen(now);
        self.handler.poll(now);
        while let Some(event) = self.handler.frames.take_event() {
            self.session.event(&event);
        }
        self.session.poll(now, &self.handler);
        self.log();
        self.say() || heard
    }

    #[inline(never)]
    fn listen(&mut self, now: u64) -> bool {
        let mut heard = false;
        let mut piece = [0; PIECE];
        for _ in 0..READS {
            if !matches!(self.serial.read_ready(), Ok(true)) {
                break;
            }
            let count = self.serial.read(&mut piece).unwrap_or(0);
            let bytes = piece.get(..count).unwrap_or_default();
            self.session.receive(bytes, now, &mut self.handler);
            heard |= count > 0;
        }
        heard
    }

    #[inline(never)]
    fn log(&mut self) {
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
    }

    fn say(&mut self) -> bool {
        let mut said = false;
        while !self.session.pending().is_empty() && matches!(self.serial.write_ready(), Ok(true)) {
            match self.serial.write(self.session.pending()) {
                Ok(count) if count > 0 => self.session.sent(count),
                _ => break,
            }
            said = true;
        }
        said
    }
}
