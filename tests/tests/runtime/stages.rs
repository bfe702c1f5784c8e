//! Pipeline stages: a frame runs those that its table lists, and none of the others.
//!
//! Firmware runs in the emulator. Its own record says which code a frame came to; counts
//! of instructions say what that took; and firmware that was built without the stages
//! says what is left when their code is not there at all.

use iltm::device::emulator::{Board, Emulator};
use iltm::device::memory::BoardMemory;
use iltm::device::playback::Playback;
use iltm::device::upload::{NoObserver, Parcel, Upload, UploadError};
use iltm::device::{Client, DeviceError, Port};
use iltm_runtime::FrameSize;
use iltm_runtime::features::Stage;
use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::Table;
use iltm_runtime::link::{Fault, Mode, PassThrough, Refusal, SlotState};
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::trust::Rejected;
use iltm_tests::executed::{Code, Executed};
use iltm_tests::firmware::{
    ALL_STAGES, Effects, LEAN, client, elf_of, memory_with, on_host, random_frame, random_table,
    start, through,
};
use iltm_tests::grid;
use iltm_tests::instructions::bench;
use iltm_tests::neighbours::OF_SEVERAL;
use iltm_tests::stages::{choices, costs, csv, instructions, size_line, table};
use std::time::Duration;

const CHECK: &str = "runtime/src/image/check.rs";

/// The code of a stage, down to what checks its part of a table.
fn code(stage: Stage) -> Vec<Code> {
    use Code::{File, Function, Instance, OneOf, Symbol};
    match stage {
        Stage::Operator => vec![
            File("runtime/src/operator/"),
            File("runtime/src/kernel/arm/gather.rs"),
            File("runtime/src/kernel/arm/levels.rs"),
            File("runtime/src/haar/analysis.rs"),
            File("runtime/src/haar/source.rs"),
            File("runtime/src/haar/synthesis.rs"),
            Function("runtime/src/pipeline/stages.rs", "operate"),
            Function("runtime/src/pipeline/full_frames.rs", "average_frame"),
            Function("runtime/src/pipeline/full.rs", "correct_row"),
            Symbol("merge"),
            Symbol("split"),
            Symbol("store"),
        ],
        Stage::Ambient => vec![
            Function("runtime/src/pipeline/full.rs", "ambient_row"),
            Function("runtime/src/image/table.rs", "ambient_row"),
            Function(CHECK, "ambient"),
            Symbol("_lit"),
        ],
        Stage::Response => vec![
            Function(CHECK, "response"),
            OneOf(&[
                "iltm_finish_1_dark",
                "iltm_finish_1_lit",
                "iltm_finish_3_dark",
                "iltm_finish_3_lit",
            ]),
        ],
        Stage::Colour => vec![
            Instance("runtime/src/pipeline/", 3),
            Instance("runtime/src/kernel/", 3),
            Symbol("_three_"),
            Symbol("merge_3_"),
            Symbol("finish_3_"),
            Symbol("add_3_"),
        ],
        Stage::FullResolution => vec![
            File("runtime/src/pipeline/full.rs"),
            File("runtime/src/pipeline/full_frames.rs"),
            File("runtime/src/resample/"),
            File("runtime/src/kernel/arm/lines.rs"),
            OneOf(&[
                "iltm_add_1_dark",
                "iltm_add_1_lit",
                "iltm_add_3_dark",
                "iltm_add_3_lit",
            ]),
            Symbol("blend"),
            Symbol("expand"),
        ],
        Stage::Neighbours => vec![
            File("runtime/src/image/neighbours.rs"),
            Function("runtime/src/pipeline/stages.rs", "analyse_neighbours"),
        ],
    }
}

fn executed(stages: &[Stage], size: FrameSize) -> Executed {
    let (grid, elf) = (grid(16, 16), elf_of(Board::An500, OF_SEVERAL, "bench"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = folder.path().join("executed");
    let _ = bench(&elf, &table(grid, stages).image(), size, Some(&log));
    Executed::read(&log, &elf)
}

/// Frames of the grid's size, or larger ones, through a table with these stages.
fn executed_with(stages: &[Stage]) -> Executed {
    let size = |side| FrameSize::new(side, side).expect("not empty");
    let small = executed(stages, size(16));
    if stages.contains(&Stage::FullResolution) {
        small.and(executed(stages, size(40)))
    } else {
        small
    }
}

#[test]
fn a_frame_runs_the_code_of_the_stages_that_its_table_lists_and_of_no_others() {
    let all = executed_with(&Stage::ALL);
    let none = executed_with(&[]);
    let mut wrong = Vec::new();
    for stage in Stage::ALL {
        let others: Vec<_> = Stage::ALL.into_iter().filter(|s| *s != stage).collect();
        let without = executed_with(&others);
        for code in code(stage) {
            let found = all.of(&code).count();
            println!("{stage:?}: {found} places of {code:?}");
            if found == 0 {
                wrong.push(format!("{stage:?}: nothing is {code:?}, even with it"));
            }
            for (executed, listed) in [(&without, "all others"), (&none, "none")] {
                for place in executed.of(&code) {
                    wrong.push(format!("{stage:?} with {listed}: {place:?}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn stages_that_a_table_does_not_list_cost_a_frame_the_same_few_instructions_at_any_size() {
    let mut more = Vec::new();
    for side in [8, 32, 64] {
        let grid = grid(side, side);
        let made = table(grid, &[]);
        let of = |stages| instructions(&made, FrameSize::of_grid(grid), stages);
        let (with, lean) = (of(ALL_STAGES), of(LEAN));
        println!("{side} x {side}: {with} instructions with all stages built, {lean} without");
        more.push(with.abs_diff(lean));
    }
    // A clock tick is 40 instructions. One more for every sample would be 4,096 here.
    more.sort_unstable();
    let (least, most) = (more[0], more[more.len() - 1]);
    assert!(most <= 320 && most <= least + 80, "{more:?}");
}

const COSTS: &str = include_str!("../../../docs/stages.csv");

#[test]
fn every_stage_costs_what_the_documentation_says() {
    let costs = costs();
    let counted = csv(&costs);
    println!("{counted}");
    let numbers = |line: &str| -> Vec<f64> {
        let fields = line.split(',').skip(1);
        fields
            .map(|field| field.parse().expect("a number"))
            .collect()
    };
    assert_eq!(counted.lines().count(), COSTS.lines().count());
    for (counted, listed) in counted.lines().zip(COSTS.lines()).skip(1) {
        for (counted_number, listed_number) in numbers(counted).iter().zip(numbers(listed)) {
            // As much as the compiler's changes may be, or a clock tick in few samples.
            let allowed = 1.03 * listed_number + 0.05;
            assert!(
                *counted_number <= allowed,
                "{counted} instead of {listed}; if that is meant, run\n\
                 cargo run --release -p iltm-tests --bin counts -- stages > docs/stages.csv"
            );
        }
    }
}

const SIZES: &str = include_str!("../../../docs/firmware-sizes.csv");

#[test]
fn firmware_with_no_stage_with_those_of_one_projector_and_with_all_has_the_size_that_the_documentation_says()
 {
    let lines: Vec<&str> = SIZES.lines().skip(1).collect();
    let choices = choices();
    assert_eq!(lines.len(), choices.len());
    for at in [0, choices.len() - 2, choices.len() - 1] {
        let counted = size_line(&choices[at]);
        println!("{counted}");
        let parts = |line: &str| -> (String, f64) {
            let (stages, bytes) = line.rsplit_once(',').expect("two fields");
            (stages.to_owned(), bytes.parse().expect("a number"))
        };
        let ((stages, bytes), (listed, most)) = (parts(&counted), parts(lines[at]));
        assert_eq!(stages, listed);
        assert!(bytes <= 1.02 * most, "{counted} instead of {}", lines[at]);
    }
}

/// A board whose firmware has gain and clip alone, with this in slot A.
fn lean(slot: &[u8]) -> (BoardMemory, Emulator, Client<Port>) {
    let memory = memory_with(slot);
    let firmware = elf_of(Board::An500, LEAN, "firmware");
    let emulator = start(Board::An500, &firmware, &memory);
    let client = client(&emulator);
    (memory, emulator, client)
}

fn format(size: FrameSize, channels: u8) -> Format {
    Format::new(size, channels, Encoding::Display, 100_000).expect("a format")
}

/// A table that lists one stage and no other.
fn table_of_one(stage: Stage) -> Vec<u8> {
    let grid = grid(6, 8);
    match stage {
        Stage::FullResolution => {
            let effects = Effects {
                fine: true,
                ..Effects::NONE
            };
            random_table(grid, 1, effects, 3)
        }
        listed => table(grid, &[listed]).image(),
    }
}

#[test]
fn a_device_built_without_a_stage_refuses_tables_that_list_it_and_names_it() {
    let good = table(grid(6, 8), &[]).image();
    let id = Table::check(&good).expect("a table").id();
    let (_memory, _emulator, mut client) = lean(&good);
    for stage in Stage::ALL {
        let image = table_of_one(stage);
        let parcel = Parcel::new(&image);
        let mut upload = Upload::new(&mut client, &parcel);
        upload.run(&mut NoObserver).expect("a good line");
        let error = upload
            .activate(Duration::from_mins(5), &mut NoObserver)
            .expect_err("the stage is not there");
        let UploadError::Device(DeviceError::Refused { refusal, .. }) = &error else {
            panic!("{stage:?}: {error}");
        };
        assert_eq!(*refusal, Refusal::Table(Rejected::NotBuilt { stage }));
        let status = client.status().expect("the device answers");
        assert_eq!(
            status.mode,
            Mode::Compensating,
            "with the table from before"
        );
        assert_eq!(status.table.map(|table| table.id), Some(id));
        assert_eq!(status.slots, [SlotState::Active, SlotState::Broken]);
    }
}

#[test]
fn a_device_that_starts_with_a_table_of_a_stage_that_it_has_not_passes_frames_through() {
    let image = table_of_one(Stage::Ambient);
    let (memory, _emulator, mut client) = lean(&image);
    let format = format(FrameSize::new(8, 6).expect("not empty"), 1);
    let mut playback = Playback::new(&memory, format).expect("it fits");
    let wanted = random_frame(format, 4);
    assert_eq!(through(&mut playback, &wanted), wanted);
    let status = client.status().expect("the device answers");
    assert_eq!(status.mode, Mode::PassThrough(PassThrough::BrokenTable));
    let cause = Rejected::NotBuilt {
        stage: Stage::Ambient,
    };
    assert_eq!(status.last_fault, Some(Fault::Table { slot: 0, cause }));
}

#[test]
fn a_device_with_gain_alone_makes_the_hosts_frames_and_passes_larger_ones_through() {
    let made = table(grid(9, 7), &[]);
    let image = made.image();
    let table = Table::check(&image).expect("a table");
    let (memory, _emulator, mut client) = lean(&image);
    let own = format(FrameSize::of_grid(made.grid), 1);
    let mut playback = Playback::new(&memory, own).expect("it fits");
    for seed in 0..4 {
        let wanted = random_frame(own, seed);
        let (expected, _) = on_host(&table, 0, own, &wanted);
        assert_eq!(through(&mut playback, &wanted), expected);
    }
    let larger = format(FrameSize::new(20, 30).expect("not empty"), 1);
    let mut playback = Playback::new(&memory, larger).expect("it fits");
    let wanted = random_frame(larger, 5);
    assert_eq!(through(&mut playback, &wanted), wanted);
    let status = client.status().expect("the device answers");
    assert_eq!(status.mode, Mode::PassThrough(PassThrough::OtherFrames));
}
