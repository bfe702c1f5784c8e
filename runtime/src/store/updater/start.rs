//! What an updater finds when the device starts.

use super::Updater;
use crate::image::layout::header;
use crate::link::{Fault, PassThrough};
use crate::store::journal::Journal;
use crate::store::record::Commit;
use crate::store::{Map, Shelf, Slot, flash, identity};
use crate::trust::{Rejected, Terms, Trust};
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Updater<F> {
    /// After a start: finds the table that counts, checks it and has it used; with
    /// the other one if that fails, or none.
    #[inline(never)]
    pub fn start(mut flash: F, map: Map, shelf: &mut impl Shelf<F>) -> Self {
        let identity = identity::find(&mut flash, map.identity());
        if identity.is_none() {
            // A flash that fails here leaves things as they are.
            let _ = identity::settle(&mut flash, map.identity());
        }
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

    /// Ends the doubt about a record that may have been cut. A flash that fails here leaves
    /// things as they are.
    fn settle(&mut self) {
        if let Some(last) = self.journal.last().filter(|_| self.journal.is_doubtful()) {
            let _ = self.append(last);
        }
    }

    /// Checks what is in a slot.
    #[inline(never)]
    pub(super) fn look(&mut self, slot: Slot, shelf: &mut impl Shelf<F>) {
        let part = self.map.slot(slot);
        let head = header::SIZE as u32;
        let empty = flash::is_blank(&mut self.flash, part, 0, head).unwrap_or(false);
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
    pub(super) fn absence(&self) -> PassThrough {
        if self.fault.is_some() {
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
