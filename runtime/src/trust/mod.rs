//! Trust: who signed a table, and whether it may run here.
//!
//! [`examine`] is the one gate: before a new table becomes active, and again for what
//! lies in flash at every start. What a device demands is its [`Terms`]; a device
//! that was never given a key demands only that the table is whole.

mod admission;
mod ed25519;
mod rejected;
mod right;

#[cfg(test)]
mod ed25519_tests;
#[cfg(test)]
mod tests;

pub use admission::{admit, examine};
pub use rejected::Rejected;
pub use right::{Certificate, Deed, NoRight, SIGNATURE, allows};

use crate::Grid;
use crate::image::{Label, Seal};

/// Bytes of a key that name it.
pub const KEY_ID: usize = 8;

/// What a device is provisioned with.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Trust {
    /// Ed25519 public key that tables must be signed with. Without one, every whole
    /// table is taken: signed or not, of any version, for any device.
    pub key: Option<[u8; 32]>,
    /// The device's own number; tables for another are refused.
    pub device: u64,
}

impl Trust {
    /// What names the key.
    #[must_use]
    pub fn key_id(&self) -> Option<[u8; KEY_ID]> {
        self.key.as_ref().map(Seal::key_id)
    }
}

/// What a table must meet to run on a device now.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Terms {
    /// What the device is provisioned with.
    pub trust: Trust,
    /// Oldest version that is taken: the largest
    /// [`oldest`](crate::image::Seal::oldest) of the tables confirmed so far.
    pub floor: u32,
}

/// What is known of a file that was admitted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Accepted {
    /// What tells its table from others ([`Table::id`](crate::image::Table::id)).
    pub id: u32,
    /// Version of the table as its seal states it; 0 without a seal.
    pub version: u32,
    /// The floor that it brings once it is confirmed; 0 if nobody vouches for it,
    /// because the device has no key: a stranger must not revoke tables.
    pub oldest: u32,
    /// Bytes of the file, its seal included.
    pub length: u32,
    /// The table's grid.
    pub grid: Grid,
    /// The table's colour channels.
    pub channels: u8,
    /// What people call the table.
    pub label: Label,
}
