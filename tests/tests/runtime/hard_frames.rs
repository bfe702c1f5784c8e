//! Hard frames: frames and tables at the edge of what integers hold, through the runtime. The
//! lines of `docs/hard-cases.md` about them are for `tests/tests/scenes/hard_cases.rs`.

use iltm::device::emulator::Board;
use iltm::device::playback::Playback;
use iltm_runtime::FrameSize;
use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::Table;
use iltm_runtime::operator::{Bounds, OperatorError};
use iltm_runtime::pipeline::Encoding;
use iltm_tests::firmware::{elf, memory_with, on_host, order, start, through, word};
use iltm_tests::grid;
use iltm_tests::hard_frames::limits::{
    at_the_accumulators_limit, at_the_corrections_limit, corrections, verdict,
};
use iltm_tests::hard_frames::{Frame, GRIDS, all_frames};
use iltm_tests::made_up::MadeUp;
use proptest::prelude::*;

#[test]
fn every_hard_frame_on_every_hard_grid_is_the_exact_one_within_its_roundings() {
    for (seed, (rows, cols)) in (0..).zip(GRIDS) {
        for channels in [1, 3] {
            let made = MadeUp::random(grid(rows, cols), channels, 8, seed);
            let worst = all_frames(&made, &Frame::all(made.grid));
            let [samples, inside] = worst.samples;
            println!("{rows} x {cols}, {channels} channels: {worst}, {inside} of {samples} inside");
            assert!(worst.holds(), "{rows} x {cols}: {worst:?}");
            // Where all is clipped there is nothing to compare.
            assert!(10 * inside > samples, "{rows} x {cols}: {worst:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn hard_frames_of_random_tables_are_exact_within_their_roundings(
        (rows, cols) in (1_u16..=24, 1_u16..=24),
        channels in prop::sample::select(vec![1_usize, 3]),
        entries in 1_usize..12,
        seed: u64,
    ) {
        let made = MadeUp::random(grid(rows, cols), channels, entries, seed);
        let worst = all_frames(&made, &Frame::all(made.grid));
        prop_assert!(worst.holds(), "{rows} x {cols}: {worst}");
    }
}

#[test]
fn an_accumulator_just_under_the_limit_is_taken_and_reaches_its_bound_to_the_bit() {
    let made = at_the_accumulators_limit(3);
    // 32,767 four times and 3, each times 2^14.
    let bound = 131_071 << 14;
    assert_eq!(verdict(&made).map(|b| b.accumulator), Ok(bound));
    for (side, sign) in [(true, 1), (false, -1)] {
        // Half of a step, 128, is on every correction, for its rounding.
        let expected = sign * (bound >> 8).cast_signed() + 128;
        let found = corrections(&made, Frame::Checkerboard(side));
        assert_eq!(
            found, [expected; 10],
            "it would be another if it had wrapped"
        );
    }
}

#[test]
fn an_accumulator_at_the_limit_is_refused_with_what_it_could_reach() {
    let refused = verdict(&at_the_accumulators_limit(4)).expect_err("2^31 is one too many");
    let expected = OperatorError::AccumulatorOverflow {
        row: 9,
        bound: Bounds::MAX_ACCUMULATOR + 1,
    };
    assert_eq!(refused, expected);
}

#[test]
fn a_correction_just_under_the_limit_is_taken_and_reaches_all_but_what_is_rounded() {
    let made = at_the_corrections_limit(1);
    // Two rows of 131,071 and one of 1, each times 2^12, and 1 a row for rounding.
    let reached = 262_143 << 12;
    assert_eq!(verdict(&made).map(|b| b.correction), Ok(reached + 3));
    let [positive, negative] =
        [true, false].map(|side| corrections(&made, Frame::Checkerboard(side)));
    assert_eq!(positive[0], reached.cast_signed() + 128);
    assert_eq!(negative[0], -reached.cast_signed() + 128);
}

#[test]
fn a_correction_at_the_limit_is_refused_with_what_it_could_reach() {
    let refused = verdict(&at_the_corrections_limit(2)).expect_err("2^30 is one too many");
    let expected = OperatorError::CorrectionOverflow {
        bound: (262_144 << 12) + 3,
    };
    assert_eq!(refused, expected);
}

#[test]
fn the_firmware_makes_of_hard_frames_what_the_host_makes_of_them() {
    let mut tables = vec![at_the_accumulators_limit(3), at_the_corrections_limit(1)];
    for (seed, (rows, cols)) in (0..).zip([(1, 1), (1, 37), (37, 1), (7, 11), (257, 3)]) {
        tables.extend([1, 3].map(|channels| MadeUp::random(grid(rows, cols), channels, 8, seed)));
    }
    let firmware = elf(Board::An500, "selftest");
    let mut compared = 0;
    for made in tables {
        let image = made.image();
        let table = Table::check(&image).expect("made to be taken");
        let memory = memory_with(&image);
        let tier = table.top_tier();
        order(&memory, word::TIER, u32::from(tier) + 1);
        let _running = start(Board::An500, &firmware, &memory);
        let size = FrameSize::of_grid(made.grid);
        let channels = made.channels;
        let format = Format::new(size, channels as u8, Encoding::Linear, 100_000);
        let format = format.expect("a format");
        let mut playback = Playback::new(&memory, format).expect("it fits");
        for frame in Frame::all(made.grid) {
            let light = frame.light(made.grid);
            let samples = light
                .iter()
                .map(|light| vec![(light * 255.0) as u8; channels]);
            let wanted: Vec<u8> = samples.flatten().collect();
            let (expected, _) = on_host(&table, tier, format, &wanted);
            assert!(
                through(&mut playback, &wanted) == expected,
                "{size}, {channels} channels, {frame:?}"
            );
            compared += 1;
        }
    }
    println!("{compared} frames equal");
}
