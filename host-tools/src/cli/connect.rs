//! Connection to the device that is meant: its port is found and it is greeted.

use super::active::Active;
use super::args::SerialLine;
use super::failure::{Failure, Kind};
use super::output::Output;
use super::words;
use crate::compile::sign::RightSigner;
use crate::device::discovery::{self, FoundDevice};
use crate::device::port_scan::{ListedPort, PortScan};
use crate::device::transcript::Transcribed;
use crate::device::{Authority, Client, DeviceError, Patience, Port};
use crate::user::{Config, Folders};
use ed25519_dalek::VerifyingKey;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, IsTerminal};
use std::path::Path;
use std::time::Duration;

/// A device may be busy with frames; an empty port should not take long.
const REMEMBERED: Patience = Patience {
    answer: Duration::from_millis(400),
    tries: 3,
};

/// What commands talk over.
pub(super) type Wire = Transcribed<Port>;

/// A conversation with the device that is meant.
#[derive(Debug)]
pub(super) struct Connection {
    pub(super) client: Client<Wire>,
    pub(super) port: String,
    pub(super) baud: u32,
    /// Where the port is to be remembered once the command has succeeded.
    remember: Option<Config>,
}

/// Talks to the device at the port that was given; else to that at the remembered one;
/// else to the only one that answers; else asks.
pub(super) fn connect(line: &SerialLine, output: &Output) -> Result<Connection, Failure> {
    if let Some(port) = &line.port {
        let greeted = discovery::greet(port, line.baud, Patience::default(), Transcribed::new);
        let (client, baud) = greeted.map_err(|error| Failure::of_device(port, &error))?;
        return Ok(Connection::new(client, port, baud, None));
    }
    let folders = Folders::of_user();
    let config = folders.as_ref().map(Config::read).transpose()?;
    let config = config.unwrap_or_default();
    let scan = folders.map(|folders| PortScan::find(&folders, &config));
    let scan = scan.unwrap_or_default();
    let may_be_asked = |port: &String| !config.excludes(port) && scan.may_ask_again(port);
    if let Some(port) = config.port.clone().filter(may_be_asked) {
        let greeted = discovery::greet(&port, line.baud, REMEMBERED, Transcribed::new);
        match greeted {
            Ok((client, baud)) => return Ok(Connection::new(client, &port, baud, None)),
            // It is meant; that it is busy does not make another one meant.
            Err(error @ (DeviceError::Protocol { .. } | DeviceError::Open { .. }))
                if Path::new(&port).exists() =>
            {
                return Err(Failure::of_device(&port, &error));
            }
            Err(_) => output.remark(&format!("no device at {port}; asking the other ports")),
        }
    }
    let (mut found, silent) = discovery::ask(&scan.asked, line.baud);
    let found = match found.len() {
        0 => return Err(nobody(&silent, &scan.unasked)),
        1 => found.remove(0),
        _ => choose(found, output)?,
    };
    let port = &found.port.path;
    let board = &found.device.board;
    output.remark(&format!("found {board} at {port}"));
    let greeted = discovery::greet(
        port,
        Some(found.baud),
        Patience::default(),
        Transcribed::new,
    );
    let (client, baud) = greeted.map_err(|error| Failure::of_device(port, &error))?;
    Ok(Connection::new(client, port, baud, Some(config)))
}

impl Connection {
    fn new(client: Client<Wire>, port: &str, baud: u32, remember: Option<Config>) -> Self {
        Self {
            client,
            port: port.to_owned(),
            baud,
            remember,
        }
    }

    /// Keeps the port for the next time, if it was not known; that this fails is no
    /// failure of the command.
    pub(super) fn remember(&mut self, output: &Output) {
        if let Some(mut config) = self.remember.take()
            && let Err(error) = config.remember(&self.port)
        {
            output.remark(&format!("the port is not remembered: {error}"));
        }
    }

    /// What is asked of a device with a key is signed with the key in this file from now
    /// on; returns the public key that signs such a device's tables.
    pub(super) fn authorise(
        &mut self,
        path: Option<&Path>,
    ) -> Result<Option<VerifyingKey>, Failure> {
        let Some(path) = path else {
            return Ok(None);
        };
        let signer = RightSigner::read(path)?;
        let site = *signer.site();
        self.client
            .authorise(Authority::new(move |deed, device, sequence| {
                signer.right(deed, device, sequence)
            }));
        Ok(Some(site))
    }

    /// Writes down what is said from now on.
    pub(super) fn transcribe(&mut self, file: File) {
        let device = self.client.device();
        let words = format!(
            "iltm {} talks to {}, firmware {}, at {}, {} baud",
            env!("CARGO_PKG_VERSION"),
            device.board,
            device.firmware,
            self.port,
            self.baud
        );
        let wire = self.client.line();
        wire.write_to(Box::new(BufWriter::new(file)));
        wire.remark(&words);
    }

    /// Goes on at the next lower speed that the device answers at; returns whether there
    /// is one.
    pub(super) fn slow_down(&mut self) -> bool {
        for baud in discovery::speeds(Some(self.baud)).into_iter().skip(1) {
            let wire = self.client.line();
            if wire.line().set_speed(baud).is_err() {
                continue;
            }
            wire.remark(&format!("{baud} baud"));
            if self.client.greet_again().is_ok() {
                self.baud = baud;
                return true;
            }
        }
        false
    }

    pub(super) fn failed(&self, error: &DeviceError) -> Failure {
        Failure::of_device(&self.port, error)
    }

    /// The same, with the table that is in use now, if it can be asked.
    pub(super) fn failed_with_table(&mut self, error: &DeviceError) -> Failure {
        let active = Active::ask(&mut self.client);
        self.failed(error).with(active)
    }
}

fn nobody(silent: &[(ListedPort, DeviceError)], unasked: &[ListedPort]) -> Failure {
    let mut message = if silent.is_empty() {
        "there is no serial port to ask".to_owned()
    } else {
        "no device answers".to_owned()
    };
    for (port, error) in silent {
        let _ = write!(message, "; {}: {error}", port.path);
    }
    if !unasked.is_empty() {
        let names: Vec<_> = unasked.iter().map(|port| port.path.as_str()).collect();
        let _ = write!(message, "; not asked: {}", names.join(", "));
    }
    if silent.is_empty() {
        return Failure::new(
            Kind::NoDevice,
            message,
            "Plug the device in, or name its port with --port; `iltm emulate` runs one without hardware.",
        );
    }
    // What keeps a port from being asked matters more than silence.
    let unopened = silent.iter().map(|(_, error)| error);
    let mut unopened = unopened.filter(|error| matches!(error, DeviceError::Open { .. }));
    let (kind, next_step) = match unopened.next() {
        Some(error) => (Kind::Port, error.next_step()),
        None => (
            Kind::NoDevice,
            "Check power and cable, or name the port with --port and its speed with --baud.",
        ),
    };
    Failure::new(kind, message, next_step)
}

/// One of several devices: a question on a terminal, an error elsewhere.
fn choose(mut found: Vec<FoundDevice>, output: &Output) -> Result<FoundDevice, Failure> {
    let several = |found: &[FoundDevice]| {
        let mut message = "several devices answer".to_owned();
        for device in found {
            let _ = write!(message, "; {}: {}", device.port.path, device.device.board);
        }
        Failure::new(Kind::SeveralDevices, message, "Name one with --port.")
    };
    if output.is_json() || !output.terminal || !io::stdin().is_terminal() {
        return Err(several(&found));
    }
    let mut question = String::from("Several devices answer:\n");
    for (number, device) in (1..).zip(&found) {
        let _ = writeln!(
            question,
            "  {number}  {}  {} {}, firmware {}",
            device.port.path,
            device.device.board,
            words::number(device.device.device),
            device.device.firmware
        );
    }
    output.people(&(question + "Which one? "));
    let mut answer = String::new();
    let _ = io::stdin().read_line(&mut answer);
    match answer.trim().parse::<usize>() {
        Ok(number @ 1..) if number <= found.len() => Ok(found.remove(number - 1)),
        _ => Err(several(&found)),
    }
}
