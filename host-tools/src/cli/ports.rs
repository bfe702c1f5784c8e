//! `iltm ports`

use super::args::Ports;
use super::failure::Failure;
use super::output::Output;
use super::words::{called, identity, table_in_use, table_name};
use crate::device::DeviceError;
use crate::device::discovery::{FoundDevice, ask};
use crate::device::port_scan::{ListedPort, PortScan};
use crate::user::{Config, Folders};
use serde_json::json;
use std::fmt::Write;

pub(super) fn run(arguments: &Ports, output: &Output) -> Result<(), Failure> {
    let folders = Folders::of_user();
    let config = folders.as_ref().map(Config::read).transpose()?;
    let config = config.unwrap_or_default();
    let scan = folders.map(|folders| PortScan::find(&folders, &config));
    let PortScan { asked, unasked } = scan.unwrap_or_default();
    let (found, silent) = ask(&asked, arguments.baud);
    let devices = found.iter().map(|found| {
        let mut data = identity(&found.device);
        data["port"] = json!(found.port.path);
        data["about"] = json!(found.port.about);
        data["baud"] = json!(found.baud);
        data["table"] = json!(found.status.as_ref().map(|status| {
            table_name(
                status
                    .table
                    .map(|table| called(table, found.slots.as_ref())),
            )
        }));
        data
    });
    let others = silent.iter().map(|(port, error)| {
        json!({
            "port": port.path,
            "about": port.about,
            "reason": error.to_string(),
        })
    });
    let not_asked = unasked
        .iter()
        .map(|port| json!({ "port": port.path, "about": port.about }));
    let data = json!({
        "devices": devices.collect::<Vec<_>>(),
        "others": others.collect::<Vec<_>>(),
        "not_asked": not_asked.collect::<Vec<_>>(),
        "remembered": config.port,
    });
    let mut text = text(&found, &silent, config.port.as_deref());
    for port in unasked {
        let _ = writeln!(text, "  {}  not asked; name it with --port", port.path);
    }
    output.result(&data, &text);
    Ok(())
}

fn text(
    found: &[FoundDevice],
    silent: &[(ListedPort, DeviceError)],
    remembered: Option<&str>,
) -> String {
    let mut rows = vec![["port", "board", "firmware", "number", "table"].map(str::to_owned)];
    for device in found {
        let slots = device.slots.as_ref();
        let table = device.status.as_ref();
        let table = table.map(|status| table_in_use(status, slots));
        rows.push([
            device.port.path.clone(),
            device.device.board.to_string(),
            device.device.firmware.to_string(),
            match device.device.device {
                0 => "none".to_owned(),
                number => number.to_string(),
            },
            table.unwrap_or_else(|| "?".to_owned()),
        ]);
    }
    let mut text = String::new();
    if found.is_empty() {
        let _ = writeln!(text, "No device answers.");
    } else {
        let width = |column: usize| rows.iter().map(|row| row[column].len()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..4).map(width).collect();
        for [port, board, firmware, number, table] in &rows {
            let star = if Some(port.as_str()) == remembered {
                "*"
            } else {
                " "
            };
            let _ = writeln!(
                text,
                "{star} {port:0$}  {board:1$}  {firmware:2$}  {number:3$}  {table}",
                widths[0], widths[1], widths[2], widths[3]
            );
        }
        if found
            .iter()
            .any(|found| Some(found.port.path.as_str()) == remembered)
        {
            let _ = writeln!(text, "* is the one that is asked first.");
        }
    }
    for (port, error) in silent {
        let why = match error {
            DeviceError::NoAnswer { heard, .. } => format!("no answer: {heard}"),
            other => other.to_string(),
        };
        let _ = writeln!(text, "  {}  {why}", port.path);
    }
    text
}
