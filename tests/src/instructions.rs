//! Instruction counts: what frames take on the reference board.
//!
//! Counted by the firmware's `bench` in the emulator; the same binary, table and
//! frame give the same count every time. `docs/firmware.md` shows the result,
//! `docs/instructions.csv` holds it, and a test compares the two.

use crate::firmware::{counted, elf, elf_of, memory_with, order};
use crate::neighbours::OF_SEVERAL;
use crate::simulated::{host_tools, learned, photograph, scene};
use iltm::compile::{CompileOptions, compile};
use iltm::device::emulator::Board;
use iltm::picture::Response;
use iltm::scene::description::Scene;
use iltm::solve::{InverseTransport, natural_images};
use iltm_runtime::frame_buffers::psram;
use iltm_runtime::image::Table;
use iltm_runtime::{FrameSize, Grid};
use std::fmt::Write as _;
use std::path::Path;
use std::process::Stdio;
use std::sync::OnceLock;

/// A table and frames to count.
#[derive(Clone)]
pub struct Case {
    /// Its name in the lists.
    pub name: String,
    /// The table's image.
    pub image: Vec<u8>,
    /// Size of its frames.
    pub size: FrameSize,
}

/// What one tier takes.
#[derive(Clone, PartialEq, Debug)]
pub struct Count {
    /// The case's name.
    pub case: String,
    /// The tier.
    pub tier: u8,
    /// Predicted error of what the tier leaves out.
    pub error: f64,
    /// Operator entries a row, all parts together.
    pub entries: f64,
    /// Instructions of the three stages.
    pub stages: [u64; 3],
    /// Instructions of the whole frame.
    pub frame: u64,
    /// Samples clipped.
    pub clipped: u64,
}

/// The tables and frames of the list but for [`slow_cases`].
pub fn cases() -> Vec<Case> {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(quick).clone()
}

/// The last ones of the list, whose tables take minutes to solve.
pub fn slow_cases() -> Vec<Case> {
    vec![
        case(
            "320x240 over 48x64 colour",
            painted((48, 64), (400, 300)),
            Some((320, 240)),
        ),
        case("96x128 colour", painted((96, 128), (640, 480)), None),
    ]
}

/// A table of the painted panels at so many cells, solved from simulated photographs.
fn painted((rows, cols): (u16, u16), (width, height): (u16, u16)) -> Vec<u8> {
    let scene = scene(
        "m-panels-painted",
        &[
            ("rows = 16", &format!("aspect = 1.6\nrows = {rows}")),
            ("cols = 24", &format!("cols = {cols}")),
            ("width = 216", &format!("width = {width}")),
            ("height = 150", &format!("height = {height}")),
        ],
    );
    compiled(&solved(&scene), &[1.0 / 255.0])
}

/// Two square panels at a right angle, in grey.
const CORNER: &str = r"
ambient = 0.004

[projector]
position = [-4.0, 0.5, 4.0]
look_at = [0.0, 0.5, 0.0]
field_of_view = 16.0
aspect = 1.6
rows = 32
cols = 32

[camera]
position = [-3.6, 0.8, 4.4]
look_at = [0.0, 0.5, 0.0]
field_of_view = 18.5
width = 320
height = 220
white = 0.8
full_well = 20000.0
read_noise = 5.0
bits = 12

[[panel]]
corners = [[-1, 0, 0], [0, 0, 0], [0, 1, 0], [-1, 1, 0]]
albedo = 0.8

[[panel]]
corners = [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]]
albedo = 0.8
";

/// Tables of the corner in a dark room and in one with some light.
fn corner() -> [Vec<u8>; 2] {
    let scene = Scene::parse(CORNER.as_bytes(), Path::new("corner.toml")).expect("a scene");
    let mut inverse = solved(&scene);
    let targets = [1.0 / 64.0, 1.0 / 255.0, 1.0 / 750.0];
    let lit = compiled(&inverse, &targets);
    inverse.channels[0].ambient.fill(0.0);
    [compiled(&inverse, &targets), lit]
}

/// What is learned from simulated photographs of a scene.
fn solved(scene: &Scene) -> InverseTransport {
    let capture = tempfile::tempdir().expect("a folder for photographs");
    photograph(scene, 250, 1, capture.path());
    learned(capture.path()).inverse
}

fn compiled(inverse: &InverseTransport, targets: &[f64]) -> Vec<u8> {
    let options = CompileOptions {
        projector: Response::Srgb.into(),
        targets: Some(targets.to_vec()),
        ..CompileOptions::default()
    };
    let compiled = compile(inverse, None, &options);
    compiled.expect("a plain scene").image
}

fn case(name: &str, image: Vec<u8>, size: Option<(u16, u16)>) -> Case {
    let own = FrameSize::of_grid(Table::check(&image).expect("a table").grid());
    let size = size.and_then(|(width, height)| FrameSize::new(width, height));
    Case {
        name: name.to_owned(),
        size: size.unwrap_or(own),
        image,
    }
}

fn quick() -> Vec<Case> {
    let sample = host_tools().join("samples/m-panels-colour");
    let [dark, lit] = corner();
    vec![
        case("32x32 dark room", dark, None),
        case("32x32", lit, None),
        case("13x21 colour", painted((13, 21), (216, 150)), None),
        case("16x24 colour", learned(&sample).compiled.image, None),
        case("64x64 colour", painted((64, 64), (400, 300)), None),
    ]
}

/// A natural-looking frame of a size, sRGB codes.
fn frame(size: FrameSize, channels: usize) -> Vec<u8> {
    // Content comes for grids; a larger frame repeats each of its cells.
    let factor = if size.pixels() > Grid::MAX_CELLS {
        2
    } else {
        1
    };
    let (rows, cols) = (size.height() / factor, size.width() / factor);
    let grid = Grid::new(rows as u16, cols as u16).expect("within a grid's limits");
    let images = natural_images(grid);
    let code = |light: f64| (Response::Srgb.value(light) * 255.0).round() as u8;
    let mut frame = Vec::new();
    for y in 0..size.height() {
        for x in 0..size.width() {
            let cell = y / factor * cols + x / factor;
            frame.extend((0..channels).map(|channel| code(images[(cell, channel)])));
        }
    }
    frame
}

/// Counts all tiers of a case.
pub fn count(case: &Case) -> Vec<Count> {
    let table = Table::check(&case.image).expect("a table");
    let cells = table.grid().cells() as f64;
    let read = |numbers: [u64; 6]| {
        let [tier, first, second, third, frame, clipped] = numbers;
        let info = &table.tiers()[tier as usize];
        Count {
            case: case.name.clone(),
            tier: tier as u8,
            error: info.predicted_error.to_num(),
            entries: f64::from(info.entries) / cells,
            stages: [first, second, third],
            frame,
            clipped,
        }
    };
    let bench_elf = if table.neighbours().is_some() {
        elf_of(Board::An500, OF_SEVERAL, "bench")
    } else {
        elf(Board::An500, "bench")
    };
    let lines = bench(&bench_elf, &case.image, case.size, None);
    lines.into_iter().map(read).collect()
}

/// What the bench finds for a natural-looking frame: for every tier its number,
/// instructions of the three stages and of all, and samples clipped. With `executed`,
/// the emulator writes there each block of code that it comes to, once or more.
pub fn bench(elf: &Path, image: &[u8], size: FrameSize, executed: Option<&Path>) -> Vec<[u64; 6]> {
    let table = Table::check(image).expect("a table");
    let memory = memory_with(image);
    let wanted = frame(size, usize::from(table.channels()));
    let frames = psram::FRAMES.start..psram::FRAMES.start + wanted.len();
    memory.write(&frames, &wanted).expect("room");
    order(
        &memory,
        0,
        size.width() as u32 | (size.height() as u32) << 16,
    );
    let mut qemu = counted(Board::An500, elf, &memory, "null");
    if let Some(log) = executed {
        qemu.args(["-d", "in_asm", "-D"]).arg(log);
    }
    let output = qemu.stdout(Stdio::piped()).output();
    let output = output.expect("qemu-system-arm is installed: tests/run.sh does it");
    // What semihosting prints goes to the emulator's standard error.
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(output.status.success(), "{said}");
    let read = |line: &str| {
        let numbers = line.split(' ').map_while(|field| field.parse().ok());
        let numbers: Vec<u64> = numbers.collect();
        numbers.try_into().unwrap_or_else(|_| panic!("{said}"))
    };
    said.lines().map(read).collect()
}

/// The list as `docs/instructions.csv` holds it.
pub fn csv(counts: &[Count]) -> String {
    let mut text =
        String::from("case,tier,error,entries a row,first,operator,last,frame,clipped\n");
    for count in counts {
        let [first, operator, last] = count.stages;
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "{},{},1/{:.0},{:.1},{first},{operator},{last},{},{}",
            count.case,
            count.tier,
            count.error.recip(),
            count.entries,
            count.frame,
            count.clipped
        );
    }
    text
}
