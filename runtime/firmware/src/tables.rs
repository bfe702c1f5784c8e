//! Which slot's table is used, and why not.

use crate::board::TableFlash;
use iltm_runtime::image::layout::header;
use iltm_runtime::image::{ImageError, Table};
use iltm_runtime::link::{Fault, PassThrough, SlotState, TableFault, TableName};
use static_cell::StaticCell;

/// What the slots hold.
pub struct Tables {
    /// The table in use, or why there is none.
    pub active: Result<Table<'static>, PassThrough>,
    /// Its name.
    pub name: Option<TableName>,
    /// Every slot.
    pub slots: [SlotState; 2],
    /// The last slot that was refused.
    pub fault: Option<Fault>,
}

impl Tables {
    /// Checks both slots, once; the first good table is used, where it lies. `None`
    /// after that.
    ///
    /// The check needs more stack than anything else. Not inlined, so that it is
    /// not on top of the frame loop's.
    #[inline(never)]
    pub fn take(flash: &impl TableFlash) -> Option<&'static Self> {
        static TABLES: StaticCell<Tables> = StaticCell::new();
        let tables = TABLES.try_init_with(|| Self::new(flash))?;
        Some(tables)
    }

    fn new(flash: &impl TableFlash) -> Self {
        let mut tables = Self {
            active: Err(PassThrough::NoTable),
            name: None,
            slots: [SlotState::Empty; 2],
            fault: None,
        };
        for index in 0..tables.slots.len() {
            let state = tables.look(index, flash.slot(index));
            if let Some(slot) = tables.slots.get_mut(index) {
                *slot = state;
            }
        }
        tables
    }

    fn look(&mut self, index: usize, slot: &'static [u8]) -> SlotState {
        // Flash is all ones when erased; memory that stands for it, zeros.
        let head = slot.get(..header::SIZE).unwrap_or_default();
        if head.iter().all(|byte| *byte == 0xFF) || head.iter().all(|byte| *byte == 0) {
            return SlotState::Empty;
        }
        let image = image(slot);
        match Table::check(image) {
            Ok(_) if self.active.is_ok() => SlotState::Valid,
            Ok(table) => {
                self.name = Some(TableName {
                    id: table.id(),
                    version: 0,
                });
                self.active = Ok(table);
                SlotState::Active
            }
            Err(error) => {
                self.refuse(index, &error);
                SlotState::Broken
            }
        }
    }

    fn refuse(&mut self, index: usize, error: &ImageError) {
        let cause = TableFault::from(error);
        defmt::error!(
            "slot {=usize}: the table is refused, cause {=u8}",
            index,
            cause as u8
        );
        self.fault = Some(Fault::Table {
            slot: index as u8,
            cause,
        });
        if self.active.is_err() {
            self.active = Err(PassThrough::BrokenTable);
        }
    }
}

/// The image at the start of a slot, as long as it says that it is, or the whole
/// slot if that is longer.
#[must_use]
pub fn image(slot: &[u8]) -> &[u8] {
    let length = slot
        .get(header::LENGTH)
        .and_then(|field| field.try_into().ok());
    let length = length.map_or(0, |field| u32::from_le_bytes(field) as usize);
    slot.get(..length).unwrap_or(slot)
}
