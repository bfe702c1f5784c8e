//! Telemetry: all that a status says, kept up to date by the frame loop.

use crate::board::{Board, Clock};
use crate::retained::{Cause, Restart};
use crate::stack;
use iltm_runtime::frame_buffers::{Format, InputCounts};
use iltm_runtime::link::{
    Clipping, Fault, FrameCounts, FrameKind, FrameTime, Mode, Name, PassThrough, SerialCounts,
    SlotState, Stack, Status, Version,
};
use iltm_runtime::units::ClippedSamples;

/// Everything that a status says, kept up to date by the frame loop.
pub struct Telemetry {
    status: Status,
    ticks_per_microsecond: u32,
    /// Mean frame time in ticks, 16 times.
    mean: u32,
}

/// Frames over which the mean frame time moves.
const MEAN_OVER: u32 = 16;

impl Telemetry {
    /// Of a device that starts.
    #[must_use]
    pub fn new<B: Board>(restart: Restart) -> Self {
        let last_fault = match restart.cause {
            Cause::Outside => None,
            Cause::Watchdog => Some(Fault::Watchdog),
            Cause::Panic | Cause::HardFault => Some(Fault::Crash),
        };
        Self {
            status: Status {
                firmware: Version::CURRENT,
                board: Name::try_from(B::NAME).unwrap_or_default(),
                uptime_ms: 0,
                table: None,
                mode: Mode::PassThrough(PassThrough::NoTable),
                tier: 0,
                top_tier: 0,
                frames: FrameCounts::default(),
                clipping: Clipping::default(),
                frame_time: FrameTime::default(),
                slots: [SlotState::Empty; 2],
                last_fault,
                stack: Stack::default(),
                watchdog_resets: restart.watchdog_resets,
                serial: SerialCounts::default(),
                input: None,
            },
            ticks_per_microsecond: (B::Clock::HERTZ / 1_000_000).max(1),
            mean: 0,
        }
    }

    /// The time. Once a second the stack is measured, which takes as long as a small frame.
    pub fn set_uptime(&mut self, milliseconds: u64) {
        let seconds = |time: u64| time as u32 / 1_000;
        let stack = &mut self.status.stack;
        if stack.size == 0 || seconds(milliseconds) != seconds(self.status.uptime_ms) {
            *stack = stack::depth();
        }
        self.status.uptime_ms = milliseconds;
    }

    /// Frames of another kind: what is done with them, and how long they may take.
    pub fn set_mode(&mut self, mode: Mode, top_tier: u8, samples: u32, budget: u32) {
        self.status.mode = mode;
        self.status.tier = 0;
        self.status.top_tier = top_tier;
        self.status.clipping.samples = samples;
        self.status.frame_time.budget_us = budget / self.ticks_per_microsecond;
    }

    /// Whether the neighbours of the table in use are silent; says whether they have just become so.
    pub fn set_alone(&mut self, alone: bool) -> bool {
        match self.status.mode {
            Mode::Compensating if alone => {
                self.status.mode = Mode::Alone;
                true
            }
            Mode::Alone if !alone => {
                self.status.mode = Mode::Compensating;
                false
            }
            _ => false,
        }
    }

    /// Frames of this format come in.
    pub fn set_input(&mut self, format: Format) {
        self.status.input = Some(FrameKind {
            width: format.size().width() as u16,
            height: format.size().height() as u16,
            channels: format.channels(),
        });
    }

    /// A frame was worked on in this many ticks.
    pub fn frame(&mut self, ticks: u32, tier: u8, clipped: ClippedSamples) {
        let microseconds = ticks / self.ticks_per_microsecond;
        self.mean = if self.status.frames.shown == 0 {
            ticks.saturating_mul(MEAN_OVER)
        } else {
            (self.mean - self.mean / MEAN_OVER).saturating_add(ticks)
        };
        self.status.tier = tier;
        self.status.frames.shown = self.status.frames.shown.saturating_add(1);
        let time = &mut self.status.frame_time;
        time.last_us = microseconds;
        time.mean_us = self.mean / MEAN_OVER / self.ticks_per_microsecond;
        time.worst_us = time.worst_us.max(microseconds);
        let clipping = &mut self.status.clipping;
        clipping.last = clipped;
        clipping.black = clipping.black.saturating_add(clipped.black.into());
        clipping.white = clipping.white.saturating_add(clipped.white.into());
    }

    /// What became of the frames that were to come in.
    pub fn set_inputs(&mut self, counts: InputCounts, late: u32) {
        let frames = &mut self.status.frames;
        frames.received = counts.received;
        frames.broken = counts.broken;
        frames.dropped = counts.dropped;
        frames.late = late;
    }

    /// Something went wrong.
    pub fn set_fault(&mut self, fault: Fault) {
        self.status.last_fault = Some(fault);
    }

    /// What became of the frames.
    #[must_use]
    pub const fn frame_counts(&self) -> FrameCounts {
        self.status.frames
    }

    /// All of it, but for what the store knows.
    #[must_use]
    pub fn status(&self) -> Status {
        self.status.clone()
    }
}
