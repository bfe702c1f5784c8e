//! Messages between host and device: requests, responses, refusals, events.
//!
//! Messages are postcard (version 1 of its wire format): integers as varints,
//! an enum as the number of its variant and then its fields. **The order of
//! variants and fields is the wire format: do not reorder.** New variants go at
//! the end; any other change needs a new [`PROTOCOL_VERSION`].

use super::status::{Fault, Name, Status, TableName};
use super::update::{Digest, InUse, Receiving, Sectors, Slots};
use crate::trust::{NoRight, Rejected};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Version of the messages here. [`Request::Hello`] and [`Response::Hello`] stay
/// as they are in every version, so that any two can find out that they differ.
pub const PROTOCOL_VERSION: u16 = 2;

/// What a host asks. Every request may be repeated without harm.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Request<'a> {
    /// Starts a conversation, and ends what an earlier host had subscribed to.
    /// Answered by [`Response::Hello`].
    Hello {
        /// The host's [`PROTOCOL_VERSION`].
        protocol: u16,
    },
    /// Answered by [`Response::Status`].
    Status,
    /// Asks for [`Event`]s and logs, or no longer. Answered by
    /// [`Response::Subscribed`].
    Subscribe {
        /// Milliseconds between two [`Event::Status`]; 0 ends the subscription.
        period_ms: u16,
    },
    /// Answered by [`Response::Slots`].
    Slots,
    /// Asks what is in the slot that the next table would go to, so that only what
    /// differs is sent. Answered by [`Response::Sectors`].
    Sectors {
        /// Bytes of the table: the CRC of its last sector ends with it.
        length: u32,
        /// Index of the first sector.
        first: u32,
    },
    /// A table is about to come. Whatever was received of another one is forgotten;
    /// what was received of this one stays. Answered by [`Response::Receiving`].
    Begin {
        /// Bytes of the file, seal included.
        length: u32,
        /// Of the file.
        digest: Digest,
        /// The [right](crate::trust::allows) to do so, where the device has a key.
        #[serde(borrow)]
        right: &'a [u8],
    },
    /// A chunk of it. Answered by [`Response::Written`] when the flash holds it.
    Write {
        /// [`Digest::transfer`] of the file.
        transfer: u32,
        /// Of its first byte: a multiple of [`Receiving::chunk`].
        offset: u32,
        /// [`Receiving::chunk`] bytes, or fewer up to the end of the file.
        #[serde(borrow)]
        bytes: &'a [u8],
    },
    /// Checks what was received and uses it from the next frame on, on trial.
    /// Answered by [`Response::InUse`].
    Activate {
        /// [`Digest::transfer`] of the file.
        transfer: u32,
        /// Seconds until the device goes back by itself, if nobody confirms.
        trial_s: u16,
    },
    /// Keeps the table that is on trial. Answered by [`Response::InUse`].
    Confirm {
        /// [`TableName::id`] of the table.
        table: u32,
        /// The right to do so, where the device has a key.
        #[serde(borrow)]
        right: &'a [u8],
    },
    /// Goes back to the table before: that of the other slot. Answered by
    /// [`Response::InUse`].
    Rollback {
        /// [`TableName::id`] of the table that is to go.
        table: u32,
        /// The right to do so, where the device has a key.
        #[serde(borrow)]
        right: &'a [u8],
    },
    /// Gives a new device its key and its number, once and for all. Answered by
    /// [`Response::Provisioned`].
    Provision {
        /// Ed25519 public key.
        key: [u8; 32],
        /// The device's number; 0 for none.
        device: u64,
        /// Also where the table in use would be refused from the next start on.
        even_so: bool,
    },
}

impl<'a> Request<'a> {
    /// Number of variants: what is not below it is of a later version.
    const VARIANTS: u8 = 11;

    /// Reads the payload of a request.
    ///
    /// # Errors
    /// [`Refusal::Unknown`] or [`Refusal::Malformed`].
    pub fn parse(payload: &'a [u8]) -> Result<Self, Refusal> {
        match postcard::take_from_bytes(payload) {
            Ok((request, [])) => Ok(request),
            _ if payload.first().is_some_and(|kind| *kind >= Self::VARIANTS) => {
                Err(Refusal::Unknown)
            }
            _ => Err(Refusal::Malformed),
        }
    }
}

/// What a device answers.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Response {
    /// Who it is.
    Hello(Hello),
    /// How it is.
    Status(Status),
    /// What it will send by itself.
    Subscribed {
        /// Milliseconds between two [`Event::Status`], perhaps more than was asked
        /// for; 0: nothing.
        period_ms: u16,
        /// Milliseconds of silence of the host after which it stops.
        lapse_ms: u16,
    },
    /// The request was not carried out.
    Refused(Refusal),
    /// What is in the slots.
    Slots(Slots),
    /// What is in some sectors.
    Sectors(Sectors),
    /// The device is ready for chunks.
    Receiving(Receiving),
    /// The flash holds the chunk.
    Written,
    /// The table that is in use now.
    InUse(InUse),
    /// The device has the key and the number.
    Provisioned,
}

/// Why a request is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Refusal {
    /// There was no [`Request::Hello`] since the device started: it may be another
    /// one, or have another version than before.
    HelloFirst,
    /// The device does not know the request.
    Unknown,
    /// The request's fields cannot be read.
    Malformed,
    /// No such transfer has begun since the device started.
    NoTransfer,
    /// The table is longer than a slot.
    TooLong {
        /// Bytes of a slot.
        limit: u32,
    },
    /// A table is on trial: it must be confirmed or rolled back first.
    OnTrial,
    /// A chunk that is not one of the file's.
    Chunk,
    /// The flash does not hold what was written to it.
    Flash {
        /// Where in the slot.
        offset: u32,
    },
    /// Not everything of the file has come, or not as it is.
    Incomplete,
    /// The table must not be used.
    Table(Rejected),
    /// Another table is in use than the request is about.
    NotInUse {
        /// The one that is.
        table: Option<TableName>,
    },
    /// There is no table to go back to.
    NoOther,
    /// The device has another key or number already.
    HasKey,
    /// The device cannot be updated.
    ReadOnly,
    /// The device was given a key that it cannot read any more: it takes no table.
    KeyLost,
    /// The device has a key, and the request does not show the right to do that.
    NoRight(NoRight),
    /// The flash has been erased too often since the start.
    Wear {
        /// Seconds until the next erase is allowed.
        wait_s: u32,
    },
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::HelloFirst => "the device has started anew and waits for a hello",
            Self::Unknown => "the device's firmware does not know the request",
            Self::Malformed => "the device cannot read the request",
            Self::NoTransfer => "the device does not know the transfer",
            Self::TooLong { limit } => {
                return write!(f, "the device has room for tables of {limit} bytes");
            }
            Self::OnTrial => "another table is on trial",
            Self::Chunk => "the chunk does not belong to the table",
            Self::Flash { offset } => {
                return write!(
                    f,
                    "the flash does not hold what is written to byte {offset}"
                );
            }
            Self::Incomplete => "not all of the table has arrived as it is",
            Self::Table(rejected) => return write!(f, "{rejected}"),
            Self::NotInUse { table: None } => "no table is in use",
            Self::NotInUse { table: Some(table) } => {
                return write!(f, "table {table} is in use");
            }
            Self::NoOther => "there is no other table",
            Self::HasKey => "the device has another key or number",
            Self::ReadOnly => "the device cannot be updated",
            Self::KeyLost => "the device cannot read its key and takes no table",
            Self::NoRight(cause) => return write!(f, "{cause}"),
            Self::Wear { wait_s } => {
                return write!(
                    f,
                    "the flash has been erased too often since the start; the next erase is allowed in {wait_s} s"
                );
            }
        })
    }
}

impl core::error::Error for Refusal {}

/// Who a device is and what it can take.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Hello {
    /// Its [`PROTOCOL_VERSION`].
    pub protocol: u16,
    /// Version of its firmware.
    pub firmware: Version,
    /// Name of its board.
    pub board: Name,
    /// The device's own number; 0 if it has none.
    pub device: u64,
    /// The [format version](crate::image::layout::FORMAT_VERSION) of tables that
    /// it reads.
    pub table_format: u16,
    /// Most bytes of a payload that it takes and sends.
    pub max_payload: u16,
    /// What it has room for.
    pub limits: Limits,
}

/// What a device has room for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Limits {
    /// Most cells of a table's grid.
    pub cells: u32,
    /// Most bytes of a frame.
    pub frame_bytes: u32,
    /// Most bytes of a table.
    pub table_bytes: u32,
}

/// What a device says by itself while a host is subscribed.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Event {
    /// How it is, once a period.
    Status(Status),
    /// The governor chose another tier.
    TierChanged {
        /// Tier until now.
        from: u8,
        /// Tier from now on.
        to: u8,
        /// Why.
        reason: TierReason,
        /// Number of the first frame with the new tier.
        frame: u32,
    },
    /// Something went wrong.
    Fault(Fault),
    /// Another table is in use, or the same one for another reason.
    TableChanged {
        /// The table; none passes frames through.
        table: Option<TableName>,
        /// Why.
        reason: TableReason,
        /// Number of the first frame with it.
        frame: u32,
    },
}

/// Why the table in use changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum TableReason {
    /// It is on trial.
    Trial,
    /// It has been confirmed.
    Confirmed,
    /// The trial of the other one ended without confirmation.
    TrialOver,
    /// A host went back to it.
    RolledBack,
    /// The other one was damaged while it was in use.
    Damaged,
}

impl fmt::Display for TableReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Trial => "on trial",
            Self::Confirmed => "confirmed",
            Self::TrialOver => "nobody confirmed the other one",
            Self::RolledBack => "rolled back",
            Self::Damaged => "the other one is damaged",
        })
    }
}

/// Why the tier changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum TierReason {
    /// A frame took longer than the budget.
    OverBudget,
    /// There has been time to spare for long enough.
    TimeToSpare,
    /// Another table, or frames of another kind.
    NewStart,
}

impl fmt::Display for TierReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OverBudget => "a frame took longer than the budget",
            Self::TimeToSpare => "there is time to spare",
            Self::NewStart => "another table or other frames",
        })
    }
}

/// Version of a firmware.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct Version {
    /// Changes when something stops working as before.
    pub major: u16,
    /// Changes when something is added.
    pub minor: u16,
    /// Changes with every other release.
    pub patch: u16,
}

impl Version {
    /// The version of this crate, which firmware and host tools share.
    pub const CURRENT: Self = Self {
        major: number(env!("CARGO_PKG_VERSION_MAJOR")),
        minor: number(env!("CARGO_PKG_VERSION_MINOR")),
        patch: number(env!("CARGO_PKG_VERSION_PATCH")),
    };
}

/// Cargo sets the parts of a version to decimal numbers.
const fn number(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => u16::MAX,
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}
