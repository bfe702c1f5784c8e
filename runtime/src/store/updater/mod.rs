//! Updater: transfer, trial, confirmation, and the way back.
//!
//! | what | file |
//! |---|---|
//! | what a start finds | `start` |
//! | what each request does | `requests` |
//! | the slot in use, the trial, the record that counts | `state` |

mod requests;
mod start;
mod state;

use super::journal::Journal;
use super::record::Identity;
use super::transfer::Transfer;
use super::wear::WearLimit;
use super::{Map, Slot, TableSlots};
use crate::link::{Fault, Refusal, Request, Response, SlotState, TableName, TableReason};
use crate::trust::{Accepted, Rejected, Trust};
use embedded_storage::nor_flash::NorFlash;

/// Both slots, the records, and what a host may do with them.
#[derive(Clone, Debug)]
pub struct Updater<F> {
    flash: F,
    map: Map,
    trust: Trust,
    /// Whether the device was given a key that cannot be read: it takes no table.
    has_lost_key: bool,
    journal: Journal,
    /// Sectors erased so far: slot A, slot B, records.
    erases: [u32; 3],
    tables: [Option<Accepted>; 2],
    broken: [bool; 2],
    in_use: Option<Slot>,
    /// The slot of a table that is not used because the device crashed with it.
    suspect: Option<Slot>,
    /// When sectors were compared last.
    compared_ms: Option<u64>,
    transfer: Option<Transfer>,
    trial: Option<Trial>,
    ended: Option<Ended>,
    wear: WearLimit,
    fault: Option<Fault>,
    change: Option<TableChange>,
}

/// A table in use that nobody has confirmed.
#[derive(Clone, Copy, Debug)]
struct Trial {
    ends_ms: u64,
    transfer: u32,
    /// What frames go through when it ends.
    before: Option<Slot>,
}

/// A trial that ended without confirmation.
#[derive(Clone, Copy, Debug)]
struct Ended {
    table: u32,
    reason: TableReason,
    at_ms: u64,
}

/// Another table in use.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TableChange {
    /// It; none passes frames through.
    pub table: Option<TableName>,
    /// Why.
    pub reason: TableReason,
}

impl<F: NorFlash> Updater<F> {
    /// Answers a request about tables. Repeating one does no harm.
    pub fn answer(
        &mut self,
        request: Request<'_>,
        now_ms: u64,
        slots: &mut impl TableSlots<F>,
    ) -> Response {
        let answer = match request {
            Request::Begin { .. } | Request::Rollback { .. } | Request::Provision { .. }
                if self.has_lost_key =>
            {
                Err(Refusal::KeyLost)
            }
            Request::Slots => Ok(Response::Slots(self.slots(now_ms))),
            Request::Sectors { length, first } => self.sectors(length, first, now_ms, slots),
            Request::Begin {
                length,
                digest,
                right,
            } => self.begin(length, digest, right, slots),
            Request::Write {
                transfer,
                offset,
                bytes,
            } => self.write(transfer, offset, bytes, now_ms, slots),
            Request::Activate { transfer, trial_s } => {
                self.activate(transfer, trial_s, now_ms, slots)
            }
            Request::Confirm { table, right } => self.confirm(table, right, now_ms, slots),
            Request::Rollback { table, right } => self.roll_back(table, right, now_ms, slots),
            Request::Provision {
                key,
                device,
                even_so,
            } => self.provision(Identity { key, device }, even_so, slots),
            // The session answers these.
            Request::Hello { .. } | Request::Status | Request::Subscribe { .. } => {
                Err(Refusal::Unknown)
            }
        };
        answer.unwrap_or_else(Response::Refused)
    }

    /// Ends a trial whose time is over.
    pub fn poll(&mut self, now_ms: u64, slots: &mut impl TableSlots<F>) {
        if let Some(trial) = self.trial.filter(|trial| now_ms >= trial.ends_ms) {
            self.end_trial(trial, TableReason::TrialOver, now_ms, slots);
        }
    }

    /// The table in use is no longer what was checked: bits have rotted under it. Frames
    /// go through the one that was confirmed before it, if that is still whole, or pass.
    pub fn abandon(&mut self, slots: &mut impl TableSlots<F>) {
        let Some(slot) = self.in_use else {
            return;
        };
        self.trial = None;
        self.transfer = None;
        *slot.of_mut(&mut self.tables) = None;
        *slot.of_mut(&mut self.broken) = true;
        let cause = Rejected::Damaged;
        self.fault = Some(Fault::Table {
            slot: slot as u8,
            cause,
        });
        let other = slot.other();
        let there = *other.of(&self.tables);
        let there = there.filter(|there| self.has_counted(other, there.id));
        let terms = self.terms();
        let taken = there.filter(|there| self.take(other, there.length, &terms, slots).is_ok());
        self.use_slot(taken.map(|_| other), TableReason::Damaged, slots);
        slots.unload(slot);
    }

    /// The last change that nobody has asked for yet.
    pub const fn take_change(&mut self) -> Option<TableChange> {
        self.change.take()
    }

    /// The slot that frames go through.
    #[must_use]
    pub const fn in_use(&self) -> Option<Slot> {
        self.in_use
    }

    /// The table that frames go through.
    #[must_use]
    pub fn table(&self) -> Option<TableName> {
        self.name(self.in_use?)
    }

    /// What was wrong with a table at the start.
    #[must_use]
    pub const fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// What the device is provisioned with.
    #[must_use]
    pub const fn trust(&self) -> &Trust {
        &self.trust
    }

    /// What lies where in it.
    #[must_use]
    pub const fn map(&self) -> &Map {
        &self.map
    }

    /// The flash.
    #[must_use]
    pub const fn flash(&self) -> &F {
        &self.flash
    }

    /// The flash, for what else is done with it than storing tables.
    pub const fn flash_mut(&mut self) -> &mut F {
        &mut self.flash
    }

    /// Gives the flash back.
    #[must_use]
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// States of both slots.
    #[must_use]
    pub fn states(&self) -> [SlotState; 2] {
        Slot::ALL.map(|slot| {
            if *slot.of(&self.broken) {
                SlotState::Broken
            } else if slot.of(&self.tables).is_none() {
                SlotState::Empty
            } else if self.in_use != Some(slot) {
                self.state_of_other(slot)
            } else if self.trial.is_some() {
                SlotState::Trial
            } else {
                SlotState::Active
            }
        })
    }
}
