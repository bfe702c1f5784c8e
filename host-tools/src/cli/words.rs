//! Words and data that several commands have in common: a device, its state, its tables.

use iltm_runtime::image::Label;
use iltm_runtime::link::{
    Clipping, FrameKind, Hello, Mode, PassThrough, SlotInfo, SlotState, Slots, Status, TableAbout,
    TableName, TableReason,
};
use serde_json::{Value, json};
use std::fmt::{self, Write};

/// Lines under a heading, the following ones indented as far.
pub(super) fn lines(heading: &str, lines: &[String]) -> String {
    let indent = " ".repeat(heading.len());
    let mut text = String::new();
    for (at, line) in lines.iter().enumerate() {
        let start = if at == 0 { heading } else { &indent };
        let _ = writeln!(text, "{start}{line}");
    }
    text
}

/// A device's number, in words.
pub(super) fn number(number: u64) -> String {
    if number == 0 {
        "no number".to_owned()
    } else {
        format!("number {number}")
    }
}

/// Who a device is, for programs.
pub(super) fn identity(device: &Hello) -> Value {
    json!({
        "board": device.board.as_str(),
        "firmware": device.firmware.to_string(),
        "number": device.device.to_string(),
        "protocol": device.protocol,
        "table_format": device.table_format,
        "max_payload": device.max_payload,
        "limits": {
            "cells": device.limits.cells,
            "frame_bytes": device.limits.frame_bytes,
            "table_bytes": device.limits.table_bytes,
        },
    })
}

/// A table as people know it: by name and day, where a device has said them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct CalledTable {
    pub(super) name: TableName,
    pub(super) about: Option<TableAbout>,
}

impl From<TableName> for CalledTable {
    fn from(name: TableName) -> Self {
        Self { name, about: None }
    }
}

impl fmt::Display for CalledTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.about.map(|about| about.label) {
            Some(label) if !label.name().is_empty() => write!(f, "{label}, {}", self.name),
            _ => write!(f, "{}", self.name),
        }
    }
}

/// What a table is called, for programs.
pub(super) fn table_name(table: Option<impl Into<CalledTable>>) -> Option<Value> {
    table.map(|table| {
        let CalledTable { name, about } = table.into();
        let label = about.map(|about| about.label).unwrap_or_default();
        json!({
            "id": format!("{:08x}", name.id),
            "version": (name.version != 0).then_some(name.version),
            "name": named(&label),
            "date": day(&label),
        })
    })
}

/// The name on a table's label, if it has one.
pub(super) fn named(label: &Label) -> Option<&str> {
    Some(label.name()).filter(|name| !name.is_empty())
}

/// The day on a table's label, if it has one.
pub(super) fn day(label: &Label) -> Option<String> {
    let date = label.date();
    let (year, month, day) = (date / 10_000, date / 100 % 100, date % 100);
    (date != 0).then(|| format!("{year:04}-{month:02}-{day:02}"))
}

/// Frames, for programs.
pub(super) fn frame_kind(frames: FrameKind) -> Value {
    json!({
        "width": frames.width,
        "height": frames.height,
        "channels": frames.channels,
    })
}

/// A device's state, for programs.
pub(super) fn status_data(status: &Status) -> Value {
    let (mode, reason) = match status.mode {
        Mode::Compensating => ("compensating", None),
        Mode::Alone => ("alone", None),
        Mode::PassThrough(why) => ("pass-through", Some(why)),
    };
    let name = |why: PassThrough| match why {
        PassThrough::NoTable => "no-table",
        PassThrough::BrokenTable => "broken-table",
        PassThrough::OtherFrames => "other-frames",
        PassThrough::Memory => "memory",
        PassThrough::CrashLoop => "crash-loop",
    };
    json!({
        "firmware": status.firmware.to_string(),
        "board": status.board.as_str(),
        "uptime_ms": status.uptime_ms,
        "table": table_name(status.table),
        "mode": mode,
        "reason": reason.map(name),
        "tier": status.tier,
        "top_tier": status.top_tier,
        "frames": {
            "received": status.frames.received,
            "shown": status.frames.shown,
            "late": status.frames.late,
            "dropped": status.frames.dropped,
            "broken": status.frames.broken,
        },
        "clipped": {
            "last": status.clipping.last,
            "black": status.clipping.black,
            "white": status.clipping.white,
            "samples": status.clipping.samples,
        },
        "frame_time_us": {
            "last": status.frame_time.last_us,
            "mean": status.frame_time.mean_us,
            "worst": status.frame_time.worst_us,
            "budget": status.frame_time.budget_us,
        },
        "slots": status.slots.map(|slot| slot.to_string()),
        "last_fault": status.last_fault.map(|fault| fault.to_string()),
        "stack": { "used": status.stack.used, "size": status.stack.size },
        "watchdog_resets": status.watchdog_resets,
        "input": status.input.map(frame_kind),
        "serial": { "bad": status.serial.bad, "unsent": status.serial.unsent },
    })
}

/// The table in use; with what the slots say of it, where they were asked.
pub(super) fn table_in_use(status: &Status, slots: Option<&Slots>) -> String {
    let table = status.table.map(|table| called(table, slots).to_string());
    table.unwrap_or_else(|| "none".to_owned())
}

/// A table, with what the slots say of it.
pub(super) fn called(name: TableName, slots: Option<&Slots>) -> CalledTable {
    let all = slots.into_iter().flat_map(|slots| &slots.slots);
    let mut same = all.filter(|slot| slot.table == Some(name));
    CalledTable {
        name,
        about: same.next().and_then(|slot| slot.about),
    }
}

/// What a device does with frames: plain where it does not compensate them.
pub(super) fn mode(status: &Status, slots: Option<&Slots>) -> String {
    let Mode::PassThrough(why) = status.mode else {
        return match status.input {
            Some(input) if status.mode == Mode::Alone => {
                format!("compensating {input} alone: its neighbours are silent")
            }
            Some(input) => format!("compensating {input}"),
            None => "ready to compensate: no frames have come in yet".to_owned(),
        };
    };
    let why = match why {
        PassThrough::OtherFrames => match slots.and_then(|slots| misfit(status, slots)) {
            Some(misfit) => misfit,
            None => why.to_string(),
        },
        why => why.to_string(),
    };
    format!("NOT COMPENSATING, frames pass unchanged: {why}")
}

/// Which frames come in and which the table in use takes.
pub(super) fn misfit(status: &Status, slots: &Slots) -> Option<String> {
    let (input, about) = (status.input?, used(slots)?.about?);
    Some(format!(
        "the device gets {input}, this table is for {} or more",
        about.frames
    ))
}

/// Both slots, in a few words.
pub(super) fn slot_states(status: &Status) -> String {
    let [a, b] = status.slots;
    format!("A {a}, B {b}")
}

pub(super) fn milliseconds(us: u32) -> String {
    format!("{:.1} ms", f64::from(us) / 1000.0)
}

/// Percent of the samples clipped at white from which people are told what to do.
const WORTH_ADVICE: f64 = 0.1;

/// What to do if this many percent of the samples are clipped at white.
pub(super) fn advice_for_white(percent: f64) -> Option<&'static str> {
    let advice = "too bright: `iltm solve --content FILE` makes a table that is dark enough for it";
    (percent > WORTH_ADVICE).then_some(advice)
}

/// Shares of the last frame's samples that were clipped at black and at white, in percent.
pub(super) fn clipped_percent(status: &Status) -> [f64; 2] {
    let Clipping { last, samples, .. } = status.clipping;
    [last.black, last.white].map(|count| 100.0 * f64::from(count) / f64::from(samples.max(1)))
}

pub(super) fn serial(status: &Status) -> String {
    format!(
        "{} bad frames, {} unsent",
        status.serial.bad, status.serial.unsent
    )
}

pub(super) fn watchdog(status: &Status) -> String {
    match status.watchdog_resets {
        0 => "never restarted the device".to_owned(),
        1 => "restarted the device once".to_owned(),
        times => format!("restarted the device {times} times"),
    }
}

/// Hours, minutes and seconds.
pub(super) fn duration(ms: u64) -> String {
    let seconds = ms / 1000;
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    format!("{hours}:{minutes:02}:{:02}", seconds % 60)
}

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

fn held(slot: &SlotInfo) -> Option<CalledTable> {
    Some(CalledTable {
        name: slot.table?,
        about: slot.about,
    })
}

/// The table in use.
pub(super) fn in_use(slots: &Slots) -> Option<CalledTable> {
    held(used(slots)?)
}

/// The table to go back to.
pub(super) fn other(slots: &Slots) -> Option<CalledTable> {
    let mut all = slots.slots.iter();
    held(all.find(|slot| slot.state == SlotState::Valid)?)
}

/// The table that is there and was never confirmed.
pub(super) fn unconfirmed(slots: &Slots) -> Option<CalledTable> {
    let mut all = slots.slots.iter();
    held(all.find(|slot| slot.state == SlotState::Unconfirmed)?)
}

/// How the trial of a table that nobody confirmed ended; `None` if it was none.
pub(super) fn how_ended(slots: &Slots, table: TableName) -> Option<String> {
    let ended = slots.ended.filter(|ended| ended.table == table.id)?;
    let ago = ended.ago_ms.div_ceil(1_000);
    Some(match ended.reason {
        TableReason::RolledBack => format!("was rolled back {ago} s ago"),
        _ => format!("ended {ago} s ago"),
    })
}

/// Whether a file of this length with this table is in use.
pub(super) fn uses(slots: &Slots, table: TableName, length: usize) -> bool {
    used(slots).is_some_and(|slot| slot.table == Some(table) && slot.length as usize == length)
}

/// The table slots, for programs.
pub(super) fn slots_data(slots: &Slots) -> Value {
    let slot = |slot: &SlotInfo| {
        json!({
            "state": slot.state.to_string(),
            "table": table_name(held(slot)),
            "frames": slot.about.map(|about| frame_kind(about.frames)),
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
        "number": slots.device.to_string(),
        "sector_bytes": slots.sector,
        "record_erases": slots.record_erases,
        "sequence": slots.sequence,
        "ended": slots.ended.map(|ended| json!({
            "id": format!("{:08x}", ended.table),
            "reason": table_reason(ended.reason),
            "ago_ms": ended.ago_ms,
        })),
    })
}

/// Why another table is in use, for programs.
pub(super) const fn table_reason(reason: TableReason) -> &'static str {
    match reason {
        TableReason::Trial => "trial",
        TableReason::Confirmed => "confirmed",
        TableReason::TrialOver => "trial-over",
        TableReason::RolledBack => "rolled-back",
        TableReason::Damaged => "damaged",
    }
}

/// A line a slot.
pub(super) fn slot_lines(slots: &Slots) -> Vec<String> {
    let line = |(index, slot): (u8, &SlotInfo)| {
        let table = match held(slot) {
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
            SlotState::Unconfirmed => "never confirmed".to_owned(),
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
