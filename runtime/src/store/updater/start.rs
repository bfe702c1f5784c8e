//! Start of an updater: the tables and records that it finds.

use super::Updater;
use crate::image::layout::header;
use crate::link::{Fault, PassThrough};
use crate::store::identity::Found;
use crate::store::journal::Journal;
use crate::store::record::{Commit, Identity};
use crate::store::wear::WearLimit;
use crate::store::{Map, Slot, TableSlots, flash, identity};
use crate::trust::{Accepted, Rejected, Terms, Trust};
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Updater<F> {
    /// After a start: finds the table that counts, checks it and has it used; with
    /// the other one if that fails, or none.
    pub fn start(flash: F, map: Map, slots: &mut impl TableSlots<F>) -> Self {
        Self::start_after(false, flash, map, slots)
    }

    /// [`start`](Self::start) of a device that may have crashed again and again: then the
    /// table that counts is neither looked at nor used, nor is another one in its place,
    /// which may be to blame as little or as much. The next table goes into its slot.
    #[inline(never)]
    pub fn start_after(
        crashes: bool,
        mut flash: F,
        map: Map,
        slots: &mut impl TableSlots<F>,
    ) -> Self {
        let journal = Journal::find(&mut flash, map.records());
        let found = identity::find(&mut flash, map.identity(), journal.last());
        let trust = match found {
            Found::Identity(Identity { key, device }) => Trust {
                key: Some(key),
                device,
            },
            Found::Nothing | Found::Lost => Trust::default(),
        };
        let erases = journal.last().unwrap_or_default().erases;
        let mut updater = Self {
            flash,
            map,
            trust,
            has_lost_key: found == Found::Lost,
            journal,
            erases,
            tables: [None; 2],
            broken: [false; 2],
            in_use: None,
            suspect: None,
            compared_ms: None,
            transfer: None,
            trial: None,
            ended: None,
            wear: WearLimit::new(map.slot_bytes() / map.sector().max(1)),
            fault: None,
            change: None,
        };
        updater.settle();
        if crashes {
            let counts = updater.journal.last().and_then(|last| last.table);
            updater.suspect = Some(counts.map_or(Slot::A, |(slot, _)| slot));
        }
        for slot in Slot::ALL {
            updater.look(slot, slots);
        }
        if !crashes {
            updater.in_use = updater.choose();
        }
        if updater.has_lost_key {
            updater.fault = Some(Fault::KeyLost);
        }
        let chosen = updater.in_use.ok_or(updater.absence());
        slots.select(chosen);
        updater
    }

    /// Ends the doubt about a record that may have been cut, and has the last one say that
    /// there is a key. A flash that fails here leaves things as they are.
    fn settle(&mut self) {
        let noted = self.journal.last().is_none_or(|last| last.has_key);
        if self.journal.is_uncertain() || self.trust.key.is_some() && !noted {
            let _ = self.renew_record();
        }
    }

    /// Checks what is in a slot.
    #[inline(never)]
    pub(super) fn look(&mut self, slot: Slot, slots: &mut impl TableSlots<F>) {
        let part = self.map.slot(slot);
        let head = header::SIZE as u32;
        let empty = flash::is_blank(&mut self.flash, part, 0, head).unwrap_or(false);
        *slot.of_mut(&mut self.tables) = None;
        *slot.of_mut(&mut self.broken) = false;
        if empty {
            return;
        }
        let last = self.journal.last();
        let meant = last.and_then(|last| last.table);
        let unknown = self.has_lost_key && meant.is_none_or(|(meant, _)| meant != slot);
        // Without a record, which of the two was used is not known.
        let suspect = self.suspect.is_some_and(|it| it == slot || meant.is_none());
        if unknown || suspect {
            // Who signed it cannot be told, while what was confirmed may run on; or the
            // check itself may be what the device crashes in.
            *slot.of_mut(&mut self.broken) = true;
            return;
        }
        let noted = last.map(|last| *slot.of(&last.lengths));
        let noted = noted.filter(|length| *length > 0);
        let mut loaded = self.load(slot, noted, slots);
        // The length is that of the table before, if this one was on trial at a restart.
        if loaded.is_err() && noted.is_some() && meant.is_none_or(|(meant, _)| meant != slot) {
            loaded = self.load(slot, None, slots);
        }
        let loaded = loaded.and_then(|accepted| match meant {
            // Something else was put there past this code.
            Some((meant, id)) if meant == slot && id != accepted.id => {
                slots.unload(slot);
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

    /// Checks the file of this length, or of the one that it states itself.
    fn load(
        &mut self,
        slot: Slot,
        length: Option<u32>,
        slots: &mut impl TableSlots<F>,
    ) -> Result<Accepted, Rejected> {
        let part = self.map.slot(slot);
        // It will be read like memory: flash with ECC faults there at a unit that was cut, where
        // [`read`](embedded_storage::nor_flash::ReadNorFlash::read) gives an error.
        let bytes = length.unwrap_or(part.length);
        let readable = flash::read(&mut self.flash, part, 0, bytes, |_| {
            slots.yield_now();
            true
        });
        if readable.is_err() {
            slots.unload(slot);
            return Err(Rejected::Damaged);
        }
        slots.load(&self.flash, slot, length, &self.terms())
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
    pub(super) fn absence(&self) -> PassThrough {
        if self.suspect.is_some() {
            PassThrough::CrashLoop
        } else if self.fault.is_some() {
            PassThrough::BrokenTable
        } else {
            PassThrough::NoTable
        }
    }

    /// What a table must meet in any case.
    pub(super) fn terms(&self) -> Terms {
        Terms {
            trust: self.trust,
            floor: self.journal.last().map_or(0, |last| last.floor),
        }
    }
}
