//! Emulator: a reference board in QEMU, its serial line as a port of this machine.

use super::memory::BoardMemory;
use iltm_runtime::frame_buffers::psram;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};
use strum::{Display, EnumString, IntoStaticStr, VariantArray};

/// The emulator's program.
const PROGRAM: &str = "qemu-system-arm";

/// Longest that QEMU takes to make its port, on a busy machine.
const START: Duration = Duration::from_secs(20);

/// A board that can be emulated.
#[derive(
    Clone, Copy, PartialEq, Eq, Debug, Default, Display, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(parse_err_ty = String, parse_err_fn = unknown)]
pub enum Board {
    /// Arm MPS2 with the AN500 image: Cortex-M7 with FPU.
    #[default]
    #[strum(serialize = "mps2-an500")]
    An500,
    /// Arm MPS2 with the AN386 image: Cortex-M4F.
    #[strum(serialize = "mps2-an386")]
    An386,
}

impl Board {
    /// Its name, which QEMU uses as well.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn unknown(_: &str) -> String {
    "the boards are mps2-an500 and mps2-an386".to_owned()
}

/// Why there is no emulated board.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// QEMU is not installed.
    #[error("the emulator `{PROGRAM}` is not installed")]
    Missing,
    /// QEMU is there and cannot be run.
    #[error("the emulator `{PROGRAM}` cannot be started: {source}")]
    Start {
        /// What the operating system says.
        source: io::Error,
    },
    /// The firmware is not there.
    #[error("{}: the firmware cannot be read: {source}", path.display())]
    Firmware {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// The firmware is something else.
    #[error("{}: is no firmware: not an ELF file for Arm processors", path.display())]
    NoFirmware {
        /// The file.
        path: PathBuf,
    },
    /// QEMU runs and has no port.
    #[error("the emulator does not say where its serial line is; it says: {said}")]
    NoPort {
        /// Its first words.
        said: String,
    },
    /// QEMU ran and does not any more.
    #[error("the emulated board has gone ({status}); the emulator says: {said}")]
    Gone {
        /// How it ended.
        status: String,
        /// Its last words.
        said: String,
    },
    /// QEMU has ended at once.
    #[error("the emulator ended ({status}); it says: {said}")]
    Ended {
        /// How.
        status: String,
        /// Its first words.
        said: String,
    },
}

impl EmulatorError {
    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Missing => {
                "Install it: `sudo apt-get install qemu-system-arm` on Debian and Ubuntu, `brew install qemu` on macOS."
            }
            Self::Start { .. } => "Check that it may be run: `qemu-system-arm --version`.",
            Self::Firmware { .. } | Self::NoFirmware { .. } => {
                "Check the name, or build the firmware: `runtime/firmware/build.sh mps2-an500`."
            }
            Self::Gone { .. } => {
                "Start it again: with the same --memory it finds its tables there."
            }
            Self::NoPort { .. } | Self::Ended { .. } => {
                "Check that the firmware is an ELF file for this board, and QEMU's version: 7.2 works."
            }
        }
    }
}

/// The processor that an ELF file for Arm names in its head.
const ARM: [u8; 2] = [40, 0];

/// A running board; it stops when this is dropped.
#[derive(Debug)]
pub struct Emulator {
    child: Child,
    lines: Receiver<String>,
    said: Vec<String>,
    port: String,
}

impl Emulator {
    /// Starts a board with this firmware and memory, and waits for its port.
    ///
    /// # Errors
    /// [`EmulatorError`].
    pub fn start(
        board: Board,
        firmware: &Path,
        memory: &BoardMemory,
    ) -> Result<Self, EmulatorError> {
        let mut head = [0; 20];
        let read = File::open(firmware).and_then(|mut file| file.read(&mut head));
        read.map_err(|source| EmulatorError::Firmware {
            path: firmware.to_owned(),
            source,
        })?;
        // QEMU runs anything.
        if !head.starts_with(b"\x7FELF") || !head.ends_with(&ARM) {
            let path = firmware.to_owned();
            return Err(EmulatorError::NoFirmware { path });
        }
        let mut child = command(board, firmware, memory.path())
            .spawn()
            .map_err(|source| match source.kind() {
                io::ErrorKind::NotFound => EmulatorError::Missing,
                _ => EmulatorError::Start { source },
            })?;
        let (sender, lines) = channel();
        collect(child.stdout.take(), &sender);
        collect(child.stderr.take(), &sender);
        let mut emulator = Self {
            child,
            lines,
            said: Vec::new(),
            port: String::new(),
        };
        emulator.port = emulator.find_port()?;
        Ok(emulator)
    }

    /// Path of the port.
    #[must_use]
    pub fn port(&self) -> &str {
        &self.port
    }

    /// That the board still runs.
    ///
    /// # Errors
    /// [`EmulatorError::Gone`].
    pub fn check(&mut self) -> Result<(), EmulatorError> {
        match self.child.try_wait() {
            Ok(None) => Ok(()),
            Ok(Some(status)) => Err(self.gone(status.to_string())),
            Err(error) => Err(self.gone(error.to_string())),
        }
    }

    fn find_port(&mut self) -> Result<String, EmulatorError> {
        let end = Instant::now() + START;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match self.lines.recv_timeout(left) {
                Ok(line) => {
                    let port = port(&line).map(str::to_owned);
                    self.said.push(line);
                    if let Some(port) = port {
                        return Ok(port);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {
                    let said = self.said();
                    return Err(EmulatorError::NoPort { said });
                }
                Err(RecvTimeoutError::Disconnected) => {
                    let status = self.child.wait();
                    let status = status.map_or_else(|e| e.to_string(), |it| it.to_string());
                    return Err(self.ended(status));
                }
            }
        }
    }

    fn ended(&mut self, status: String) -> EmulatorError {
        let said = self.last_words();
        EmulatorError::Ended { status, said }
    }

    fn gone(&mut self, status: String) -> EmulatorError {
        let said = self.last_words();
        EmulatorError::Gone { status, said }
    }

    fn last_words(&mut self) -> String {
        // They may still be on their way.
        while let Ok(line) = self.lines.recv_timeout(Duration::from_millis(200)) {
            self.said.push(line);
        }
        self.said()
    }

    /// What it said that matters: a crash ends with pages of registers.
    fn said(&self) -> String {
        let lines = self.said.iter().map(|line| line.trim());
        let words = lines.filter(|line| !line.is_empty() && port(line).is_none());
        let said = words.take(3).collect::<Vec<_>>().join(" / ");
        if said.is_empty() {
            return "nothing".to_owned();
        }
        said
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn command(board: Board, firmware: &Path, memory: &Path) -> Command {
    let mut command = Command::new(PROGRAM);
    // In QEMU's options a comma is doubled to be none.
    let memory = memory.display().to_string().replace(',', ",,");
    let size = psram::SIZE;
    command
        .arg("-machine")
        .arg(format!("{board},memory-backend=psram"))
        .arg("-object")
        .arg(format!(
            "memory-backend-file,id=psram,size={size},mem-path={memory},share=on"
        ))
        .args(["-display", "none", "-monitor", "none", "-serial", "pty"])
        .arg("-kernel")
        .arg(firmware)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// Sends every line of a stream on, from a thread that ends with the stream.
fn collect(stream: Option<impl Read + Send + 'static>, sender: &Sender<String>) {
    let Some(stream) = stream else {
        return;
    };
    let sender = sender.clone();
    thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
}

/// The port in a line like `char device redirected to /dev/pts/3 (label serial0)`.
fn port(line: &str) -> Option<&str> {
    let (_, port) = line.split_once("char device redirected to ")?;
    let port = port.split_once(" (label").map_or(port, |(port, _)| port);
    Some(port.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_port_is_read_from_what_the_emulator_says() {
        let line = "char device redirected to /dev/pts/3 (label serial0)";
        assert_eq!(port(line), Some("/dev/pts/3"));
        let older = "char device redirected to /dev/ttys004";
        assert_eq!(port(older), Some("/dev/ttys004"));
        assert_eq!(port("qemu-system-arm: warning"), None);
    }

    #[test]
    fn a_board_has_the_name_that_it_is_asked_for_by() {
        for board in [Board::An500, Board::An386] {
            assert_eq!(board.to_string().parse(), Ok(board));
        }
        assert!("mps2".parse::<Board>().is_err());
    }

    #[test]
    fn a_firmware_that_is_not_there_is_named() {
        let memory = BoardMemory::temporary().expect("a temporary file");
        let error = Emulator::start(Board::An500, Path::new("none.elf"), &memory);
        let error = error.expect_err("there is none").to_string();
        assert!(error.starts_with("none.elf: "), "{error}");
    }

    #[test]
    fn a_program_of_another_processor_and_a_text_are_no_firmware() {
        let memory = BoardMemory::temporary().expect("a temporary file");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let other = [&b"\x7FELF"[..], &[0; 16]].concat();
        let text = [&[b' '; 20 - ARM.len()][..], &ARM].concat();
        for (name, bytes) in [("other.elf", other), ("text.elf", text)] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).expect("writable");
            let error = Emulator::start(Board::An500, &path, &memory).expect_err(name);
            assert!(matches!(error, EmulatorError::NoFirmware { .. }), "{error}");
        }
    }
}
