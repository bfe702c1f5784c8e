//! Cost model: what it says that a frame takes against the counts, and the counts against
//! those of the repository.

use iltm::compile::cost;
use iltm_runtime::FrameSize;
use iltm_runtime::features::Stage;
use iltm_runtime::image::Table;
use iltm_runtime::operator::Segment;
use iltm_tests::instructions::{self, Case};
use iltm_tests::{costs, stages};

/// What `cargo run --release -p iltm-tests --bin counts` counted in the emulator.
const INSTRUCTIONS: &str = include_str!("../../../docs/instructions.csv");
const COSTS: &str = include_str!("../../../docs/costs.csv");
const STAGES: &str = include_str!("../../../docs/stages.csv");

/// Instructions of a sample clipped at black, as most are. How many there are depends on the
/// picture, so that the model does not count them.
const CLIPPED_SAMPLE: f64 = 2.0;

/// Largest deviation of a frame.
const MOST: f64 = 0.02;

/// Fields of a list's lines but the first.
fn lines(list: &'static str) -> impl Iterator<Item = Vec<&'static str>> {
    list.lines().skip(1).map(|line| line.split(',').collect())
}

/// Cases of the list of instructions whose tables take minutes to solve.
const SLOW: [&str; 2] = ["320x240 over 48x64 colour", "96x128 colour"];

/// Lines of the list of instructions: of those cases, or of the others.
fn instruction_lines(slow: bool) -> impl Iterator<Item = Vec<&'static str>> {
    lines(INSTRUCTIONS).filter(move |fields| SLOW.contains(&fields[0]) == slow)
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

/// The same for all tiers of cases, which a list has in this order; `counted` reads the
/// fields of a line.
fn compare_with(
    mut listed: impl Iterator<Item = Vec<&'static str>>,
    cases: &[Case],
    counted: fn(&[&str]) -> f64,
) {
    let mut rows = Vec::new();
    for case in cases {
        for (tier, model) in model(&case.image, case.size).into_iter().enumerate() {
            let fields = listed.next().expect("the list has all tiers");
            assert_eq!((fields[0], fields[1]), (&*case.name, &*tier.to_string()));
            let name = format!("{}, tier {tier}", case.name);
            rows.push((name, counted(&fields), model));
        }
    }
    assert_eq!(listed.next(), None, "the list has other tiers");
    compare(rows.into_iter());
}

fn number(field: &str) -> f64 {
    field.parse().expect("a number")
}

fn compare_with_instructions(slow: bool, cases: &[Case]) {
    let counted = |line: &[&str]| number(line[7]) - CLIPPED_SAMPLE * number(line[8]);
    compare_with(instruction_lines(slow), cases, counted);
}

#[test]
fn the_model_is_within_two_per_cent_of_every_frame_of_the_list() {
    compare_with_instructions(false, &instructions::cases());
}

#[test]
fn the_model_is_within_two_per_cent_of_frames_of_many_shapes() {
    let all = |line: &[&str]| line[2..].iter().map(|field| number(field)).sum();
    compare_with(lines(COSTS), &costs::cases(), all);
}

#[test]
fn the_model_is_within_two_per_cent_of_stages_that_it_was_not_fitted_to() {
    let larger = FrameSize::new(256, 256).expect("not empty");
    let named = |name: &str| {
        let stages = Stage::ALL.into_iter();
        let listed = |stage: &Stage| name.split(" + ").any(|part| part == stage.feature());
        stages.filter(listed).collect::<Vec<_>>()
    };
    let rows = lines(STAGES).flat_map(|fields| {
        let table = stages::listed(&named(fields[0]));
        let image = table.image();
        [(FrameSize::of_grid(table.grid), 1), (larger, 2)].map(|(size, field)| {
            let counted = number(fields[field]);
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

/// Growth that is taken for the compiler's.
const MOST_GROWTH: f64 = 1.03;

fn count_again(slow: bool, cases: &[Case]) {
    let counts: Vec<_> = cases.iter().flat_map(instructions::count).collect();
    println!("{}", instructions::csv(&counts));
    let mut committed = instruction_lines(slow);
    for count in &counts {
        let fields = committed.next().expect("the list has all tiers");
        let [case, tier, .., frame, _] = fields.as_slice() else {
            panic!("{fields:?}");
        };
        assert_eq!((*case, *tier), (&*count.case, &*count.tier.to_string()));
        let listed = number(frame);
        assert!(
            count.frame as f64 <= MOST_GROWTH * listed,
            "{case}, tier {tier}: {} instructions instead of {listed}; if that is meant, run\n\
             cargo run --release -p iltm-tests --bin counts -- instructions > docs/instructions.csv",
            count.frame
        );
    }
    assert_eq!(committed.next(), None, "the list has other tiers");
}

#[test]
fn no_frame_takes_more_than_three_per_cent_more_instructions_than_the_list_says() {
    count_again(false, &instructions::cases());
}

#[test]
#[ignore = "its tables take minutes to solve"]
fn the_frames_of_the_tables_that_take_minutes_to_solve_hold_as_well() {
    let cases = instructions::slow_cases();
    compare_with_instructions(true, &cases);
    count_again(true, &cases);
}
