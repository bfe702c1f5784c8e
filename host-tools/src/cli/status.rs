//! `iltm status`

use super::args;
use super::connect::connect;
use super::failure::Failure;
use super::output::Output;
use super::slots;
use crate::device::DeviceError;
use iltm_runtime::link::{Hello, Mode, PassThrough, Slots, Status, TableName};
use serde_json::{Value, json};
use std::fmt::Write;

pub(super) fn run(arguments: &args::Status, output: &Output) -> Result<(), Failure> {
    let mut connection = connect(&arguments.line, output)?;
    let status = connection.client.status();
    let status = status.map_err(|error| connection.failed(&error))?;
    let slots = match connection.client.slots() {
        Ok(slots) => Some(slots),
        // It takes no tables.
        Err(DeviceError::Refused { .. }) => None,
        Err(error) => return Err(connection.failed(&error)),
    };
    connection.remember(output);
    let device = connection.client.device();
    let mut data = data(&status);
    data["port"] = json!(connection.port);
    data["baud"] = json!(connection.baud);
    data["device"] = identity(device);
    data["update"] = json!(slots.as_ref().map(slots::data));
    output.result(
        &data,
        &text(&connection.port, &status, device, slots.as_ref()),
    );
    Ok(())
}

/// A device's number, in words.
pub(super) fn number(number: u64) -> String {
    if number == 0 {
        "no number".to_owned()
    } else {
        format!("number {number:016x}")
    }
}

/// Who a device is, for programs.
pub(super) fn identity(device: &Hello) -> Value {
    json!({
        "board": device.board.as_str(),
        "firmware": device.firmware.to_string(),
        "number": format!("{:016x}", device.device),
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

/// What a table is called, for programs.
pub(super) fn table_name(table: Option<TableName>) -> Option<Value> {
    table.map(|table| {
        json!({
            "id": format!("{:08x}", table.id),
            "version": table.version,
        })
    })
}

/// How a device is, for programs.
pub(super) fn data(status: &Status) -> Value {
    let (mode, reason) = match status.mode {
        Mode::Compensating => ("compensating", None),
        Mode::PassThrough(why) => ("pass-through", Some(why)),
    };
    let name = |why: PassThrough| match why {
        PassThrough::NoTable => "no-table",
        PassThrough::BrokenTable => "broken-table",
        PassThrough::OtherFrames => "other-frames",
        PassThrough::Memory => "memory",
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
            "total": status.clipping.total,
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
        "serial": { "bad": status.serial.bad, "unsent": status.serial.unsent },
    })
}

fn text(port: &str, status: &Status, device: &Hello, slots: Option<&Slots>) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<12} {value}");
    };
    line(
        "device",
        format!(
            "{} at {port}, {}, firmware {}, up {}",
            status.board,
            number(device.device),
            status.firmware,
            duration(status.uptime_ms)
        ),
    );
    line("mode", status.mode.to_string());
    line("table", table(status));
    match slots {
        Some(slots) => {
            for (index, slot) in slots::lines(slots).into_iter().enumerate() {
                line(if index == 0 { "slots" } else { "" }, slot);
            }
            line("key", slots::trust(slots));
        }
        None => line("slots", self::slots(status)),
    }
    line("tier", format!("{} of {}", status.tier, status.top_tier));
    line("frames", frames(status));
    line("frame time", frame_time(status));
    line("clipped", clipped(status));
    line(
        "stack",
        format!("{} of {} bytes used", status.stack.used, status.stack.size),
    );
    line("line", serial(status));
    line("watchdog", watchdog(status));
    let fault = status.last_fault.map(|fault| fault.to_string());
    line("last fault", fault.unwrap_or_else(|| "none".to_owned()));
    text
}

pub(super) fn table(status: &Status) -> String {
    let table = status.table.map(|table| table.to_string());
    table.unwrap_or_else(|| "none".to_owned())
}

pub(super) fn slots(status: &Status) -> String {
    let [a, b] = status.slots;
    format!("A {a}, B {b}")
}

fn frames(status: &Status) -> String {
    let frames = &status.frames;
    format!(
        "{} in, {} out, {} late, {} dropped, {} broken",
        frames.received, frames.shown, frames.late, frames.dropped, frames.broken
    )
}

fn frame_time(status: &Status) -> String {
    let time = &status.frame_time;
    format!(
        "{}, mean {}, worst {}, budget {}",
        milliseconds(time.last_us),
        milliseconds(time.mean_us),
        milliseconds(time.worst_us),
        milliseconds(time.budget_us)
    )
}

pub(super) fn milliseconds(us: u32) -> String {
    format!("{:.1} ms", f64::from(us) / 1000.0)
}

/// Share of the last frame's samples that were clipped.
pub(super) fn clipped_share(status: &Status) -> f64 {
    f64::from(status.clipping.last) / f64::from(status.clipping.samples.max(1))
}

fn clipped(status: &Status) -> String {
    format!(
        "{:.2} % of the last frame's samples, {} samples in all",
        100.0 * clipped_share(status),
        status.clipping.total
    )
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
