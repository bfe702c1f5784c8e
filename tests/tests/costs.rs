//! The model of what a frame takes against the counts.

use iltm::compile::cost;
use iltm_runtime::features::Stage;
use iltm_runtime::image::Table;
use iltm_runtime::operator::Segment;
use iltm_runtime::{FrameSize, Grid};
use iltm_tests::{costs, instructions, stages};

/// What `cargo run --release -p iltm-tests --bin instructions`, `costs` and `stages`
/// counted in the emulator.
const INSTRUCTIONS: &str = include_str!("../../docs/instructions.csv");
const COSTS: &str = include_str!("../../docs/costs.csv");
const STAGES: &str = include_str!("../../docs/stages.csv");

/// Largest deviation of a frame.
const MOST: f64 = 0.02;

/// Fields of a list's lines but the first.
fn lines(list: &'static str) -> impl Iterator<Item = Vec<&'static str>> {
    list.lines().skip(1).map(|line| line.split(',').collect())
}

/// What the model says of each tier of a table.
fn model(image: &[u8], size: FrameSize) -> Vec<f64> {
    let table = Table::check(image).expect("a table");
    let tiers = 0..=table.top_tier();
    tiers
        .map(|tier| cost::stages(&table, tier, size).total() as f64)
        .collect()
}

/// Deviations of the model from counts, each with its name; none may be above [`MOST`].
fn compare(rows: impl Iterator<Item = (String, f64, f64)>) {
    let mut worst = (0.0_f64, String::new());
    for (name, counted, model) in rows {
        let deviation = model / counted - 1.0;
        println!(
            "{name}: {counted} counted, {model} by the model, {:+.2} %",
            100.0 * deviation
        );
        if deviation.abs() > worst.0.abs() {
            worst = (deviation, name);
        }
    }
    assert!(worst.0.abs() > 0.0 && worst.0.abs() <= MOST, "{worst:?}");
}

#[test]
fn the_model_is_within_two_per_cent_of_every_frame_of_the_list() {
    let mut listed = lines(INSTRUCTIONS);
    let mut rows = Vec::new();
    for case in instructions::cases() {
        for (tier, model) in model(&case.image, case.size).into_iter().enumerate() {
            let fields = listed.next().expect("the list has all tiers");
            assert_eq!((fields[0], fields[1]), (case.name, &*tier.to_string()));
            let counted = fields[7].parse().expect("a number");
            rows.push((format!("{}, tier {tier}", case.name), counted, model));
        }
    }
    assert_eq!(listed.next(), None, "the list has other tiers");
    compare(rows.into_iter());
}

#[test]
fn the_model_is_within_two_per_cent_of_frames_of_many_shapes() {
    let mut listed = lines(COSTS);
    let mut rows = Vec::new();
    for case in costs::cases() {
        for (tier, model) in model(&case.image, case.size).into_iter().enumerate() {
            let fields = listed.next().expect("the list has all tiers");
            assert_eq!((fields[0], fields[1]), (&*case.name, &*tier.to_string()));
            let counted = fields[2..].iter().map(|field| field.parse::<f64>());
            let counted = counted.map(|field| field.expect("a number")).sum();
            rows.push((format!("{}, tier {tier}", case.name), counted, model));
        }
    }
    assert_eq!(listed.next(), None, "the list has other tiers");
    compare(rows.into_iter());
}

#[test]
fn the_model_is_within_two_per_cent_of_stages_that_it_was_not_fitted_to() {
    let grid = Grid::new(64, 64).expect("a small grid");
    let larger = FrameSize::new(256, 256).expect("not empty");
    let named = |name: &str| {
        let stages = Stage::ALL.into_iter();
        let listed = |stage: &Stage| name.split(" + ").any(|part| part == stage.feature());
        stages.filter(listed).collect::<Vec<_>>()
    };
    let rows = lines(STAGES).flat_map(|fields| {
        let table = stages::table(grid, &named(fields[0]));
        let image = table.image();
        [(FrameSize::of_grid(grid), 1), (larger, 2)].map(|(size, field)| {
            let counted: f64 = fields[field].parse().expect("a number");
            let samples = (size.pixels() * table.channels) as f64;
            let model = model(&image, size).pop().expect("tier 0 at least");
            (format!("{}, {size}", fields[0]), counted * samples, model)
        })
    });
    compare(rows);
}

#[test]
fn fewer_pairs_never_take_more_instructions() {
    let case = instructions::cases().pop().expect("one at least");
    let table = Table::check(&case.image).expect("a table");
    let segments: Vec<Segment<'_>> = table.operator().expect("one").segments().to_vec();
    let shape = cost::Shape::of(&table, case.size);
    let (with, without) = (shape.stages(&segments), shape.stages(&[]));
    assert!(with.total() > without.total());
}
