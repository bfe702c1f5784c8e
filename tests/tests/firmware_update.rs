//! Tables on their way into the firmware, in the emulator: what the device does with
//! frames meanwhile, and which tables it takes.

use ed25519_dalek::SigningKey;
use iltm::compile::sign::{SealTerms, sign};
use iltm::device::emulator::Board;
use iltm::device::memory::BoardMemory;
use iltm::device::upload::{NoObserver, Parcel, Upload, UploadError};
use iltm::device::{Client, DeviceError, Patience};
use iltm_runtime::frame_buffers::{Format, Layout, psram};
use iltm_runtime::image::{Table, crc32};
use iltm_runtime::link::{Refusal, SlotState};
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::trust::Rejected;
use iltm_runtime::{FrameSize, Grid};
use iltm_tests::firmware::{
    Effects, PATIENCE, counted, elf, finding, on_host, order, random_frame, random_table, word,
};
use iltm_tests::socket::Socket;
use std::process::Child;
use std::time::Duration;

const DEVICE: u64 = 0x1234;

const TRIAL: Duration = Duration::from_mins(5);

fn key() -> SigningKey {
    SigningKey::from_bytes(&[9; 32])
}

fn signed(image: &[u8], version: u32) -> Vec<u8> {
    let terms = SealTerms {
        version,
        oldest: 0,
        device: DEVICE,
    };
    sign(image, &key(), terms).expect("an image")
}

fn grid() -> Grid {
    Grid::new(16, 24).expect("a small grid")
}

fn table(seed: u64) -> Vec<u8> {
    let effects = Effects {
        deviation: false,
        ..Effects::ALL
    };
    random_table(grid(), 3, effects, seed)
}

/// Frames of one pixel a cell, so many a second.
fn format(hertz: u32) -> Format {
    let size = FrameSize::of_grid(grid());
    Format::new(size, 3, Encoding::Display, 1_000_000 / hertz).expect("small frames")
}

/// A board that counts instructions and plays frames to itself, at the end of a line.
struct Running {
    qemu: Child,
    memory: BoardMemory,
    client: Client<Socket>,
    _folder: tempfile::TempDir,
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// Starts a board whose frames all look like this.
fn run(memory: BoardMemory, format: Format, frame: &[u8]) -> Running {
    order(&memory, word::FRAMES, u32::MAX);
    let size = format.size();
    let sides = size.width() as u32 | (size.height() as u32) << 16;
    order(&memory, word::SIZE, sides);
    order(&memory, word::CHANNELS, u32::from(format.channels()));
    order(&memory, word::PERIOD, format.period_us());
    let layout = Layout::new(format, psram::FRAMES.len()).expect("it fits");
    for buffer in 0..2 {
        let place = layout.input(buffer);
        let start = psram::FRAMES.start + place.start;
        let written = memory.write(&(start..start + place.len()), frame);
        written.expect("room");
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("line");
    let serial = format!("unix:{},server=on,wait=off", path.display());
    let firmware = elf(Board::An500, "selftest");
    let qemu = counted(Board::An500, &firmware, &memory, &serial)
        .spawn()
        .expect("qemu-system-arm is installed: tests/run.sh does it");
    let patience = Patience {
        answer: Duration::from_secs(2),
        tries: 20,
    };
    let line = Socket::connect(&path, PATIENCE);
    Running {
        qemu,
        memory,
        client: Client::greet(line, patience).expect("the device answers"),
        _folder: folder,
    }
}

#[test]
fn an_update_misses_no_frame_and_the_new_table_comes_between_two() {
    let (old, new) = (signed(&table(1), 1), signed(&table(2), 2));
    let memory = BoardMemory::temporary().expect("a temporary file");
    memory.put_table(&old).expect("room");
    let format = format(1_000);
    let frame = random_frame(format, 3);
    let shown = |file: &[u8]| {
        let (image, _) = iltm_runtime::image::unseal(file).expect("signed");
        let table = Table::check(image).expect("compile checked it");
        let (pixels, _) = on_host(&table, 1, format, &frame);
        crc32(&[&pixels])
    };
    // Both tables at tier 1, or the governor would change the pixels; and frames that
    // leave a tenth of their period for everything else.
    order(&memory, word::TIER, 2);
    order(&memory, word::SLOW_UNTIL, u32::MAX);
    order(&memory, word::SLOW_BY, 21_000);
    order(&memory, word::OUTPUT, shown(&old));
    order(&memory, word::NEW_OUTPUT, shown(&new));
    assert_ne!(shown(&old), shown(&new));
    let mut running = run(memory, format, &frame);
    let client = &mut running.client;
    client
        .provision(key().verifying_key().to_bytes(), DEVICE)
        .expect("it had no key");
    let before = client.status().expect("an answer");
    let parcel = Parcel::new(&new);
    let mut upload = Upload::new(client, &parcel);
    let summary = upload.run(&mut NoObserver).expect("a good line");
    upload
        .activate(TRIAL, &mut NoObserver)
        .expect("a good table");
    let slots = client.slots().expect("an answer");
    assert_eq!(slots.slots[1].state, SlotState::Trial);
    let id = slots.slots[1].table.expect("whole").id;
    // Some frames with the new table.
    while finding(&running.memory, word::NEW) < 20 {
        std::thread::sleep(Duration::from_millis(5));
    }
    client.confirm(id).expect("on trial");
    let after = client.status().expect("an answer");
    let found = |word| finding(&running.memory, word);
    println!(
        "{} bytes in {} ms of the device's time at 1,000 frames/s: {} frames, the new table from frame {} on, {} late, {} dropped, {} broken, {} skipped; longest frame {} us",
        summary.sent,
        after.uptime_ms - before.uptime_ms,
        after.frames.shown - before.frames.shown,
        found(word::TURN),
        after.frames.late,
        after.frames.dropped,
        after.frames.broken,
        found(word::SKIPPED),
        after.frame_time.worst_us,
    );
    assert!(summary.sent as usize >= new.len(), "all of it was sent");
    assert!(after.frames.shown > before.frames.shown + 100);
    let frames = after.frames;
    assert_eq!((frames.late, frames.dropped, frames.broken), (0, 0, 0));
    assert_eq!(found(word::SKIPPED), 0, "every number was shown");
    assert_eq!(
        found(word::WRONG),
        0,
        "each frame is the old one or the new one"
    );
    assert_eq!(found(word::TURNS), 1, "old ones, then new ones");
    assert!(after.stack.used < after.stack.size, "{:?}", after.stack);
    println!("stack {} of {} bytes", after.stack.used, after.stack.size);
}

#[test]
fn a_trial_that_nobody_confirms_ends_with_the_old_table() {
    let (old, new) = (table(1), table(2));
    let memory = BoardMemory::temporary().expect("a temporary file");
    memory.put_table(&old).expect("room");
    let format = format(60);
    let mut running = run(memory, format, &random_frame(format, 3));
    let client = &mut running.client;
    let first = client.status().expect("an answer").table;
    let parcel = Parcel::new(&new);
    let mut upload = Upload::new(client, &parcel);
    upload.run(&mut NoObserver).expect("a good line");
    let used = upload
        .activate(Duration::from_secs(2), &mut NoObserver)
        .expect("a good table");
    assert_ne!(used.table, first);
    let end = std::time::Instant::now() + PATIENCE;
    loop {
        let status = client.status().expect("an answer");
        if status.table == first {
            assert_eq!(status.slots, [SlotState::Active, SlotState::Valid]);
            assert_eq!(status.frames.late, 0);
            break;
        }
        assert!(std::time::Instant::now() < end, "{status:?}");
    }
}

#[test]
fn the_firmware_refuses_each_bad_table_for_its_own_reason_and_keeps_the_old_one() {
    let good = signed(&table(1), 5);
    let memory = BoardMemory::temporary().expect("a temporary file");
    memory.put_table(&good).expect("room");
    let format = format(60);
    let mut running = run(memory, format, &random_frame(format, 3));
    let client = &mut running.client;
    client
        .provision(key().verifying_key().to_bytes(), DEVICE)
        .expect("it had no key");
    let in_use = client.status().expect("an answer").table;
    let image = random_table(Grid::new(3, 4).expect("small"), 1, Effects::NONE, 7);
    let terms = SealTerms {
        version: 6,
        oldest: 0,
        device: DEVICE,
    };
    let seal = |image: &[u8], key: &SigningKey, terms| sign(image, key, terms).expect("an image");
    let good = seal(&image, &key(), terms);
    let altered = |at: usize| {
        let mut file = good.clone();
        file[at] ^= 1;
        file
    };
    let older = SealTerms {
        version: 4,
        ..terms
    };
    let other = SealTerms {
        device: DEVICE + 1,
        ..terms
    };
    let cases = [
        (altered(image.len() - 1), Rejected::Damaged),
        (altered(good.len() - 1), Rejected::Signature),
        (good[..good.len() / 2].to_vec(), Rejected::Truncated),
        (
            b"no table at all, but long enough to be one".to_vec(),
            Rejected::NotATable,
        ),
        (image.clone(), Rejected::Unsigned),
        (
            seal(&image, &SigningKey::from_bytes(&[8; 32]), terms),
            Rejected::WrongKey,
        ),
        (
            seal(&image, &key(), older),
            Rejected::Older {
                version: 4,
                floor: 5,
            },
        ),
        (
            seal(&image, &key(), other),
            Rejected::OtherDevice { device: DEVICE + 1 },
        ),
    ];
    for (file, reason) in cases {
        let parcel = Parcel::new(&file);
        let mut upload = Upload::new(client, &parcel);
        upload.run(&mut NoObserver).expect("a good line");
        let error = upload
            .activate(TRIAL, &mut NoObserver)
            .expect_err("a bad table");
        let refused = match &error {
            UploadError::Device(DeviceError::Refused {
                refusal: Refusal::Table(rejected),
                ..
            }) => *rejected,
            other => panic!("{reason:?}: {other}"),
        };
        assert_eq!(refused, reason);
        let status = client.status().expect("an answer");
        assert_eq!(status.table, in_use, "{reason:?}");
        assert_eq!(status.slots, [SlotState::Active, SlotState::Broken]);
    }
    let parcel = Parcel::new(&good);
    let mut upload = Upload::new(client, &parcel);
    upload.run(&mut NoObserver).expect("a good line");
    upload
        .activate(TRIAL, &mut NoObserver)
        .expect("the same table, good");
}
