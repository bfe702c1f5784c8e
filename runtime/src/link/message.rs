//! What host and device say to each other.
//!
//! Messages are postcard (version 1 of its wire format): integers as varints,
//! an enum as the number of its variant and then its fields. **The order of
//! variants and fields is the wire format: do not reorder.** New variants go at
//! the end; any other change needs a new [`PROTOCOL_VERSION`].

use super::status::{Fault, Name, Status};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Version of the messages here. [`Request::Hello`] and [`Response::Hello`] stay
/// as they are in every version, so that any two can find out that they differ.
pub const PROTOCOL_VERSION: u16 = 1;

/// What a host asks. Every request may be repeated without harm.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Request {
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
}

impl Request {
    /// Number of variants: what is not below it is of a later version.
    const VARIANTS: u8 = 3;

    /// Reads the payload of a request.
    ///
    /// # Errors
    /// [`Refusal::Unknown`] or [`Refusal::Malformed`].
    pub fn parse(payload: &[u8]) -> Result<Self, Refusal> {
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
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::HelloFirst => "the device has started anew and waits for a hello",
            Self::Unknown => "the device's firmware does not know the request",
            Self::Malformed => "the device cannot read the request",
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
