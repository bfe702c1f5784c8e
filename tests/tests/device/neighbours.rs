//! Neighbours' light on the device of one of several projectors, in the emulator.

use iltm::device::Incoming;
use iltm::device::emulator::Board;
use iltm::device::memory::BoardMemory;
use iltm::device::playback::Playback;
use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::Table;
use iltm_runtime::link::{Event, Fault, Mode};
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::units::Halfword;
use iltm_runtime::{FrameSize, Grid};
use iltm_tests::firmware::{
    PATIENCE, client, elf_of, memory_with, order, random_frame, start, wait_for_frame, word,
};
use iltm_tests::grid;
use iltm_tests::made_up::MadeUp;
use iltm_tests::neighbours::{OF_SEVERAL, random_light, runtime_frame};
use std::time::{Duration, Instant};

/// A table of one of three projectors, and the cells of its neighbours.
fn made_up(own: Grid, channels: usize, seed: u64) -> (MadeUp, Grid) {
    let others = grid(
        own.rows().div_ceil(4) as u16,
        2 * own.cols().div_ceil(4) as u16,
    );
    let table = MadeUp::of_all_kinds(own, channels, 12, seed);
    (table.with_neighbours(others, [1, 1], seed), others)
}

fn format(size: FrameSize, channels: u8, encoding: Encoding, others: Option<Grid>) -> Format {
    let format = Format::new(size, channels, encoding, 100_000).expect("a format");
    format.with_neighbours(others)
}

/// Gives one frame and waits for what the board makes of it.
fn through(playback: &mut Playback<'_>, frame: &[u8], light: &[Halfword]) -> Vec<u8> {
    let end = Instant::now() + PATIENCE;
    while !playback.attached() {
        assert!(Instant::now() < end, "the device takes no frames");
        std::thread::sleep(Duration::from_millis(1));
    }
    playback.give_with(frame, light).expect("the memory's file");
    wait_for_frame(playback, end)
}

/// Frames with light of the neighbours and without, at every tier.
fn every_frame_equals_the_hosts(board: Board) {
    let firmware = elf_of(board, OF_SEVERAL, "selftest");
    let mut frames = 0;
    for (seed, (rows, cols, channels)) in (1..).zip([(13, 21, 3), (16, 16, 1), (8, 16, 3)]) {
        let (made, others) = made_up(grid(rows, cols), channels, seed);
        let image = made.image();
        let table = Table::check(&image).expect("made for it");
        let memory = memory_with(&image);
        let _running = start(board, &firmware, &memory);
        let larger = FrameSize::new(3 * cols + 5, 4 * rows + 1).expect("not empty");
        for size in [FrameSize::of_grid(table.grid()), larger] {
            for encoding in [Encoding::Display, Encoding::Linear] {
                let format = format(size, channels as u8, encoding, Some(others));
                let mut playback = Playback::new(&memory, format).expect("it fits");
                for tier in 0..=table.top_tier() {
                    order(&memory, word::TIER, u32::from(tier) + 1);
                    let seed = seed + u64::from(tier);
                    let (wanted, light) = (
                        random_frame(format, seed),
                        random_light(others, channels, seed),
                    );
                    let of = |light| runtime_frame(&table, (tier, format), &wanted, light);
                    let (with, without) = (of(Some(&light)), of(None));
                    assert_eq!(
                        with == without,
                        tier == 0,
                        "the light counts from tier 1 on"
                    );
                    let context = format!("{board}, {size}, {encoding:?}, tier {tier}");
                    assert!(through(&mut playback, &wanted, &light) == with, "{context}");
                    assert!(through(&mut playback, &wanted, &[]) == without, "{context}");
                    frames += 2;
                }
            }
        }
    }
    println!("{board}: {frames} frames equal");
}

#[test]
fn every_frame_of_the_an500_with_neighbours_equals_the_hosts() {
    every_frame_equals_the_hosts(Board::An500);
}

#[test]
fn every_frame_of_the_an386_with_neighbours_equals_the_hosts() {
    every_frame_equals_the_hosts(Board::An386);
}

/// What a board says after some frames.
struct Said {
    mode: Mode,
    fault: Option<Fault>,
}

/// A device, and frames that come to it with light of these cells or of none.
fn device(
    memory: &BoardMemory,
    others: Option<Grid>,
    frames: &[Option<Vec<Halfword>>],
) -> (Vec<Said>, Vec<Event>, Vec<Vec<u8>>) {
    let firmware = elf_of(Board::An500, OF_SEVERAL, "firmware");
    let emulator = start(Board::An500, &firmware, memory);
    let mut client = client(&emulator);
    let period = Duration::from_secs(10);
    client.subscribe(period).expect("the device answers");
    let format = format(
        FrameSize::new(16, 8).expect("not empty"),
        1,
        Encoding::Linear,
        others,
    );
    let mut playback = Playback::new(memory, format).expect("it fits");
    let (mut said, mut events, mut shown) = (Vec::new(), Vec::new(), Vec::new());
    for (seed, light) in (0..).zip(frames) {
        let wanted = random_frame(format, seed);
        let light = light.as_deref().unwrap_or_default();
        shown.push(through(&mut playback, &wanted, light));
        let status = client.status().expect("the device answers");
        said.push(Said {
            mode: status.mode,
            fault: status.last_fault,
        });
    }
    let end = Instant::now() + Duration::from_millis(600);
    while Instant::now() < end {
        if let Ok(Some(Incoming::Event(event))) = client.next(Duration::from_millis(100)) {
            events.push(event);
        }
    }
    (said, events, shown)
}

#[test]
fn a_device_whose_neighbours_fall_silent_goes_on_alone_says_so_and_returns() {
    let (made, others) = made_up(grid(8, 16), 1, 7);
    let image = made.image();
    let light = |seed| Some(random_light(others, 1, seed));
    let frames = [light(1), light(2), None, None, light(4), None];
    let (said, events, _) = device(&memory_with(&image), Some(others), &frames);
    let modes: Vec<Mode> = said.iter().map(|said| said.mode).collect();
    let (with, alone) = (Mode::Compensating, Mode::Alone);
    assert_eq!(modes, [with, with, alone, alone, with, alone]);
    let faults: Vec<_> = said.iter().map(|said| said.fault).collect();
    let from = |sequence| Some(Fault::Neighbours { sequence });
    assert_eq!(faults, [None, None, from(3), from(3), from(3), from(6)]);
    let told: Vec<_> = events
        .iter()
        .filter(|event| matches!(event, Event::Fault(_)))
        .collect();
    let fault = |sequence| Event::Fault(Fault::Neighbours { sequence });
    assert_eq!(told, [&fault(3), &fault(6)], "each silence once");
}

#[test]
fn light_of_other_cells_than_the_tables_is_silence() {
    let (made, others) = made_up(grid(8, 16), 1, 8);
    let image = made.image();
    let table = Table::check(&image).expect("made for it");
    let other = grid(others.rows() as u16, 2);
    for (announced, light) in [(Some(other), Some(random_light(other, 1, 1))), (None, None)] {
        let memory = memory_with(&image);
        let (said, _, shown) = device(&memory, announced, &[light]);
        assert_eq!(said[0].mode, Mode::Alone);
        let format = format(
            FrameSize::of_grid(table.grid()),
            1,
            Encoding::Linear,
            announced,
        );
        let wanted = random_frame(format, 0);
        // Whichever tier the governor begins with.
        let alone = (0..=table.top_tier())
            .any(|tier| shown[0] == runtime_frame(&table, (tier, format), &wanted, None));
        assert!(alone);
    }
}
