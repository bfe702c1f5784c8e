//! The firmware in the emulator, and tables for it.

use crate::wedge;
use iltm::compile::{CompileOptions, FineGains, compile};
use iltm::device::emulator::Board;
use iltm::device::memory::BoardMemory;
use iltm::device::playback::Playback;
use iltm::{
    picture::{Picture, Response, Samples},
    video::{CompensateOptions, Compensator},
};
use iltm_runtime::frame_buffers::{Format, psram};
use iltm_runtime::image::Table;
use iltm_runtime::{FrameSize, Grid};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Longest that anything is waited for: far more than it takes on a busy machine.
pub const PATIENCE: Duration = Duration::from_mins(1);

/// Stages of a firmware that has all.
pub const ALL_STAGES: &str = "stages";

/// Stages of a firmware that has gain and clip alone.
pub const LEAN: &str = "";

/// The ELF file of a firmware (`firmware`, `selftest` or `bench`), built for the board.
///
/// # Panics
/// If it cannot be built, with the reason.
#[must_use]
pub fn elf(board: Board, bin: &'static str) -> PathBuf {
    elf_of(board, ALL_STAGES, bin)
}

/// The same with these stages only, features of the firmware with commas between them.
/// Of those between [`LEAN`] and [`ALL_STAGES`] the last one built is kept.
///
/// # Panics
/// If it cannot be built, with the reason.
#[must_use]
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
///
/// # Panics
/// If it is none.
#[must_use]
pub fn flash_bytes(elf: &Path) -> u64 {
    use object::{Object, ObjectSegment};
    let bytes = std::fs::read(elf).expect("it has just been built");
    let file = object::File::parse(bytes.as_slice()).expect("an ELF file");
    file.segments().map(|segment| segment.file_range().1).sum()
}

/// Orders and findings of the self-test, by the names in
/// `runtime/firmware/src/bin/selftest.rs`.
pub mod word {
    /// See the self-test.
    pub const TIER: usize = 0;
    /// See the self-test.
    pub const HANG: usize = 1;
    /// See the self-test.
    pub const FRAMES: usize = 2;
    /// See the self-test.
    pub const SIZE: usize = 3;
    /// See the self-test.
    pub const CHANNELS: usize = 4;
    /// See the self-test.
    pub const PERIOD: usize = 5;
    /// See the self-test.
    pub const SLOW_FROM: usize = 6;
    /// See the self-test.
    pub const SLOW_UNTIL: usize = 7;
    /// See the self-test.
    pub const SLOW_BY: usize = 8;
    /// See the self-test.
    pub const SLOW_BY_TIER: usize = 9;
    /// See the self-test.
    pub const OUTPUT: usize = 10;
    /// See the self-test.
    pub const TEAR: usize = 11;
    /// See the self-test.
    pub const PANIC: usize = 12;
    /// See the self-test.
    pub const NEW_OUTPUT: usize = 13;
    /// See the self-test.
    pub const SHOWN: usize = 32;
    /// See the self-test.
    pub const WRONG: usize = 33;
    /// See the self-test.
    pub const OVER: usize = 34;
    /// See the self-test.
    pub const LATE: usize = 35;
    /// See the self-test.
    pub const DROPPED: usize = 36;
    /// See the self-test.
    pub const BROKEN: usize = 37;
    /// See the self-test.
    pub const STACK: usize = 38;
    /// See the self-test.
    pub const WORST: usize = 39;
    /// See the self-test.
    pub const CHANGES: usize = 40;
    /// See the self-test.
    pub const NEW: usize = 41;
    /// See the self-test.
    pub const TURNS: usize = 42;
    /// See the self-test.
    pub const TURN: usize = 43;
    /// See the self-test.
    pub const SKIPPED: usize = 44;
    /// See the self-test.
    pub const CHANGE: usize = 64;
}

/// Gives the self-test an order.
///
/// # Panics
/// If the memory's file cannot be written.
pub fn order(memory: &BoardMemory, word: usize, value: u32) {
    let at = psram::SELF_TEST.start + 4 * word;
    let written = memory.write(&(at..at + 4), &value.to_le_bytes());
    written.expect("the memory's file can be written");
}

/// What the self-test found.
///
/// # Panics
/// If the memory's file cannot be read.
#[must_use]
pub fn finding(memory: &BoardMemory, word: usize) -> u32 {
    let at = psram::SELF_TEST.start + 4 * word;
    let mut bytes = [0; 4];
    let read = memory.read(&(at..at + 4), &mut bytes);
    read.expect("the memory's file can be read");
    u32::from_le_bytes(bytes)
}

/// QEMU with every instruction taking a nanosecond, so that each run is the same;
/// `serial` is its option of that name.
#[must_use]
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

/// Gives one frame and returns the projector input that the device makes of it.
///
/// # Panics
/// If nothing is shown in a long time.
pub fn through(playback: &mut Playback<'_>, frame: &[u8]) -> Vec<u8> {
    let end = Instant::now() + PATIENCE;
    while !playback.attached() {
        assert!(Instant::now() < end, "the device takes no frames");
        std::thread::sleep(Duration::from_millis(1));
    }
    let refused = playback.counts().refused;
    playback.give(frame).expect("the memory's file is there");
    assert_eq!(playback.counts().refused, refused, "there is room");
    wait_for_frame(playback, end)
}

/// The next frame shown.
///
/// # Panics
/// If nothing is shown by then.
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
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// What the host makes of a frame.
///
/// # Panics
/// If it cannot: tables and frames of tests fit each other.
#[must_use]
pub fn on_host(table: &Table<'_>, tier: u8, format: Format, frame: &[u8]) -> (Vec<u8>, u64) {
    let settings = CompensateOptions {
        tier: Some(tier),
        encoding: format.encoding(),
        threads: 1,
    };
    let compensator = Compensator::new(table, settings).expect("the tier exists");
    let samples = Samples::Eight(frame.to_vec());
    let mut picture = Picture::new(format.size(), samples).expect("a whole frame");
    let summary = compensator
        .picture(&mut picture)
        .expect("it fits the table");
    match picture.samples() {
        Samples::Eight(samples) => (samples.clone(), summary.clipped),
        Samples::Sixteen(_) => unreachable!("the samples were bytes"),
    }
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
/// random.
///
/// # Panics
/// If it cannot be compiled.
#[must_use]
pub fn random_table(grid: Grid, channels: usize, effects: Effects, seed: u64) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(seed);
    let cells = grid.cells();
    let mut inverse = wedge(grid, channels);
    if !effects.operator {
        inverse.shared.fill(0.0);
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
            nalgebra::DMatrix::from_fn(cells, cells, |i, j| {
                let chosen = i != j && (i + 5 * j + index).is_multiple_of(23);
                if chosen { 0.003 * random.f64() } else { 0.0 }
            })
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
        inverse_error: 0.01,
        provenance: format!("seed = {seed}\n"),
        ..CompileOptions::default()
    };
    let compiled = compile(&inverse, fine.as_ref(), &options);
    compiled.expect("the wedge is a plain scene").image
}

/// A frame with all kinds of content: noise, a ramp, black, white.
#[must_use]
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
