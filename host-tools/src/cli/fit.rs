//! Fit of a table and the frames that a device gets, as the device itself says.

use super::failure::{Failure, Kind};
use super::words::{CalledTable, mode};
use crate::device::{Client, DeviceError, Line};
use iltm_runtime::link::{Mode, Slots, Status};
use std::thread;
use std::time::{Duration, Instant};

/// Longest wait for a frame, or for frames that fit.
const WAIT: Duration = Duration::from_secs(3);

/// Longest wait for a source that has not announced any frames.
const NO_SOURCE: Duration = Duration::from_millis(500);

/// Between two questions.
const STEP: Duration = Duration::from_millis(100);

/// What a device does with frames.
pub(super) enum Fit {
    /// A frame has gone through the table.
    Compensating,
    /// Frames pass unchanged.
    PassThrough(Box<Status>),
    /// No frame came out while it was watched.
    NoFrames,
}

impl Fit {
    /// What is left to say after a success.
    pub(super) const fn remark(&self) -> &'static str {
        match self {
            Self::NoFrames => "\nNo frames arrive: whether the table fits them cannot be told.",
            Self::Compensating | Self::PassThrough(_) => "",
        }
    }

    /// Whether frames are compensated, for programs; none: it cannot be told.
    pub(super) const fn data(&self) -> Option<bool> {
        match self {
            Self::Compensating => Some(true),
            Self::PassThrough(_) => Some(false),
            Self::NoFrames => None,
        }
    }
}

/// Watches until a frame has gone through the table; at most a few seconds, in which a
/// source may also change its frames.
pub(super) fn ask_fit<L: Line>(client: &mut Client<L>) -> Result<Fit, DeviceError> {
    let before = client.status()?.frames.shown;
    let start = Instant::now();
    loop {
        let status = client.status()?;
        let seen = status.frames.shown != before;
        let wait = match status.input {
            Some(_) => WAIT,
            None => NO_SOURCE,
        };
        let over = start.elapsed() >= wait;
        match status.mode {
            Mode::Compensating | Mode::Alone if seen => return Ok(Fit::Compensating),
            Mode::PassThrough(_) if over => return Ok(Fit::PassThrough(Box::new(status))),
            _ if over => return Ok(Fit::NoFrames),
            _ => thread::sleep(STEP),
        }
    }
}

/// A table is in use and does nothing.
pub(super) fn not_compensating(
    port: &str,
    table: CalledTable,
    status: &Status,
    slots: Option<&Slots>,
) -> Failure {
    let message = format!("{port}: table {table}: {}", mode(status, slots));
    let next_step = "Give the device other frames, or flash a table that was made for these.";
    Failure::new(Kind::PassThrough, message, next_step)
}
