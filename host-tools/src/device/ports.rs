//! Which ports there are, and which of them a device answers at.

use super::client::{Client, Patience};
use super::port::{BAUD, Port};
use super::{DeviceError, Line};
use crate::user::{Config, Folders, emulated};
use iltm_runtime::link::{Hello, Status};
use serialport::SerialPortType;
use std::thread;
use std::time::Duration;

/// Speeds that are tried, bits a second.
pub const SPEEDS: [u32; 4] = [921_600, 460_800, 230_400, BAUD];

/// For a hello to a port that may well have nothing behind it.
pub const SHORT: Patience = Patience {
    answer: Duration::from_millis(250),
    tries: 2,
};

/// A port that may have a device behind it.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Candidate {
    /// Its name.
    pub path: String,
    /// What the system says about it; may be empty.
    pub about: String,
}

/// Ports of this machine and of emulated boards, without those that the user excluded.
#[must_use]
pub fn candidates(folders: &Folders, config: &Config) -> Vec<Candidate> {
    let mut found = of_machine();
    found.extend(
        emulated::registered(folders)
            .into_iter()
            .map(|(path, board)| Candidate {
                path,
                about: format!("emulated {board}"),
            }),
    );
    found.retain(|candidate| !config.excludes(&candidate.path));
    found.sort();
    found.dedup_by(|a, b| a.path == b.path);
    found
}

fn of_machine() -> Vec<Candidate> {
    // Without this folder, serialport does not return.
    if cfg!(target_os = "linux") && !std::path::Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let ports = serialport::available_ports().unwrap_or_default();
    let candidate = |port: serialport::SerialPortInfo| {
        let about = match port.port_type {
            SerialPortType::UsbPort(usb) => {
                let parts = [usb.manufacturer, usb.product, usb.serial_number];
                let parts: Vec<_> = parts.into_iter().flatten().collect();
                parts.join(" ")
            }
            _ => String::new(),
        };
        // On macOS the `tty` of a pair waits for a carrier that these devices lack.
        let path = port.port_name;
        Candidate { path, about }
    };
    ports.into_iter().map(candidate).collect()
}

/// A device that answers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Found {
    /// Where.
    pub candidate: Candidate,
    /// At which speed.
    pub baud: u32,
    /// Who it is.
    pub device: Hello,
    /// How it is; none if it says hello and nothing more.
    pub status: Option<Status>,
}

/// Asks every port at once; returns the devices that answer, and why the other ports
/// have none.
#[must_use]
pub fn ask(
    candidates: &[Candidate],
    baud: Option<u32>,
) -> (Vec<Found>, Vec<(Candidate, DeviceError)>) {
    let answers = thread::scope(|scope| {
        let asked: Vec<_> = candidates
            .iter()
            .map(|candidate| scope.spawn(move || ask_one(candidate, baud)))
            .collect();
        let answers = asked.into_iter().map(thread::ScopedJoinHandle::join);
        answers.filter_map(Result::ok).collect::<Vec<_>>()
    });
    let mut found = Vec::new();
    let mut silent = Vec::new();
    for (candidate, answer) in candidates.iter().zip(answers) {
        match answer {
            Ok(device) => found.push(device),
            Err(error) => silent.push((candidate.clone(), error)),
        }
    }
    (found, silent)
}

fn ask_one(candidate: &Candidate, baud: Option<u32>) -> Result<Found, DeviceError> {
    let (mut client, baud) = greet(&candidate.path, baud, SHORT, |port| port)?;
    Ok(Found {
        candidate: candidate.clone(),
        baud,
        device: client.device().clone(),
        status: client.status().ok(),
    })
}

/// The speeds to try, the likeliest first: the one that was given and all that are
/// lower, or the usual one and all others.
#[must_use]
pub fn speeds(baud: Option<u32>) -> Vec<u32> {
    let first = baud.unwrap_or(BAUD);
    let rest = SPEEDS.into_iter().filter(|speed| match baud {
        Some(given) => *speed < given,
        None => *speed != BAUD,
    });
    std::iter::once(first).chain(rest).collect()
}

/// Opens a port and says hello, at one speed after the other until something answers.
/// Returns the error at the first speed if nothing does at any.
///
/// # Errors
/// [`DeviceError`].
pub fn greet<L: Line>(
    path: &str,
    baud: Option<u32>,
    patience: Patience,
    mut wrap: impl FnMut(Port) -> L,
) -> Result<(Client<L>, u32), DeviceError> {
    let mut first = None;
    for speed in speeds(baud) {
        let patience = if first.is_some() { SHORT } else { patience };
        let greeted = Port::open(path, speed);
        match greeted.and_then(|port| Client::greet(wrap(port), patience)) {
            Ok(client) => return Ok((client, speed)),
            Err(error @ DeviceError::NoAnswer { .. }) => {
                first.get_or_insert(error);
            }
            // A speed that the port cannot do is no reason to give up the others.
            Err(error @ DeviceError::Open { .. }) if first.is_none() => return Err(error),
            Err(DeviceError::Open { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Err(first.unwrap_or(DeviceError::Answer { request: "hello" }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_go_down_from_the_one_that_was_given() {
        assert_eq!(speeds(Some(460_800)), [460_800, 230_400, 115_200]);
        assert_eq!(speeds(Some(3_000_000)).len(), 5);
        assert_eq!(speeds(Some(9_600)), [9_600]);
        assert_eq!(speeds(None), [115_200, 921_600, 460_800, 230_400]);
    }
}
