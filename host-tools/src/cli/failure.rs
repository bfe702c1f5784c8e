//! Failures of a command: words for people, an exit code for scripts.

use super::active::Active;
use super::check;
use crate::capture::CaptureError;
use crate::compile::CompileError;
use crate::compile::sign::KeyError;
use crate::device::DeviceError;
use crate::device::upload::UploadError;
use crate::learn::LearnError;
use crate::session::SessionError;
use crate::user::ConfigError;
use iltm_runtime::{link::Refusal, trust::Rejected};
use miette::Diagnostic;
use serde_json::{Value, json};
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
    /// No device answers at any port.
    NoDevice = 14,
    /// Several devices answer, and none was chosen.
    SeveralDevices = 15,
    /// The user's settings cannot be read or kept.
    Settings = 16,
    /// A key cannot be read or made.
    Key = 17,
    /// A table did not arrive whole.
    Transfer = 18,
    /// A device's flash does not hold what is written to it.
    Flash = 19,
    /// A table is larger than the device has room for.
    TooLarge = 20,
    /// A table is not signed, and the device wants that.
    Unsigned = 21,
    /// A table is signed with another key than the device's.
    WrongKey = 22,
    /// A table's signature is false.
    Signature = 23,
    /// A table is older than the device takes.
    Older = 24,
    /// A table is for another device.
    OtherDevice = 25,
    /// Another table is on trial.
    OnTrial = 26,
    /// There is no table to confirm or to go back to.
    NoTable = 27,
    /// A device has another key or number already.
    HasKey = 28,
    /// Stopped by the user before the end.
    Interrupted = 29,
    /// A scene cannot be simulated as it is described.
    Scene = 30,
    /// A table does not keep its promise on the wall.
    Verdict = 31,
    /// A camera gives no photograph, or none that can be used.
    Camera = 32,
    /// Slides cannot be shown.
    Display = 33,
}

impl From<&Rejected> for Kind {
    fn from(rejected: &Rejected) -> Self {
        match rejected {
            Rejected::Unsigned => Self::Unsigned,
            Rejected::WrongKey => Self::WrongKey,
            Rejected::Signature => Self::Signature,
            Rejected::Older { .. } => Self::Older,
            Rejected::OtherDevice { .. } => Self::OtherDevice,
            Rejected::NotBuilt { .. } => Self::Device,
            Rejected::NotATable
            | Rejected::Truncated
            | Rejected::Format
            | Rejected::Damaged
            | Rejected::Contents => Self::Table,
        }
    }
}

impl From<&DeviceError> for Kind {
    fn from(error: &DeviceError) -> Self {
        match error {
            DeviceError::Open { .. } => Self::Port,
            DeviceError::Gone { .. } | DeviceError::NoAnswer { .. } => Self::NoAnswer,
            DeviceError::Refused { refusal, .. } => match refusal {
                Refusal::Table(rejected) => rejected.into(),
                Refusal::TooLong { .. } => Self::TooLarge,
                Refusal::OnTrial => Self::OnTrial,
                Refusal::Flash { .. } => Self::Flash,
                Refusal::NoTransfer | Refusal::Incomplete | Refusal::Chunk => Self::Transfer,
                Refusal::NotInUse { .. } | Refusal::NoOther => Self::NoTable,
                Refusal::HasKey => Self::HasKey,
                Refusal::HelloFirst
                | Refusal::Unknown
                | Refusal::Malformed
                | Refusal::ReadOnly
                | Refusal::KeyLost => Self::Device,
            },
            DeviceError::Protocol { .. } | DeviceError::Exchanged | DeviceError::Answer { .. } => {
                Self::Device
            }
        }
    }
}

impl From<&UploadError> for Kind {
    fn from(error: &UploadError) -> Self {
        match error {
            UploadError::Device(error) => error.into(),
            UploadError::Worn { .. } => Self::Flash,
            UploadError::Stalled { .. } | UploadError::NeverWhole { .. } => Self::Transfer,
            UploadError::Stopped => Self::Interrupted,
        }
    }
}

impl Kind {
    const ALL: [(Self, &'static str, &'static str); 32] = [
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
        (Self::NoDevice, "no-device", "no device answers at any port"),
        (
            Self::SeveralDevices,
            "several-devices",
            "several devices answer, and none was chosen",
        ),
        (
            Self::Settings,
            "settings",
            "the user's settings cannot be read or kept",
        ),
        (Self::Key, "key", "a key cannot be read or made"),
        (Self::Transfer, "transfer", "a table did not arrive whole"),
        (
            Self::Flash,
            "flash",
            "a device's flash does not hold what is written to it",
        ),
        (
            Self::TooLarge,
            "too-large",
            "a table is larger than the device has room for",
        ),
        (
            Self::Unsigned,
            "unsigned",
            "a table is not signed, and the device wants that",
        ),
        (
            Self::WrongKey,
            "wrong-key",
            "a table is signed with another key than the device's",
        ),
        (Self::Signature, "signature", "a table's signature is false"),
        (
            Self::Older,
            "older-version",
            "a table is older than the device takes",
        ),
        (
            Self::OtherDevice,
            "other-device",
            "a table is for another device",
        ),
        (Self::OnTrial, "on-trial", "another table is on trial"),
        (
            Self::NoTable,
            "no-table",
            "there is no table to confirm or to go back to",
        ),
        (
            Self::HasKey,
            "has-key",
            "a device has another key or number already",
        ),
        (
            Self::Interrupted,
            "interrupted",
            "stopped by the user before the end",
        ),
        (
            Self::Scene,
            "scene",
            "a scene cannot be simulated as it is described",
        ),
        (
            Self::Verdict,
            "verdict",
            "a table does not keep its promise on the wall",
        ),
        (
            Self::Camera,
            "camera",
            "a camera gives no photograph that can be used",
        ),
        (Self::Display, "display", "slides cannot be shown"),
    ];

    pub(super) const fn code(self) -> u8 {
        self as u8
    }

    /// Every code with its name and its meaning.
    pub(super) fn codes() -> Vec<(u8, &'static str, &'static str)> {
        let code = |(kind, name, meaning): (Self, _, _)| (kind.code(), name, meaning);
        Self::ALL.map(code).into()
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
    /// Where a device's tables were about to change: which one is in use now.
    pub(super) active: Option<Active>,
    /// What was found out before, for programs: an object that stands beside the error.
    pub(super) data: Option<Box<Value>>,
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
            active: None,
            data: None,
        }
    }

    /// The same, with what was found out all the same: an object.
    pub(super) fn with_result(mut self, result: Value) -> Self {
        self.data = Some(Box::new(result));
        self
    }

    /// The same, with the table that is in use now.
    pub(super) fn with(mut self, active: Active) -> Self {
        self.active = Some(active);
        self
    }

    /// Which table is in use now, and what to do.
    pub(super) fn advice(&self) -> String {
        match &self.active {
            Some(active) => format!("{active}\n{}", self.next_step),
            None => self.next_step.clone(),
        }
    }
}

impl Failure {
    /// Of the device at a port.
    pub(super) fn of_device(port: &str, error: &DeviceError) -> Self {
        let kind = error.into();
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
        Some(Box::new(self.advice()))
    }
}

impl From<LearnError> for Failure {
    fn from(error: LearnError) -> Self {
        match error {
            LearnError::Capture(error) => {
                let mut failure = Self::new(kind_of(&error), &error, error.next_step());
                if let CaptureError::Refused { gates, .. } = &error {
                    failure.data = Some(Box::new(json!({ "gates": check::gates(gates) })));
                }
                failure
            }
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
                "Project as it is: an even, flat scene needs no table. If it is neither, take more \
                 Bernoulli photographs, or average several of each pattern.",
            ),
        }
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        let kind = match &error {
            SessionError::Capture(error) => kind_of(error),
            SessionError::IndexTwice { .. } => Kind::Capture,
            SessionError::NoIndex { .. } => Kind::Usage,
            SessionError::NoSlide { .. } => Kind::Read,
            SessionError::Display { .. }
            | SessionError::NoDisplay { .. }
            | SessionError::DisplaySize { .. } => Kind::Display,
            SessionError::Camera { .. } | SessionError::Latency { .. } => Kind::Camera,
            SessionError::Write { .. } => Kind::Write,
            SessionError::Stopped => Kind::Interrupted,
        };
        Self::new(kind, &error, error.next_step())
    }
}

impl From<KeyError> for Failure {
    fn from(error: KeyError) -> Self {
        Self::new(Kind::Key, &error, error.next_step())
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        let next_step = "Correct the file, or move it away; --port needs none.";
        Self::new(Kind::Settings, error, next_step)
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
pub(super) const fn kind_of(error: &CaptureError) -> Kind {
    match error {
        CaptureError::Io { .. } | CaptureError::NoManifest { .. } => Kind::Read,
        CaptureError::MorePhotographsThanTaken { .. }
        | CaptureError::UnknownIndex { .. }
        | CaptureError::BlackIndex { .. } => Kind::Usage,
        CaptureError::TooFewPhotographs { .. }
        | CaptureError::NoLight { .. }
        | CaptureError::Refused { .. }
        | CaptureError::ResponseUnknown { .. } => Kind::Photographs,
        _ => Kind::Capture,
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}
