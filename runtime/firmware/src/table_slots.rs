//! Table slots: the tables of both, checked, and the one that frames go through.

use crate::board::{Board, TableFlash};
use crate::frames::Frames;
use crate::hooks::FrameHooks;
use iltm_runtime::image::{Checked, Recheck, Table, content};
use iltm_runtime::link::PassThrough;
use iltm_runtime::store::{Slot, TableSlots};
use iltm_runtime::trust::{Accepted, Rejected, Terms, examine};
use static_cell::StaticCell;

/// The tables of slot A and slot B, where they are good.
pub type Tables = [Option<Table<'static>>; 2];

/// Not on the stack: each has room for all segments that an operator may have.
/// Written at the start rather than copied from the image, which would hold it twice.
static TABLES: StaticCell<Tables> = StaticCell::new();

/// The places for the tables, once.
pub(crate) fn take() -> Option<&'static mut Tables> {
    TABLES.try_init_with(|| [None, None])
}

/// Not inlined: the table on its way to its place would lie on the stack under the
/// check, and under the frames that go on meanwhile.
#[inline(never)]
fn put(place: &mut Option<Table<'static>>, checked: &Checked<'static>) {
    *place = Some(checked.table());
}

/// The bytes of a slot that are a table's file, by its length where that is known.
fn file(bytes: &[u8], length: Option<u32>) -> &[u8] {
    match length {
        Some(length) => bytes.get(..length as usize).unwrap_or(bytes),
        None => content(bytes),
    }
}

impl<B: Board, H: FrameHooks> Frames<B, H> {
    /// Not inlined: it is called twice.
    #[inline(never)]
    fn check(
        &mut self,
        flash: &B::Flash,
        slot: Slot,
        length: Option<u32>,
        terms: &Terms,
    ) -> Result<(Checked<'static>, Accepted), Rejected> {
        // Of one type for all checks, which are compiled once, here, and small.
        let yield_now: &mut dyn FnMut() = &mut || {
            self.round();
        };
        examine(file(flash.slot(slot), length), terms, yield_now)
    }
}

impl<B: Board, H: FrameHooks> TableSlots<B::Flash> for Frames<B, H> {
    fn examine(
        &mut self,
        flash: &B::Flash,
        slot: Slot,
        length: Option<u32>,
        terms: &Terms,
    ) -> Result<Accepted, Rejected> {
        Ok(self.check(flash, slot, length, terms)?.1)
    }

    fn load(
        &mut self,
        flash: &B::Flash,
        slot: Slot,
        length: Option<u32>,
        terms: &Terms,
    ) -> Result<Accepted, Rejected> {
        self.unload(slot);
        let (checked, accepted) = self.check(flash, slot, length, terms)?;
        put(slot.of_mut(self.tables), &checked);
        let mut recheck = Recheck::new(file(flash.slot(slot), length));
        while recheck.step().is_none() {
            self.round();
        }
        *slot.of_mut(&mut self.rechecks) = Some(recheck);
        Ok(accepted)
    }

    fn unload(&mut self, slot: Slot) {
        *slot.of_mut(self.tables) = None;
        *slot.of_mut(&mut self.rechecks) = None;
    }

    fn select(&mut self, table: Result<Slot, PassThrough>) {
        if let Ok(slot) = table {
            self.prepare(slot);
        }
        self.in_use = table;
        self.restage();
    }

    fn yield_now(&mut self) {
        self.round();
    }
}
