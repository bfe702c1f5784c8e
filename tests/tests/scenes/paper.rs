//! Claims of the paper in few draws; the whole study is `iltm compare --paper`, whose page
//! is `docs/results`.

use iltm::compare::paper::Condition;
use iltm::compare::paper::seeds::{DrawErrors, run};
use iltm::compare::{acquisition, inversion};
use iltm::progress::Silent;
use iltm::solve::Method;
use std::path::Path;

const DRAWS: u64 = 2;

const TWO_STAGE: (Method, usize) = (Method::TwoStage, 120);
const DIRECT: (Method, usize) = (Method::Direct, 120);
const DIRECT_MORE: (Method, usize) = (Method::Direct, 150);
const OURS: (Method, usize) = (Method::Joint, 50);

fn of(samples: &[DrawErrors], condition: Condition, entry: (Method, usize)) -> &DrawErrors {
    let found = samples
        .iter()
        .find(|s| s.condition == condition && (s.method, s.photographs) == entry);
    found.expect("it was asked for")
}

#[test]
fn direct_beats_two_stage_on_uniform_panels_and_loses_on_textured_ones() {
    let samples = run(DRAWS, &[TWO_STAGE, DIRECT, DIRECT_MORE, OURS], &Silent);
    let all = DRAWS as usize;
    for condition in Condition::ALL {
        let get = |entry| of(&samples, condition, entry);
        let wins = get(DIRECT).wins(get(TWO_STAGE));
        let expected = if condition.textured { 0 } else { all };
        assert_eq!(wins, (expected, all), "{}", condition.name());
        // What the wall shows, in every condition; the second bounce of a noisy uniform
        // scene is the one exception (docs/results).
        let (ours, theirs) = (get(OURS).compensation(), get(DIRECT_MORE).compensation());
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert!(ours < theirs, "{}: {ours} {theirs}", condition.name());
        }
        if condition.textured || !condition.noisy {
            assert_eq!(get(OURS).wins(get(DIRECT_MORE)), (all, all));
        }
    }
}

#[test]
fn the_page_of_results_names_every_method_with_its_source() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/results/README.md");
    let page = std::fs::read_to_string(path).expect("it is part of the repository");
    let photographed = acquisition::all(150, 1);
    let photographed = photographed
        .iter()
        .map(|m| (m.name(), m.description().source));
    let inverted = inversion::all(&[]);
    let inverted = inverted.iter().map(|m| (m.name(), m.description().source));
    for (name, source) in photographed.chain(inverted) {
        let (name, source) = (format!("**{name}**"), format!(": {source}."));
        let told = page
            .lines()
            .any(|line| line.contains(&name) && line.contains(&source));
        assert!(told, "{name}{source}");
    }
}
