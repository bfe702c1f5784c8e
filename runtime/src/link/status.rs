//! Status messages: tables, frames, faults and counters of a device.
//!
//! The order of variants and fields is the wire format: do not reorder.

use super::message::Version;
use crate::frame_buffers::{AttachError, Broken};
use crate::trust::Rejected;
use crate::units::ClippedSamples;
use core::fmt;
use heapless::String;
use serde::{Deserialize, Serialize};

/// Longest name of a board, bytes.
pub const MAX_NAME: usize = 32;

/// Name of a board.
pub type Name = String<MAX_NAME>;

/// All that a device knows of itself. Counters start at zero when it starts.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Status {
    /// Version of the firmware.
    pub firmware: Version,
    /// Name of the board.
    pub board: Name,
    /// Milliseconds since it started.
    pub uptime_ms: u64,
    /// The table in use.
    pub table: Option<TableName>,
    /// What it does with frames.
    pub mode: Mode,
    /// Tier of the last frame.
    pub tier: u8,
    /// The table's most accurate tier.
    pub top_tier: u8,
    /// What became of the frames.
    pub frames: FrameCounts,
    /// Samples that the projector cannot show.
    pub clipping: Clipping,
    /// How long frames took.
    pub frame_time: FrameTime,
    /// The table slots.
    pub slots: [SlotState; 2],
    /// What went wrong last.
    pub last_fault: Option<Fault>,
    /// Depth of the stack.
    pub stack: Stack,
    /// Times that the watchdog restarted the device since it was switched on.
    pub watchdog_resets: u32,
    /// Trouble on this line.
    pub serial: SerialCounts,
    /// The frames that come in; `None` before a source has announced any.
    pub input: Option<FrameKind>,
}

/// Frames of a size and channels: those that come in, or the least that a table takes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct FrameKind {
    /// Pixels in a row.
    pub width: u16,
    /// Rows.
    pub height: u16,
    /// Samples of a pixel, 1 or 3.
    pub channels: u8,
}

impl fmt::Display for FrameKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            width,
            height,
            channels,
        } = self;
        let colour = if *channels == 1 { "grey" } else { "colour" };
        write!(f, "{colour} frames of {width} x {height}")
    }
}

/// What tells one table from another.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct TableName {
    /// CRC-32 in its header, which covers those of all sections.
    pub id: u32,
    /// Its version; 0 if it has none.
    pub version: u32,
}

impl fmt::Display for TableName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.version {
            0 => write!(f, "{:08x}, unsigned", self.id),
            version => write!(f, "{:08x}, version {version}", self.id),
        }
    }
}

/// What a device does with frames.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Mode {
    /// It compensates them.
    Compensating,
    /// It shows them as they are.
    PassThrough(PassThrough),
    /// It compensates the light of its own projector alone: none of its neighbours' has come.
    Alone,
}

/// Why frames are shown as they are.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum PassThrough {
    /// There is no table.
    NoTable,
    /// There is one, but it is damaged or not for this firmware.
    BrokenTable,
    /// The frames are smaller than the table's grid, of other channels, or larger and
    /// the firmware was built without that stage.
    OtherFrames,
    /// The table needs more memory than the device has.
    Memory,
    /// The device crashed or hung with the table at one start after the other.
    CrashLoop,
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Compensating => f.write_str("compensating"),
            Self::PassThrough(why) => write!(f, "pass-through: {why}"),
            Self::Alone => {
                f.write_str("compensating its own light alone: its neighbours are silent")
            }
        }
    }
}

impl fmt::Display for PassThrough {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoTable => "there is no table",
            Self::BrokenTable => "the table cannot be used",
            Self::OtherFrames => "the table is for other frames",
            Self::Memory => "the table needs more memory than there is",
            Self::CrashLoop => "the device crashed with the table three times in a row",
        })
    }
}

/// What became of the frames. Each stops at the largest number.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct FrameCounts {
    /// Came in.
    pub received: u32,
    /// Went out.
    pub shown: u32,
    /// Were not there when they were due.
    pub late: u32,
    /// Were numbered by the source and never seen.
    pub dropped: u32,
    /// Were torn, short or stale, and not shown.
    pub broken: u32,
}

/// Samples that were wanted brighter or darker than the projector can show.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Clipping {
    /// In the last frame.
    pub last: ClippedSamples,
    /// At black, in all frames.
    pub black: u64,
    /// At white, in all frames.
    pub white: u64,
    /// Samples of a frame, clipped or not.
    pub samples: u32,
}

/// Microseconds from a frame taken to its compensated frame handed on.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct FrameTime {
    /// Of the last frame.
    pub last_us: u32,
    /// Moving mean.
    pub mean_us: u32,
    /// Longest.
    pub worst_us: u32,
    /// What a frame may take.
    pub budget_us: u32,
}

/// What is in a table slot.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum SlotState {
    /// Nothing.
    Empty,
    /// A whole table that was confirmed, not in use.
    Valid,
    /// Something that is no table.
    Broken,
    /// The table in use.
    Active,
    /// The table in use, until it is confirmed or its time is over.
    Trial,
    /// A whole table that nobody has confirmed, not in use.
    Unconfirmed,
}

impl fmt::Display for SlotState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Empty => "empty",
            Self::Valid => "valid",
            Self::Broken => "broken",
            Self::Active => "active",
            Self::Trial => "trial",
            Self::Unconfirmed => "unconfirmed",
        })
    }
}

/// Bytes of stack.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Stack {
    /// Most that were ever in use.
    pub used: u32,
    /// All.
    pub size: u32,
}

/// Trouble on the serial line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct SerialCounts {
    /// Times that something other than a frame stood between delimiters.
    pub bad: u32,
    /// Frames that were not sent because the line was busy.
    pub unsent: u32,
}

/// Something that went wrong.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Fault {
    /// A slot's table was refused.
    Table {
        /// Index of the slot.
        slot: u8,
        /// Why.
        cause: Rejected,
    },
    /// A frame was not shown.
    Frame {
        /// Its number.
        sequence: u32,
        /// Why.
        cause: FaultyFrame,
    },
    /// The source announced frames that the device cannot take.
    Source(SourceFault),
    /// The watchdog restarted the device.
    Watchdog,
    /// The firmware stopped itself and started anew: a defect.
    Crash,
    /// The device was given a key that it cannot read any more: it takes no table.
    KeyLost,
    /// A frame came without the light of the neighbours, which the table takes.
    Neighbours {
        /// Number of the first such frame.
        sequence: u32,
    },
}

/// Why a frame is not shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum FaultyFrame {
    /// It changed while it was read.
    Torn,
    /// It is incomplete.
    Short,
    /// It is not newer than the last.
    Stale,
    /// The source changed its format.
    Superseded,
}

/// Why the frames of a source cannot be taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum SourceFault {
    /// It has another version of the frame memory.
    Version,
    /// There are no such frames.
    Format,
    /// They do not fit in the frame memory.
    TooLarge,
}

impl From<Broken> for FaultyFrame {
    fn from(broken: Broken) -> Self {
        match broken {
            Broken::Torn => Self::Torn,
            Broken::Short => Self::Short,
            Broken::Stale => Self::Stale,
            Broken::Superseded => Self::Superseded,
        }
    }
}

impl SourceFault {
    /// The fault behind an error; `None` where there merely is no source.
    #[must_use]
    pub const fn of(error: &AttachError) -> Option<Self> {
        Some(match error {
            AttachError::NoSource => return None,
            AttachError::Version { .. } => Self::Version,
            AttachError::Format => Self::Format,
            AttachError::Region(_) => Self::TooLarge,
        })
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Table { slot, cause } => {
                write!(f, "slot {}: {cause}", if *slot == 0 { 'A' } else { 'B' })
            }
            Self::Frame { sequence, cause } => write!(f, "frame {sequence} {cause}"),
            Self::Source(cause) => write!(f, "the source of frames {cause}"),
            Self::Watchdog => f.write_str("the watchdog restarted the device"),
            Self::Crash => f.write_str("the firmware crashed and started anew"),
            Self::KeyLost => f.write_str("the key cannot be read: no table is taken"),
            Self::Neighbours { sequence } => {
                write!(
                    f,
                    "frame {sequence} came without the light of the neighbours"
                )
            }
        }
    }
}

impl fmt::Display for FaultyFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Torn => "changed while it was read",
            Self::Short => "is incomplete",
            Self::Stale => "is not newer than the one before",
            Self::Superseded => "was of another format",
        })
    }
}

impl fmt::Display for SourceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Version => "has another version of the frame memory",
            Self::Format => "announces frames that there cannot be",
            Self::TooLarge => "announces frames that do not fit in the frame memory",
        })
    }
}
