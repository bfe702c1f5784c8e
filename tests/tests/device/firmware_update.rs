//! Firmware update: tables on their way into the firmware, in the emulator: what the
//! device does with frames meanwhile, and which tables it takes.

use ed25519_dalek::{Signer, SigningKey};
use iltm::device::memory::BoardMemory;
use iltm::device::upload::{NoObserver, Parcel, Upload, UploadError};
use iltm::device::{Authority, Client, DeviceError, Patience};
use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::{Table, crc32};
use iltm_runtime::link::{Refusal, SlotState};
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::trust::Rejected;
use iltm_runtime::{FrameSize, Grid};
use iltm_tests::firmware::{
    CountedBoard, Effects, PATIENCE, Socket, finding, on_host, order, play, random_frame,
    random_table, word,
};
use iltm_tests::signing_key;
use std::time::Duration;

const DEVICE: u64 = 0x1234;

const TRIAL: Duration = Duration::from_mins(5);

fn key() -> SigningKey {
    signing_key(9)
}

fn signed(image: &[u8], version: u32) -> Vec<u8> {
    iltm_tests::signed(image, &key(), version, 0, DEVICE)
}

fn grid() -> Grid {
    iltm_tests::grid(16, 24)
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

/// A board that counts instructions and plays frames to itself, which all look like this,
/// and its host.
fn run(memory: &BoardMemory, format: Format, frame: &[u8]) -> (CountedBoard, Client<Socket>) {
    play(memory, u32::MAX, format, frame);
    let board = CountedBoard::start(memory);
    let patience = Patience {
        answer: Duration::from_secs(2),
        tries: 20,
    };
    let client = Client::greet(board.line(), patience);
    (board, client.expect("the device answers"))
}

/// A memory with this table's file.
fn memory(file: &[u8]) -> BoardMemory {
    let memory = BoardMemory::temporary().expect("a temporary file");
    memory.put_table(file).expect("room");
    memory
}

#[test]
fn an_update_misses_no_frame_and_the_new_table_comes_between_two() {
    let (old, new) = (signed(&table(1), 1), signed(&table(2), 2));
    let memory = memory(&old);
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
    let (_board, mut client) = run(&memory, format, &frame);
    let client = &mut client;
    client
        .provision(key().verifying_key().to_bytes(), DEVICE, false)
        .expect("it had no key");
    client.authorise(Authority::new(|deed, device, sequence| {
        let signature = key().sign(&deed.message(device, sequence));
        signature.to_bytes().to_vec()
    }));
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
    while finding(&memory, word::NEW) < 20 {
        std::thread::sleep(Duration::from_millis(5));
    }
    client.confirm(id).expect("on trial");
    let after = client.status().expect("an answer");
    let found = |word| finding(&memory, word);
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
    let memory = memory(&old);
    let format = format(60);
    let (_board, mut client) = run(&memory, format, &random_frame(format, 3));
    let client = &mut client;
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
            assert_eq!(status.slots, [SlotState::Active, SlotState::Unconfirmed]);
            assert_eq!(status.frames.late, 0);
            break;
        }
        assert!(std::time::Instant::now() < end, "{status:?}");
    }
}

#[test]
fn the_firmware_refuses_each_bad_table_for_its_own_reason_and_keeps_the_old_one() {
    let good = signed(&table(1), 5);
    let memory = memory(&good);
    let format = format(60);
    let (_board, mut client) = run(&memory, format, &random_frame(format, 3));
    let client = &mut client;
    client
        .provision(key().verifying_key().to_bytes(), DEVICE, false)
        .expect("it had no key");
    client.authorise(Authority::new(|deed, device, sequence| {
        let signature = key().sign(&deed.message(device, sequence));
        signature.to_bytes().to_vec()
    }));
    let in_use = client.status().expect("an answer").table;
    let image = random_table(iltm_tests::grid(3, 4), 1, Effects::NONE, 7);
    let seal =
        |key: &SigningKey, version, device| iltm_tests::signed(&image, key, version, 0, device);
    let good = seal(&key(), 6, DEVICE);
    let altered = |at: usize| {
        let mut file = good.clone();
        file[at] ^= 1;
        file
    };
    let (version, floor) = (4, 5);
    let device = DEVICE + 1;
    let no_table = b"no table at all, but long enough to be one";
    let cases = [
        (altered(image.len() - 1), Rejected::Damaged),
        (altered(good.len() - 1), Rejected::Signature),
        (good[..good.len() / 2].to_vec(), Rejected::Truncated),
        (no_table.to_vec(), Rejected::NotATable),
        (image.clone(), Rejected::Unsigned),
        (seal(&signing_key(8), 6, DEVICE), Rejected::WrongKey),
        (
            seal(&key(), version, DEVICE),
            Rejected::Older { version, floor },
        ),
        (seal(&key(), 6, device), Rejected::OtherDevice { device }),
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
