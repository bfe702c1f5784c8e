//! Journal of commit records, one behind the other, in two parts of the flash in turn.

use super::StoreError;
use super::flash;
use super::map::Part;
use super::record::{self, Commit, Contents, places};
use embedded_storage::nor_flash::NorFlash;

/// Where the last record is and where the next one goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Journal {
    parts: [Part; 2],
    /// Index of the part with the record that counts.
    part: usize,
    /// Place of the next record there.
    next: u32,
    last: Option<Commit>,
    /// Places between the last record and the next one, which hold something that is
    /// no record now.
    corrupt: u32,
    /// Whether that part was erased since the start.
    is_fresh: bool,
    /// Whether the record that counts was written whole, beyond doubt: its duplicate is
    /// there.
    has_duplicate: bool,
    /// Whether the other part holds something behind its last record that is none now.
    is_other_cut: bool,
}

impl Journal {
    /// Finds the record that counts. A place that cannot be read counts as corrupt.
    pub(super) fn find<F: NorFlash>(flash: &mut F, parts: [Part; 2]) -> Self {
        let mut journal = Self {
            parts,
            part: 0,
            next: 0,
            last: None,
            corrupt: 0,
            is_fresh: false,
            has_duplicate: false,
            is_other_cut: false,
        };
        for (index, part) in parts.into_iter().enumerate() {
            let (mut newest, mut next, mut corrupt) = (None::<Commit>, 0, 0);
            let (mut before, mut duplicated) = (None::<Commit>, false);
            for place in 0..places(part) {
                let found = record::look::<F, Commit>(flash, part, place);
                let previous = before.take();
                match found.unwrap_or(Contents::Corrupt) {
                    Contents::Blank => {}
                    Contents::Corrupt => {
                        next = place + 1;
                        corrupt += 1;
                    }
                    Contents::Record(commit) => {
                        next = place + 1;
                        before = Some(commit);
                        if newest.is_none_or(|newest| newest.sequence <= commit.sequence) {
                            newest = Some(commit);
                            corrupt = 0;
                            duplicated =
                                previous.is_some_and(|previous| previous.is_duplicate(&commit));
                        }
                    }
                }
            }
            let newer = match (newest, journal.last) {
                (Some(new), Some(old)) => new.sequence > old.sequence,
                (Some(_), None) => true,
                // Without any record, the part with more room.
                (None, None) => index > 0 && next < journal.next,
                (None, Some(_)) => false,
            };
            if index == 0 || newer {
                journal.is_other_cut = index > 0 && journal.corrupt > 0;
                journal.part = index;
                journal.next = next;
                journal.last = newest;
                journal.corrupt = corrupt;
                journal.has_duplicate = duplicated;
            } else {
                journal.is_other_cut = corrupt > 0;
            }
        }
        journal
    }

    /// The record that counts.
    pub(super) const fn last(&self) -> Option<Commit> {
        self.last
    }

    /// Whether a record was cut, the one that counts or one after it. It might be read
    /// otherwise another time; a record behind it, with a higher number, ends that.
    pub(super) const fn is_uncertain(&self) -> bool {
        let [part, _] = self.parts;
        self.corrupt > 0 || self.is_other_cut || !self.has_duplicate && has_duplicates(part)
    }

    /// Writes a record; from then on it counts. Returns how many parts were erased for
    /// it.
    ///
    /// Its duplicate follows at once: where that has begun, the record before it is whole
    /// however often it is read. A part with room for one record only has no duplicates.
    ///
    /// The first one after a start goes to the other part, erased anew: a place behind
    /// the last record may look blank and yet have been cut before any of its bits
    /// changed, and flash must not be written twice.
    ///
    /// # Errors
    /// [`StoreError`]; the record before still counts then.
    pub(super) fn append<F: NorFlash>(
        &mut self,
        flash: &mut F,
        mut commit: Commit,
    ) -> Result<u32, StoreError> {
        commit.sequence = match self.last {
            // 2^32 records outlast any flash.
            Some(last) => last.sequence.saturating_add(1),
            None => 0,
        };
        commit.sequence = commit.sequence.saturating_add(self.corrupt);
        let [first, second] = self.parts;
        let parts = if self.part == 0 {
            [first, second]
        } else {
            [second, first]
        };
        let [here, there] = parts;
        if self.is_fresh && self.try_places(flash, here, &commit) {
            return Ok(0);
        }
        let [.., records] = &mut commit.erases;
        *records = records.saturating_add(1);
        flash::erase(flash, there, 0, there.length)?;
        self.is_other_cut = false;
        let (part, next) = (self.part, self.next);
        self.part = 1 - part;
        self.next = 0;
        if self.try_places(flash, there, &commit) {
            self.is_fresh = true;
            return Ok(1);
        }
        // The part with the record that counts stays the one to keep.
        self.part = part;
        self.next = next;
        self.is_fresh = false;
        Err(StoreError::Full)
    }

    /// Writes to the first place that takes it.
    fn try_places<F: NorFlash>(&mut self, flash: &mut F, part: Part, commit: &Commit) -> bool {
        let duplicates = has_duplicates(part);
        while self.next + u32::from(duplicates) < places(part) {
            let place = self.next;
            self.next += 1;
            if record::write(flash, part, place, commit).is_ok() {
                self.last = Some(*commit);
                self.corrupt = 0;
                if duplicates {
                    self.add_duplicate(flash, part, commit);
                }
                return true;
            }
            self.corrupt += 1;
        }
        false
    }

    /// Writes the record that counts once more. Where that fails, the next start does it.
    fn add_duplicate<F: NorFlash>(&mut self, flash: &mut F, part: Part, commit: &Commit) {
        let duplicate = Commit {
            sequence: commit.sequence.saturating_add(1),
            ..*commit
        };
        let place = self.next;
        self.next += 1;
        self.has_duplicate = record::write(flash, part, place, &duplicate).is_ok();
        if self.has_duplicate {
            self.last = Some(duplicate);
        } else {
            self.corrupt += 1;
        }
    }
}

/// Whether a part has room for a record and its duplicate.
const fn has_duplicates(part: Part) -> bool {
    places(part) > 1
}
