//! Serial link between a host and a device.
//!
//! ```text
//! bytes -> Decoder -> LinkFrame {channel, sequence, payload} -> Request | Response | Event | log bytes
//! ```
//!
//! A host asks and a device answers; the device sends nothing else unless the
//! host has subscribed to it, and stops when the host falls silent. [`Session`]
//! is the device's side as a state machine without input or output of its own;
//! `docs/protocol.md` is the specification for whoever writes another client.
//!
//! Nothing here trusts a length, allocates or panics, whatever the bytes.

mod decoder;
mod frame;
mod message;
mod outbox;
mod session;
#[cfg(test)]
mod session_tests;
mod status;
#[cfg(test)]
mod test_device;
#[cfg(test)]
mod tests;
mod update;

pub use decoder::Decoder;
pub use frame::{
    Channel, DELIMITER, LinkFrame, LinkFrameError, MAX_ENCODED, MAX_FRAME, MAX_PAYLOAD,
};
pub use message::{
    Event, Hello, Limits, PROTOCOL_VERSION, Refusal, Request, Response, TableReason, TierReason,
    Version,
};
pub use outbox::Outbox;
pub use session::{Device, LAPSE_MS, MIN_PERIOD_MS, OUTBOX, Session};
pub use status::{
    Clipping, Fault, FaultyFrame, FrameCounts, FrameKind, FrameTime, MAX_NAME, Mode, Name,
    PassThrough, SerialCounts, SlotState, SourceFault, Stack, Status, TableName,
};
pub use update::{
    Digest, EndedTrial, InUse, MAX_SECTORS, Receiving, Sectors, SlotInfo, Slots, TableAbout,
};
