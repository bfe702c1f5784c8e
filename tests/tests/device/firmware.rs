//! Firmware on both reference boards, in the emulator.

use iltm::device::emulator::{Board, Emulator};
use iltm::device::logs::Logs;
use iltm::device::memory::BoardMemory;
use iltm::device::playback::Playback;
use iltm::device::{Client, Incoming, Line, Patience};
use iltm_runtime::FrameSize;
use iltm_runtime::frame_buffers::layout::descriptor;
use iltm_runtime::frame_buffers::{ControlWords, Format, Layout, psram};
use iltm_runtime::image::{Table, crc32};
use iltm_runtime::link::{Event, Fault, FaultyFrame, Mode, PassThrough, SlotState, Status};
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::trust::Rejected;
use iltm_runtime::units::ClippedSamples;
use iltm_tests::firmware::{
    CountedBoard, Effects, PATIENCE, client, clipped_on_host, counted, elf, finding, flash_bytes,
    memory_with, on_host, order, play, random_frame, random_table, start, through, word,
};
use iltm_tests::grid;
use iltm_tests::made_up::MadeUp;
use std::time::{Duration, Instant};

fn size(width: u16, height: u16) -> FrameSize {
    FrameSize::new(width, height).expect("not empty")
}

fn format(size: FrameSize, channels: usize, encoding: Encoding) -> Format {
    // Slow enough for a busy machine: these frames are given one at a time.
    Format::new(size, channels as u8, encoding, 100_000).expect("a format")
}

/// Tables of every effect and of none, each with frames of the grid's size and
/// larger, in both encodings, at every tier.
fn every_frame_equals_the_hosts(board: Board) {
    let firmware = elf(board, "selftest");
    let without = |change: fn(&mut Effects)| {
        let mut effects = Effects::ALL;
        change(&mut effects);
        effects
    };
    let cases = [
        (13, 21, 3, Effects::ALL),
        (16, 16, 1, Effects::ALL),
        (5, 9, 3, Effects::NONE),
        (7, 8, 1, without(|effects| effects.ambient = false)),
        (8, 7, 3, without(|effects| effects.response = false)),
        (6, 10, 3, without(|effects| effects.deviation = false)),
        (9, 5, 3, without(|effects| effects.fine = false)),
        // Even all the way, so that whole levels are done at once.
        (16, 8, 3, Effects::ALL),
        (8, 16, 3, without(|effects| effects.ambient = false)),
        (10, 6, 1, without(|effects| effects.operator = false)),
    ];
    let mut frames = 0;
    for (seed, (rows, cols, channels, effects)) in (1..).zip(cases) {
        let grid = grid(rows, cols);
        let image = random_table(grid, channels, effects, seed);
        let table = Table::check(&image).expect("compile checked it");
        let memory = memory_with(&image);
        let _running = start(board, &firmware, &memory);
        let larger = size(3 * cols + 5, 4 * rows + 1);
        for size in [FrameSize::of_grid(grid), larger] {
            for encoding in [Encoding::Display, Encoding::Linear] {
                let format = format(size, channels, encoding);
                let mut playback = Playback::new(&memory, format).expect("it fits");
                for tier in 0..=table.top_tier() {
                    order(&memory, word::TIER, u32::from(tier) + 1);
                    let wanted = random_frame(format, seed + u64::from(tier));
                    let input = through(&mut playback, &wanted);
                    let (expected, _) = on_host(&table, tier, format, &wanted);
                    assert!(
                        input == expected,
                        "{board}, {effects:?}, {size}, {encoding:?}, tier {tier}"
                    );
                    frames += 1;
                }
            }
        }
    }
    println!("{board}: {frames} frames equal");
}

#[test]
fn every_frame_of_the_an500_equals_the_hosts() {
    every_frame_equals_the_hosts(Board::An500);
}

#[test]
fn every_frame_of_the_an386_equals_the_hosts() {
    every_frame_equals_the_hosts(Board::An386);
}

/// A board that runs the product with this in slot A.
fn product(board: Board, slot: &[u8]) -> (BoardMemory, Emulator) {
    let memory = memory_with(slot);
    let emulator = start(board, &elf(board, "firmware"), &memory);
    (memory, emulator)
}

fn small_table() -> Vec<u8> {
    let grid = grid(6, 8);
    random_table(grid, 3, Effects::ALL, 77)
}

fn small_format() -> Format {
    format(size(8, 6), 3, Encoding::Display)
}

#[test]
fn a_status_says_what_the_device_has_done() {
    let image = small_table();
    let table = Table::check(&image).expect("compile checked it");
    let (memory, emulator) = product(Board::An500, &image);
    let mut client = client(&emulator);
    assert_eq!(client.device().board, "mps2-an500");
    let mut playback = Playback::new(&memory, small_format()).expect("it fits");
    let (mut clipped, mut last) = (ClippedSamples::default(), ClippedSamples::default());
    for seed in 0..60 {
        let wanted = random_frame(small_format(), seed);
        let input = through(&mut playback, &wanted);
        // The governor has climbed one tier or another: one of them fits.
        let of_frame = clipped_on_host(&table, small_format(), &wanted, &input);
        last = of_frame.expect("the frame is one that the table gives");
        clipped += last;
    }
    let status = client.status().expect("the device answers");
    println!("{status:?}");
    assert_eq!(status.mode, Mode::Compensating);
    assert_eq!(status.table.map(|table| table.id), Some(table.id()));
    assert_eq!(status.slots, [SlotState::Active, SlotState::Empty]);
    assert_eq!((status.frames.received, status.frames.shown), (60, 60));
    assert_eq!((status.frames.dropped, status.frames.broken), (0, 0));
    assert!(clipped.black > 0 && clipped.white > 0, "{clipped:?}");
    assert_eq!(status.clipping.last, last);
    assert_eq!(status.clipping.black, u64::from(clipped.black));
    assert_eq!(status.clipping.white, u64::from(clipped.white));
    assert_eq!(status.clipping.samples, 6 * 8 * 3);
    assert_eq!(status.top_tier, table.top_tier());
    assert_eq!(status.last_fault, None);
    assert_eq!(status.watchdog_resets, 0);
    let time = status.frame_time;
    assert!(0 < time.mean_us && time.mean_us <= time.worst_us);
    assert_eq!(time.budget_us, 87_500);
}

#[test]
fn the_stack_is_never_full() {
    // The largest tables and every path, and a conversation on top.
    let grid = grid(13, 21);
    let image = random_table(grid, 3, Effects::ALL, 5);
    for board in [Board::An500, Board::An386] {
        let (memory, emulator) = product(board, &image);
        let mut client = client(&emulator);
        for size in [size(21, 13), size(64, 40)] {
            let format = format(size, 3, Encoding::Display);
            let mut playback = Playback::new(&memory, format).expect("it fits");
            for seed in 0..4 {
                through(&mut playback, &random_frame(format, seed));
            }
        }
        client
            .subscribe(Duration::from_millis(100))
            .expect("granted");
        let stack = client.status().expect("the device answers").stack;
        println!("{board}: {} of {} bytes of stack", stack.used, stack.size);
        assert!(stack.used > 0);
        // Two KiB to spare, for what the measurement has not seen.
        assert!(stack.used + 2_048 <= stack.size, "{stack:?}");
    }
}

fn passes_through(slot: &[u8], why: PassThrough) -> Status {
    let (memory, emulator) = product(Board::An500, slot);
    let mut client = client(&emulator);
    let mut playback = Playback::new(&memory, small_format()).expect("it fits");
    let wanted = random_frame(small_format(), 4);
    assert_eq!(through(&mut playback, &wanted), wanted);
    let status = client.status().expect("the device answers");
    assert_eq!(status.mode, Mode::PassThrough(why));
    status
}

#[test]
fn a_device_without_a_usable_table_passes_frames_through_and_says_why() {
    let image = small_table();
    let status = passes_through(&[], PassThrough::NoTable);
    assert_eq!(
        (status.slots[0], status.last_fault),
        (SlotState::Empty, None)
    );

    let broken = |status: &Status, cause| {
        assert_eq!(status.slots[0], SlotState::Broken);
        assert_eq!(status.last_fault, Some(Fault::Table { slot: 0, cause }));
    };
    let mut corrupted = image.clone();
    let middle = corrupted.len() / 2;
    corrupted[middle] ^= 0x10;
    let status = passes_through(&corrupted, PassThrough::BrokenTable);
    broken(&status, Rejected::Damaged);
    // Behind half an image, the slot is zeros.
    let status = passes_through(&image[..middle], PassThrough::BrokenTable);
    broken(&status, Rejected::Damaged);

    let grey = random_table(grid(6, 8), 1, Effects::ALL, 3);
    passes_through(&grey, PassThrough::OtherFrames);
}

#[test]
fn a_border_stays_black_on_the_device_and_another_aspect_passes_through() {
    for (board, channels) in [(Board::An500, 3), (Board::An386, 1)] {
        let mut made = MadeUp::of_all_kinds(grid(5, 9), channels, 4, 7);
        made.projector = ProjectorPixels::new(size(320, 200), 21);
        let image = made.image();
        let table = Table::check(&image).expect("whole");
        let (memory, emulator) = product(board, &image);
        let mut client = client(&emulator);
        for (width, height, mode) in [
            (96, 60, Mode::Compensating),
            (75, 47, Mode::Compensating),
            (80, 60, Mode::PassThrough(PassThrough::OtherFrames)),
        ] {
            let format = format(size(width, height), channels, Encoding::Display);
            let mut playback = Playback::new(&memory, format).expect("it fits");
            let wanted = random_frame(format, 4);
            let shown = through(&mut playback, &wanted);
            let status = client.status().expect("the device answers");
            assert_eq!(status.mode, mode, "{board} {width} x {height}");
            if mode == Mode::Compensating {
                let clipped = clipped_on_host(&table, format, &wanted, &shown);
                assert!(
                    clipped.is_some(),
                    "{board} {width} x {height}: not the host's frame"
                );
                assert!(
                    shown
                        .iter()
                        .take(width as usize * channels)
                        .all(|code| *code == 0)
                );
            } else {
                assert_eq!(shown, wanted);
            }
        }
    }
}

#[test]
fn a_good_table_in_the_other_slot_is_used_where_the_first_is_broken() {
    let image = small_table();
    let table = Table::check(&image).expect("compile checked it");
    let memory = memory_with(b"ILTM, but no table");
    memory.write(&psram::SLOT_B, &image).expect("room");
    let emulator = start(Board::An500, &elf(Board::An500, "firmware"), &memory);
    let mut playback = Playback::new(&memory, small_format()).expect("it fits");
    let wanted = random_frame(small_format(), 8);
    let (expected, _) = on_host(&table, 0, small_format(), &wanted);
    assert_eq!(through(&mut playback, &wanted), expected);
    let status = client(&emulator).status().expect("the device answers");
    assert_eq!(status.slots, [SlotState::Broken, SlotState::Active]);
}

#[test]
fn torn_short_and_stale_frames_are_never_shown_and_the_last_good_one_stays() {
    let image = small_table();
    let (memory, emulator) = product(Board::An500, &image);
    let mut client = client(&emulator);
    let mut playback = Playback::new(&memory, small_format()).expect("it fits");
    let words = memory.words().expect("the memory's file is there");
    let good = random_frame(small_format(), 1);
    for _ in 0..3 {
        through(&mut playback, &good);
    }
    // What a source that fails part of the way leaves behind, each in a free
    // buffer, with pixels that must not be seen.
    let layout = Layout::new(small_format(), psram::FRAMES.len()).expect("it fits");
    let place = layout.input(0);
    let place = psram::FRAMES.start + place.start..psram::FRAMES.start + place.end;
    let at = descriptor::input(0);
    let length = small_format().bytes() as u32;
    let broken = [
        (FaultyFrame::Torn, 4, 3, length),
        (FaultyFrame::Short, 4, 4, length - 1),
        (FaultyFrame::Stale, 2, 2, length),
    ];
    for (count, (kind, start, end, length)) in (1..).zip(broken) {
        memory
            .write(&place, &vec![0xEE; place.len()])
            .expect("room");
        words.store(at + descriptor::START, start);
        words.store(at + descriptor::END, end);
        words.store(at + descriptor::LENGTH, length);
        words.store(at + descriptor::OWNER, 1);
        let limit = Instant::now() + PATIENCE;
        loop {
            playback
                .show(|shown, _| panic!("{kind:?}: frame {} was shown", shown.sequence()))
                .expect("the memory's file is there");
            let status = client.status().expect("the device answers");
            if status.frames.broken == count {
                assert_eq!(status.frames.shown, 3);
                let fault = Fault::Frame {
                    sequence: start,
                    cause: kind,
                };
                assert_eq!(status.last_fault, Some(fault));
                break;
            }
            assert!(Instant::now() < limit, "{kind:?} is not noticed");
        }
    }
    // And the device goes on.
    let table = Table::check(&image).expect("compile checked it");
    let input = through(&mut playback, &good);
    assert!(clipped_on_host(&table, small_format(), &good, &input).is_some());
    let status = client.status().expect("the device answers");
    assert_eq!((status.frames.shown, status.frames.broken), (4, 3));
}

#[test]
fn a_source_that_falls_silent_is_late_and_the_last_frame_stays() {
    let (memory, emulator) = product(Board::An500, &small_table());
    let mut client = client(&emulator);
    let format = Format::new(size(8, 6), 3, Encoding::Display, 20_000).expect("a format");
    let mut playback = Playback::new(&memory, format).expect("it fits");
    through(&mut playback, &random_frame(format, 1));
    let limit = Instant::now() + PATIENCE;
    loop {
        let frames = client.status().expect("the device answers").frames;
        assert_eq!((frames.received, frames.shown, frames.dropped), (1, 1, 0));
        if frames.late >= 3 {
            break;
        }
        assert!(Instant::now() < limit, "nothing is missed");
    }
    playback
        .show(|shown, _| panic!("frame {} was shown", shown.sequence()))
        .expect("the memory's file is there");
}

#[test]
fn a_subscribed_host_hears_of_tiers_and_logs() {
    let (memory, emulator) = product(Board::An500, &small_table());
    let mut client = client(&emulator);
    let logs = Logs::read(&elf(Board::An500, "firmware")).expect("the firmware's words");
    client
        .subscribe(Duration::from_millis(200))
        .expect("granted");
    let mut playback = Playback::new(&memory, small_format()).expect("it fits");
    for seed in 0..20 {
        through(&mut playback, &random_frame(small_format(), seed));
    }
    let limit = Instant::now() + PATIENCE;
    let (mut words, mut rose, mut statuses) = (String::new(), false, 0);
    while statuses == 0 || !rose || !words.contains("tier 0 -> 1") {
        assert!(Instant::now() < limit, "heard: {words}");
        match client.next(Duration::from_millis(100)).expect("the line") {
            Some(Incoming::Log(payload)) => {
                for message in logs.messages(&payload) {
                    words.push_str(&message.text);
                    words.push('\n');
                }
            }
            Some(Incoming::Event(Event::TierChanged { from, to, .. })) => {
                rose |= (from, to) == (0, 1);
            }
            Some(Incoming::Event(Event::Status(_))) => statuses += 1,
            _ => {}
        }
    }
    print!("{words}");
    assert!(words.contains("mps2-an500 starts"));
    assert!(words.contains("frames of 8 x 6, 3 channels"));
}

/// Flash and RAM of the product, bytes: what is loaded, and what else there is
/// besides the workspace of a frame.
fn sizes(board: Board) -> (u64, u64) {
    use object::{Object, ObjectSection, ObjectSymbol, SectionKind};
    let path = elf(board, "firmware");
    let bytes = std::fs::read(&path).expect("it has just been built");
    let file = object::File::parse(bytes.as_slice()).expect("an ELF file");
    let flash = flash_bytes(&path);
    let data = file.sections().filter(|section| {
        let kind = section.kind();
        matches!(kind, SectionKind::Data | SectionKind::UninitializedData)
    });
    let variables: u64 = data.map(|section| section.size()).sum();
    let symbol = |name: &str| {
        let mut symbols = file.symbols();
        let symbol = symbols.find(|symbol| symbol.name() == Ok(name));
        symbol.unwrap_or_else(|| panic!("the firmware has a symbol `{name}`"))
    };
    let workspace = symbol("FRAME_WORKSPACE").size();
    let stack = symbol("_stack_start").address() - symbol("_stack_end").address();
    println!(
        "{board}: {flash} bytes of flash, {} of variables, {stack} of stack, {workspace} of workspace",
        variables - workspace
    );
    (flash, variables - workspace + stack)
}

#[test]
fn the_firmware_fits_in_96_kib_of_flash_and_24_kib_of_ram() {
    for board in [Board::An500, Board::An386] {
        let (flash, ram) = sizes(board);
        assert!(flash <= 96 * 1_024, "{board}: {flash} bytes of flash");
        assert!(ram <= 24 * 1_024, "{board}: {ram} bytes of RAM");
    }
}

/// A board that runs the self-test with the small table and one order; frames are
/// worked on at tier 1.
fn ordered(board: Board, orders: &[(usize, u32)]) -> (BoardMemory, Emulator) {
    let memory = memory_with(&small_table());
    order(&memory, word::TIER, 2);
    for (word, value) in orders {
        order(&memory, *word, *value);
    }
    let emulator = start(board, &elf(board, "selftest"), &memory);
    (memory, emulator)
}

#[test]
fn a_frame_that_the_source_writes_into_while_it_is_worked_on_is_not_shown() {
    let (memory, emulator) = ordered(Board::An500, &[(word::TEAR, 2)]);
    let mut playback = Playback::new(&memory, small_format()).expect("it fits");
    through(&mut playback, &random_frame(small_format(), 1));
    playback
        .give(&random_frame(small_format(), 2))
        .expect("the memory's file is there");
    let mut client = client(&emulator);
    let limit = Instant::now() + PATIENCE;
    loop {
        playback
            .show(|shown, _| panic!("frame {} was shown", shown.sequence()))
            .expect("the memory's file is there");
        let status = client.status().expect("the device answers");
        if status.frames.broken == 1 {
            let fault = Fault::Frame {
                sequence: 2,
                cause: FaultyFrame::Torn,
            };
            assert_eq!(status.last_fault, Some(fault));
            assert_eq!((status.frames.received, status.frames.shown), (2, 1));
            break;
        }
        assert!(Instant::now() < limit, "it is not noticed");
    }
    let table = small_table();
    let table = Table::check(&table).expect("compile checked it");
    let wanted = random_frame(small_format(), 3);
    let (expected, _) = on_host(&table, 1, small_format(), &wanted);
    assert_eq!(through(&mut playback, &wanted), expected);
}

/// Frames through a device that restarts itself during the third of six.
fn comes_back(board: Board, order: usize) -> Status {
    let (memory, emulator) = ordered(board, &[(order, 3)]);
    let image = small_table();
    let table = Table::check(&image).expect("compile checked it");
    let mut playback = Playback::new(&memory, small_format()).expect("it fits");
    for seed in 0..6 {
        let wanted = random_frame(small_format(), seed);
        // The third frame is begun twice: it was still claimed at the restart.
        let (expected, _) = on_host(&table, 1, small_format(), &wanted);
        assert_eq!(through(&mut playback, &wanted), expected);
    }
    let status = client(&emulator).status().expect("the device answers");
    assert_eq!(status.mode, Mode::Compensating);
    assert_eq!(status.frames.shown, 4, "frames 3 to 6, since the restart");
    status
}

#[test]
fn the_watchdog_restarts_a_loop_that_hangs_and_the_device_compensates_again() {
    for board in [Board::An500, Board::An386] {
        let status = comes_back(board, word::HANG);
        assert_eq!(status.watchdog_resets, 1);
        assert_eq!(status.last_fault, Some(Fault::Watchdog));
    }
}

#[test]
fn a_panic_restarts_the_device_which_says_so_and_compensates_again() {
    let status = comes_back(Board::An500, word::PANIC);
    assert_eq!(status.watchdog_resets, 0);
    assert_eq!(status.last_fault, Some(Fault::Crash));
}

/// Orders the self-test to play frames of the small table's size, a thousand a second.
fn play_small(memory: &BoardMemory, frames: u32) {
    let format = Format::new(size(8, 6), 3, Encoding::Display, 1_000).expect("a format");
    play(memory, frames, format, &random_frame(format, 9));
}

/// One run of the governor under a slow stage: what the self-test found.
fn governed(board: Board) -> Vec<u32> {
    let memory = memory_with(&small_table());
    play_small(&memory, 1_200);
    // Ticks are 40 ns: from frame 300 on a frame takes .28 ms longer and .1 ms more
    // for each tier, so of a budget of .875 ms too much above tier 5 or so.
    order(&memory, word::SLOW_FROM, 300);
    order(&memory, word::SLOW_UNTIL, 700);
    order(&memory, word::SLOW_BY, 7_000);
    order(&memory, word::SLOW_BY_TIER, 2_500);
    let mut qemu = counted(board, &elf(board, "selftest"), &memory, "null");
    let status = qemu
        .status()
        .expect("qemu-system-arm is installed: tests/run.sh does it");
    assert!(status.success(), "{status}");
    (0..256).map(|word| finding(&memory, word)).collect()
}

#[test]
fn the_governor_keeps_every_frame_under_a_stage_that_becomes_slow() {
    let image = small_table();
    let top = u32::from(Table::check(&image).expect("compile checked it").top_tier());
    let found = governed(Board::An500);
    let count = found[word::CHANGES] as usize;
    let changes: Vec<(u32, u32, u32)> = found[word::CHANGE..word::CHANGE + count]
        .iter()
        .map(|word| (word & 0xFFFF, word >> 16 & 0xFF, word >> 24))
        .collect();
    println!(
        "top tier {top}, {} over the budget, longest {} ticks, changes {changes:?}",
        found[word::OVER],
        found[word::WORST]
    );
    // Nothing is missed: every frame is shown, none comes late.
    assert_eq!(found[word::SHOWN], 1_200);
    assert_eq!(
        (found[word::DROPPED], found[word::LATE], found[word::BROKEN]),
        (0, 0, 0)
    );
    // At the top before it becomes slow, down at once when it does, and back.
    let tier_at = |frame: u32| {
        let before = changes.iter().take_while(|change| change.0 < frame);
        before.last().map_or(0, |change| change.2)
    };
    assert_eq!(tier_at(300), top);
    let (frame, from, to) = *changes
        .iter()
        .find(|change| change.0 >= 300)
        .expect("it becomes too slow");
    assert_eq!((frame, from), (300, top), "the first slow frame");
    assert!(to < top);
    assert!(tier_at(700) > 0, "what fits is kept");
    assert_eq!(tier_at(1_201), top);
    assert!(
        found[word::OVER] <= 4,
        "{} over the budget",
        found[word::OVER]
    );
    // Deterministic: instructions are counted.
    assert_eq!(governed(Board::An500), found);
}

/// `ILTM_GARBAGE` says how many bytes.
#[test]
fn garbage_on_the_line_disturbs_no_frame() {
    let most = std::env::var("ILTM_GARBAGE").map_or(Ok(250_000), |bytes| bytes.parse());
    let most: usize = most.expect("a number");
    let image = small_table();
    let table = Table::check(&image).expect("compile checked it");
    let memory = memory_with(&image);
    play_small(&memory, u32::MAX);
    // Frames that leave a tenth of their period for everything else. Time passes
    // slowly for a busy device, so the garbage comes several times faster than on
    // any line: what it is in the device's time is printed.
    order(&memory, word::SLOW_UNTIL, u32::MAX);
    order(&memory, word::SLOW_BY, 21_000);
    order(&memory, word::TIER, 2);
    let wanted = random_frame(small_format(), 9);
    let (expected, _) = on_host(&table, 1, small_format(), &wanted);
    order(&memory, word::OUTPUT, crc32(&[&expected]));
    let board = CountedBoard::start(&memory);
    let mut line = board.line();
    let start = Instant::now();
    let mut random = fastrand::Rng::with_seed(1);
    let mut sent = 0;
    while sent < most {
        // Runs without a delimiter, with many, and starts of real frames.
        let mut piece = [0; 1_000];
        random.fill(&mut piece);
        if sent % 3_000 == 0 {
            piece.fill(0);
        }
        Line::write(&mut line, &piece).expect("the line takes bytes");
        sent += piece.len();
    }
    println!("{sent} bytes in {:?}", start.elapsed());
    let patience = Patience {
        answer: Duration::from_secs(5),
        tries: 20,
    };
    let mut client = Client::greet(line, patience).expect("the device answers");
    let status = client.status().expect("the device answers");
    let shown = finding(&memory, word::SHOWN);
    println!(
        "{shown} frames meanwhile, {} bytes a second of the device's time, {status:?}",
        u64::from(sent as u32) * 1_000 / status.uptime_ms
    );
    assert!(shown > 100);
    assert_eq!(finding(&memory, word::WRONG), 0);
    let frames = status.frames;
    assert_eq!((frames.late, frames.dropped, frames.broken), (0, 0, 0));
    assert!(status.serial.bad as usize > sent / 1_000);
    assert_eq!(status.watchdog_resets, 0);
}
