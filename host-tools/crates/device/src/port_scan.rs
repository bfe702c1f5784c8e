//! Scan for serial ports: those of this machine and of emulated boards, and which of them
//! may be asked.
//!
//! Whoever asks a port writes to it, and what is behind it may be no device of ours: a
//! console, a modem, a relay. So only ports that were plugged in are asked (USB,
//! Bluetooth, a card) and emulated boards; those of the mainboard only where the user
//! says so.

use crate::user::{Config, Folders, emulated};
use serialport::{SerialPortInfo, SerialPortType};
use std::path::Path;

/// A port.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct ListedPort {
    /// Its name.
    pub path: String,
    /// What the system says about it; may be empty.
    pub about: String,
}

/// Ports of this machine and of emulated boards, without those that the user excluded.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct PortScan {
    /// A device may be there, and they may be asked.
    pub asked: Vec<ListedPort>,
    /// Nobody said that they may be written to.
    pub unasked: Vec<ListedPort>,
}

impl PortScan {
    /// Those of now.
    #[must_use]
    pub fn find(folders: &Folders, config: &Config) -> Self {
        let there = |path: &str| Path::new(path).exists();
        Self::sort(of_machine(), emulated::registered(folders), config, there)
    }

    fn sort(
        machine: Vec<SerialPortInfo>,
        boards: Vec<(String, String)>,
        config: &Config,
        there: impl Fn(&str) -> bool,
    ) -> Self {
        let mut found = Self::default();
        for port in machine {
            let path = port.port_name;
            let asked = is_plugged(&port.port_type) || config.includes(&path);
            let list = if asked {
                &mut found.asked
            } else {
                &mut found.unasked
            };
            let about = about(port.port_type);
            list.push(ListedPort { path, about });
        }
        let boards = boards.into_iter().map(|(path, board)| ListedPort {
            path,
            about: format!("emulated {board}"),
        });
        found.asked.extend(boards);
        // The system does not list every port that it has.
        let known = |path: &str| found.asked.iter().any(|port| port.path == path);
        let named = config.included().filter(|path| !known(path) && there(path));
        let named = named.map(|path| ListedPort {
            path: path.to_owned(),
            about: String::new(),
        });
        let named: Vec<_> = named.collect();
        found.asked.extend(named);
        for list in [&mut found.asked, &mut found.unasked] {
            list.retain(|port| !config.excludes(&port.path));
            list.sort();
            list.dedup_by(|a, b| a.path == b.path);
        }
        found
    }

    /// Whether the port where a device answered last may be asked: another device, or
    /// somebody's terminal, may have its name by now.
    #[must_use]
    pub fn may_ask_again(&self, path: &str) -> bool {
        let mut listed = self.asked.iter().chain(&self.unasked);
        listed.any(|port| port.path == path) || !is_terminal(path)
    }
}

/// Whether somebody plugged it in, so that it is there for a device.
const fn is_plugged(kind: &SerialPortType) -> bool {
    match kind {
        SerialPortType::UsbPort(_) | SerialPortType::BluetoothPort | SerialPortType::PciPort => {
            true
        }
        SerialPortType::Unknown => false,
    }
}

fn about(kind: SerialPortType) -> String {
    match kind {
        SerialPortType::UsbPort(usb) => {
            let parts = [usb.manufacturer, usb.product, usb.serial_number];
            let parts: Vec<_> = parts.into_iter().flatten().collect();
            parts.join(" ")
        }
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::PciPort => "PCI card".to_owned(),
        SerialPortType::Unknown => String::new(),
    }
}

/// Whether it has the name of a pseudo-terminal.
fn is_terminal(path: &str) -> bool {
    let digit = |rest: &str| rest.starts_with(|first: char| first.is_ascii_digit());
    path.starts_with("/dev/pts/") || path.strip_prefix("/dev/ttys").is_some_and(digit)
}

fn of_machine() -> Vec<SerialPortInfo> {
    // Without this folder, serialport does not return.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    serialport::available_ports().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::UsbPortInfo;

    fn config(text: &str) -> Config {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("config.toml"), text).expect("writable");
        let folders = Folders {
            config: folder.path().to_owned(),
            state: folder.path().to_owned(),
        };
        Config::read(&folders).expect("good")
    }

    fn port(name: &str, port_type: SerialPortType) -> SerialPortInfo {
        SerialPortInfo {
            port_name: name.to_owned(),
            port_type,
        }
    }

    /// A machine with a port of each kind.
    fn machine() -> Vec<SerialPortInfo> {
        let usb = UsbPortInfo {
            vid: 1,
            pid: 2,
            serial_number: Some("17".to_owned()),
            manufacturer: Some("Maker".to_owned()),
            product: None,
        };
        vec![
            port("/dev/ttyUSB0", SerialPortType::UsbPort(usb)),
            port("/dev/ttyS4", SerialPortType::PciPort),
            port("/dev/rfcomm0", SerialPortType::BluetoothPort),
            port("/dev/ttyS0", SerialPortType::Unknown),
            port("/dev/ttyS1", SerialPortType::Unknown),
        ]
    }

    /// Names of the ports asked and not asked; of unlisted files, only `/dev/ttyAMA0`
    /// is there.
    fn sorted(text: &str) -> [Vec<String>; 2] {
        let boards = vec![("/dev/pts/3".to_owned(), "mps2-an500".to_owned())];
        let there = |path: &str| path == "/dev/ttyAMA0";
        let found = PortScan::sort(machine(), boards, &config(text), there);
        let names = |list: Vec<ListedPort>| list.into_iter().map(|port| port.path).collect();
        [names(found.asked), names(found.unasked)]
    }

    #[test]
    fn ports_of_the_mainboard_are_not_asked_by_themselves() {
        let [asked, unasked] = sorted("");
        assert_eq!(
            asked,
            ["/dev/pts/3", "/dev/rfcomm0", "/dev/ttyS4", "/dev/ttyUSB0"]
        );
        assert_eq!(unasked, ["/dev/ttyS0", "/dev/ttyS1"]);
    }

    #[test]
    fn included_ports_are_asked_also_where_the_system_does_not_list_them() {
        let [asked, unasked] = sorted("include = [\"/dev/ttyAMA*\", \"/dev/ttyS[1-3]\"]");
        assert!(asked.contains(&"/dev/ttyS1".to_owned()), "{asked:?}");
        assert_eq!(unasked, ["/dev/ttyS0"]);
        assert_eq!(
            asked.len(),
            5,
            "a pattern brings no unlisted file: {asked:?}"
        );
        let [asked, _] = sorted("include = [\"/dev/ttyAMA0\", \"/dev/ttyAMA1\"]");
        assert!(asked.contains(&"/dev/ttyAMA0".to_owned()), "{asked:?}");
        assert_eq!(asked.len(), 5, "one of the two is there: {asked:?}");
    }

    #[test]
    fn a_port_that_is_included_and_excluded_is_excluded() {
        let both = "include = [\"/dev/ttyS0\", \"/dev/ttyAMA0\"]\nexclude = [\"/dev/tty*\"]";
        let [asked, unasked] = sorted(both);
        assert_eq!(asked, ["/dev/pts/3", "/dev/rfcomm0"]);
        assert!(unasked.is_empty(), "{unasked:?}");
    }

    #[test]
    fn what_the_system_says_about_a_port_is_kept() {
        let found = PortScan::sort(machine(), Vec::new(), &config(""), |_| false);
        let about = |path: &str| {
            let mut ports = found.asked.iter();
            let port = ports.find(|port| port.path == path);
            port.map(|port| port.about.as_str())
        };
        assert_eq!(about("/dev/ttyUSB0"), Some("Maker 17"));
        assert_eq!(about("/dev/ttyS4"), Some("PCI card"));
    }

    #[test]
    fn a_remembered_pseudo_terminal_is_asked_only_while_a_board_has_it() {
        let boards = vec![("/dev/pts/3".to_owned(), "mps2-an500".to_owned())];
        let found = PortScan::sort(machine(), boards, &config(""), |_| false);
        assert!(found.may_ask_again("/dev/pts/3"));
        for other in ["/dev/pts/4", "/dev/ttys004"] {
            assert!(!found.may_ask_again(other), "{other}");
        }
        // Also where the list has other names for it, or it was soldered.
        for port in ["/dev/serial/by-id/usb-1", "/dev/ttyS0", "COM3"] {
            assert!(found.may_ask_again(port), "{port}");
        }
    }
}
