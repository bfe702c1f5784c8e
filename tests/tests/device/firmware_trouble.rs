//! Firmware in trouble, in the emulator: floods of good requests, gains of large frames to be
//! computed at a switch, crash after crash, and flash that rots under the table in use.

use iltm::device::emulator::Board;
use iltm::device::playback::Playback;
use iltm::device::upload::{NoObserver, Parcel, Upload};
use iltm::device::{Client, Line, Patience};
use iltm_runtime::FrameSize;
use iltm_runtime::frame_buffers::{Format, psram};
use iltm_runtime::image::{Table, crc32};
use iltm_runtime::link::{
    Channel, Fault, LinkFrame, MAX_ENCODED, Mode, PROTOCOL_VERSION, PassThrough, Request, SlotState,
};
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::trust::Rejected;
use iltm_tests::firmware::{
    CountedBoard, Effects, PATIENCE, Socket, client, elf, finding, memory_with, on_host, order,
    play, random_frame, random_table, start, through, word,
};
use iltm_tests::grid;
use std::time::{Duration, Instant};

fn format(width: u16, height: u16, period_us: u32) -> Format {
    let size = FrameSize::new(width, height).expect("not empty");
    Format::new(size, 3, Encoding::Display, period_us).expect("a format")
}

fn table(seed: u64) -> Vec<u8> {
    random_table(grid(16, 24), 3, Effects::ALL, seed)
}

/// One of fewer cells, which is sent in a quarter of the time.
fn short_table(seed: u64) -> Vec<u8> {
    random_table(grid(8, 12), 3, Effects::ALL, seed)
}

fn greet(board: &CountedBoard) -> Client<Socket> {
    let patience = Patience {
        answer: Duration::from_secs(5),
        tries: 20,
    };
    Client::greet(board.line(), patience).expect("the device answers")
}

/// A request as it goes on the line.
fn framed(sequence: u16, request: &Request<'_>) -> Vec<u8> {
    let mut payload = [0; 64];
    let payload = postcard::to_slice(request, &mut payload).expect("a short request");
    let mut bytes = [0; MAX_ENCODED];
    let frame = LinkFrame {
        channel: Channel::Request,
        sequence,
        payload,
    };
    let length = frame.emit(&mut bytes).expect("it fits");
    bytes[..length].to_vec()
}

/// What became of the frames during a flood of one request at so many baud, and for how many
/// milliseconds of the device's time the next host waits for an answer.
fn flooded(request: &Request<'_>, baud: u32) -> (u32, [u32; 3], u32) {
    const MILLISECONDS: u32 = 200;
    let image = table(1);
    let memory = memory_with(&image);
    // A thousand frames a second that leave a seventh of the time for everything else.
    let format = format(24, 16, 1_000);
    let frame = random_frame(format, 9);
    play(&memory, u32::MAX, format, &frame);
    order(&memory, word::TIER, 3);
    order(&memory, word::SLOW_UNTIL, u32::MAX);
    order(&memory, word::SLOW_BY, 19_500);
    let table = Table::check(&image).expect("compile checked it");
    let (expected, _) = on_host(&table, 2, format, &frame);
    order(&memory, word::OUTPUT, crc32(&[&expected]));
    let board = CountedBoard::start(&memory);
    let mut line = board.line();
    let hello = Request::Hello {
        protocol: PROTOCOL_VERSION,
    };
    Line::write(&mut line, &framed(0, &hello)).expect("the line takes bytes");
    let clock = || finding(&memory, word::SHOWN) + finding(&memory, word::DROPPED);
    let end = Instant::now() + PATIENCE;
    while clock() < 20 {
        assert!(Instant::now() < end, "no frames");
        std::thread::sleep(Duration::from_millis(1));
    }
    let (begin, mut sent, mut sequence) = (clock(), 0_u32, 1_u16);
    let mut heard = [0; 4_096];
    while clock() - begin < MILLISECONDS {
        assert!(Instant::now() < end + PATIENCE, "it takes too long");
        // Ten bits a byte.
        if sent < (clock() - begin) * (baud / 10) / 1_000 {
            let bytes = framed(sequence, request);
            Line::write(&mut line, &bytes).expect("the line takes bytes");
            sent += bytes.len() as u32;
            sequence = sequence.wrapping_add(1);
        } else {
            let _ = Line::read(&mut line, &mut heard, Duration::ZERO);
        }
    }
    let asked = clock();
    let mut client = Client::greet(
        line,
        Patience {
            answer: Duration::from_secs(10),
            tries: 4,
        },
    )
    .expect("the device answers");
    let status = client.status().expect("the device answers");
    let waited = clock() - asked;
    let frames = status.frames;
    println!(
        "{request:?} at {baud} baud: {sequence} requests, {sent} bytes in {MILLISECONDS} ms, {frames:?}, the next host waits {waited} ms"
    );
    assert_eq!(finding(&memory, word::WRONG), 0);
    assert_eq!(status.watchdog_resets, 0);
    (sent, [frames.late, frames.dropped, frames.broken], waited)
}

#[test]
fn a_flood_of_good_requests_drops_no_frame_and_holds_no_other_host_up_for_long() {
    let sectors = Request::Sectors {
        length: 1 << 21,
        first: 0,
    };
    for (request, baud) in [
        (Request::Status, 115_200),
        (Request::Status, 921_600),
        (sectors, 115_200),
        (sectors, 921_600),
    ] {
        let (sent, frames, waited) = flooded(&request, baud);
        assert!(sent > 1_000, "{sent} bytes");
        assert_eq!(frames, [0; 3], "{request:?} at {baud}");
        assert!(waited < 1_000, "{request:?} at {baud}: {waited} ms");
    }
}

#[test]
fn no_frame_waits_for_the_gains_of_a_new_tables_pixels() {
    let (old, new) = (short_table(1), short_table(2));
    let memory = memory_with(&old);
    // The gains and ambient light of all pixels take 15 million instructions, a frame at
    // the top tier 6: of a nanosecond each, as everything here.
    let format = format(320, 240, 12_000);
    let frame = random_frame(format, 4);
    play(&memory, u32::MAX, format, &frame);
    order(&memory, word::TIER, 2);
    let shown = |image: &[u8]| {
        let table = Table::check(image).expect("compile checked it");
        crc32(&[&on_host(&table, 1, format, &frame).0])
    };
    order(&memory, word::OUTPUT, shown(&old));
    order(&memory, word::NEW_OUTPUT, shown(&new));
    let board = CountedBoard::start(&memory);
    let mut client = greet(&board);
    let found = |word| finding(&memory, word);
    // The first frames of all wait: nothing can be shown before the gains are there.
    let end = Instant::now() + PATIENCE;
    while found(word::SHOWN) < 5 {
        assert!(Instant::now() < end, "no frames are shown");
        std::thread::sleep(Duration::from_millis(5));
    }
    let at_first = [word::LATE, word::DROPPED].map(found);
    let parcel = Parcel::new(&new);
    let mut upload = Upload::new(&mut client, &parcel);
    upload.run(&mut NoObserver).expect("a good line");
    let trial = Duration::from_mins(5);
    upload
        .activate(trial, &mut NoObserver)
        .expect("a good table");
    let end = Instant::now() + PATIENCE;
    while finding(&memory, word::NEW) < 5 {
        assert!(Instant::now() < end, "the new table is not used");
        std::thread::sleep(Duration::from_millis(5));
    }
    let now = [word::LATE, word::DROPPED].map(found);
    println!(
        "longest frame {} us, {} over the budget, late and dropped {now:?}, {at_first:?} of them at \
         first, {} wrong",
        found(word::WORST) / 25,
        found(word::OVER),
        found(word::WRONG),
    );
    assert_eq!(found(word::OVER), 0);
    assert_eq!(now, at_first);
    assert_eq!(
        found(word::WRONG),
        0,
        "each is the old one's or the new one's"
    );
    assert_eq!(found(word::TURNS), 1, "old ones, then new ones");
    // The first frame is one like all others.
    assert!(found(word::WORST) / 25 < 8_000, "{}", found(word::WORST));
}

#[test]
fn after_three_hangs_in_a_row_frames_pass_and_a_new_table_can_come() {
    let (old, new) = (short_table(1), short_table(2));
    let memory = memory_with(&old);
    order(&memory, word::HANGS, 3);
    order(&memory, word::TIER, 1);
    let emulator = start(Board::An500, &elf(Board::An500, "selftest"), &memory);
    let format = format(24, 16, 100_000);
    let mut playback = Playback::new(&memory, format).expect("it fits");
    let frame = random_frame(format, 3);
    // It hangs with this frame at three starts; the fourth passes it.
    assert_eq!(through(&mut playback, &frame), frame);
    let mut client = client(&emulator);
    let status = client.status().expect("the device answers");
    assert_eq!(status.mode, Mode::PassThrough(PassThrough::CrashLoop));
    assert_eq!(status.watchdog_resets, 3);
    assert_eq!(status.last_fault, Some(Fault::Watchdog));
    let parcel = Parcel::new(&new);
    let mut upload = Upload::new(&mut client, &parcel);
    upload.run(&mut NoObserver).expect("a good line");
    let trial = Duration::from_mins(5);
    upload
        .activate(trial, &mut NoObserver)
        .expect("a good table");
    let table = Table::check(&new).expect("compile checked it");
    let frame = random_frame(format, 4);
    let (expected, _) = on_host(&table, 0, format, &frame);
    assert_eq!(through(&mut playback, &frame), expected);
    client.confirm(table.id()).expect("on trial");
    let status = client.status().expect("the device answers");
    assert_eq!(status.mode, Mode::Compensating);
}

#[test]
fn a_table_that_rots_in_use_is_found_and_frames_pass() {
    let image = table(1);
    let memory = memory_with(&image);
    let format = format(24, 16, 100_000);
    play(&memory, u32::MAX, format, &random_frame(format, 3));
    let board = CountedBoard::start(&memory);
    let mut client = greet(&board);
    let status = client.status().expect("the device answers");
    assert_eq!(status.mode, Mode::Compensating);
    // The last byte: of its provenance, which no frame is made of.
    let at = psram::SLOT_A.start + image.len() - 8;
    let mut byte = [0];
    memory.read(&(at..at + 1), &mut byte).expect("room");
    byte[0] ^= 4;
    memory.write(&(at..at + 1), &byte).expect("room");
    let end = Instant::now() + PATIENCE;
    let status = loop {
        let status = client.status().expect("the device answers");
        if status.mode != Mode::Compensating {
            break status;
        }
        assert!(Instant::now() < end, "it is not found: {status:?}");
        std::thread::sleep(Duration::from_millis(50));
    };
    println!("after {} ms of the device's time", status.uptime_ms);
    assert_eq!(status.mode, Mode::PassThrough(PassThrough::BrokenTable));
    assert_eq!(status.slots[0], SlotState::Broken);
    let cause = Rejected::Damaged;
    assert_eq!(status.last_fault, Some(Fault::Table { slot: 0, cause }));
    assert!(status.uptime_ms < 130_000);
}
