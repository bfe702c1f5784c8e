//! What becomes of tables: transfer, trial, confirmation, and the way back.

use super::journal::Journal;
use super::record::{Commit, Identity};
use super::transfer::Transfer;
use super::{Map, Shelf, Slot, StoreError, flash, identity};
use crate::image::layout::header;
use crate::link::{
    Digest, Fault, InUse, PassThrough, Receiving, Refusal, Request, Response, Sectors, SlotInfo,
    SlotState, Slots, TableName, TableReason,
};
use crate::trust::{Accepted, Rejected, Terms, Trust};
use embedded_storage::nor_flash::NorFlash;
use heapless::Vec;

/// Chunks that may be on their way to a device at once. What it cannot look at yet
/// waits in the serial line's buffer, which must hold as many.
const WINDOW: u8 = 3;

/// Longest trial, milliseconds.
const MAX_TRIAL_MS: u64 = 65_535_000;

/// Both slots, the records, and what a host may do with them.
#[derive(Clone, Debug)]
pub struct Updater<F> {
    flash: F,
    map: Map,
    trust: Trust,
    journal: Journal,
    /// Sectors erased so far: slot A, slot B, records.
    erases: [u32; 3],
    tables: [Option<Accepted>; 2],
    broken: [bool; 2],
    in_use: Option<Slot>,
    transfer: Option<Transfer>,
    trial: Option<Trial>,
    fault: Option<Fault>,
    change: Option<Change>,
}

/// A table in use that nobody has confirmed.
#[derive(Clone, Copy, Debug)]
struct Trial {
    ends_ms: u64,
    transfer: u32,
    /// What frames go through when it ends.
    before: Option<Slot>,
}

/// Another table in use.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Change {
    /// It; none passes frames through.
    pub table: Option<TableName>,
    /// Why.
    pub reason: TableReason,
}

impl<F: NorFlash> Updater<F> {
    /// After a start: finds the table that counts, checks it and has it used; with
    /// the other one if that fails, or none.
    #[inline(never)]
    pub fn start(mut flash: F, map: Map, shelf: &mut impl Shelf<F>) -> Self {
        let identity = identity::find(&mut flash, map.identity());
        let trust = identity.map_or_else(Trust::default, |identity| Trust {
            key: Some(identity.key),
            device: identity.device,
        });
        let journal = Journal::find(&mut flash, map.records());
        let erases = journal.last().unwrap_or_default().erases;
        let mut updater = Self {
            flash,
            map,
            trust,
            journal,
            erases,
            tables: [None; 2],
            broken: [false; 2],
            in_use: None,
            transfer: None,
            trial: None,
            fault: None,
            change: None,
        };
        updater.settle();
        for slot in Slot::ALL {
            updater.look(slot, shelf);
        }
        updater.in_use = updater.choose();
        let chosen = updater.in_use.ok_or(updater.absence());
        shelf.select(chosen);
        updater
    }

    /// Ends the doubt about a record that was cut. A flash that fails here leaves
    /// things as they are.
    fn settle(&mut self) {
        if let Some(last) = self.journal.last().filter(|_| self.journal.is_cut()) {
            let _ = self.append(last);
        }
    }

    /// Checks what is in a slot.
    #[inline(never)]
    fn look(&mut self, slot: Slot, shelf: &mut impl Shelf<F>) {
        let part = self.map.slot(slot);
        let erased = |piece: &[u8]| piece.iter().all(|byte| *byte == flash::ERASED);
        let head = header::SIZE as u32;
        let empty = flash::read(&mut self.flash, part, 0, head, erased).unwrap_or(false);
        *slot.of_mut(&mut self.tables) = None;
        *slot.of_mut(&mut self.broken) = false;
        if empty {
            return;
        }
        let last = self.journal.last();
        let noted = last.map(|last| *slot.of(&last.lengths));
        let length = noted.filter(|length| *length > 0);
        let loaded = shelf.load(&self.flash, slot, length, &self.terms());
        let meant = last.and_then(|last| last.table);
        let loaded = loaded.and_then(|accepted| match meant {
            // Something else was put there past this code.
            Some((meant, id)) if meant == slot && id != accepted.id => {
                shelf.unload(slot);
                Err(Rejected::NotATable)
            }
            _ => Ok(accepted),
        });
        match loaded {
            Ok(accepted) => *slot.of_mut(&mut self.tables) = Some(accepted),
            Err(cause) => {
                *slot.of_mut(&mut self.broken) = true;
                // An unfinished table in the other slot is nothing wrong.
                if last.is_none() || meant.is_some_and(|(meant, _)| meant == slot) {
                    let slot = slot as u8;
                    self.fault = Some(Fault::Table { slot, cause });
                }
            }
        }
    }

    /// The table that counts; where it cannot be used, the other one. Without any
    /// record, the one of the higher version.
    fn choose(&self) -> Option<Slot> {
        let there = |slot: &Slot| slot.of(&self.tables).is_some();
        match self.journal.last() {
            Some(Commit { table: None, .. }) => None,
            Some(Commit {
                table: Some((slot, _)),
                ..
            }) => [slot, slot.other()].into_iter().find(there),
            None => {
                let version = |slot: &Slot| slot.of(&self.tables).map(|table| table.version);
                let [a, b] = Slot::ALL;
                let better = if version(&b) > version(&a) { b } else { a };
                Some(better).filter(there)
            }
        }
    }

    /// Why no table is in use.
    fn absence(&self) -> PassThrough {
        if self.fault.is_some() {
            PassThrough::BrokenTable
        } else {
            PassThrough::NoTable
        }
    }

    /// What a table must meet in any case.
    fn terms(&self) -> Terms {
        Terms {
            trust: self.trust,
            floor: self.journal.last().map_or(0, |last| last.floor),
        }
    }

    /// Answers a request about tables. Repeating one does no harm.
    pub fn answer(
        &mut self,
        request: Request<'_>,
        now_ms: u64,
        shelf: &mut impl Shelf<F>,
    ) -> Response {
        let answer = match request {
            Request::Slots => Ok(Response::Slots(self.slots(now_ms))),
            Request::Sectors { length, first } => self.sectors(length, first, shelf),
            Request::Begin { length, digest } => self.begin(length, digest),
            Request::Write {
                transfer,
                offset,
                bytes,
            } => self.write(transfer, offset, bytes, shelf),
            Request::Activate { transfer, trial_s } => {
                self.activate(transfer, trial_s, now_ms, shelf)
            }
            Request::Confirm { table } => self.confirm(table, now_ms),
            Request::Rollback { table } => self.roll_back(table, now_ms, shelf),
            Request::Provision { key, device } => self.provision(Identity { key, device }, shelf),
            // The session answers these.
            Request::Hello { .. } | Request::Status | Request::Subscribe { .. } => {
                Err(Refusal::Unknown)
            }
        };
        answer.unwrap_or_else(Response::Refused)
    }

    /// Ends a trial whose time is over.
    pub fn poll(&mut self, now_ms: u64, shelf: &mut impl Shelf<F>) {
        if let Some(trial) = self.trial.filter(|trial| now_ms >= trial.ends_ms) {
            self.end_trial(trial, TableReason::TrialOver, shelf);
        }
    }

    /// The last change that nobody has asked for yet.
    pub const fn take_change(&mut self) -> Option<Change> {
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
                SlotState::Valid
            } else if self.trial.is_some() {
                SlotState::Trial
            } else {
                SlotState::Active
            }
        })
    }

    fn name(&self, slot: Slot) -> Option<TableName> {
        let table = slot.of(&self.tables).as_ref()?;
        Some(TableName {
            id: table.id,
            version: table.version,
        })
    }

    #[inline(never)]
    fn slots(&self, now_ms: u64) -> Slots {
        let [a, b, record_erases] = self.erases;
        let states = self.states();
        Slots {
            slots: Slot::ALL.map(|slot| SlotInfo {
                state: *slot.of(&states),
                table: self.name(slot),
                length: slot.of(&self.tables).map_or(0, |table| table.length),
                erases: *slot.of(&[a, b]),
            }),
            target: self.target() as u8,
            trial_ms: self.trial_ms(now_ms),
            oldest: self.oldest(),
            key: self.trust.key_id(),
            device: self.trust.device,
            sector: self.map.sector(),
            record_erases,
        }
    }

    fn trial_ms(&self, now_ms: u64) -> u32 {
        let left = |trial: Trial| trial.ends_ms.saturating_sub(now_ms).max(1);
        u32::try_from(self.trial.map_or(0, left)).unwrap_or(u32::MAX)
    }

    fn use_now(&self, now_ms: u64) -> Response {
        Response::InUse(InUse {
            table: self.table(),
            trial_ms: self.trial_ms(now_ms),
        })
    }

    /// The slot that the next table goes to: not the one in use.
    fn target(&self) -> Slot {
        self.in_use.map_or(Slot::A, Slot::other)
    }

    /// The lowest version of a table that may come: not below the one that counts,
    /// and not a revoked one.
    fn oldest(&self) -> u32 {
        let used = self.in_use.and_then(|slot| *slot.of(&self.tables));
        let floor = self.terms().floor;
        used.map_or(floor, |table| table.version.max(floor))
    }

    #[inline(never)]
    fn sectors(
        &mut self,
        length: u32,
        first: u32,
        shelf: &mut impl Shelf<F>,
    ) -> Result<Response, Refusal> {
        self.check_length(length)?;
        let part = self.map.slot(self.target());
        let mut crcs = Vec::new();
        let mut start = first.saturating_mul(self.map.sector());
        while start < length && !crcs.is_full() {
            let sector = self.map.sector().min(length - start);
            let crc = flash::crc(&mut self.flash, part, start, sector);
            let crc = crc.map_err(|_| Refusal::Flash { offset: start })?;
            // Not full.
            let _ = crcs.push(crc);
            start = start.saturating_add(sector);
            shelf.pause();
        }
        Ok(Response::Sectors(Sectors { first, crcs }))
    }

    fn check_length(&self, length: u32) -> Result<(), Refusal> {
        let limit = self.map.slot_bytes();
        if length > limit {
            return Err(Refusal::TooLong { limit });
        }
        Ok(())
    }

    #[inline(never)]
    fn begin(&mut self, length: u32, digest: Digest) -> Result<Response, Refusal> {
        if self.trial.is_some() {
            return Err(Refusal::OnTrial);
        }
        self.check_length(length)?;
        if self.journal.last().is_none() {
            // Without a record, a whole table that nobody confirmed would count at
            // the next start.
            self.commit(self.in_use, 0)?;
        }
        let same = |transfer: &Transfer| transfer.digest == digest && transfer.length == length;
        if !self.transfer.as_ref().is_some_and(same) {
            self.transfer = Some(Transfer::new(digest, length));
        }
        Ok(Response::Receiving(Receiving {
            slot: self.target() as u8,
            chunk: self.map.chunk(),
            window: WINDOW,
        }))
    }

    #[inline(never)]
    fn write(
        &mut self,
        transfer: u32,
        offset: u32,
        bytes: &[u8],
        shelf: &mut impl Shelf<F>,
    ) -> Result<Response, Refusal> {
        let slot = self.target();
        let running = self.transfer.as_mut();
        let running = running.filter(|running| running.digest.transfer() == transfer);
        let running = running.ok_or(Refusal::NoTransfer)?;
        // Its bytes are about to change.
        shelf.unload(slot);
        *slot.of_mut(&mut self.tables) = None;
        *slot.of_mut(&mut self.broken) = true;
        let part = self.map.slot(slot);
        let erases = running.write(&mut self.flash, &self.map, part, offset, bytes)?;
        if let Some(count) = self.erases.get_mut(slot.index()) {
            *count = count.saturating_add(erases);
        }
        Ok(Response::Written)
    }

    #[inline(never)]
    fn activate(
        &mut self,
        transfer: u32,
        trial_s: u16,
        now_ms: u64,
        shelf: &mut impl Shelf<F>,
    ) -> Result<Response, Refusal> {
        // The answer to the first such request may have been lost.
        if self.trial.is_some_and(|trial| trial.transfer == transfer) {
            return Ok(self.use_now(now_ms));
        }
        if self.trial.is_some() {
            return Err(Refusal::OnTrial);
        }
        let running = self.transfer.as_ref();
        let running = running.filter(|running| running.digest.transfer() == transfer);
        let running = *running.ok_or(Refusal::NoTransfer)?;
        let slot = self.target();
        let part = self.map.slot(slot);
        let whole = running.is_whole(&mut self.flash, part, || shelf.pause());
        if !whole.map_err(|_| Refusal::Incomplete)? {
            return Err(Refusal::Incomplete);
        }
        let terms = Terms {
            trust: self.trust,
            floor: self.oldest(),
        };
        *slot.of_mut(&mut self.tables) = None;
        *slot.of_mut(&mut self.broken) = true;
        let accepted = shelf.load(&self.flash, slot, Some(running.length), &terms);
        let accepted = accepted.map_err(Refusal::Table)?;
        *slot.of_mut(&mut self.tables) = Some(accepted);
        *slot.of_mut(&mut self.broken) = false;
        let trial_ms = (u64::from(trial_s.max(1)) * 1_000).min(MAX_TRIAL_MS);
        self.trial = Some(Trial {
            ends_ms: now_ms.saturating_add(trial_ms),
            transfer,
            before: self.in_use,
        });
        self.transfer = None;
        self.use_slot(Some(slot), TableReason::Trial, shelf);
        Ok(self.use_now(now_ms))
    }

    #[inline(never)]
    fn confirm(&mut self, table: u32, now_ms: u64) -> Result<Response, Refusal> {
        self.check_in_use(table)?;
        if self.trial.is_some() {
            let oldest = self.in_use.and_then(|slot| *slot.of(&self.tables));
            self.commit(self.in_use, oldest.map_or(0, |table| table.oldest))?;
            self.trial = None;
            self.changed(TableReason::Confirmed);
        }
        Ok(self.use_now(now_ms))
    }

    #[inline(never)]
    fn roll_back(
        &mut self,
        table: u32,
        now_ms: u64,
        shelf: &mut impl Shelf<F>,
    ) -> Result<Response, Refusal> {
        self.check_in_use(table)?;
        if let Some(trial) = self.trial {
            self.end_trial(trial, TableReason::RolledBack, shelf);
            return Ok(self.use_now(now_ms));
        }
        let other = self.target();
        let there = other.of(&self.tables).ok_or(Refusal::NoOther)?;
        let floor = self.terms().floor;
        if self.trust.key.is_some() && there.version < floor {
            let version = there.version;
            return Err(Refusal::Table(Rejected::Older { version, floor }));
        }
        self.commit(Some(other), 0)?;
        self.transfer = None;
        self.use_slot(Some(other), TableReason::RolledBack, shelf);
        Ok(self.use_now(now_ms))
    }

    #[inline(never)]
    fn provision(
        &mut self,
        identity: Identity,
        shelf: &mut impl Shelf<F>,
    ) -> Result<Response, Refusal> {
        let wanted = Trust {
            key: Some(identity.key),
            device: identity.device,
        };
        if self.trust.key.is_none() {
            if self.trial.is_some() {
                return Err(Refusal::OnTrial);
            }
            let part = self.map.identity();
            let written = identity::write(&mut self.flash, part, &identity);
            written.map_err(|_| Refusal::ReadOnly)?;
            self.trust = wanted;
            // From now on nobody goes back to a table that the next start would refuse.
            // The one in use stays until then.
            if let Some(used) = self.in_use {
                self.look(used.other(), shelf);
            }
        }
        if self.trust != wanted {
            return Err(Refusal::HasKey);
        }
        Ok(Response::Provisioned)
    }

    fn check_in_use(&self, table: u32) -> Result<(), Refusal> {
        let used = self.table();
        if used.is_some_and(|used| used.id == table) {
            return Ok(());
        }
        Err(Refusal::NotInUse { table: used })
    }

    fn end_trial(&mut self, trial: Trial, reason: TableReason, shelf: &mut impl Shelf<F>) {
        self.trial = None;
        self.use_slot(trial.before, reason, shelf);
    }

    fn use_slot(&mut self, slot: Option<Slot>, reason: TableReason, shelf: &mut impl Shelf<F>) {
        self.in_use = slot;
        shelf.select(slot.ok_or(self.absence()));
        self.changed(reason);
    }

    fn changed(&mut self, reason: TableReason) {
        let table = self.table();
        self.change = Some(Change { table, reason });
    }

    /// Makes the table of a slot the one that counts; `oldest` is the lowest version
    /// that may run from then on.
    fn commit(&mut self, slot: Option<Slot>, oldest: u32) -> Result<(), Refusal> {
        let id = |slot: Slot| Some((slot, slot.of(&self.tables).as_ref()?.id));
        let table = slot.and_then(id);
        let floor = self.terms().floor.max(oldest);
        let commit = Commit {
            sequence: 0,
            table,
            floor,
            lengths: Slot::ALL.map(|slot| slot.of(&self.tables).map_or(0, |table| table.length)),
            erases: self.erases,
        };
        self.append(commit).map_err(|error| match error {
            StoreError::Flash { offset } => Refusal::Flash { offset },
            StoreError::Full => Refusal::ReadOnly,
        })
    }

    fn append(&mut self, commit: Commit) -> Result<(), StoreError> {
        let erases = self.journal.append(&mut self.flash, commit)?;
        let [.., records] = &mut self.erases;
        *records = records.saturating_add(erases);
        Ok(())
    }
}
