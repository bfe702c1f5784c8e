//! Failures of a command: words for people, an exit code for scripts.

use super::active::Active;
use super::output::printable;
use super::summary::gates;
use crate::build_table::BuildError;
use crate::capture::{CaptureError, PoseError};
use crate::compile::sign::KeyError;
use crate::compile::{CompileError, SplitTableError};
use crate::demo::DemoError;
use crate::device::DeviceError;
use crate::device::logs::LogsError;
use crate::device::upload::UploadError;
use crate::scene::SimulationError;
use crate::scene::description::{SceneError, SceneProblem};
use crate::scene::folder::CaptureFolderError;
use crate::session::{PatternsError, SessionError};
use crate::solve::SolveError;
use crate::user::ConfigError;
use crate::verify::VerifyError;
use crate::video::VideoError;
use crate::video::y4m::Y4mError;
use iltm_picture::{FolderError, html::capitalised, png::PngError};
use iltm_runtime::{link::Refusal, trust::Rejected};
use miette::Diagnostic;
use serde_json::{Value, json};
use std::fmt::{self, Write};
use std::io;
use std::path::Path;
use strum::{EnumIter, EnumMessage, IntoEnumIterator, IntoStaticStr};

/// Causes of failure, each with an exit code of its own, its name in kebab case, and what
/// it means. The codes are a contract; `docs/errors.md` and `--help` are made from them.
#[derive(Clone, Copy, PartialEq, Eq, Debug, EnumIter, EnumMessage, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
#[repr(u8)]
pub(super) enum Kind {
    #[strum(message = "the command line cannot be understood")]
    Usage = 2,
    #[strum(message = "a file is not there or cannot be read")]
    Read = 3,
    #[strum(message = "a capture folder is not well-formed")]
    Capture = 4,
    #[strum(message = "photographs show that something went wrong")]
    Photographs = 5,
    #[strum(message = "no usable inverse was found")]
    Solve = 6,
    #[strum(message = "a table is damaged, or not a table")]
    Table = 7,
    #[strum(message = "a picture or video cannot be used")]
    Frames = 8,
    #[strum(message = "the result cannot be written")]
    Write = 9,
    #[strum(message = "a serial port cannot be opened")]
    Port = 10,
    #[strum(message = "a device does not answer")]
    NoAnswer = 11,
    #[strum(message = "a device cannot do what it was asked")]
    Device = 12,
    #[strum(message = "the emulated board cannot be started")]
    Emulator = 13,
    #[strum(message = "no device answers at any port")]
    NoDevice = 14,
    #[strum(message = "several devices answer, and none was chosen")]
    SeveralDevices = 15,
    #[strum(message = "the user's settings cannot be read or kept")]
    Settings = 16,
    #[strum(message = "a key cannot be read or made")]
    Key = 17,
    #[strum(message = "a table did not arrive whole")]
    Transfer = 18,
    #[strum(message = "a device's flash does not hold what is written to it")]
    Flash = 19,
    #[strum(message = "a table is larger than the device has room for")]
    TooLarge = 20,
    #[strum(message = "a table is not signed, and the device wants that")]
    Unsigned = 21,
    #[strum(message = "a table is signed with another key than the device's")]
    WrongKey = 22,
    #[strum(message = "a table's signature is false")]
    Signature = 23,
    #[strum(message = "a table is older than the device takes")]
    OlderVersion = 24,
    #[strum(message = "a table is for another device")]
    OtherDevice = 25,
    #[strum(message = "another table is on trial")]
    OnTrial = 26,
    #[strum(message = "there is no table to confirm or to go back to")]
    NoTable = 27,
    #[strum(message = "a device has another key or number already")]
    HasKey = 28,
    #[strum(message = "stopped by the user before the end")]
    Interrupted = 29,
    #[strum(message = "a scene cannot be simulated as it is described")]
    Scene = 30,
    #[strum(message = "a table does not keep its promise on the wall")]
    Verdict = 31,
    #[strum(message = "a camera gives no photograph that can be used")]
    Camera = 32,
    #[strum(message = "slides cannot be shown")]
    Display = 33,
    #[strum(message = "photographs cannot tell whether a table keeps its promise")]
    Inconclusive = 34,
    #[strum(message = "a device shows frames as they are instead of compensating them")]
    PassThrough = 35,
    #[strum(message = "a device with a key was not shown the right to do that")]
    NoRight = 36,
    #[strum(message = "photographs or a folder belong to another table")]
    OtherTable = 37,
    #[strum(message = "the player is missing, or a show went wrong")]
    Player = 38,
    #[strum(message = "there is no graphics processor to work with")]
    Gpu = 39,
}

impl From<&Rejected> for Kind {
    fn from(rejected: &Rejected) -> Self {
        match rejected {
            Rejected::Unsigned => Self::Unsigned,
            Rejected::WrongKey => Self::WrongKey,
            Rejected::Signature => Self::Signature,
            Rejected::Older { .. } => Self::OlderVersion,
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
                Refusal::Flash { .. } | Refusal::Wear { .. } => Self::Flash,
                Refusal::NoRight(_) => Self::NoRight,
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
    pub(super) const fn code(self) -> u8 {
        self as u8
    }

    pub(super) fn name(self) -> &'static str {
        self.into()
    }

    /// Every code with its name and its meaning.
    pub(super) fn codes() -> Vec<(u8, &'static str, &'static str)> {
        let code = |kind: Self| {
            let meaning = kind.get_message().unwrap_or_default();
            (kind.code(), kind.name(), meaning)
        };
        Self::iter().map(code).collect()
    }

    /// The list that `--help` ends with.
    pub(super) fn table() -> String {
        let mut text = String::from("Exit codes:\n   0  done");
        for (code, _, meaning) in Self::codes() {
            let _ = write!(text, "\n  {code:>2}  {meaning}");
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
    pub(super) active: Option<Box<Active>>,
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
            message: printable(&message.to_string()).into_owned(),
            next_step: printable(&next_step.into()).into_owned(),
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
        self.active = Some(Box::new(active));
        self
    }

    /// Which table is in use now, and what to do.
    pub(super) fn advice(&self) -> String {
        match &self.active {
            Some(active) => format!("{active}\n{}", self.next_step),
            None => self.next_step.clone(),
        }
    }

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

impl From<BuildError> for Failure {
    fn from(error: BuildError) -> Self {
        match error {
            BuildError::Capture(error) => error.into(),
            BuildError::Solve(error) => error.into(),
            BuildError::Compile(error) => error.into(),
            BuildError::Worse { .. } => Self::new(
                Kind::Solve,
                error,
                "Project as it is: an even, flat scene needs no table. If it is neither, take more \
                 Bernoulli photographs, or average several of each pattern.",
            ),
        }
    }
}

impl From<CaptureError> for Failure {
    /// Whether a capture cannot be read, is not well-formed, or shows bad light.
    fn from(error: CaptureError) -> Self {
        let kind = match &error {
            CaptureError::Io { .. } | CaptureError::NoManifest { .. } => Kind::Read,
            CaptureError::Asked { .. } => Kind::Usage,
            CaptureError::TooFewPhotographs { .. }
            | CaptureError::NoLight { .. }
            | CaptureError::Refused { .. }
            | CaptureError::ResponseUnknown { .. } => Kind::Photographs,
            _ => Kind::Capture,
        };
        let failure = Self::new(kind, &error, error.next_step());
        match &error {
            CaptureError::Refused { gates: found, .. } => {
                failure.with_result(json!({ "gates": gates(found) }))
            }
            _ => failure,
        }
    }
}

impl From<SolveError> for Failure {
    fn from(error: SolveError) -> Self {
        // The message of a solve error ends with what to do.
        let message = error.to_string();
        let (what, next_step) = message.rsplit_once("; ").unwrap_or((&message, ""));
        Self::new(Kind::Solve, what, format!("{}.", capitalised(next_step)))
    }
}

impl From<CompileError> for Failure {
    fn from(error: CompileError) -> Self {
        let kind = match error {
            CompileError::ReferenceWhite { .. } | CompileError::BeyondReach { .. } => Kind::Usage,
            _ => Kind::Solve,
        };
        Self::new(kind, &error, error.next_step())
    }
}

impl From<SplitTableError> for Failure {
    fn from(error: SplitTableError) -> Self {
        let next_step = match error {
            SplitTableError::Compile(error) => return error.into(),
            SplitTableError::Columns { .. } | SplitTableError::Unsaid => {
                "Give the number of projectors with --projectors."
            }
            SplitTableError::Projectors { .. } => "Leave --projectors away.",
            SplitTableError::Frames { .. } => {
                "Take the photographs again with `iltm patterns --projector WxH` of the wide frame, without a border."
            }
            SplitTableError::Split => "Give the table that `iltm solve` made of all projectors.",
            SplitTableError::NeighboursCells { .. } => "Give a larger --neighbours.",
        };
        Self::new(Kind::Usage, error, next_step)
    }
}

impl From<DemoError> for Failure {
    fn from(error: DemoError) -> Self {
        match error {
            DemoError::Folder(error) => error.into(),
            DemoError::Write(error) => cannot_write(&error.path, &error.source),
            DemoError::Build(error) => error.into(),
            DemoError::Video(error) => error.into(),
            DemoError::Report(error) => Self::new(
                Kind::Frames,
                error,
                "please report this: the demo brings all that it needs",
            ),
        }
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        let kind = match error {
            SessionError::Capture(error) => return error.into(),
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

impl From<PatternsError> for Failure {
    fn from(error: PatternsError) -> Self {
        match error {
            PatternsError::Folder(error) => error.into(),
            error => {
                let kind = match error {
                    PatternsError::Images { .. } => Kind::Read,
                    PatternsError::Image(_) | PatternsError::NoImages { .. } => Kind::Frames,
                    _ => Kind::Usage,
                };
                Self::new(kind, &error, error.next_step())
            }
        }
    }
}

impl From<VerifyError> for Failure {
    fn from(error: VerifyError) -> Self {
        let kind = match error {
            VerifyError::Folder(error) => return error.into(),
            VerifyError::Video(error) => return error.into(),
            VerifyError::Capture(error) => return error.into(),
            VerifyError::Slides(_) => Kind::Usage,
            VerifyError::NoManifest { .. } => Kind::Read,
            VerifyError::Order { .. }
            | VerifyError::Map(_)
            | VerifyError::TooFewCells { .. }
            | VerifyError::Unrecognised { .. }
            | VerifyError::NoCards { other: None, .. } => Kind::Photographs,
            VerifyError::OtherTable { .. }
            | VerifyError::NoCards { other: Some(_), .. }
            | VerifyError::NotOfTable { .. }
            | VerifyError::Grid { .. } => Kind::OtherTable,
            VerifyError::Untold { .. } => Kind::Table,
            VerifyError::Photographed { .. } => Kind::Write,
            VerifyError::Overexposed { .. } | VerifyError::Refused { .. } => Kind::Inconclusive,
            VerifyError::Compile(error) => return error.into(),
            VerifyError::Missing { .. }
            | VerifyError::NotFine
            | VerifyError::Unpaired { .. }
            | VerifyError::NoImages { .. }
            | VerifyError::Picture { .. }
            | VerifyError::Before { .. }
            | VerifyError::Channels { .. } => Kind::Capture,
        };
        Self::new(kind, &error, error.next_step())
    }
}

impl From<VideoError> for Failure {
    fn from(error: VideoError) -> Self {
        let kind = match &error {
            VideoError::NoSuchTier { .. }
            | VideoError::Threads { .. }
            | VideoError::Still
            | VideoError::NothingToFit => Kind::Usage,
            VideoError::Table(_) => Kind::Table,
            VideoError::Gpu { .. } | VideoError::WithoutGpu => Kind::Gpu,
            VideoError::File { .. }
            | VideoError::Y4m(Y4mError::Write { .. })
            | VideoError::Png(PngError::Write { .. }) => Kind::Write,
            VideoError::Open { .. }
            | VideoError::Read { .. }
            | VideoError::Y4m(Y4mError::Read { .. })
            | VideoError::Png(PngError::Read { .. }) => Kind::Read,
            _ => Kind::Frames,
        };
        Self::new(kind, &error, error.next_step())
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        let kind = match error.problem {
            SceneProblem::Io(_) => Kind::Read,
            _ => Kind::Scene,
        };
        Self::new(kind, &error, error.next_step())
    }
}

impl From<SimulationError> for Failure {
    fn from(error: SimulationError) -> Self {
        Self::new(Kind::Scene, &error, error.next_step())
    }
}

impl From<CaptureFolderError> for Failure {
    fn from(error: CaptureFolderError) -> Self {
        match error {
            CaptureFolderError::Simulation(error) => error.into(),
            CaptureFolderError::Folder(error) => error.into(),
        }
    }
}

impl From<PoseError> for Failure {
    fn from(error: PoseError) -> Self {
        match error {
            PoseError::Capture(error) => error.into(),
            PoseError::Folder(error) => error.into(),
        }
    }
}

impl From<FolderError> for Failure {
    fn from(error: FolderError) -> Self {
        match error {
            FolderError::Taken { .. } | FolderError::Foreign { .. } => Self::new(
                Kind::Write,
                error,
                "Choose another folder, or move that one away.",
            ),
            FolderError::Io { path, source } => cannot_write(&path, &source),
        }
    }
}

impl From<LogsError> for Failure {
    fn from(error: LogsError) -> Self {
        let next_step = "Give the ELF file that the device's firmware was flashed from.";
        Self::new(Kind::Read, error, next_step)
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

pub(super) fn cannot_write(path: &Path, error: &io::Error) -> Failure {
    let next_step = match error.kind() {
        io::ErrorKind::StorageFull => "Free some space and run the command again.",
        io::ErrorKind::PermissionDenied => "Choose a folder that you may write to.",
        io::ErrorKind::NotFound => "Make the folder first, or choose another.",
        io::ErrorKind::IsADirectory => "Name a file.",
        _ => "Check the folder and run the command again.",
    };
    let message = format!("{}: cannot be written: {error}", path.display());
    Failure::new(Kind::Write, message, next_step)
}

pub(super) fn cannot_read(path: &Path, error: &io::Error) -> Failure {
    let message = format!("{}: cannot be read: {error}", path.display());
    Failure::new(Kind::Read, message, "Check the name and the permissions.")
}
