//! `iltm status`

use super::args;
use super::connect::connect;
use super::failure::Failure;
use super::output::Output;
use super::words::{
    advice_for_white, called, clipped_percent, duration, identity, milliseconds, mode, number,
    serial, slot_lines, slot_states, slots_data, status_data, table_in_use, table_name, trust,
    watchdog,
};
use crate::device::DeviceError;
use iltm_runtime::link::{Clipping, Hello, Slots, Status};
use serde_json::json;
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
    let mut data = status_data(&status);
    data["table"] = json!(table_name(
        status.table.map(|table| called(table, slots.as_ref()))
    ));
    data["port"] = json!(connection.port);
    data["baud"] = json!(connection.baud);
    data["device"] = identity(device);
    data["update"] = json!(slots.as_ref().map(slots_data));
    output.result(
        &data,
        &text(&connection.port, &status, device, slots.as_ref()),
    );
    Ok(())
}

fn text(port: &str, status: &Status, device: &Hello, slots: Option<&Slots>) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<12} {value}");
    };
    line("mode", mode(status, slots));
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
    line("table", table_in_use(status, slots));
    match slots {
        Some(slots) => {
            for (index, slot) in slot_lines(slots).into_iter().enumerate() {
                line(if index == 0 { "slots" } else { "" }, slot);
            }
            line("key", trust(slots));
        }
        None => line("slots", slot_states(status)),
    }
    line("tier", format!("{} of {}", status.tier, status.top_tier));
    line("frames", frames(status));
    line("frame time", frame_time(status));
    line("clipped", clipped(status));
    if let Some(advice) = advice_for_white(clipped_percent(status)[1]) {
        line("", advice.to_owned());
    }
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

fn clipped(status: &Status) -> String {
    let [black, white] = clipped_percent(status);
    let Clipping {
        black: all_black,
        white: all_white,
        ..
    } = status.clipping;
    format!(
        "{black:.2} % of the last frame at black, {white:.2} % at white; \
         {all_black} and {all_white} samples in all"
    )
}
