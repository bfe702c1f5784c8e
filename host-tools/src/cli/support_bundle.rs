//! `iltm support-bundle`: a zip file for whoever helps, and never a key in it.

use super::args::SupportBundle;
use super::connect::{Connection, connect};
use super::failure::Failure;
use super::output::{Output, write_file};
use super::words::{identity, slots_data, status_data};
use crate::device::logs::Logs;
use crate::device::{DeviceError, Incoming};
use crate::user::{Config, Folders, transcripts};
use iltm_runtime::{image::layout::FORMAT_VERSION, link::PROTOCOL_VERSION};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use std::io::{Cursor, Read, Seek, Write};
use std::time::{Duration, Instant};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Files of the zip: name and content.
type Files = Vec<(String, Vec<u8>)>;

pub(super) fn run(arguments: &SupportBundle, output: &Output) -> Result<(), Failure> {
    let logs = arguments.firmware.as_deref().map(Logs::read).transpose()?;
    let mut files: Files = vec![("versions.json".to_owned(), pretty(&versions()))];
    // A device that does not answer is a reason for a report, not against one.
    let device = match connect(&arguments.line, output) {
        Ok(mut connection) => {
            let what = of_device(&mut connection, arguments, logs.as_ref(), &mut files);
            connection.remember(output);
            what.map_err(|error| format!("{}: {error}", connection.port))
        }
        Err(failure) => Err(failure.to_string()),
    };
    if let Err(why) = &device {
        files.push((
            "device-error.txt".to_owned(),
            format!("{why}\n").into_bytes(),
        ));
    }
    of_user(&mut files);
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    let data = json!({
        "report": arguments.output.display().to_string(),
        "files": names,
        "device_error": device.as_ref().err(),
    });
    let mut text = format!("{}: {}\n", arguments.output.display(), names.join(", "));
    if let Err(why) = &device {
        let _ = writeln!(text, "The device is missing in it: {why}");
    }
    text.push_str("It holds no keys. Look through it before you send it on.\n");
    write_file(&arguments.output, &zipped(&files))?;
    output.result(&data, &text);
    Ok(())
}

fn pretty(data: &Value) -> Vec<u8> {
    format!("{data:#}\n").into_bytes()
}

fn versions() -> Value {
    json!({
        "iltm": env!("CARGO_PKG_VERSION"),
        "protocol": PROTOCOL_VERSION,
        "table_format": FORMAT_VERSION,
        "system": std::env::consts::OS,
        "machine": std::env::consts::ARCH,
        "release": fs::read_to_string("/etc/os-release").ok(),
        "time": chrono::Local::now().to_rfc3339(),
    })
}

/// What the device says.
fn of_device(
    connection: &mut Connection,
    arguments: &SupportBundle,
    logs: Option<&Logs>,
    files: &mut Files,
) -> Result<(), DeviceError> {
    let mut transcript = tempfile::tempfile().ok();
    if let Some(copy) = transcript.as_ref().and_then(|file| file.try_clone().ok()) {
        connection.transcribe(copy);
    }
    let result = ask(connection, arguments, logs, files);
    connection.client.line().remark("end");
    let mut text = Vec::new();
    if let Some(file) = &mut transcript
        && file.rewind().is_ok()
        && file.read_to_end(&mut text).is_ok()
    {
        files.push(("transcript.txt".to_owned(), text));
    }
    result
}

fn ask(
    connection: &mut Connection,
    arguments: &SupportBundle,
    logs: Option<&Logs>,
    files: &mut Files,
) -> Result<(), DeviceError> {
    let client = &mut connection.client;
    let mut data = identity(client.device());
    data["port"] = json!(connection.port);
    data["baud"] = json!(connection.baud);
    files.push(("device.json".to_owned(), pretty(&data)));
    let status = client.status()?;
    files.push(("status.json".to_owned(), pretty(&status_data(&status))));
    match client.slots() {
        Ok(slots) => files.push(("slots.json".to_owned(), pretty(&slots_data(&slots)))),
        Err(DeviceError::Refused { .. }) => {}
        Err(error) => return Err(error),
    }
    client.subscribe(Duration::from_millis(500))?;
    let end = Instant::now() + Duration::from_secs(arguments.seconds.into());
    let (mut raw, mut words) = (Vec::new(), String::new());
    while let Some(left) = end.checked_duration_since(Instant::now()) {
        let Some(incoming) = client.next(left)? else {
            break;
        };
        if let Incoming::Log(payload) = incoming {
            for message in logs
                .map(|logs| logs.messages(&payload))
                .into_iter()
                .flatten()
            {
                let parts = [&message.time, &message.level, &message.text];
                words.push_str(&parts.map(|part| part.trim()).join(" "));
                words.push('\n');
            }
            raw.extend(payload);
        }
    }
    client.subscribe(Duration::ZERO)?;
    files.push(("log.defmt".to_owned(), raw));
    if logs.is_some() {
        files.push(("log.txt".to_owned(), words.into_bytes()));
    }
    Ok(())
}

/// Settings, and what was said during the last transfers.
fn of_user(files: &mut Files) {
    let Some(folders) = Folders::of_user() else {
        return;
    };
    if let Ok(config) = Config::read(&folders)
        && let Ok(text) = fs::read(config.path())
    {
        files.push(("config.toml".to_owned(), text));
    }
    for path in transcripts(&folders) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if let Ok(text) = fs::read(&path) {
            files.push((format!("flash/{name}"), text));
        }
    }
}

fn zipped(files: &Files) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        // In memory, so that nothing can fail but the names, which are our own.
        let started = zip.start_file(name.as_str(), SimpleFileOptions::default());
        if started.is_ok() {
            let _ = zip.write_all(bytes);
        }
    }
    zip.finish().map(Cursor::into_inner).unwrap_or_default()
}
