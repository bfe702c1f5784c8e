//! Firmware in the emulator (QEMU): building it, boards that run it, their lines, and
//! tables and frames for them.

use crate::wedge;
use iltm::compile::{CompileOptions, FineGains, compile};
use iltm::device::emulator::{Board, Emulator};
use iltm::device::memory::BoardMemory;
use iltm::device::playback::Playback;
use iltm::device::port::BAUD;
use iltm::device::{Client, Line, Patience, Port};
use iltm::{
    picture::{Picture, Response, Samples},
    video::{CompensateOptions, Compensator},
};
use iltm_runtime::frame_buffers::{Format, Layout, psram};
use iltm_runtime::image::Table;
use iltm_runtime::units::ClippedSamples;
use iltm_runtime::{FrameSize, Grid};
use std::collections::HashMap;
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longest that anything is waited for: far more than it takes on a busy machine.
pub const PATIENCE: Duration = Duration::from_mins(1);

/// Stages of a firmware that has all.
pub const ALL_STAGES: &str = "stages";

/// Stages of a firmware that has gain and clip alone.
pub const LEAN: &str = "";

/// The ELF file of a firmware (`firmware`, `selftest` or `bench`), built for the board.
pub fn elf(board: Board, bin: &'static str) -> PathBuf {
    elf_of(board, ALL_STAGES, bin)
}

/// The same with these stages only, features of the firmware with commas between them.
/// Of those between [`LEAN`] and [`ALL_STAGES`] the last one built is kept.
pub fn elf_of(board: Board, stages: &str, bin: &'static str) -> PathBuf {
    static BUILT: Mutex<Option<HashMap<(String, &str), PathBuf>>> = Mutex::new(None);
    let key = (format!("{board} {stages}"), bin);
    // A build that failed must fail every test that needs it, not poison them.
    let mut built = BUILT
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    let built = built.get_or_insert_default();
    if let Some(path) = built.get(&key) {
        return path.clone();
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../runtime/firmware/build.sh");
    let mut command = Command::new("bash");
    without_cargos_variables(&mut command);
    let output = command
        .arg(script)
        .args([board.name(), bin])
        .env("ILTM_FIRMWARE_STAGES", stages)
        .output()
        .expect("bash is there");
    assert!(
        output.status.success(),
        "the firmware cannot be built:\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let path = PathBuf::from(said.lines().last().expect("the script prints the path"));
    built.insert(key, path.clone());
    path
}

/// Takes away what cargo tells its tests about their build: it is not meant for another one
/// that the command starts.
pub fn without_cargos_variables(command: &mut Command) {
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if text.starts_with("CARGO_") && text != "CARGO_HOME"
            || text.starts_with("RUSTUP_TOOLCHAIN")
        {
            command.env_remove(name);
        }
    }
}

/// Bytes of flash that an ELF file takes.
pub fn flash_bytes(elf: &Path) -> u64 {
    use object::{Object, ObjectSegment};
    let bytes = std::fs::read(elf).expect("it has just been built");
    let file = object::File::parse(bytes.as_slice()).expect("an ELF file");
    file.segments().map(|segment| segment.file_range().1).sum()
}

/// Orders and findings of the self-test, by the names in
/// `runtime/firmware/src/bin/selftest.rs`.
#[allow(missing_docs, reason = "the self-test explains them")]
pub mod word {
    pub const TIER: usize = 0;
    pub const HANG: usize = 1;
    pub const FRAMES: usize = 2;
    pub const SIZE: usize = 3;
    pub const CHANNELS: usize = 4;
    pub const PERIOD: usize = 5;
    pub const SLOW_FROM: usize = 6;
    pub const SLOW_UNTIL: usize = 7;
    pub const SLOW_BY: usize = 8;
    pub const SLOW_BY_TIER: usize = 9;
    pub const OUTPUT: usize = 10;
    pub const TEAR: usize = 11;
    pub const PANIC: usize = 12;
    pub const NEW_OUTPUT: usize = 13;
    pub const HANGS: usize = 14;
    pub const SHOWN: usize = 32;
    pub const WRONG: usize = 33;
    pub const OVER: usize = 34;
    pub const LATE: usize = 35;
    pub const DROPPED: usize = 36;
    pub const BROKEN: usize = 37;
    pub const STACK: usize = 38;
    pub const WORST: usize = 39;
    pub const CHANGES: usize = 40;
    pub const NEW: usize = 41;
    pub const TURNS: usize = 42;
    pub const TURN: usize = 43;
    pub const SKIPPED: usize = 44;
    pub const CHANGE: usize = 64;
}

/// Gives the self-test an order.
pub fn order(memory: &BoardMemory, word: usize, value: u32) {
    let at = psram::SELF_TEST.start + 4 * word;
    let written = memory.write(&(at..at + 4), &value.to_le_bytes());
    written.expect("the memory's file can be written");
}

/// What the self-test found.
pub fn finding(memory: &BoardMemory, word: usize) -> u32 {
    let at = psram::SELF_TEST.start + 4 * word;
    let mut bytes = [0; 4];
    let read = memory.read(&(at..at + 4), &mut bytes);
    read.expect("the memory's file can be read");
    u32::from_le_bytes(bytes)
}

/// A board's memory with this in slot A.
pub fn memory_with(slot: &[u8]) -> BoardMemory {
    let memory = BoardMemory::temporary().expect("a temporary file");
    memory.write(&psram::SLOT_A, slot).expect("room");
    memory
}

/// Runs a firmware on a board with this memory, until what is returned is dropped.
pub fn start(board: Board, elf: &Path, memory: &BoardMemory) -> Emulator {
    let emulator = Emulator::start(board, elf, memory);
    emulator.expect("qemu-system-arm is installed: tests/run.sh does it")
}

/// A client of a running board.
pub fn client(emulator: &Emulator) -> Client<Port> {
    let port = Port::open(emulator.port(), BAUD).expect("the emulator's port");
    let patience = Patience {
        tries: 40,
        ..Patience::default()
    };
    Client::greet(port, patience).expect("the device answers")
}

/// QEMU with every instruction taking a nanosecond, so that each run is the same;
/// `serial` is its option of that name.
pub fn counted(board: Board, elf: &Path, memory: &BoardMemory, serial: &str) -> Command {
    let mut qemu = Command::new("qemu-system-arm");
    qemu.arg("-machine")
        .arg(format!("{board},memory-backend=psram"))
        .arg("-object")
        .arg(format!(
            "memory-backend-file,id=psram,size={},mem-path={},share=on",
            psram::SIZE,
            memory.path().display()
        ))
        .args([
            "-icount",
            "shift=0,sleep=off",
            "-display",
            "none",
            "-monitor",
            "none",
        ])
        .args(["-semihosting-config", "enable=on,target=native"])
        .args(["-serial", serial])
        .arg("-kernel")
        .arg(elf)
        .stdin(Stdio::null())
        .stdout(Stdio::null());
    qemu
}

/// The self-test on a board that counts instructions and has a [`Socket`] for its line,
/// until it is dropped.
#[derive(Debug)]
pub struct CountedBoard {
    qemu: Child,
    folder: TempDir,
}

impl CountedBoard {
    /// Starts it with this memory.
    pub fn start(memory: &BoardMemory) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("line");
        let serial = format!("unix:{},server=on,wait=off", path.display());
        let firmware = elf(Board::An500, "selftest");
        let mut qemu = counted(Board::An500, &firmware, memory, &serial);
        let qemu = qemu.spawn();
        Self {
            qemu: qemu.expect("qemu-system-arm is installed: tests/run.sh does it"),
            folder,
        }
    }

    /// Its line.
    pub fn line(&self) -> Socket {
        Socket::connect(&self.folder.path().join("line"), PATIENCE)
    }
}

impl Drop for CountedBoard {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// Orders the self-test to play so many frames by itself, which all look like this.
pub fn play(memory: &BoardMemory, count: u32, format: Format, frame: &[u8]) {
    let size = format.size();
    let sides = size.width() as u32 | (size.height() as u32) << 16;
    order(memory, word::FRAMES, count);
    order(memory, word::SIZE, sides);
    order(memory, word::CHANNELS, u32::from(format.channels()));
    order(memory, word::PERIOD, format.period_us());
    let layout = Layout::new(format, psram::FRAMES.len()).expect("it fits");
    for buffer in 0..2 {
        let start = psram::FRAMES.start + layout.input(buffer).start;
        let written = memory.write(&(start..start + frame.len()), frame);
        written.expect("room");
    }
}

/// A serial line as a socket of the emulator's, which takes bytes faster than a terminal.
#[derive(Debug)]
pub struct Socket(UnixStream);

impl Socket {
    /// Waits for the emulator to make the socket.
    pub fn connect(path: &Path, patience: Duration) -> Self {
        let end = Instant::now() + patience;
        loop {
            match UnixStream::connect(path) {
                Ok(stream) => return Self(stream),
                Err(error) => assert!(Instant::now() < end, "no line: {error}"),
            }
            thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Line for Socket {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        let wait = wait.max(Duration::from_millis(1));
        self.0.set_read_timeout(Some(wait))?;
        match self.0.read(bytes) {
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Ok(0)
            }
            other => other,
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}

/// Gives one frame and returns the projector input that the device makes of it.
pub fn through(playback: &mut Playback<'_>, frame: &[u8]) -> Vec<u8> {
    let end = Instant::now() + PATIENCE;
    while !playback.attached() {
        assert!(Instant::now() < end, "the device takes no frames");
        thread::sleep(Duration::from_millis(1));
    }
    let refused = playback.counts().refused;
    playback.give(frame).expect("the memory's file is there");
    assert_eq!(playback.counts().refused, refused, "there is room");
    wait_for_frame(playback, end)
}

/// The next frame shown.
pub fn wait_for_frame(playback: &mut Playback<'_>, end: Instant) -> Vec<u8> {
    loop {
        let mut shown = None;
        playback
            .show(|_, pixels| shown = Some(pixels.to_vec()))
            .expect("the memory's file is there");
        if let Some(shown) = shown {
            return shown;
        }
        assert!(Instant::now() < end, "the device shows nothing");
        thread::sleep(Duration::from_micros(200));
    }
}

/// What the host makes of a frame, and the samples that it clips.
pub fn on_host(
    table: &Table<'_>,
    tier: u8,
    format: Format,
    frame: &[u8],
) -> (Vec<u8>, ClippedSamples) {
    let settings = CompensateOptions {
        tier: Some(tier),
        encoding: format.encoding(),
        threads: 1,
        ..CompensateOptions::default()
    };
    let compensator = Compensator::new(table, settings).expect("the tier exists");
    let samples = Samples::Eight(frame.to_vec());
    let picture = Picture::new(format.size(), samples).expect("a whole frame");
    let (picture, summary) = compensator.frame(picture).expect("it fits the table");
    let count = |samples: u64| u32::try_from(samples).expect("a frame's");
    let clipped = ClippedSamples {
        black: count(summary.clipped - summary.clipped_white),
        white: count(summary.clipped_white),
    };
    match picture.samples() {
        Samples::Eight(samples) => (samples.clone(), clipped),
        Samples::Sixteen(_) => unreachable!("the samples were bytes"),
    }
}

/// Samples that the host clips of a frame at the tier at which it makes of it what was
/// shown: a governor has chosen the tier. `None` if there is no such tier.
pub fn clipped_on_host(
    table: &Table<'_>,
    format: Format,
    frame: &[u8],
    shown: &[u8],
) -> Option<ClippedSamples> {
    (0..=table.top_tier()).find_map(|tier| {
        let (made, clipped) = on_host(table, tier, format, frame);
        (made == shown).then_some(clipped)
    })
}

/// What a table may need; any may be left out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "any of them may be missing")]
pub struct Effects {
    /// Light between the cells.
    pub operator: bool,
    /// Light that is there under black.
    pub ambient: bool,
    /// A projector that is not linear.
    pub response: bool,
    /// An operator of its own for each channel, beside the shared one.
    pub deviation: bool,
    /// Gains finer than the cells.
    pub fine: bool,
}

impl Effects {
    /// All.
    pub const ALL: Self = Self {
        operator: true,
        ambient: true,
        response: true,
        deviation: true,
        fine: true,
    };

    /// None.
    pub const NONE: Self = Self {
        operator: false,
        ambient: false,
        response: false,
        deviation: false,
        fine: false,
    };
}

/// A table with these effects for a wedge whose texture and ambient light are
/// random. With an even seed, black is raised to the brightest ambient light.
pub fn random_table(grid: Grid, channels: usize, effects: Effects, seed: u64) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(seed);
    let cells = grid.cells();
    let mut inverse = wedge(grid, channels);
    if !effects.operator {
        inverse.shared *= 0.0;
    }
    for (index, channel) in inverse.channels.iter_mut().enumerate() {
        for gain in &mut channel.gain {
            *gain *= 0.7 + 0.6 * random.f64();
        }
        for ambient in &mut channel.ambient {
            *ambient = if effects.ambient {
                0.03 * random.f64()
            } else {
                0.0
            };
        }
        channel.deviation = effects.deviation.then(|| {
            let deviation = nalgebra::DMatrix::from_fn(cells, cells, |i, j| {
                let chosen = i != j && (i + 5 * j + index).is_multiple_of(23);
                if chosen { 0.003 * random.f64() } else { 0.0 }
            });
            deviation.into()
        });
    }
    let (rows, cols) = (2 * grid.rows() + 1, 3 * grid.cols());
    let fine = effects.fine.then(|| FineGains {
        size: FrameSize::new(cols as u16, rows as u16).expect("not empty"),
        channels: (0..channels)
            .map(|_| (0..rows * cols).map(|_| 1.0 + random.f64()).collect())
            .collect(),
    });
    let options = CompileOptions {
        projector: if effects.response {
            Response::Srgb.into()
        } else {
            Response::Linear.into()
        },
        match_black: seed.is_multiple_of(2),
        inverse_error: 0.01,
        provenance: format!("seed = {seed}\n"),
        ..CompileOptions::default()
    };
    let compiled = compile(&inverse, fine.as_ref(), &options);
    compiled.expect("the wedge is a plain scene").image
}

/// A frame with all kinds of content: noise, a ramp, black, white.
pub fn random_frame(format: Format, seed: u64) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(seed);
    let bytes = format.bytes();
    let byte = |at: usize| match seed % 4 {
        0 => random.u8(..),
        1 => (at * 255 / bytes) as u8,
        2 => [0, 255][at / 7 % 2],
        _ => 120 + random.u8(..40),
    };
    (0..bytes).map(byte).collect()
}
