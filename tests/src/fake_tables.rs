//! The tables of the device that is none: the runtime's own updater over a simulated
//! flash.

use crate::flash_simulator::NorSimulator;
use iltm_runtime::image::content;
use iltm_runtime::link::{PassThrough, Request, Response};
use iltm_runtime::store::{Map, Slot, TableChange, TableSlots, Updater};
use iltm_runtime::trust::{Accepted, Rejected, Terms, admit};
use std::ops::Range;

/// Written in words, erased in sectors of 4 KiB.
pub type Flash = NorSimulator<4, 4_096>;

/// Bytes of a sector.
pub const SECTOR: usize = 4_096;

/// Sectors of a slot.
const SLOT: usize = 32;

/// Sectors: two slots, two for records, one for the identity.
const SECTORS: usize = 2 * SLOT + 3;

/// Where each slot is.
#[must_use]
pub const fn slot(index: usize) -> Range<usize> {
    index * SLOT * SECTOR..(index + 1) * SLOT * SECTOR
}

/// Which table frames would go through.
#[derive(Debug)]
struct FakeSlots {
    selected: Result<Slot, PassThrough>,
}

impl TableSlots<Flash> for FakeSlots {
    fn load(
        &mut self,
        flash: &Flash,
        slot: Slot,
        length: Option<u32>,
        terms: &Terms,
    ) -> Result<Accepted, Rejected> {
        let bytes = &flash.contents()[self::slot(slot.index())];
        let file = length.map_or_else(|| content(bytes), |length| &bytes[..length as usize]);
        admit(file, terms, &mut || ()).map(|(_, accepted)| accepted)
    }

    fn unload(&mut self, slot: Slot) {
        assert_ne!(self.selected, Ok(slot), "frames go through it");
    }

    fn select(&mut self, table: Result<Slot, PassThrough>) {
        self.selected = table;
    }

    fn yield_now(&mut self) {}
}

/// The tables of a device.
#[derive(Debug)]
pub struct FakeTables {
    updater: Option<Updater<Flash>>,
    map: Map,
    tables: FakeSlots,
    /// Offset of every chunk that came.
    pub writes: Vec<u32>,
    /// How often an activation was asked for.
    pub activations: u32,
    /// Restarts once so many chunks have come, before it answers the last.
    pub restart_after: Option<usize>,
    /// Carries out and answers nothing from the chunk of this number on.
    pub mute_after: Option<usize>,
}

impl Default for FakeTables {
    fn default() -> Self {
        Self::new(Flash::new(SECTORS, 1))
    }
}

impl FakeTables {
    /// What a device finds in this flash when it starts.
    ///
    /// # Panics
    /// If the flash is none that [`Self::default`] makes.
    #[must_use]
    pub fn new(flash: Flash) -> Self {
        let sector = |index: usize| (index * SECTOR) as u32..((index + 1) * SECTOR) as u32;
        let slots = [slot(0), slot(1)].map(|slot| slot.start as u32..slot.end as u32);
        let records = [sector(2 * SLOT), sector(2 * SLOT + 1)];
        let map = Map::new(&flash, slots, records, sector(2 * SLOT + 2)).expect("it fits");
        let mut tables = Self {
            updater: None,
            map,
            tables: FakeSlots {
                selected: Err(PassThrough::NoTable),
            },
            writes: Vec::new(),
            activations: 0,
            restart_after: None,
            mute_after: None,
        };
        tables.start(flash);
        tables
    }

    fn start(&mut self, flash: Flash) {
        self.tables.selected = Err(PassThrough::NoTable);
        self.updater = Some(Updater::start(flash, self.map, &mut self.tables));
    }

    /// As after a loss of power.
    ///
    /// # Panics
    /// Never.
    pub fn restart(&mut self) {
        let flash = self.updater.take().expect("running").into_flash();
        self.start(flash);
    }

    /// Of a device with this key and number.
    ///
    /// # Panics
    /// Never: the flash is new.
    #[must_use]
    pub fn provisioned(key: [u8; 32], device: u64) -> Self {
        let mut tables = Self::default();
        let response = tables.carry_out(Request::Provision { key, device }, 0);
        assert_eq!(response, Response::Provisioned);
        tables
    }

    /// The updater.
    ///
    /// # Panics
    /// Never.
    #[must_use]
    pub const fn updater(&self) -> &Updater<Flash> {
        self.updater.as_ref().expect("running")
    }

    /// Longest table.
    #[must_use]
    pub const fn slot_bytes(&self) -> u32 {
        self.map.slot_bytes()
    }

    /// What the flash holds.
    #[must_use]
    pub fn contents(&self) -> Vec<u8> {
        self.updater().flash().contents().to_vec()
    }

    /// Ends trials; what changed.
    ///
    /// # Panics
    /// Never.
    pub fn poll(&mut self, now_ms: u64) -> Option<TableChange> {
        let updater = self.updater.as_mut().expect("running");
        updater.poll(now_ms, &mut self.tables);
        updater.take_change()
    }

    /// Whether it answers nothing any more.
    #[must_use]
    pub fn is_mute(&self) -> bool {
        self.mute_after
            .is_some_and(|count| self.writes.len() >= count)
    }

    /// Whether it is about to restart; true once.
    pub fn restarts(&mut self) -> bool {
        let count = self.writes.len();
        self.restart_after
            .take_if(|after| count >= *after)
            .is_some()
    }

    /// Carries out a request.
    ///
    /// # Panics
    /// Never.
    pub fn carry_out(&mut self, request: Request<'_>, now_ms: u64) -> Response {
        match request {
            Request::Write { offset, .. } => self.writes.push(offset),
            Request::Activate { .. } => self.activations += 1,
            _ => {}
        }
        let updater = self.updater.as_mut().expect("running");
        updater.answer(request, now_ms, &mut self.tables)
    }
}
