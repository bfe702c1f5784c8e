//! Requests about tables, carried out.

use super::{Trial, Updater};
use crate::FrameSize;
use crate::link::{
    Digest, EndedTrial, FrameKind, Receiving, Refusal, Response, Sectors, SlotInfo, Slots,
    TableAbout, TableReason,
};
use crate::store::record::Identity;
use crate::store::transfer::Transfer;
use crate::store::{Slot, TableSlots, flash, identity};
use crate::trust::{Accepted, Deed, Rejected, Terms, Trust};
use embedded_storage::nor_flash::NorFlash;
use heapless::Vec;

/// Chunks that may be on their way to a device at once. What it cannot look at yet
/// waits in the serial line's buffer, which must hold as many.
const WINDOW: u8 = 3;

/// CRC-32 of a sector that cannot be read. A host whose sector has this very one finds out
/// when it activates the table.
const UNREADABLE: u32 = 0;

/// Milliseconds between two comparisons of sectors of which each takes its full number. A
/// line takes longer to carry the answer; whoever asks without waiting for it is given one
/// sector at a time, so that he holds others up for milliseconds instead of seconds.
const COMPARE_MS: u64 = 2;

/// Longest trial, milliseconds.
const MAX_TRIAL_MS: u64 = 65_535_000;

impl<F: NorFlash> Updater<F> {
    #[inline(never)]
    pub(super) fn slots(&self, now_ms: u64) -> Slots {
        let [a, b, record_erases] = self.erases;
        let states = self.states();
        Slots {
            slots: Slot::ALL.map(|slot| SlotInfo {
                state: *slot.of(&states),
                table: self.name(slot),
                length: slot.of(&self.tables).map_or(0, |table| table.length),
                erases: *slot.of(&[a, b]),
                about: slot.of(&self.tables).as_ref().map(about),
            }),
            target: self.target() as u8,
            trial_ms: self.trial_ms(now_ms),
            oldest: self.oldest(),
            key: self.trust.key_id(),
            device: self.trust.device,
            sector: self.map.sector(),
            record_erases,
            sequence: self.sequence(),
            ended: self.ended.map(|ended| EndedTrial {
                table: ended.table,
                reason: ended.reason,
                ago_ms: u32::try_from(now_ms.saturating_sub(ended.at_ms)).unwrap_or(u32::MAX),
            }),
        }
    }

    #[inline(never)]
    pub(super) fn sectors(
        &mut self,
        length: u32,
        first: u32,
        now_ms: u64,
        slots: &mut impl TableSlots<F>,
    ) -> Result<Response, Refusal> {
        self.check_length(length)?;
        let part = self.map.slot(self.target());
        let mut crcs = Vec::new();
        let mut start = first.saturating_mul(self.map.sector());
        let before = self.compared_ms.replace(now_ms);
        let rushed = before.is_some_and(|before| now_ms.saturating_sub(before) < COMPARE_MS);
        let most = if rushed { 1 } else { crcs.capacity() };
        while start < length && crcs.len() < most {
            let sector = self.map.sector().min(length - start);
            // What cannot be read, as a unit that was cut on flash with ECC, differs from
            // whatever it should be.
            let crc = flash::crc(&mut self.flash, part, start, sector).unwrap_or(UNREADABLE);
            // Not full.
            let _ = crcs.push(crc);
            start = start.saturating_add(sector);
            slots.yield_now();
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
    pub(super) fn begin(
        &mut self,
        length: u32,
        digest: Digest,
        right: &[u8],
        slots: &mut impl TableSlots<F>,
    ) -> Result<Response, Refusal> {
        if self.trial.is_some() {
            return Err(Refusal::OnTrial);
        }
        self.check_length(length)?;
        let same = |transfer: &Transfer| transfer.digest == digest && transfer.length == length;
        if !self.transfer.as_ref().is_some_and(same) {
            self.need_right(right, &Deed::Begin { length, digest }, slots)?;
            self.need_record()?;
            if self.trust.key.is_some() {
                // The right is used up.
                self.renew_record()?;
            }
            self.transfer = Some(Transfer::new(digest, length));
        }
        Ok(Response::Receiving(Receiving {
            slot: self.target() as u8,
            chunk: self.map.chunk(),
            window: WINDOW,
        }))
    }

    #[inline(never)]
    pub(super) fn write(
        &mut self,
        transfer: u32,
        offset: u32,
        bytes: &[u8],
        now_ms: u64,
        slots: &mut impl TableSlots<F>,
    ) -> Result<Response, Refusal> {
        let slot = self.target();
        let running = self.transfer.as_mut();
        let running = running.filter(|running| running.digest.transfer() == transfer);
        let running = running.ok_or(Refusal::NoTransfer)?;
        running.check(&self.map, offset, bytes)?;
        if running.erases(&self.map, offset) {
            self.wear.take(now_ms)?;
        }
        // Its bytes are about to change.
        slots.unload(slot);
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
    pub(super) fn activate(
        &mut self,
        transfer: u32,
        trial_s: u16,
        now_ms: u64,
        slots: &mut impl TableSlots<F>,
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
        let whole = running.is_whole(&mut self.flash, part, || slots.yield_now());
        if !whole.map_err(|_| Refusal::Incomplete)? {
            return Err(Refusal::Incomplete);
        }
        let terms = Terms {
            trust: self.trust,
            floor: self.oldest(),
        };
        let before = *slot.of(&self.tables);
        // Its confirmation will write a record.
        self.wear.take(now_ms)?;
        if let Err(rejected) = self.take(slot, running.length, &terms, slots) {
            // What lay there already is still good to go back to.
            if let Some(before) = before {
                let _ = self.take(slot, before.length, &self.terms(), slots);
            }
            return Err(Refusal::Table(rejected));
        }
        let trial_ms = (u64::from(trial_s.max(1)) * 1_000).min(MAX_TRIAL_MS);
        self.trial = Some(Trial {
            ends_ms: now_ms.saturating_add(trial_ms),
            transfer,
            before: self.in_use,
        });
        self.transfer = None;
        self.ended = None;
        self.use_slot(Some(slot), TableReason::Trial, slots);
        Ok(self.use_now(now_ms))
    }

    /// Checks the file in a slot that is not in use, and has its table kept.
    pub(super) fn take(
        &mut self,
        slot: Slot,
        length: u32,
        terms: &Terms,
        slots: &mut impl TableSlots<F>,
    ) -> Result<(), Rejected> {
        let loaded = slots.load(&self.flash, slot, Some(length), terms);
        *slot.of_mut(&mut self.tables) = loaded.ok();
        *slot.of_mut(&mut self.broken) = loaded.is_err();
        loaded.map(|_| ())
    }

    #[inline(never)]
    pub(super) fn confirm(
        &mut self,
        table: u32,
        right: &[u8],
        now_ms: u64,
        slots: &mut impl TableSlots<F>,
    ) -> Result<Response, Refusal> {
        self.check_in_use(table)?;
        if self.trial.is_some() {
            self.need_right(right, &Deed::Confirm { table }, slots)?;
            let oldest = self.in_use.and_then(|slot| *slot.of(&self.tables));
            self.commit(self.in_use, oldest.map_or(0, |table| table.oldest))?;
            self.trial = None;
            self.changed(TableReason::Confirmed);
        }
        Ok(self.use_now(now_ms))
    }

    #[inline(never)]
    pub(super) fn roll_back(
        &mut self,
        table: u32,
        right: &[u8],
        now_ms: u64,
        slots: &mut impl TableSlots<F>,
    ) -> Result<Response, Refusal> {
        self.check_in_use(table)?;
        let deed = Deed::Rollback { table };
        if let Some(trial) = self.trial {
            self.need_right(right, &deed, slots)?;
            self.end_trial(trial, TableReason::RolledBack, now_ms, slots);
            return Ok(self.use_now(now_ms));
        }
        let other = self.target();
        // One that nobody ever confirmed is none to go back to; nor is the same table
        // under another seal: a repetition of this request would undo it.
        let counted = self.journal.last().and_then(|last| last.other);
        let there = other.of(&self.tables);
        let there = there.filter(|there| there.id != table && counted == Some(there.id));
        let there = there.ok_or(Refusal::NoOther)?.length;
        self.need_right(right, &deed, slots)?;
        // It writes a record.
        self.wear.take(now_ms)?;
        // Since it was checked last, its version may have been revoked, or the device
        // have got a key.
        let terms = self.terms();
        let taken = self.take(other, there, &terms, slots);
        taken.map_err(Refusal::Table)?;
        self.commit(Some(other), 0)?;
        self.transfer = None;
        self.use_slot(Some(other), TableReason::RolledBack, slots);
        Ok(self.use_now(now_ms))
    }

    #[inline(never)]
    pub(super) fn provision(
        &mut self,
        identity: Identity,
        even_so: bool,
        slots: &mut impl TableSlots<F>,
    ) -> Result<Response, Refusal> {
        let wanted = Trust {
            key: Some(identity.key),
            device: identity.device,
        };
        if self.trust.key.is_none() {
            if self.trial.is_some() {
                return Err(Refusal::OnTrial);
            }
            if let Some(slot) = self.in_use.filter(|_| !even_so) {
                // What the next start will say of it.
                let length = slot.of(&self.tables).map_or(0, |table| table.length);
                let terms = Terms {
                    trust: wanted,
                    ..self.terms()
                };
                let kept = slots.examine(&self.flash, slot, Some(length), &terms);
                kept.map_err(Refusal::Table)?;
            }
            self.need_record()?;
            let part = self.map.identity();
            let written = identity::write(&mut self.flash, part, &identity);
            written.map_err(|_| Refusal::ReadOnly)?;
            self.trust = wanted;
            if let Err(refusal) = self.renew_record() {
                // What was refused must not count at the next start.
                let _ = identity::erase(&mut self.flash, part);
                self.trust = Trust::default();
                return Err(refusal);
            }
            // From now on nobody goes back to a table that the next start would refuse.
            // The one in use stays until then.
            for slot in Slot::ALL {
                if self.in_use != Some(slot) {
                    self.look(slot, slots);
                }
            }
        }
        if self.trust != wanted {
            return Err(Refusal::HasKey);
        }
        Ok(Response::Provisioned)
    }
}

/// What people are told of a table.
const fn about(table: &Accepted) -> TableAbout {
    let least = FrameSize::of_grid(table.grid);
    TableAbout {
        label: table.label,
        frames: FrameKind {
            width: least.width() as u16,
            height: least.height() as u16,
            channels: table.channels,
        },
    }
}
