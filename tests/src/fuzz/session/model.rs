//! Model of a device: what it may do, as plainly as it can be said.
//!
//! Written from the protocol and the store's promises, not from the store: flash is
//! two vectors of bytes, the records are one `Option`, and which files may run is
//! known from how they were made ([`files`](crate::fuzz::files)).

use crate::fuzz::files::{Facts, Owner, files, judge};
use iltm_runtime::link::{
    InUse, Receiving, Refusal, Request, Response, Sectors, SlotInfo, SlotState, Slots, TableName,
};
use iltm_runtime::trust::Rejected;
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
            compared_ms: None,
            touched: None,
        }
    }

    /// After a loss of power: what is in flash is all that it knows.
    pub(super) fn start(&mut self) {
        self.trial = None;
        self.transfer = None;
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
            self.trial = None;
            self.in_use = trial.before;
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
            Some(_) => used.max(self.floor()),
            None => 0,
        }
    }

    /// How the slots are.
    pub(super) fn states(&self) -> [SlotState; 2] {
        [0, 1].map(|slot| match self.known[slot] {
            Known::Nothing => SlotState::Empty,
            Known::Broken => SlotState::Broken,
            Known::Whole(_) if self.in_use != Some(slot) => SlotState::Valid,
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
            Request::Begin { length, digest } => self.begin(length, digest.0),
            Request::Write {
                transfer,
                offset,
                bytes,
            } => self.write(transfer, offset, bytes),
            Request::Activate { transfer, trial_s } => self.activate(transfer, trial_s, now_ms),
            Request::Confirm { table } => self.confirm(table, now_ms),
            Request::Rollback { table } => self.roll_back(table, now_ms),
            Request::Provision { key, device } => self.provision(Owner { key, device }),
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

    fn begin(&mut self, length: u32, digest: [u8; 16]) -> Result<Response, Refusal> {
        if self.trial.is_some() {
            return Err(Refusal::OnTrial);
        }
        self.fits(length)?;
        // From the first transfer on it is noted which table counts.
        if self.record.is_none() {
            self.note(self.in_use, 0);
        }
        let goes_on = |old: &Transfer| (old.length, old.digest) == (length, digest);
        if !self.transfer.as_ref().is_some_and(goes_on) {
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

    fn write(&mut self, number: u32, offset: u32, bytes: &[u8]) -> Result<Response, Refusal> {
        let slot = self.target();
        let running = self.transfer.as_mut();
        let running = running.filter(|running| running.number() == number);
        let running = running.ok_or(Refusal::NoTransfer)?;
        let left = running.length.saturating_sub(offset);
        let wanted = left.min(self.sizes.chunk) as usize;
        if !offset.is_multiple_of(self.sizes.chunk) || left == 0 || bytes.len() != wanted {
            return Err(Refusal::Chunk);
        }
        // What was there is gone, whatever comes of it.
        self.known[slot] = Known::Broken;
        let sector = offset / self.sizes.sector;
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

    fn confirm(&mut self, table: u32, now_ms: u64) -> Result<Response, Refusal> {
        self.meant(table)?;
        if self.trial.take().is_some() {
            self.note(self.in_use, self.facts().map_or(0, |facts| facts.oldest));
        }
        Ok(self.now_in_use(now_ms))
    }

    fn roll_back(&mut self, table: u32, now_ms: u64) -> Result<Response, Refusal> {
        self.meant(table)?;
        if let Some(trial) = self.trial.take() {
            self.in_use = trial.before;
            return Ok(self.now_in_use(now_ms));
        }
        let slot = self.target();
        let confirmed = self.record.and_then(|record| record.other);
        let other = self.whole(slot);
        let other = other.filter(|facts| facts.id != table && Some(facts.id) == confirmed);
        let facts = other.ok_or(Refusal::NoOther)?;
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

    fn provision(&mut self, owner: Owner) -> Result<Response, Refusal> {
        if self.trial.is_some() && self.owner.is_none() {
            return Err(Refusal::OnTrial);
        }
        if self.owner.is_none() {
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
        let id = |slot| Some((slot, self.whole(slot)?.id));
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
