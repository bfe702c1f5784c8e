//! Fuzz targets: one function for each parser of foreign bytes. Whatever the bytes, it must
//! return: the targets in `tests/fuzz` and the short runs in
//! `tests/tests/runtime/foreign_bytes.rs` call the same functions.

mod files;
mod flash;
mod gate;
pub mod mutate;
mod pictures;
mod session;
mod targets;

pub use flash::flash;
pub use gate::{contents, gate};
pub use pictures::pictures;
pub use session::{described, session};
pub use targets::{TARGETS, Target};

use crate::fake_device::FakeDevice;
use crate::wedge_table;
use iltm::capture::{
    self, CalibrationRole, CaptureOptions, LinearPhotograph, ListedRole, ManifestOf, Role,
    Settings, StripeRole, parse_reference,
};
use iltm::progress::Silent;
use iltm::scene::description::{Scene, parse_mesh};
use iltm::verify::VerifyRole;
use iltm::video::{Compensator, OperatorMemory};
use iltm_runtime::FrameSize;
use iltm_runtime::Grid;
use iltm_runtime::image::Table;
use iltm_runtime::link::{DELIMITER, Decoder, Event, MAX_PAYLOAD, Request, Response, Session};
use iltm_runtime::pipeline::{Encoding, GridPipeline};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A table image, and frames through it where it is taken.
pub fn image(bytes: &[u8]) {
    if let Ok(table) = Table::check(bytes) {
        match table.channels() {
            1 => frame::<1>(&table),
            _ => frame::<3>(&table),
        }
        placed(&table);
    }
}

/// Where the cells of frames larger than the grid lie: inside, whatever a table says.
fn placed(table: &Table<'_>) {
    for (width, height) in [
        (1, 1),
        (64, 40),
        (17, 200),
        (u16::MAX, 3),
        (u16::MAX, u16::MAX),
    ] {
        let Some(frame) = FrameSize::new(width, height) else {
            continue;
        };
        if let Some(area) = table.area(frame) {
            assert!(area.left + area.size.width() <= frame.width());
            assert!(area.top + area.size.height() <= frame.height());
            assert!(area.size.holds(table.grid()));
        }
    }
}

/// A black and a white frame through a table, at every tier.
fn frame<const C: usize>(table: &Table<'_>) {
    let cells = table.grid().cells();
    let Ok(pipeline) = GridPipeline::<C>::new(table) else {
        return;
    };
    let mut memory = OperatorMemory::new(table);
    for tier in 0..=table.top_tier() {
        for code in [0_u8, 255] {
            let neighbours = table.neighbours();
            memory.hear(neighbours.map(|others| vec![[code; 2]; others.samples()]));
            let mut workspace = memory.workspace();
            let (wanted, mut input) = (vec![[code; C]; cells], vec![[0; C]; cells]);
            let done =
                pipeline.compensate(tier, Encoding::Display, &wanted, &mut input, &mut workspace);
            assert!(done.is_ok(), "a checked table refused a frame of its size");
        }
    }
}

/// A picture or a video stream, by its first bytes, through a small table.
pub fn frames(bytes: &[u8]) {
    static IMAGE: OnceLock<Vec<u8>> = OnceLock::new();
    let image = IMAGE.get_or_init(|| wedge_table(2, 3, 1));
    let Ok(table) = Table::check(image) else {
        return;
    };
    if let Ok(compensator) = Compensator::new(&table, iltm::video::CompensateOptions::default()) {
        let _ = compensator.stream(bytes, io::sink(), &Silent);
    }
}

/// A `capture.csv`, `stripes.csv`, `calibration.csv` or `verify.csv`.
///
/// # Panics
/// If a manifest that was read is written and read again as another. Only the
/// lines may differ: they are written in the order of the index.
pub fn manifest(bytes: &[u8]) {
    manifest_of::<Role>(bytes);
    manifest_of::<StripeRole>(bytes);
    manifest_of::<CalibrationRole>(bytes);
    manifest_of::<VerifyRole>(bytes);
}

fn manifest_of<R: ListedRole + PartialEq + Debug>(bytes: &[u8]) {
    let parse = |bytes: &[u8]| ManifestOf::<R>::parse(bytes, Path::new(R::FILE));
    if let Ok(manifest) = parse(bytes) {
        let mut again = parse(manifest.to_csv().as_bytes()).expect("a written manifest is good");
        assert_eq!(again.shots.len(), manifest.shots.len(), "photographs");
        for (again, first) in again.shots.iter_mut().zip(&manifest.shots) {
            again.line = first.line;
            assert_eq!(again, first, "written and read again");
        }
    }
}

/// A `capture.toml`.
pub fn settings(bytes: &[u8]) {
    let _ = Settings::parse(bytes, Path::new("capture.toml"));
}

/// A scene file. Meshes and textures that it names are looked for where there are none.
pub fn scene(bytes: &[u8]) {
    let _ = Scene::parse(bytes, Path::new("/nowhere/scene.toml"));
}

/// A reference transport of 2 x 2 cells, grey or in colour.
pub fn reference(bytes: &[u8]) {
    let Ok(grid) = Grid::new(2, 2) else { return };
    for channels in [1, 3] {
        let _ = parse_reference(bytes, grid, channels, Path::new("reference_T.npy"));
    }
}

/// A mesh.
pub fn mesh(bytes: &[u8]) {
    let _ = parse_mesh(bytes);
}

/// The photographs of an otherwise plain capture, and its patterns.
pub fn photograph(bytes: &[u8]) {
    static FOLDER: OnceLock<Option<PathBuf>> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("iltm-fuzz-{}", std::process::id()));
        fs::create_dir_all(&folder).ok()?;
        let lines =
            "index,role,pattern,photo\n0,white,bytes.png,bytes.png\n1,black,bytes.png,bytes.png\n";
        fs::write(folder.join("capture.csv"), lines).ok()?;
        Some(folder)
    });
    if let Some(folder) = folder
        && fs::write(folder.join("bytes.png"), bytes).is_ok()
    {
        let options = CaptureOptions {
            min_bernoulli: 0,
            coarsen: true,
            ..CaptureOptions::default()
        };
        let _ = capture::examine(folder, &options, &Silent);
        // Patterns are PNG; photographs are of many formats.
        let _ = LinearPhotograph::read(folder, None, &Silent);
    }
}

/// A hello of protocol version 2 with number 7, as it goes on a line.
pub const HELLO: [u8; 11] = [
    0x01, 0x02, 0x07, 0x01, 0x06, 0x02, 0x88, 0xAE, 0xFB, 0xB5, 0x00,
];

/// A subscription to a status every 500 ms with number 8.
pub const SUBSCRIBE: [u8; 12] = [
    0x01, 0x02, 0x08, 0x08, 0x02, 0xF4, 0x03, 0x0F, 0x4B, 0xEF, 0x6B, 0x00,
];

/// Bytes on a serial line: to a device, and to a host.
///
/// # Panics
/// If the device does not answer a hello after them, or says something that is no
/// frame.
pub fn link(bytes: &[u8]) {
    let mut device = FakeDevice::default();
    let mut session = Session::new();
    // The first byte of each piece says how long to wait before the rest.
    let (mut now, mut decoder) = (0, Decoder::new());
    for piece in bytes.chunks(64) {
        now += u64::from(piece[0]) * 16;
        session.receive(piece, now, &mut device);
        session.poll(now, &device);
        session.log(piece);
        say(&mut session, &mut decoder);
    }
    session.receive(&[DELIMITER], now, &mut device);
    say(&mut session, &mut decoder);
    session.receive(&HELLO, now, &mut device);
    assert!(!session.pending().is_empty(), "a hello is answered");
    say(&mut session, &mut decoder);

    let mut decoder = Decoder::new();
    for byte in bytes {
        if let Some(Ok(frame)) = decoder.push(*byte) {
            let _ = postcard::from_bytes::<Response>(frame.payload);
            let _ = postcard::from_bytes::<Event>(frame.payload);
        }
    }
}

/// Takes what a session has to say, which is whole frames.
fn say(session: &mut Session, decoder: &mut Decoder) {
    while !session.pending().is_empty() {
        let bytes = session.pending().to_vec();
        session.sent(bytes.len());
        for byte in bytes {
            if let Some(frame) = decoder.push(byte) {
                assert!(frame.is_ok(), "a device sends whole frames");
            }
        }
    }
}

/// A payload as a request, a response and an event.
///
/// # Panics
/// If a message that was read does not fit a frame, or is read as another one after
/// it was written again.
pub fn messages(bytes: &[u8]) {
    let bytes = &bytes[..bytes.len().min(MAX_PAYLOAD)];
    if let Ok(request) = Request::parse(bytes) {
        again(&request, |bytes| {
            assert_eq!(Request::parse(bytes), Ok(request), "written and read again");
        });
    }
    both_ways::<Response>(bytes);
    both_ways::<Event>(bytes);
}

fn both_ways<M: Serialize + for<'a> Deserialize<'a> + PartialEq + Debug>(bytes: &[u8]) {
    if let Ok(message) = postcard::from_bytes::<M>(bytes) {
        again(&message, |bytes| {
            let read = postcard::from_bytes::<M>(bytes);
            assert_eq!(read.as_ref(), Ok(&message), "written and read again");
        });
    }
}

fn again<M: Serialize + Debug>(message: &M, read: impl FnOnce(&[u8])) {
    let mut bytes = [0; MAX_PAYLOAD];
    match postcard::to_slice(message, &mut bytes) {
        Ok(bytes) => read(bytes),
        // Bytes of a chunk are what a payload has room for; a message as long as the
        // payload that it was read from fits again.
        Err(error) => panic!("{message:?} does not fit a frame: {error}"),
    }
}
