//! What a command failed for: words for people, a code for scripts.

use crate::capture::CaptureError;
use crate::compile::CompileError;
use crate::device::DeviceError;
use crate::learn::LearnError;
use miette::Diagnostic;
use std::fmt::{self, Write};

/// Causes of failure, each with an exit code of its own. The codes are a contract.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Kind {
    /// The command line cannot be understood.
    Usage = 2,
    /// A file is not there or cannot be read.
    Read = 3,
    /// A capture folder is not well-formed.
    Capture = 4,
    /// Photographs are well-formed but show that something went wrong.
    Photographs = 5,
    /// No usable inverse was found.
    Solve = 6,
    /// Bytes are not a table, or one that is damaged.
    Table = 7,
    /// A picture or video cannot be used.
    Frames = 8,
    /// The result cannot be written.
    Write = 9,
    /// A serial port cannot be opened.
    Port = 10,
    /// A device does not answer.
    NoAnswer = 11,
    /// A device answers and cannot do what was asked.
    Device = 12,
    /// The emulated board cannot be started.
    Emulator = 13,
}

impl Kind {
    const ALL: [(Self, &'static str, &'static str); 12] = [
        (
            Self::Usage,
            "usage",
            "the command line cannot be understood",
        ),
        (Self::Read, "read", "a file is not there or cannot be read"),
        (
            Self::Capture,
            "capture",
            "a capture folder is not well-formed",
        ),
        (
            Self::Photographs,
            "photographs",
            "photographs show that something went wrong",
        ),
        (Self::Solve, "solve", "no usable inverse was found"),
        (Self::Table, "table", "a table is damaged, or not a table"),
        (Self::Frames, "frames", "a picture or video cannot be used"),
        (Self::Write, "write", "the result cannot be written"),
        (Self::Port, "port", "a serial port cannot be opened"),
        (Self::NoAnswer, "no-answer", "a device does not answer"),
        (
            Self::Device,
            "device",
            "a device cannot do what it was asked",
        ),
        (
            Self::Emulator,
            "emulator",
            "the emulated board cannot be started",
        ),
    ];

    pub(super) const fn code(self) -> u8 {
        self as u8
    }

    pub(super) fn name(self) -> &'static str {
        let named = Self::ALL.iter().find(|(kind, ..)| *kind == self);
        named.map_or("unknown", |(_, name, _)| name)
    }

    /// The list that `--help` ends with.
    pub(super) fn table() -> String {
        let mut text = String::from("Exit codes:\n   0  done");
        for (kind, _, meaning) in Self::ALL {
            let _ = write!(text, "\n  {:>2}  {meaning}", kind.code());
        }
        text
    }
}

/// A failed command.
#[derive(Debug)]
pub(super) struct Failure {
    pub(super) kind: Kind,
    pub(super) message: String,
    pub(super) next_step: String,
}

impl Failure {
    pub(super) fn new(
        kind: Kind,
        message: impl fmt::Display,
        next_step: impl Into<String>,
    ) -> Self {
        Self {
            kind,
            message: message.to_string(),
            next_step: next_step.into(),
        }
    }
}

impl Failure {
    /// Of the device at a port.
    pub(super) fn of_device(port: &str, error: &DeviceError) -> Self {
        let kind = match error {
            DeviceError::Open { .. } => Kind::Port,
            DeviceError::Gone { .. } | DeviceError::NoAnswer { .. } => Kind::NoAnswer,
            DeviceError::Protocol { .. }
            | DeviceError::Refused { .. }
            | DeviceError::Answer { .. } => Kind::Device,
        };
        Self::new(kind, format!("{port}: {error}"), error.next_step())
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl Diagnostic for Failure {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(format!("iltm::{}", self.kind.name())))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.next_step))
    }
}

impl From<LearnError> for Failure {
    fn from(error: LearnError) -> Self {
        match error {
            LearnError::Capture(error) => Self::new(kind_of(&error), &error, error.next_step()),
            LearnError::Solve(error) => {
                // The message of a solve error ends with what to do.
                let message = error.to_string();
                let (what, next_step) = message.rsplit_once("; ").unwrap_or((&message, ""));
                Self::new(Kind::Solve, what, format!("{}.", capitalised(next_step)))
            }
            LearnError::Compile(error) => compile_failure(&error),
            LearnError::Worse { .. } => Self::new(
                Kind::Solve,
                error,
                "Take more Bernoulli photographs, or average several of each pattern.",
            ),
        }
    }
}

fn compile_failure(error: &CompileError) -> Failure {
    let kind = match error {
        CompileError::ReferenceWhite { .. } => Kind::Usage,
        _ => Kind::Solve,
    };
    Failure::new(kind, error, error.next_step())
}

/// Whether a capture cannot be read, is not well-formed, or shows bad light.
const fn kind_of(error: &CaptureError) -> Kind {
    match error {
        CaptureError::Io { .. } | CaptureError::NoManifest { .. } => Kind::Read,
        CaptureError::MorePhotographsThanTaken { .. } => Kind::Usage,
        CaptureError::TooFewPhotographs { .. }
        | CaptureError::NoLight { .. }
        | CaptureError::Overexposed { .. }
        | CaptureError::NotLinear { .. }
        | CaptureError::NothingRegistered { .. } => Kind::Photographs,
        _ => Kind::Capture,
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}
