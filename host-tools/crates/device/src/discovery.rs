//! Discovery of devices: every port is asked, at one speed after the other.

use super::port::{BAUD, Port};
use super::port_scan::ListedPort;
use super::{Client, Patience};
use super::{DeviceError, Line};
use iltm_runtime::link::{Hello, Slots, Status};
use std::thread;
use std::time::Duration;

/// Speeds that are tried, bits a second.
pub const SPEEDS: [u32; 4] = [921_600, 460_800, 230_400, BAUD];

/// For a hello to a port that may well have nothing behind it.
pub const SHORT: Patience = Patience {
    answer: Duration::from_millis(250),
    tries: 2,
};

/// A device that answers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FoundDevice {
    /// Where.
    pub port: ListedPort,
    /// At which speed.
    pub baud: u32,
    /// Who it is.
    pub device: Hello,
    /// How it is; none if it says hello and nothing more.
    pub status: Option<Status>,
    /// What is in its slots; none if it takes no tables.
    pub slots: Option<Slots>,
}

/// Asks every port at once; returns the devices that answer, and why the other ports
/// have none.
#[must_use]
pub fn ask(
    ports: &[ListedPort],
    baud: Option<u32>,
) -> (Vec<FoundDevice>, Vec<(ListedPort, DeviceError)>) {
    let answers = thread::scope(|scope| {
        let asked: Vec<_> = ports
            .iter()
            .map(|port| scope.spawn(move || ask_one(port, baud)))
            .collect();
        let answers = asked.into_iter().map(thread::ScopedJoinHandle::join);
        answers.filter_map(Result::ok).collect::<Vec<_>>()
    });
    let mut found = Vec::new();
    let mut silent = Vec::new();
    for (port, answer) in ports.iter().zip(answers) {
        match answer {
            Ok(device) => found.push(device),
            Err(error) => silent.push((port.clone(), error)),
        }
    }
    (found, silent)
}

fn ask_one(port: &ListedPort, baud: Option<u32>) -> Result<FoundDevice, DeviceError> {
    let (mut client, baud) = greet(&port.path, baud, SHORT, |port| port)?;
    Ok(FoundDevice {
        port: port.clone(),
        baud,
        device: client.device().clone(),
        status: client.status().ok(),
        slots: client.slots().ok(),
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
