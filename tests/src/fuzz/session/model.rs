//! Model of a device: what it may do, as plainly as it can be said.
//!
//! Written from the protocol and the store's promises, not from the store: flash is
//! two vectors of bytes, the records are one `Option`, and which files may run is
//! known from how they were made ([`files`](crate::fuzz::files)).

use crate::fuzz::files::{Facts, Owner, files, judge};
use ed25519_dalek::{Signature, VerifyingKey};
use iltm_runtime::link::{
    EndedTrial, InUse, Receiving, Refusal, Request, Response, Sectors, SlotInfo, SlotState, Slots,
    TableName, TableReason,
};
use iltm_runtime::trust::{NoRight, Rejected};
use std::collections::BTreeSet;
use std::ops::Range;

/// Sizes, bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Sizes {
    pub(super) slot: u32,
    pub(super) sector: u32,
    pub(super) chunk: u32,
}

/// What a device remembers of the last table that was confirmed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Record {
    /// Slot and id.
    pub(super) table: Option<(usize, u32)>,
    /// Id of the one in the other slot that was confirmed before it.
    pub(super) other: Option<u32>,
    /// Tables below never run again.
    pub(super) floor: u32,
    /// Of the files in the slots; 0 if unknown.
    pub(super) lengths: [u32; 2],
    /// The highest version that was confirmed while there was an owner.
    pub(super) newest: u32,
}

/// What is in a slot, as far as a device knows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Known {
    Nothing,
    Broken,
    Whole(Facts),
}

#[derive(Clone, PartialEq, Eq, Debug)]
struct Transfer {
    length: u32,
    digest: [u8; 16],
    /// Sectors that were erased for it.
    erased: BTreeSet<u32>,
}

impl Transfer {
    fn number(&self) -> u32 {
        let [a, b, c, d, ..] = self.digest;
        u32::from_le_bytes([a, b, c, d])
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Trial {
    ends_ms: u64,
    transfer: u32,
    before: Option<usize>,
}

/// A device.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Model {
    sizes: Sizes,
    // In flash.
    pub(super) slots: [Vec<u8>; 2],
    pub(super) record: Option<Record>,
    pub(super) owner: Option<Owner>,
    // In RAM.
    pub(super) known: [Known; 2],
    pub(super) in_use: Option<usize>,
    trial: Option<Trial>,
    transfer: Option<Transfer>,
    ended: Option<(u32, TableReason, u64)>,
    /// Erases that are allowed yet, and since when they are counted up.
    erases: (u32, u64),
    /// What a right must be signed for, which is the device's to choose; `None` once a
    /// record was written since it said so: no right from before counts then.
    pub(super) sequence: Option<u32>,
    /// When sectors were compared last.
    compared_ms: Option<u64>,
    /// Bytes of a slot that the last request may have changed.
    pub(super) touched: Option<(usize, Range<usize>)>,
}

impl Model {
    /// A device from the factory.
    pub(super) fn new(sizes: Sizes) -> Self {
        Self {
            sizes,
            slots: [0, 1].map(|_| vec![0xFF; sizes.slot as usize]),
            record: None,
            owner: None,
            known: [Known::Nothing; 2],
            in_use: None,
            trial: None,
            transfer: None,
            ended: None,
            erases: (16 * (sizes.slot / sizes.sector), 0),
            sequence: None,
            compared_ms: None,
            touched: None,
        }
    }

    /// After a loss of power: what is in flash is all that it knows.
    pub(super) fn start(&mut self) {
        self.trial = None;
        self.transfer = None;
        self.ended = None;
        self.erases = (16 * (self.sizes.slot / self.sizes.sector), 0);
        self.compared_ms = None;
        self.touched = None;
        self.look(0);
        self.look(1);
        let whole = |slot: &usize| self.whole(*slot).is_some();
        self.in_use = match self.record {
            Some(Record { table: None, .. }) => None,
            Some(Record {
                table: Some((slot, _)),
                ..
            }) => [slot, 1 - slot].into_iter().find(whole),
            None => {
                let version = |slot| self.whole(slot).map(|facts| facts.version);
                let newest = usize::from(version(1) > version(0));
                Some(newest).filter(whole)
            }
        };
    }

    /// Judges what is in a slot.
    fn look(&mut self, slot: usize) {
        let record = self.record.unwrap_or_default();
        let noted = Some(record.lengths[slot]).filter(|length| *length > 0);
        let bytes = &self.slots[slot];
        let found = judge(bytes, noted, self.owner, record.floor);
        // A table that nobody confirmed has its own length.
        let confirmed = record.table.is_some_and(|(confirmed, _)| confirmed == slot);
        let found = found.or_else(|| {
            let own = noted.is_some() && !confirmed;
            own.then(|| judge(bytes, None, self.owner, record.floor))?
        });
        // Only the very table that was confirmed counts in its slot.
        let found = found.filter(|found| match record.table {
            Some((confirmed, id)) => confirmed != slot || id == found.id,
            None => true,
        });
        self.known[slot] = match found {
            Some(facts) => Known::Whole(facts),
            None if bytes[..16].iter().all(|byte| *byte == 0xFF) => Known::Nothing,
            None => Known::Broken,
        };
    }

    /// Time passes. Whether the table in use changed.
    pub(super) fn poll(&mut self, now_ms: u64) {
        if let Some(trial) = self.trial
            && now_ms >= trial.ends_ms
        {
            self.end_trial(trial, TableReason::TrialOver, now_ms);
        }
    }

    fn end_trial(&mut self, trial: Trial, reason: TableReason, now_ms: u64) {
        self.ended = self.facts().map(|facts| (facts.id, reason, now_ms));
        self.trial = None;
        self.in_use = trial.before;
    }

    /// One more erase, of which there may be sixteen times a slot's after a start and then
    /// one in half an hour.
    fn erase(&mut self, now_ms: u64) -> Result<(), Refusal> {
        const HALF_HOUR: u64 = 1_800_000;
        let most = 16 * (self.sizes.slot / self.sizes.sector);
        let (mut left, mut since) = self.erases;
        if left < most {
            let more = (now_ms - since) / HALF_HOUR;
            left = most.min(left.saturating_add(more.min(u64::from(most)) as u32));
            since += more * HALF_HOUR;
        }
        if left == most {
            since = now_ms;
        }
        self.erases = (left, since);
        if left == 0 {
            let wait_s = (since + HALF_HOUR - now_ms).div_ceil(1_000) as u32;
            return Err(Refusal::Wear { wait_s });
        }
        self.erases.0 -= 1;
        Ok(())
    }

    /// Whether somebody may do this: what the signature must be over is written down here
    /// once more.
    fn may(&self, right: &[u8], kind: u32, subject: u32, digest: [u8; 16]) -> Result<(), Refusal> {
        let Some(owner) = self.owner else {
            return Ok(());
        };
        let refuse = |cause| Err(Refusal::NoRight(cause));
        let good = |key: &[u8; 32], message: &[u8], signature: &[u8]| {
            let key = VerifyingKey::from_bytes(key);
            let signature = Signature::from_slice(signature).expect("64 bytes");
            key.is_ok_and(|key| key.verify_strict(message, &signature).is_ok())
        };
        let mut key = owner.key;
        match right.len() {
            64 => {}
            172 => {
                let (fields, signature) = right[64..].split_at(44);
                let device = u64::from_le_bytes(fields[32..40].try_into().expect("8"));
                let version = u32::from_le_bytes(fields[40..].try_into().expect("4"));
                if device != 0 && device != owner.device {
                    return refuse(NoRight::OtherDevice { device });
                }
                let floor = self.floor();
                if version < floor {
                    return refuse(NoRight::Revoked { version, floor });
                }
                let message = [b"iltm technician1", fields].concat();
                if !good(&owner.key, &message, signature) {
                    return refuse(NoRight::Certificate);
                }
                key = fields[..32].try_into().expect("32");
            }
            _ => return refuse(NoRight::Missing),
        }
        let Some(sequence) = self.sequence else {
            return refuse(NoRight::Signature);
        };
        let mut message = b"iltm right 1".to_vec();
        message.extend(kind.to_le_bytes());
        message.extend(owner.device.to_le_bytes());
        message.extend(sequence.to_le_bytes());
        message.extend(subject.to_le_bytes());
        message.extend(digest);
        if good(&key, &message, &right[..64]) {
            Ok(())
        } else {
            refuse(NoRight::Signature)
        }
    }

    fn whole(&self, slot: usize) -> Option<Facts> {
        match self.known[slot] {
            Known::Whole(facts) => Some(facts),
            _ => None,
        }
    }

    fn facts(&self) -> Option<Facts> {
        self.whole(self.in_use?)
    }

    /// The table in use.
    pub(super) fn table(&self) -> Option<TableName> {
        self.facts().map(name)
    }

    /// What a request that is repeated must not change.
    pub(super) fn kept(&self) -> (Option<usize>, Option<Record>, Option<Owner>, [SlotState; 2]) {
        (self.in_use, self.record, self.owner, self.states())
    }

    /// The table in the other slot.
    pub(super) fn other(&self) -> Option<TableName> {
        self.whole(self.target()).map(name)
    }

    pub(super) fn target(&self) -> usize {
        self.in_use.map_or(0, |slot| 1 - slot)
    }

    fn floor(&self) -> u32 {
        self.record.map_or(0, |record| record.floor)
    }

    /// The lowest version that may come.
    fn oldest(&self) -> u32 {
        let used = self.facts().map_or(0, |facts| facts.version);
        match self.owner {
            Some(_) => used
                .max(self.floor())
                .max(self.record.map_or(0, |record| record.newest)),
            None => 0,
        }
    }

    /// How the slots are.
    pub(super) fn states(&self) -> [SlotState; 2] {
        [0, 1].map(|slot| match self.known[slot] {
            Known::Nothing => SlotState::Empty,
            Known::Broken => SlotState::Broken,
            Known::Whole(facts) if self.in_use != Some(slot) => match self.record {
                Some(Record {
                    table: Some((confirmed, id)),
                    ..
                }) if confirmed == slot && id == facts.id => SlotState::Valid,
                Some(Record {
                    table: Some((confirmed, _)),
                    ..
                }) if confirmed == slot => SlotState::Unconfirmed,
                Some(Record { other, .. }) if other != Some(facts.id) => SlotState::Unconfirmed,
                _ => SlotState::Valid,
            },
            Known::Whole(_) if self.trial.is_some() => SlotState::Trial,
            Known::Whole(_) => SlotState::Active,
        })
    }

    fn trial_ms(&self, now_ms: u64) -> u32 {
        let left = |trial: Trial| trial.ends_ms.saturating_sub(now_ms).max(1);
        self.trial.map_or(0, left) as u32
    }

    fn now_in_use(&self, now_ms: u64) -> Response {
        Response::InUse(InUse {
            table: self.table(),
            trial_ms: self.trial_ms(now_ms),
        })
    }

    /// Carries out a request about tables. Erase counts are left at 0.
    pub(super) fn answer(&mut self, request: &Request<'_>, now_ms: u64) -> Response {
        self.touched = None;
        let answer = match *request {
            Request::Slots => Ok(self.slots_now(now_ms)),
            Request::Sectors { length, first } => self.sectors(length, first, now_ms),
            Request::Begin {
                length,
                digest,
                right,
            } => self.begin(length, digest.0, right),
            Request::Write {
                transfer,
                offset,
                bytes,
            } => self.write(transfer, offset, bytes, now_ms),
            Request::Activate { transfer, trial_s } => self.activate(transfer, trial_s, now_ms),
            Request::Confirm { table, right } => self.confirm(table, right, now_ms),
            Request::Rollback { table, right } => self.roll_back(table, right, now_ms),
            Request::Provision {
                key,
                device,
                even_so,
            } => self.provision(Owner { key, device }, even_so),
            Request::Hello { .. } | Request::Status | Request::Subscribe { .. } => {
                unreachable!("not about tables")
            }
        };
        answer.unwrap_or_else(Response::Refused)
    }

    fn slots_now(&self, now_ms: u64) -> Response {
        let states = self.states();
        let info = |slot| SlotInfo {
            state: states[slot],
            table: self.whole(slot).map(name),
            length: self.whole(slot).map_or(0, |facts| facts.length),
            erases: 0,
            about: None,
        };
        Response::Slots(Slots {
            slots: [info(0), info(1)],
            target: self.target() as u8,
            trial_ms: self.trial_ms(now_ms),
            oldest: self.oldest(),
            key: self
                .owner
                .map(|owner| owner.key[..8].try_into().expect("8")),
            device: self.owner.map_or(0, |owner| owner.device),
            sector: self.sizes.sector,
            record_erases: 0,
            sequence: 0,
            ended: self.ended.map(|(table, reason, at_ms)| EndedTrial {
                table,
                reason,
                ago_ms: u32::try_from(now_ms - at_ms).unwrap_or(u32::MAX),
            }),
        })
    }

    fn sectors(&mut self, length: u32, first: u32, now_ms: u64) -> Result<Response, Refusal> {
        self.fits(length)?;
        // Whoever asks again at once is given one at a time.
        let before = self.compared_ms.replace(now_ms);
        let most = if before.is_some_and(|before| now_ms < before + 2) {
            1
        } else {
            16
        };
        let slot = &self.slots[self.target()][..length as usize];
        let sectors = slot.chunks(self.sizes.sector as usize);
        let crcs = sectors.skip(first as usize).take(most).map(crc32);
        let crcs = crcs.collect();
        Ok(Response::Sectors(Sectors { first, crcs }))
    }

    fn fits(&self, length: u32) -> Result<(), Refusal> {
        let limit = self.sizes.slot;
        if length > limit {
            return Err(Refusal::TooLong { limit });
        }
        Ok(())
    }

    fn begin(&mut self, length: u32, digest: [u8; 16], right: &[u8]) -> Result<Response, Refusal> {
        if self.trial.is_some() {
            return Err(Refusal::OnTrial);
        }
        self.fits(length)?;
        let goes_on = |old: &Transfer| (old.length, old.digest) == (length, digest);
        if !self.transfer.as_ref().is_some_and(goes_on) {
            self.may(right, 1, length, digest)?;
            // From the first transfer on it is noted which table counts.
            if self.record.is_none() {
                self.note(self.in_use, 0);
            }
            self.sequence = None;
            self.transfer = Some(Transfer {
                length,
                digest,
                erased: BTreeSet::new(),
            });
        }
        Ok(Response::Receiving(Receiving {
            slot: self.target() as u8,
            chunk: self.sizes.chunk as u16,
            window: 3,
        }))
    }

    fn write(
        &mut self,
        number: u32,
        offset: u32,
        bytes: &[u8],
        now_ms: u64,
    ) -> Result<Response, Refusal> {
        let slot = self.target();
        let running = self.transfer.as_mut();
        let running = running.filter(|running| running.number() == number);
        let running = running.ok_or(Refusal::NoTransfer)?;
        let left = running.length.saturating_sub(offset);
        let wanted = left.min(self.sizes.chunk) as usize;
        if !offset.is_multiple_of(self.sizes.chunk) || left == 0 || bytes.len() != wanted {
            return Err(Refusal::Chunk);
        }
        let sector = offset / self.sizes.sector;
        if !running.erased.contains(&sector) {
            self.erase(now_ms)?;
        }
        // What was there is gone, whatever comes of it.
        self.known[slot] = Known::Broken;
        let running = self.transfer.as_mut().expect("it runs");
        let start = (sector * self.sizes.sector) as usize;
        let range = start..start + self.sizes.sector as usize;
        self.touched = Some((slot, range.clone()));
        if running.erased.insert(sector) {
            self.slots[slot][range].fill(0xFF);
        }
        let place = &mut self.slots[slot][offset as usize..][..bytes.len()];
        if place != bytes {
            if place.iter().any(|byte| *byte != 0xFF) {
                // Other bytes came for this place; flash is not written twice.
                running.erased.remove(&sector);
                return Err(Refusal::Flash { offset });
            }
            place.copy_from_slice(bytes);
        }
        Ok(Response::Written)
    }

    fn activate(&mut self, number: u32, trial_s: u16, now_ms: u64) -> Result<Response, Refusal> {
        if let Some(trial) = self.trial {
            return if trial.transfer == number {
                Ok(self.now_in_use(now_ms))
            } else {
                Err(Refusal::OnTrial)
            };
        }
        let running = self.transfer.as_ref();
        let running = running.filter(|running| running.number() == number);
        let running = running.ok_or(Refusal::NoTransfer)?;
        let slot = self.target();
        let held = &self.slots[slot][..running.length as usize];
        // Only a file that is there byte by byte has this digest.
        let file = files()
            .iter()
            .find(|file| file.digest.0 == running.digest && file.bytes == held);
        let file = file.ok_or(Refusal::Incomplete)?;
        self.erase(now_ms)?;
        let verdict = file.verdict(self.owner, self.oldest());
        self.known[slot] = match (verdict, self.known[slot]) {
            (Ok(facts), _) => Known::Whole(facts),
            // What lay there before is still good to go back to.
            (Err(_), Known::Whole(facts)) if self.vouched(slot, facts).is_ok() => {
                Known::Whole(facts)
            }
            (Err(_), _) => Known::Broken,
        };
        verdict.map_err(Refusal::Table)?;
        let trial_ms = u64::from(trial_s.max(1)) * 1_000;
        self.trial = Some(Trial {
            ends_ms: now_ms + trial_ms,
            transfer: number,
            before: self.in_use,
        });
        self.transfer = None;
        self.ended = None;
        self.in_use = Some(slot);
        Ok(self.now_in_use(now_ms))
    }

    fn meant(&self, table: u32) -> Result<(), Refusal> {
        let used = self.table();
        if used.is_some_and(|used| used.id == table) {
            return Ok(());
        }
        Err(Refusal::NotInUse { table: used })
    }

    fn confirm(&mut self, table: u32, right: &[u8], now_ms: u64) -> Result<Response, Refusal> {
        self.meant(table)?;
        if self.trial.is_some() {
            self.may(right, 2, table, [0; 16])?;
            self.trial = None;
            self.note(self.in_use, self.facts().map_or(0, |facts| facts.oldest));
        }
        Ok(self.now_in_use(now_ms))
    }

    fn roll_back(&mut self, table: u32, right: &[u8], now_ms: u64) -> Result<Response, Refusal> {
        self.meant(table)?;
        if let Some(trial) = self.trial {
            self.may(right, 3, table, [0; 16])?;
            self.end_trial(trial, TableReason::RolledBack, now_ms);
            return Ok(self.now_in_use(now_ms));
        }
        let slot = self.target();
        let confirmed = self.record.and_then(|record| record.other);
        let other = self.whole(slot);
        let other = other.filter(|facts| facts.id != table && Some(facts.id) == confirmed);
        let facts = other.ok_or(Refusal::NoOther)?;
        self.may(right, 3, table, [0; 16])?;
        self.erase(now_ms)?;
        // It must be one that may run now; one that must not is no table.
        if let Err(rejected) = self.vouched(slot, facts) {
            self.known[slot] = Known::Broken;
            return Err(Refusal::Table(rejected));
        }
        self.note(Some(slot), 0);
        self.in_use = Some(slot);
        self.transfer = None;
        Ok(self.now_in_use(now_ms))
    }

    /// What a device with a key makes of a whole table in a slot now.
    fn vouched(&self, slot: usize, facts: Facts) -> Result<(), Rejected> {
        let Some(owner) = self.owner else {
            return Ok(());
        };
        let bytes = &self.slots[slot][..facts.length as usize];
        match files().iter().find(|file| file.bytes == bytes) {
            Some(file) => file.verdict(self.owner, self.floor()).map(|_| ()),
            // A whole table with a seal that was altered.
            None if bytes[bytes.len() - 72..][..8] != owner.key[..8] => Err(Rejected::WrongKey),
            None => Err(Rejected::Signature),
        }
    }

    fn provision(&mut self, owner: Owner, even_so: bool) -> Result<Response, Refusal> {
        if self.trial.is_some() && self.owner.is_none() {
            return Err(Refusal::OnTrial);
        }
        if self.owner.is_none() {
            // A table that would be lost at the next start.
            if let Some((slot, facts)) = self.in_use.zip(self.facts()).filter(|_| !even_so) {
                self.owner = Some(owner);
                let kept = self.vouched(slot, facts);
                self.owner = None;
                kept.map_err(Refusal::Table)?;
            }
            // From then on it is noted whether there is a key.
            if self.record.is_none() {
                self.note(self.in_use, 0);
            }
            self.owner = Some(owner);
            // The table in use stays until something else is.
            let others = [0, 1].into_iter().filter(|slot| self.in_use != Some(*slot));
            others
                .collect::<Vec<_>>()
                .into_iter()
                .for_each(|slot| self.look(slot));
        }
        if self.owner != Some(owner) {
            return Err(Refusal::HasKey);
        }
        Ok(Response::Provisioned)
    }

    fn note(&mut self, slot: Option<usize>, oldest: u32) {
        self.sequence = None;
        let id = |slot| Some((slot, self.whole(slot)?.id));
        let version = slot.and_then(|slot| self.whole(slot));
        let version = version.filter(|_| self.owner.is_some());
        let version = version.map_or(0, |facts| facts.version);
        let before = self.record.unwrap_or_default();
        let other = match before.table {
            Some((old, _)) if Some(old) == slot => before.other,
            Some((old, id)) => self.whole(old).filter(|it| it.id == id).map(|it| it.id),
            None => None,
        };
        self.record = Some(Record {
            table: slot.and_then(id),
            other,
            floor: self.floor().max(oldest),
            lengths: [0, 1].map(|slot| self.whole(slot).map_or(0, |facts| facts.length)),
            newest: before.newest.max(version),
        });
    }
}

const fn name(facts: Facts) -> TableName {
    TableName {
        id: facts.id,
        version: facts.version,
    }
}

/// CRC-32 (ISO-HDLC), bit by bit.
pub(super) fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xEDB8_8320 * (crc & 1))
        })
    })
}
