//! Emulated board with the product's firmware, whose memory outlives it, and `iltm`
//! commands to it.

use ed25519_dalek::SigningKey;
use iltm::device::emulator::{self, Emulator};
use iltm::device::memory::BoardMemory;
use iltm::device::playback::Playback;
use iltm_runtime::frame_buffers::{Format, psram};
use iltm_runtime::image::{Table, unseal};
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::{FrameSize, Grid};
use iltm_tests::firmware::{clipped_on_host, elf, random_frame, start, through};
use iltm_tests::{grid, key_file, signing_key};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Grid of the tables.
pub(crate) fn cells() -> Grid {
    grid(4, 8)
}

/// Number of the board.
pub(crate) const DEVICE: u64 = 9;

/// Longest that anything may take.
const LONGEST: Duration = Duration::from_mins(1);

/// Its file, which shows the right to change what the board uses.
const KEY_FILE: &str = "site.key";

/// The board takes tables signed with this key.
pub(crate) fn key() -> SigningKey {
    signing_key(3)
}

pub(crate) struct Board {
    folder: TempDir,
    memory: BoardMemory,
    firmware: PathBuf,
    running: Option<Emulator>,
    /// A frame that is shown to it, and its format.
    frame: (Format, Vec<u8>),
}

impl Board {
    /// One fresh from the factory, switched off.
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let memory = BoardMemory::kept(&folder.path().join("memory")).expect("a new file");
        let public = key().verifying_key().to_bytes();
        memory.provision(public, DEVICE).expect("it has none");
        fs::write(folder.path().join(KEY_FILE), key_file(&key())).expect("writable");
        let size = FrameSize::of_grid(cells());
        let format = Format::new(size, 1, Encoding::Display, 40_000).expect("small frames");
        Self {
            folder,
            memory,
            firmware: elf(emulator::Board::An500, "firmware"),
            running: None,
            frame: (format, random_frame(format, 3)),
        }
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.folder.path().join(name), bytes).expect("writable");
    }

    pub(crate) fn start(&mut self) {
        let started = start(emulator::Board::An500, &self.firmware, &self.memory);
        self.running = Some(started);
    }

    /// SIGKILL, as whatever else ends an emulator here.
    pub(crate) fn kill(&mut self) {
        let running = self.running.take();
        assert!(running.is_some_and(|mut board| board.check().is_ok()));
    }

    fn port(&self) -> &str {
        self.running.as_ref().expect("it runs").port()
    }

    fn iltm(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
        command.current_dir(self.folder.path());
        command.args(["--json"]).args(arguments);
        command.args(["--port", self.port()]);
        command.env("ILTM_CONFIG_DIR", self.folder.path().join("config"));
        command.env("ILTM_STATE_DIR", self.folder.path().join("state"));
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        command.stderr(Stdio::null());
        command
    }

    /// What `iltm status` says.
    pub(crate) fn status(&self) -> Value {
        let output = self.iltm(&["status"]).output();
        let output = output.expect("the binary is there").stdout;
        serde_json::from_slice(&output).expect("an object")
    }

    /// Begins `iltm flash FILE --confirm --key KEY`; returns when it talks to the board.
    pub(crate) fn flash(&self, name: &str) -> Flashing {
        let flash = self
            .iltm(&["flash", name, "--confirm", "--key", KEY_FILE])
            .spawn();
        let mut child = flash.expect("the binary is there");
        let out = BufReader::new(child.stdout.take().expect("piped"));
        let (sender, events) = channel();
        thread::spawn(move || {
            for line in out.lines().map_while(Result::ok) {
                let event = serde_json::from_str(&line).expect("an object a line");
                if sender.send((Instant::now(), event)).is_err() {
                    break;
                }
            }
        });
        // It writes down what is said.
        let end = format!("-{}.txt", child.id());
        let transcripts = self.folder.path().join("state/transcripts");
        let begun = || {
            let files = fs::read_dir(&transcripts).into_iter().flatten().flatten();
            let mut names = files.map(|file| file.file_name());
            names.any(|name| name.to_string_lossy().ends_with(&end))
        };
        let limit = Instant::now() + LONGEST;
        while !begun() {
            assert!(Instant::now() < limit, "it does not begin");
            thread::sleep(Duration::from_millis(1));
        }
        Flashing {
            child,
            events,
            flash: Flash {
                code: None,
                begun: Instant::now(),
                events: Vec::new(),
            },
        }
    }

    fn slot(&self, slot: usize, length: usize) -> Vec<u8> {
        let mut bytes = vec![0; length];
        let range = [psram::SLOT_A, psram::SLOT_B][slot].clone();
        let read = self.memory.read(&range, &mut bytes);
        read.expect("the memory's file is there");
        bytes
    }

    /// Whether a slot holds this file.
    pub(crate) fn holds(&self, slot: usize, file: &[u8]) -> bool {
        self.slot(slot, file.len()) == file
    }

    /// Bytes of the file in sectors of a slot that hold something else.
    pub(crate) fn missing(&self, slot: usize, file: &[u8]) -> usize {
        let held = self.slot(slot, file.len());
        let sectors = file.chunks(psram::SECTOR).zip(held.chunks(psram::SECTOR));
        let missing = sectors.filter(|(wanted, held)| wanted != held);
        missing.map(|(wanted, _)| wanted.len()).sum()
    }

    /// What the board makes of its frame.
    pub(crate) fn show(&self) -> Vec<u8> {
        let (format, frame) = &self.frame;
        let mut playback = Playback::new(&self.memory, *format).expect("small frames");
        through(&mut playback, frame)
    }

    /// Whether the host makes the same of it with this table.
    pub(crate) fn is_shown_with(&self, shown: &[u8], file: &[u8]) -> bool {
        let (image, _) = unseal(file).expect("signed");
        let table = Table::check(image).expect("compile checked it");
        let (format, frame) = &self.frame;
        // The board chooses the tier.
        clipped_on_host(&table, *format, frame, shown).is_some()
    }
}

/// `iltm flash` at work.
pub(crate) struct Flashing {
    child: Child,
    events: Receiver<(Instant, Value)>,
    flash: Flash,
}

/// `iltm flash` when it has ended.
pub(crate) struct Flash {
    /// Exit code.
    pub(crate) code: Option<i32>,
    /// When it began to talk to the board.
    pub(crate) begun: Instant,
    /// Its events, and the failure if there is one; with the time when they were said.
    pub(crate) events: Vec<(Instant, Value)>,
}

impl Flash {
    /// The result, or the failure.
    pub(crate) fn last(&self) -> &Value {
        &self.events.last().expect("a result").1
    }
}

impl Flashing {
    /// Until so long after an event or the beginning, or until the end.
    pub(crate) fn wait_for(&mut self, event: Option<&str>, time: Duration) {
        let mut from = self.flash.begun;
        if let Some(name) = event {
            while let Ok((at, event)) = self.events.recv_timeout(LONGEST) {
                from = at;
                let is_it = event["event"] == name;
                self.flash.events.push((at, event));
                if is_it {
                    break;
                }
            }
        }
        thread::sleep((from + time).saturating_duration_since(Instant::now()));
    }

    /// Until it has ended.
    pub(crate) fn wait(mut self) -> Flash {
        while let Ok(event) = self.events.recv_timeout(LONGEST) {
            self.flash.events.push(event);
        }
        let limit = Instant::now() + LONGEST;
        while self.flash.code.is_none() {
            assert!(Instant::now() < limit, "it does not end");
            let status = self.child.try_wait().expect("our own child");
            self.flash.code = status.map(|status| status.code().expect("not killed"));
            thread::sleep(Duration::from_millis(1));
        }
        self.flash
    }
}
