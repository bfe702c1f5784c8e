//! State of an updater: the slot in use, the trial, the record that counts.

use super::{Ended, TableChange, Trial, Updater};
use crate::link::{InUse, Refusal, Response, SlotState, TableName, TableReason};
use crate::store::record::Commit;
use crate::store::{Slot, StoreError, TableSlots};
use crate::trust::{Deed, allows};
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Updater<F> {
    pub(super) fn trial_ms(&self, now_ms: u64) -> u32 {
        let left = |trial: Trial| trial.ends_ms.saturating_sub(now_ms).max(1);
        u32::try_from(self.trial.map_or(0, left)).unwrap_or(u32::MAX)
    }

    pub(super) fn use_now(&self, now_ms: u64) -> Response {
        Response::InUse(InUse {
            table: self.table(),
            trial_ms: self.trial_ms(now_ms),
        })
    }

    /// The slot that the next table goes to: not the one in use.
    pub(super) fn target(&self) -> Slot {
        match (self.in_use, self.suspect) {
            (Some(slot), _) => slot.other(),
            (None, Some(suspect)) => suspect,
            (None, None) => Slot::A,
        }
    }

    /// Whether the table of this id in a slot was confirmed, last or before.
    pub(super) fn has_counted(&self, slot: Slot, id: u32) -> bool {
        self.journal.last().is_some_and(|last| match last.table {
            Some((counts, table)) if counts == slot => table == id,
            _ => last.other == Some(id),
        })
    }

    /// The lowest version of a table that may come: not below the one in use, not below
    /// any that was ever confirmed, and not a revoked one. Without a key nobody vouches for
    /// versions: any. With a lost one, none.
    pub(super) fn oldest(&self) -> u32 {
        if self.has_lost_key {
            return u32::MAX;
        }
        if self.trust.key.is_none() {
            return 0;
        }
        let used = self.in_use.and_then(|slot| *slot.of(&self.tables));
        let last = self.journal.last().unwrap_or_default();
        let floor = last.floor.max(last.newest);
        used.map_or(floor, |table| table.version.max(floor))
    }

    pub(super) fn check_in_use(&self, table: u32) -> Result<(), Refusal> {
        let used = self.table();
        if used.is_some_and(|used| used.id == table) {
            return Ok(());
        }
        Err(Refusal::NotInUse { table: used })
    }

    pub(super) fn end_trial(
        &mut self,
        trial: Trial,
        reason: TableReason,
        now_ms: u64,
        slots: &mut impl TableSlots<F>,
    ) {
        self.trial = None;
        self.ended = self.table().map(|table| Ended {
            table: table.id,
            reason,
            at_ms: now_ms,
        });
        self.use_slot(trial.before, reason, slots);
    }

    pub(super) fn use_slot(
        &mut self,
        slot: Option<Slot>,
        reason: TableReason,
        slots: &mut impl TableSlots<F>,
    ) {
        self.in_use = slot;
        slots.select(slot.ok_or(self.absence()));
        self.changed(reason);
    }

    pub(super) fn changed(&mut self, reason: TableReason) {
        let table = self.table();
        self.change = Some(TableChange { table, reason });
    }

    /// Makes the table of a slot the one that counts; `oldest` is the lowest version
    /// that may run from then on.
    pub(super) fn commit(&mut self, slot: Option<Slot>, oldest: u32) -> Result<(), Refusal> {
        let id = |slot: Slot| Some((slot, slot.of(&self.tables).as_ref()?.id));
        let table = slot.and_then(id);
        let floor = self.terms().floor.max(oldest);
        // The table that counted until now can be gone back to, if it is still there.
        let other = self.journal.last().and_then(|last| {
            let (before, id) = last.table?;
            if slot == Some(before) {
                return last.other;
            }
            let whole = before.of(&self.tables).as_ref();
            whole.filter(|table| table.id == id).map(|_| id)
        });
        let commit = Commit {
            sequence: 0,
            table,
            other,
            floor,
            lengths: Slot::ALL.map(|slot| slot.of(&self.tables).map_or(0, |table| table.length)),
            erases: self.erases,
            has_key: self.trust.key.is_some(),
            newest: self.newest(slot),
        };
        self.append(commit)
    }

    /// The highest version ever confirmed, once the table of this slot is.
    fn newest(&self, slot: Option<Slot>) -> u32 {
        let newest = self.journal.last().map_or(0, |last| last.newest);
        if self.trust.key.is_none() {
            return newest;
        }
        let version = slot.and_then(|slot| slot.of(&self.tables).map(|table| table.version));
        newest.max(version.unwrap_or(0))
    }

    /// How a whole table is that is not in use.
    pub(super) fn state_of_other(&self, slot: Slot) -> SlotState {
        let id = slot.of(&self.tables).map(|table| table.id);
        let confirmed = self.journal.last().is_none_or(|last| {
            let counts = last.table.filter(|(counts, _)| *counts == slot);
            counts.map_or(last.other, |(_, id)| Some(id)) == id
        });
        if confirmed {
            SlotState::Valid
        } else {
            SlotState::Unconfirmed
        }
    }

    /// What the next right must be signed for: the number of the next record.
    pub(super) fn sequence(&self) -> u32 {
        let last = self.journal.last();
        last.map_or(0, |last| last.sequence.saturating_add(1))
    }

    /// Whether a request shows the right to do this.
    #[inline(never)]
    pub(super) fn need_right(
        &self,
        right: &[u8],
        deed: &Deed,
        slots: &mut impl TableSlots<F>,
    ) -> Result<(), Refusal> {
        let terms = self.terms();
        // Of the same type as for the check of a table: signatures are verified by one function.
        let yield_now: &mut dyn FnMut() = &mut || slots.yield_now();
        let allowed = allows(right, deed, self.sequence(), &terms, yield_now);
        allowed.map_err(Refusal::NoRight)
    }

    /// Writes the record that counts once more; it says then whether there is a key.
    pub(super) fn renew_record(&mut self) -> Result<(), Refusal> {
        let Some(last) = self.journal.last() else {
            return Ok(());
        };
        self.append(Commit {
            has_key: last.has_key || self.trust.key.is_some(),
            erases: self.erases,
            ..last
        })
    }

    /// Without a record, a whole table that nobody confirmed would count at the next
    /// start, and a key that was cut would pass for a lost one.
    pub(super) fn need_record(&mut self) -> Result<(), Refusal> {
        match self.journal.last() {
            Some(_) => Ok(()),
            None => self.commit(self.in_use, 0),
        }
    }

    fn append(&mut self, commit: Commit) -> Result<(), Refusal> {
        let appended = self.journal.append(&mut self.flash, commit);
        let erases = appended.map_err(|error| match error {
            StoreError::Flash { offset } => Refusal::Flash { offset },
            StoreError::Full => Refusal::ReadOnly,
        })?;
        let [.., records] = &mut self.erases;
        *records = records.saturating_add(erases);
        Ok(())
    }

    pub(super) fn name(&self, slot: Slot) -> Option<TableName> {
        let table = slot.of(&self.tables).as_ref()?;
        Some(TableName {
            id: table.id,
            version: table.version,
        })
    }
}
