//! stub
use core::fmt;
use serde::{Deserialize, Serialize};
/// Bytes of a key's name.
pub const KEY_ID: usize = 8;
/// s
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Rejected {
    /// s
    NotATable,
    /// s
    Damaged,
    /// s
    Older {
        /// s
        version: u32,
        /// s
        floor: u32,
    },
}
impl fmt::Display for Rejected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("s")
    }
}
/// s
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Trust {
    /// s
    pub key: Option<[u8; 32]>,
    /// s
    pub device: u64,
}
/// s
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Terms {
    /// s
    pub trust: Trust,
    /// s
    pub floor: u32,
}
/// s
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Accepted {
    /// s
    pub id: u32,
    /// s
    pub version: u32,
    /// s
    pub oldest: u32,
    /// s
    pub length: u32,
}

impl Trust {
    /// s
    #[must_use]
    pub fn key_id(&self) -> Option<[u8; KEY_ID]> {
        self.key.as_ref().and_then(|key| key.first_chunk().copied())
    }
}
