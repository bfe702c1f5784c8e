//! Table store: two slots in NOR flash, and updates that may be cut anywhere.
//!
//! ```text
//! Request -> Updater -> Response
//!            |     \
//!            |      TableSlots: checked tables, and which one frames go through
//!            flash: slot A | slot B | commit records | identity
//! ```
//!
//! What makes a power cut harmless, in the order of an update:
//!
//! 1. Chunks go to the slot that is *not* in use. Nothing says that there is a table
//!    in it, so however it is cut, the next start uses the other one.
//! 2. A table that has arrived is checked ([`TableSlots::load`]) and used on trial. That
//!    is written nowhere: a restart ends the trial.
//! 3. Confirming writes one commit record. A record counts only when its CRC-32
//!    holds; until then the record before it does.
//! 4. Records go to two sectors in turn. The one that is erased is never the one
//!    with the record that counts.
//! 5. The device's key is written once, before a commit record says that it is there; see
//!    `identity` for what a start makes of one that it cannot read.
//!
//! A transfer that was cut goes on where it stopped, because a host asks for the
//! CRC-32 of every sector and sends those that differ; nothing about a transfer is
//! stored either.

mod error;
mod flash;
mod identity;
mod journal;
mod map;
mod record;
mod transfer;
mod updater;
mod wear;

pub use error::StoreError;
pub use identity::identity_record;
pub use map::{MAX_CHUNK, Map, MapError};
pub use record::RECORD;
pub use updater::{TableChange, Updater};

use crate::link::PassThrough;
use crate::trust::{Accepted, Rejected, Terms};

/// A table slot.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Slot {
    /// The first.
    A = 0,
    /// The second.
    B = 1,
}

impl Slot {
    /// Both.
    pub const ALL: [Self; 2] = [Self::A, Self::B];

    /// The other one.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }

    /// 0 or 1.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The item of this slot.
    #[must_use]
    pub const fn of<T>(self, [a, b]: &[T; 2]) -> &T {
        match self {
            Self::A => a,
            Self::B => b,
        }
    }

    /// The item of this slot.
    pub const fn of_mut<T>(self, [a, b]: &mut [T; 2]) -> &mut T {
        match self {
            Self::A => a,
            Self::B => b,
        }
    }
}

/// Where checked tables are kept, one a slot, and where frames are worked on.
pub trait TableSlots<F> {
    /// Checks the file of `length` bytes in a slot with
    /// [`examine`](crate::trust::examine); where nobody has noted the length,
    /// [`content`](crate::image::content) tells it. Frames go on with the table in use,
    /// and nothing else is kept or forgotten.
    ///
    /// # Errors
    /// [`Rejected`].
    fn examine(
        &mut self,
        flash: &F,
        slot: Slot,
        length: Option<u32>,
        terms: &Terms,
    ) -> Result<Accepted, Rejected>;

    /// The same, and its table is kept.
    ///
    /// # Errors
    /// [`Rejected`]; nothing is kept for the slot then.
    fn load(
        &mut self,
        flash: &F,
        slot: Slot,
        length: Option<u32>,
        terms: &Terms,
    ) -> Result<Accepted, Rejected>;

    /// Forgets the table of a slot: its bytes are about to change. It is not the one
    /// in use.
    fn unload(&mut self, slot: Slot);

    /// Frames go through the table of this slot from the next one on, or pass
    /// unchanged.
    fn select(&mut self, table: Result<Slot, PassThrough>);

    /// Called now and then while something takes long.
    fn yield_now(&mut self);
}
