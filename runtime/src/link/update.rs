//! Update messages: tables on their way into a device.
//!
//! The order of variants and fields is the wire format: do not reorder.

use super::message::TableReason;
use super::status::{FrameKind, SlotState, TableName};
use crate::image::Label;
use crate::trust::KEY_ID;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Most sectors in one [`Sectors`].
pub const MAX_SECTORS: usize = 16;

/// What tells one file from another: the first 16 bytes of its SHA-512.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Digest(pub [u8; 16]);

impl Digest {
    /// The first 16 bytes of a SHA-512.
    #[must_use]
    pub fn of(hash: &[u8]) -> Self {
        Self(hash.first_chunk().copied().unwrap_or_default())
    }

    /// What the chunks of the file are marked with: its first four bytes,
    /// little-endian.
    #[must_use]
    pub const fn transfer(&self) -> u32 {
        let [a, b, c, d, ..] = self.0;
        u32::from_le_bytes([a, b, c, d])
    }
}

/// What is in the slots, and who may change it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Slots {
    /// Slot A, then slot B.
    pub slots: [SlotInfo; 2],
    /// Index of the slot that the next table goes to.
    pub target: u8,
    /// Milliseconds that the table in use is still on trial; 0 if it is not.
    pub trial_ms: u32,
    /// Tables of a lower version than this are refused; [`u32::MAX`] without a key where
    /// the device has lost it and takes none.
    pub oldest: u32,
    /// First bytes of the public key that tables must be signed for; without one
    /// the device takes every whole table.
    pub key: Option<[u8; KEY_ID]>,
    /// The device's own number, 0 if it has none.
    pub device: u64,
    /// Bytes that are compared, erased and sent as one.
    pub sector: u32,
    /// Times that a sector of the commit records has been erased.
    pub record_erases: u32,
    /// What a [right](crate::trust::allows) must be signed for.
    pub sequence: u32,
    /// The last trial since the start that ended without confirmation, if no other one
    /// has begun.
    pub ended: Option<EndedTrial>,
}

/// A trial that ended without confirmation.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct EndedTrial {
    /// [`TableName::id`] of the table.
    pub table: u32,
    /// Why it ended.
    pub reason: TableReason,
    /// Milliseconds since then.
    pub ago_ms: u32,
}

/// What is in a slot.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct SlotInfo {
    /// Its state.
    pub state: SlotState,
    /// The table in it, if it is whole.
    pub table: Option<TableName>,
    /// Bytes of the table's file.
    pub length: u32,
    /// Times that a sector of it has been erased, as far as known.
    pub erases: u32,
    /// What the table in it is called and takes, if it is whole.
    pub about: Option<TableAbout>,
}

/// What a device shows of a table beside its [`TableName`].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct TableAbout {
    /// For people.
    pub label: Label,
    /// The smallest frames that it takes.
    pub frames: FrameKind,
}

/// CRC-32 of what sectors hold.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Sectors {
    /// Index of the first.
    pub first: u32,
    /// Of each; fewer at the end of the table.
    pub crcs: Vec<u32, MAX_SECTORS>,
}

/// How the device wants a file.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Receiving {
    /// Index of the slot that it goes to.
    pub slot: u8,
    /// Bytes of a chunk.
    pub chunk: u16,
    /// Chunks that may be on their way at once.
    pub window: u8,
}

/// The table that is in use.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct InUse {
    /// The table; none passes frames through.
    pub table: Option<TableName>,
    /// Milliseconds that it is still on trial; 0 if it is not.
    pub trial_ms: u32,
}
