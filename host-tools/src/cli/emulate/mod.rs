//! `iltm emulate`
//!
//! | what | file |
//! |---|---|
//! | the board: its memory, firmware and port | here |
//! | frames that go through it | [`film`] |
//! | a window and a video of them | [`screen`] |

mod film;
mod screen;

use super::args::Emulate;
use super::failure::{Failure, Kind, cannot_write};
use super::interrupt;
use super::output::Output;
use super::tables::{TableSize, check, read_table};
use crate::compile::Provenance;
use crate::compile::sign::read_public_key;
use crate::device::emulator::{Board, Emulator, EmulatorError};
use crate::device::frame_source::FrameFeed;
use crate::device::memory::BoardMemory;
use crate::device::playback::PlaybackError;
use crate::user::Folders;
use crate::user::emulated::register;
use crate::video::wide_size;
use film::Film;
use iltm_runtime::{
    FrameSize,
    frame_buffers::{Format, psram},
    image::Table,
    pipeline::Encoding,
};
use screen::BoardScreen;
use serde_json::json;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Builds the firmware; the last line that it prints is the ELF file.
const BUILD: &str = "runtime/firmware/build.sh";

/// What names the stages that are built, and those of the firmware for one of several projectors.
const STAGES: &str = "ILTM_FIRMWARE_STAGES";
const OF_SEVERAL: &str = "stages,neighbours";

/// Frames a second of the test scene.
const RATE: f64 = 25.0;

/// Least width and height of the test scene.
const LEAST_SCENE: [u16; 2] = [128, 96];

pub(super) fn run(arguments: &Emulate, output: &Output) -> Result<(), Failure> {
    let memory = memory(arguments)?;
    if let Some(path) = &arguments.key {
        provision(&memory, path, arguments.device)?;
    }
    let image = arguments.table.as_deref().map(read_table).transpose()?;
    let table = match (&arguments.table, &image) {
        (Some(path), Some(image)) => Some(check(path, image)?),
        _ => None,
    };
    if let (Some(path), Some(image), Some(table)) = (&arguments.table, &image, &table) {
        put_table(&memory, path, image, table)?;
    }
    let frames = frames(arguments, table.as_ref())?;
    let firmware = match &arguments.firmware {
        Some(firmware) => firmware.clone(),
        None => build(arguments.board, table.as_ref(), output)?,
    };
    let follows = arguments.frames.is_none() && arguments.size.is_none();
    let mut film = Film::new(&memory, frames, follows)?;
    let mut screen = BoardScreen::new(arguments, film.kind())?;
    interrupt::catch();
    let started = Emulator::start(arguments.board, &firmware, &memory);
    let mut emulator = started.map_err(|error| emulator_failure(&error))?;
    // Others find its port until this goes.
    let folders = Folders::of_user();
    let registered = folders.map(|it| register(&it, emulator.port(), arguments.board.name()));
    if let Some(Err(error)) = &registered {
        output.remark(&format!("`iltm ports` will not find this board: {error}"));
    }
    report(arguments, &emulator, &firmware, output);
    let played = play(&mut emulator, &mut film, &mut screen);
    let saved = screen.finish();
    // Ctrl-C goes to the emulator as well, which may be the first to notice.
    if !interrupt::stopped() {
        thread::sleep(Duration::from_millis(100));
    }
    if interrupt::stopped() {
        let saved = saved?;
        let counts = film.counts();
        let mut data = json!({ "event": "end", "given": counts.given, "shown": counts.shown });
        let mut text = format!("{} frames given, {} shown\n", counts.given, counts.shown);
        if let (Some(frames), Some(path)) = (saved, &arguments.save) {
            data["saved"] = json!(frames);
            text = format!("{text}{frames} frames in {}\n", path.display());
        }
        output.result(&data, &text);
        return Ok(());
    }
    played
}

fn memory(arguments: &Emulate) -> Result<BoardMemory, Failure> {
    let memory = match &arguments.memory {
        Some(path) => BoardMemory::kept(path).map_err(|error| {
            let message = format!("{}: cannot be the board's memory: {error}", path.display());
            Failure::new(Kind::Write, message, "Name a file that is not there yet.")
        })?,
        None => BoardMemory::temporary().map_err(|error| {
            let message = format!("no file for the board's memory can be made: {error}");
            Failure::new(
                Kind::Write,
                message,
                "Make room, or name a file with --memory.",
            )
        })?,
    };
    Ok(memory)
}

fn provision(memory: &BoardMemory, path: &Path, device: u64) -> Result<(), Failure> {
    let key = read_public_key(path)?;
    let provisioned = memory.provision(key.to_bytes(), device);
    provisioned.map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => Failure::new(
            Kind::HasKey,
            format!(
                "{}: the board has another key or number",
                memory.path().display()
            ),
            "A device keeps them for good: give the same --key and --device, or another --memory.",
        ),
        _ => cannot_write(memory.path(), &error),
    })
}

fn put_table(
    memory: &BoardMemory,
    path: &Path,
    image: &[u8],
    table: &Table<'_>,
) -> Result<(), Failure> {
    memory.put_table(image).map_err(|error| {
        if error.kind() != io::ErrorKind::FileTooLarge {
            return cannot_write(memory.path(), &error);
        }
        let room = psram::SLOT_A.len();
        let message = format!(
            "{}: the table has {} bytes; the board's flash has room for {room}",
            path.display(),
            image.len()
        );
        let advice = TableSize::new(table, image.len()).advice(room);
        Failure::new(Kind::TooLarge, message, advice)
    })
}

fn frames(arguments: &Emulate, table: Option<&Table<'_>>) -> Result<FrameFeed, Failure> {
    let channels = table.map(Table::channels);
    if let Some(path) = &arguments.frames {
        let frames = FrameFeed::file(path, channels, arguments.fps)?;
        return Ok(match table {
            Some(table) => frames.for_table(table, &frames_of_all(table))?,
            None => frames,
        });
    }
    scene(table, arguments.size, arguments.fps.unwrap_or(RATE))
}

/// The test scene for the device that has a table; of all projectors side by side, if it is one of
/// several.
fn scene(
    table: Option<&Table<'_>>,
    size: Option<FrameSize>,
    rate: f64,
) -> Result<FrameFeed, Failure> {
    let own = size.unwrap_or_else(|| scene_size(table));
    let Some(table) = table else {
        return Ok(FrameFeed::scene(own, 3, rate));
    };
    let all = frames_of_all(table);
    let wide = |own| wide_size((table, &all), own);
    let other = || {
        size.is_none()
            .then(|| smaller(table)?.find_map(wide))
            .flatten()
    };
    let wide = wide(own).or_else(other);
    let frames = FrameFeed::scene(wide.unwrap_or(own), table.channels(), rate);
    Ok(frames.for_table(table, &all)?)
}

/// Rows and columns of cells of the frames of all projectors, if the table says them.
fn frames_of_all(table: &Table<'_>) -> Vec<[u16; 2]> {
    let provenance = Provenance::read(table.provenance());
    provenance.frames.unwrap_or_default()
}

/// Frames of the projector's aspect whose pixels are whole parts of its own, the smallest first, none
/// smaller than the board's least.
fn smaller(table: &Table<'_>) -> Option<impl Iterator<Item = FrameSize>> {
    let size = table.projector()?.size();
    let least = LEAST_SCENE.map(usize::from);
    let parts = (1..=size.width()).rev();
    Some(parts.filter_map(move |part| {
        let whole = size.width().is_multiple_of(part) && size.height().is_multiple_of(part);
        let [width, height] = [size.width() / part, size.height() / part];
        let enough = width >= least[0] && height >= least[1];
        let sides = (whole && enough).then(|| [width, height].map(|side| side as u16));
        sides.and_then(|[width, height]| FrameSize::new(width, height))
    }))
}

/// A size that the emulated board can keep up with, in the aspect of the table's projector.
fn scene_size(table: Option<&Table<'_>>) -> FrameSize {
    let grid = table.map(|table| FrameSize::of_grid(table.grid()));
    let side = |least: u16, side: fn(FrameSize) -> usize| {
        grid.map_or(least, |grid| least.max(side(grid) as u16))
    };
    let width = side(LEAST_SCENE[0], FrameSize::width);
    let height = side(LEAST_SCENE[1], FrameSize::height);
    let size = FrameSize::new(width, height).expect("neither side is zero");
    let projector = table.and_then(Table::projector);
    let around = projector.and_then(|projector| projector.around(size));
    around.unwrap_or(size)
}

fn format(frames: &FrameFeed) -> Result<Format, Failure> {
    let period = (1e6 / frames.rate()).round().clamp(1.0, 1e8) as u32;
    let format = Format::new(frames.size(), frames.channels(), Encoding::Display, period);
    let format = format.map(|format| format.with_neighbours(frames.neighbours()));
    format.ok_or_else(|| {
        let message = format!("a board cannot take frames of {}", frames.size());
        Failure::new(Kind::Frames, message, "Give other frames.")
    })
}

/// Builds the firmware of the source folder that this is run in, or was built
/// from; returns its ELF file.
fn build(board: Board, table: Option<&Table<'_>>, output: &Output) -> Result<PathBuf, Failure> {
    let here = std::env::current_dir().unwrap_or_default();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).parent();
    let script = here
        .ancestors()
        .chain(source)
        .map(|folder| folder.join(BUILD))
        .find(|script| script.is_file())
        .ok_or_else(|| {
            Failure::new(
                Kind::Emulator,
                "there is no firmware: this is not a source folder, and none was given",
                "Give the firmware's ELF file with --firmware, or run this in the source folder.",
            )
        })?;
    if output.terminal {
        let _ = writeln!(io::stderr(), "building the firmware for {board}");
    }
    let mut command = Command::new("bash");
    if table.and_then(Table::neighbours).is_some() {
        command.env(STAGES, OF_SEVERAL);
    }
    let built = command
        .arg(&script)
        .arg(board.name())
        .stdin(Stdio::null())
        .stderr(if output.terminal {
            Stdio::inherit()
        } else {
            Stdio::piped()
        })
        .output();
    let failed = |why: String| {
        let message = format!("{}: {why}", script.display());
        let next_step = format!("Run `bash {} {board}` to see all of it.", script.display());
        Failure::new(Kind::Emulator, message, next_step)
    };
    let built = built.map_err(|error| failed(error.to_string()))?;
    let last = |text: &[u8]| {
        let text = String::from_utf8_lossy(text);
        let last = text.lines().rfind(|line| !line.trim().is_empty());
        last.unwrap_or_default().trim().to_owned()
    };
    if !built.status.success() {
        let why = match last(&built.stderr) {
            empty if empty.is_empty() => built.status.to_string(),
            why => why,
        };
        return Err(failed(format!("the firmware cannot be built: {why}")));
    }
    Ok(PathBuf::from(last(&built.stdout)))
}

fn report(arguments: &Emulate, emulator: &Emulator, firmware: &Path, output: &Output) {
    let shown = |path: &Path| path.display().to_string();
    let mut out = io::stdout();
    let _ = if output.is_json() {
        let data = json!({
            "event": "started",
            "port": emulator.port(),
            "board": arguments.board.name(),
            "firmware": shown(firmware),
            "table": arguments.table.as_deref().map(shown),
            "memory": arguments.memory.as_deref().map(shown),
            "key": arguments.key.as_deref().map(shown),
        });
        writeln!(out, "{data}")
    } else {
        writeln!(out, "{}", emulator.port())
    };
    let _ = out.flush();
    if output.terminal && !output.is_json() {
        let _ = writeln!(
            io::stderr(),
            "{} runs; try `iltm monitor --firmware {}` in another terminal. Ctrl-C ends it.",
            arguments.board,
            firmware.display()
        );
    }
}

/// Frames at their rate, until somebody stops it or the board ends.
fn play(
    emulator: &mut Emulator,
    film: &mut Film<'_>,
    screen: &mut BoardScreen,
) -> Result<(), Failure> {
    let period = Duration::from_secs_f64(1.0 / film.rate());
    let mut due = Instant::now();
    while !interrupt::stopped() {
        emulator.check().map_err(|error| emulator_failure(&error))?;
        wait_until(due);
        // After a pause, go on from now rather than make up for it in a burst.
        due = (due + period).max(Instant::now());
        film.turn(screen)?;
    }
    Ok(())
}

/// Sleeps in pieces, so that ctrl-C is noticed at a slow rate too.
fn wait_until(time: Instant) {
    const PIECE: Duration = Duration::from_millis(100);
    while !interrupt::stopped() {
        let left = time.saturating_duration_since(Instant::now());
        if left.is_zero() {
            break;
        }
        thread::sleep(left.min(PIECE));
    }
}

fn emulator_failure(error: &EmulatorError) -> Failure {
    Failure::new(Kind::Emulator, error, error.next_step())
}

fn playback_failure(error: &PlaybackError) -> Failure {
    match error {
        PlaybackError::Memory(_) => Failure::new(
            Kind::Emulator,
            error,
            "Check that the disk has room for the board's memory.",
        ),
        PlaybackError::Region(_) => Failure::new(
            Kind::Frames,
            error,
            "Give smaller frames, or a smaller --size.",
        ),
    }
}
