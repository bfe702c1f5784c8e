//! The table slots of a device, in words.

use super::status::table_name;
use iltm_runtime::link::{SlotInfo, SlotState, Slots, TableName};
use serde_json::{Value, json};
use std::fmt::Write;

/// `A` or `B`.
pub(super) const fn letter(slot: u8) -> char {
    if slot == 0 { 'A' } else { 'B' }
}

/// What names a key.
pub(super) fn key_id(id: &[u8]) -> String {
    let mut text = String::new();
    for byte in id {
        let _ = write!(text, "{byte:02x}");
    }
    text
}

fn used(slots: &Slots) -> Option<&SlotInfo> {
    let mut all = slots.slots.iter();
    all.find(|slot| matches!(slot.state, SlotState::Active | SlotState::Trial))
}

/// The table in use.
pub(super) fn in_use(slots: &Slots) -> Option<TableName> {
    used(slots)?.table
}

/// The table to go back to.
pub(super) fn other(slots: &Slots) -> Option<TableName> {
    let mut all = slots.slots.iter();
    all.find(|slot| slot.state == SlotState::Valid)?.table
}

/// Whether a file of this length with this table is in use.
pub(super) fn uses(slots: &Slots, table: TableName, length: usize) -> bool {
    used(slots).is_some_and(|slot| slot.table == Some(table) && slot.length as usize == length)
}

/// For programs.
pub(super) fn data(slots: &Slots) -> Value {
    let slot = |slot: &SlotInfo| {
        json!({
            "state": slot.state.to_string(),
            "table": table_name(slot.table),
            "bytes": slot.length,
            "erases": slot.erases,
        })
    };
    json!({
        "slots": slots.slots.iter().map(slot).collect::<Vec<_>>(),
        "target": letter(slots.target).to_string(),
        "trial_ms": slots.trial_ms,
        "oldest": slots.oldest,
        "key": slots.key.map(|id| key_id(&id)),
        "number": format!("{:016x}", slots.device),
        "sector_bytes": slots.sector,
        "record_erases": slots.record_erases,
    })
}

/// A line a slot.
pub(super) fn lines(slots: &Slots) -> Vec<String> {
    let line = |(index, slot): (u8, &SlotInfo)| {
        let table = match slot.table {
            Some(table) => format!("table {table}, {} bytes, ", slot.length),
            None => String::new(),
        };
        let trial = match slot.state {
            SlotState::Trial => format!(", {} s left", slots.trial_ms.div_ceil(1_000)),
            _ => String::new(),
        };
        let erases = match slot.erases {
            // The device notes it when a table is confirmed.
            0 if slot.state == SlotState::Broken => {
                return format!("{} no whole table", letter(index));
            }
            0 => "never erased".to_owned(),
            1 => "erased once".to_owned(),
            times => format!("erased {times} times"),
        };
        let state = match slot.state {
            // A transfer that was cut is no defect.
            SlotState::Broken => "no whole table".to_owned(),
            state => state.to_string(),
        };
        format!("{} {state}{trial}: {table}{erases}", letter(index))
    };
    (0..).zip(&slots.slots).map(line).collect()
}

/// Whose tables the device takes.
pub(super) fn trust(slots: &Slots) -> String {
    match slots.key {
        Some(id) => format!("{}; versions from {} on", key_id(&id), slots.oldest),
        None if slots.oldest == u32::MAX => "lost: this device takes no table".to_owned(),
        None => "none: this device takes tables from anybody (`iltm key install`)".to_owned(),
    }
}
