//! Table slots of a simulated device: the runtime's own updater and admission over
//! simulated flash, with nothing but memory around them.

use crate::flash_simulator::NorSimulator;
use crate::signing_key;
use ed25519_dalek::{Signer, SigningKey};
use iltm_runtime::image::{Seal, content};
use iltm_runtime::link::{Digest, PassThrough, Refusal, Request, Response, Slots};
use iltm_runtime::store::{Map, Slot, TableSlots, Updater};
use iltm_runtime::trust::{Accepted, Deed, Rejected, Terms, admit};
use sha2::{Digest as _, Sha512};
use std::ops::Range;
use std::sync::OnceLock;

/// Where the slots of a device are: both at the start of the flash, then a sector for
/// each half of the records and one for the identity.
#[derive(Clone, Copy, Debug)]
pub struct SlotLayout {
    /// Sectors of a slot.
    pub slot: usize,
    /// Bytes of a sector.
    pub sector: usize,
}

impl SlotLayout {
    /// Sectors in all.
    pub const fn sectors(self) -> usize {
        2 * self.slot + 3
    }

    /// Where a slot is.
    pub const fn slot(self, slot: Slot) -> Range<usize> {
        let length = self.slot * self.sector;
        let start = slot.index() * length;
        start..start + length
    }

    fn sector(self, index: usize) -> Range<u32> {
        (index * self.sector) as u32..((index + 1) * self.sector) as u32
    }

    /// Where the device's key is.
    pub const fn identity(self) -> Range<usize> {
        let start = (2 * self.slot + 2) * self.sector;
        start..start + self.sector
    }

    /// As the store wants it.
    pub fn map<const W: usize, const E: usize>(self, flash: &NorSimulator<W, E>) -> Map {
        let slots = Slot::ALL.map(|slot| {
            let range = self.slot(slot);
            range.start as u32..range.end as u32
        });
        let after = 2 * self.slot;
        let records = [self.sector(after), self.sector(after + 1)];
        Map::new(flash, slots, records, self.sector(after + 2)).expect("it fits")
    }
}

/// Which table frames would go through.
#[derive(Clone, Debug)]
pub struct SimTables {
    layout: SlotLayout,
    /// The slot.
    pub selected: Result<Slot, PassThrough>,
    /// Slots whose table is kept.
    pub kept: [bool; 2],
    /// How often there was time for a frame.
    pub pauses: u32,
}

impl<const W: usize, const E: usize> TableSlots<NorSimulator<W, E>> for SimTables {
    fn examine(
        &mut self,
        flash: &NorSimulator<W, E>,
        slot: Slot,
        length: Option<u32>,
        terms: &Terms,
    ) -> Result<Accepted, Rejected> {
        let bytes = flash.contents().get(self.layout.slot(slot));
        let bytes = bytes.unwrap_or_default();
        let file = match length {
            Some(length) => bytes.get(..length as usize).unwrap_or(bytes),
            None => content(bytes),
        };
        let start = self.layout.slot(slot).start;
        let read = start..start + length.map_or(bytes.len(), |length| length as usize);
        assert!(flash.is_readable(read), "the processor faults");
        let pauses = &mut self.pauses;
        let (_, accepted) = admit(file, terms, &mut || *pauses += 1)?;
        Ok(accepted)
    }

    fn load(
        &mut self,
        flash: &NorSimulator<W, E>,
        slot: Slot,
        length: Option<u32>,
        terms: &Terms,
    ) -> Result<Accepted, Rejected> {
        *slot.of_mut(&mut self.kept) = false;
        let accepted = self.examine(flash, slot, length, terms)?;
        *slot.of_mut(&mut self.kept) = true;
        Ok(accepted)
    }

    fn unload(&mut self, slot: Slot) {
        assert_ne!(self.selected, Ok(slot), "frames go through it");
        *slot.of_mut(&mut self.kept) = false;
    }

    fn select(&mut self, table: Result<Slot, PassThrough>) {
        if let Ok(slot) = table {
            assert!(*slot.of(&self.kept), "a table that is not there");
        }
        self.selected = table;
    }

    fn yield_now(&mut self) {
        self.pauses += 1;
    }
}

/// A device without a line.
#[derive(Clone, Debug)]
pub struct SimDevice<const W: usize, const E: usize> {
    /// Its store.
    pub updater: Updater<NorSimulator<W, E>>,
    /// Its tables.
    pub tables: SimTables,
    layout: SlotLayout,
    /// Milliseconds since it started.
    pub now_ms: u64,
}

impl<const W: usize, const E: usize> SimDevice<W, E> {
    /// One fresh from the factory.
    pub fn new(slot: usize, seed: u64) -> Self {
        let layout = SlotLayout { slot, sector: E };
        Self::start(NorSimulator::new(layout.sectors(), seed), layout)
    }

    /// One that finds this in its flash when it starts.
    pub fn start(flash: NorSimulator<W, E>, layout: SlotLayout) -> Self {
        Self::start_after(false, flash, layout)
    }

    fn start_after(crashes: bool, flash: NorSimulator<W, E>, layout: SlotLayout) -> Self {
        let mut tables = SimTables {
            layout,
            selected: Err(PassThrough::NoTable),
            kept: [false; 2],
            pauses: 0,
        };
        let map = layout.map(&flash);
        let updater = Updater::start_after(crashes, flash, map, &mut tables);
        Self {
            updater,
            tables,
            layout,
            now_ms: 0,
        }
    }

    /// The same after a loss of power.
    pub fn restarted(self) -> Self {
        let mut flash = self.updater.into_flash();
        flash.power_on();
        Self::start(flash, self.layout)
    }

    /// The same after it has crashed again and again.
    pub fn restarted_after_crashes(self) -> Self {
        Self::start_after(true, self.updater.into_flash(), self.layout)
    }

    /// What it does where the table in use has rotted.
    pub fn abandon(&mut self) {
        self.updater.abandon(&mut self.tables);
    }

    /// Asks it something.
    pub fn ask(&mut self, request: Request<'_>) -> Response {
        self.updater.answer(request, self.now_ms, &mut self.tables)
    }

    /// What is in its slots.
    pub fn slots(&mut self) -> Slots {
        match self.ask(Request::Slots) {
            Response::Slots(slots) => slots,
            other => panic!("not to a question for the slots: {other:?}"),
        }
    }

    /// The right to do this now.
    pub fn right(&mut self, deed: &Deed) -> Vec<u8> {
        right(&self.slots(), deed)
    }

    /// Time passes.
    pub fn wait(&mut self, milliseconds: u64) {
        self.poll(self.now_ms + milliseconds);
    }

    /// It is so late now; trials end.
    pub fn poll(&mut self, now_ms: u64) {
        self.now_ms = now_ms;
        self.updater.poll(now_ms, &mut self.tables);
    }

    /// The flash.
    pub const fn flash(&self) -> &NorSimulator<W, E> {
        self.updater.flash()
    }

    /// Where its slots are.
    pub const fn layout(&self) -> SlotLayout {
        self.layout
    }

    /// Whether frames go through exactly this file.
    pub fn runs(&self, file: &[u8]) -> bool {
        let Some(slot) = self.updater.in_use() else {
            return false;
        };
        let bytes = &self.flash().contents()[self.layout.slot(slot)];
        self.tables.selected == Ok(slot) && bytes.starts_with(file)
    }

    /// The whole way of a file into use, without a line: transfer, trial and, if
    /// wanted, confirmation. Sectors that hold it already are left out, as a host does.
    ///
    /// # Errors
    /// The first refusal.
    pub fn update(&mut self, file: &[u8], confirm: bool) -> Result<(), Refusal> {
        for step in self.plan(file, confirm) {
            self.carry_out(file, &step)?;
        }
        Ok(())
    }

    /// The steps of [`update`](Self::update) from what is in the flash now.
    pub fn plan(&self, file: &[u8], confirm: bool) -> Vec<Step> {
        let target = self.updater.in_use().map_or(Slot::A, Slot::other);
        let held = &self.flash().contents()[self.layout.slot(target)];
        let sector = self.updater.map().sector() as usize;
        let chunk = usize::from(self.updater.map().chunk());
        let mut steps = vec![Step::Begin];
        for start in (0..file.len()).step_by(sector) {
            let end = file.len().min(start + sector);
            if held[start..end] != file[start..end] {
                let offsets = (start..end).step_by(chunk);
                steps.extend(offsets.map(|offset| Step::Write(offset as u32)));
            }
        }
        steps.push(Step::Activate);
        steps.extend(confirm.then_some(Step::Confirm));
        steps
    }

    /// One step of an update with `file`.
    ///
    /// # Errors
    /// The refusal.
    pub fn carry_out(&mut self, file: &[u8], step: &Step) -> Result<(), Refusal> {
        let digest = digest(file);
        let transfer = digest.transfer();
        let table = self.updater.table().map_or(0, |table| table.id);
        let right;
        let request = match *step {
            Step::Begin => {
                let length = file.len() as u32;
                right = self.right(&Deed::Begin { length, digest });
                Request::Begin {
                    length,
                    digest,
                    right: &right,
                }
            }
            Step::Write(offset) => {
                let start = offset as usize;
                let end = file
                    .len()
                    .min(start + usize::from(self.updater.map().chunk()));
                Request::Write {
                    transfer,
                    offset,
                    bytes: &file[start..end],
                }
            }
            Step::Activate => Request::Activate {
                transfer,
                trial_s: TRIAL_S,
            },
            Step::Confirm => {
                right = self.right(&Deed::Confirm { table });
                let right = &right;
                Request::Confirm { table, right }
            }
            Step::Rollback => {
                right = self.right(&Deed::Rollback { table });
                let right = &right;
                Request::Rollback { table, right }
            }
            Step::TrialOver => {
                self.wait(u64::from(TRIAL_S) * 1_000);
                return Ok(());
            }
        };
        match self.ask(request) {
            Response::Refused(refusal) => Err(refusal),
            _ => Ok(()),
        }
    }
}

/// What a device with one of the tests' [keys](signing_key) wants to be shown; nothing for
/// a device without a key.
pub fn right(slots: &Slots, deed: &Deed) -> Vec<u8> {
    static KEYS: OnceLock<Vec<SigningKey>> = OnceLock::new();
    let keys = KEYS.get_or_init(|| (0..64).map(signing_key).collect());
    let known = |key: &&SigningKey| slots.key == Some(Seal::key_id(key.verifying_key().as_bytes()));
    let message = deed.message(slots.device, slots.sequence);
    let key = keys.iter().find(known);
    key.map_or(Vec::new(), |key| key.sign(&message).to_bytes().to_vec())
}

/// A request to give a device its number, and the key whose tables it takes from then on.
pub fn provision(key: &SigningKey, device: u64) -> Request<'static> {
    let key = key.verifying_key().to_bytes();
    Request::Provision {
        key,
        device,
        even_so: true,
    }
}

/// Seconds of a trial.
pub const TRIAL_S: u16 = 60;

/// A step of an update.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// The transfer begins.
    Begin,
    /// The chunk at this offset.
    Write(u32),
    /// Check, and use on trial.
    Activate,
    /// The table on trial is kept.
    Confirm,
    /// Back to the table before.
    Rollback,
    /// Nobody confirms in time.
    TrialOver,
}

/// What tells a file from others.
pub fn digest(file: &[u8]) -> Digest {
    Digest::of(&Sha512::digest(file))
}
