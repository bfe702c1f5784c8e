//! Mutation testing: small defects in the code that must not have any, and whether its tests
//! notice them.
//!
//! `cargo mutants` names the defects. They are compiled into one copy of the workspace, each
//! behind the question whether it is the one that an environment variable chooses: a build for
//! each of hundreds would take a day. Then the tests of its area are run against each.
//!
//! ```text
//! cargo install cargo-mutants
//! cargo run --release --manifest-path tests/mutations/Cargo.toml -- store trust
//! ```
//!
//! prints a table; areas are those of [`areas::AREAS`], all if none is named. A word like
//! `order.rs:265` leaves only the defects of that line in them.

mod areas;
mod plant;
mod run;

use areas::{AREAS, Area};
use plant::Mutant;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

fn main() {
    let (lines, words): (Vec<String>, Vec<String>) = std::env::args()
        .skip(1)
        .partition(|word| word.contains(':'));
    let chosen: Vec<&Area> = AREAS
        .iter()
        .filter(|area| words.is_empty() || words.iter().any(|word| word == area.name))
        .collect();
    assert!(!chosen.is_empty(), "no area is called so");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let root = root.canonicalize().expect("the repository");
    let place = root.join("target/mutations");
    let (plain, copy) = (place.join("plain"), place.join("source"));
    // Work goes on while this runs.
    copied(&root, &plain, "git ls-files -z");
    let mut refused = BTreeSet::new();
    let mutants: Vec<Mutant> = chosen
        .iter()
        .flat_map(|area| plant::choose(&root, area))
        .collect();
    let (tests, planted) = loop {
        copied(&plain, &copy, "find . -type f -print0");
        let left: Vec<&Mutant> = (mutants.iter())
            .filter(|mutant| !refused.contains(&mutant.number))
            .collect();
        let planted = plant::plant(&copy, &left);
        match run::build(&copy, &place.join("target"), &chosen) {
            Ok(tests) => break (tests, planted),
            // Those that no compiler takes are none.
            Err(errors) => {
                let found = plant::blame(&copy, &errors);
                assert!(!found.is_empty(), "the copy does not build: {errors:#?}");
                eprintln!("{} defects do not compile", found.len());
                refused.extend(found);
            }
        }
    };
    let mutants: Vec<Mutant> = (mutants.into_iter())
        .filter(|mutant| planted.contains(&mutant.number))
        .filter(|mutant| lines.is_empty() || lines.iter().any(|line| mutant.lies_at(line)))
        .collect();
    run::all(&mutants, &tests);
}

/// Makes a copy of the files that a command lists, with their times: little is compiled again.
fn copied(from: &Path, to: &Path, list: &str) {
    let shell = format!(
        "mkdir -p \"$1\" && cd \"$0\" && {list} | tar c --null --files-from - | tar x -C \"$1\""
    );
    let done = Command::new("sh")
        .args(["-c", &shell])
        .arg(from)
        .arg(to)
        .status();
    assert!(done.is_ok_and(|status| status.success()), "no copy");
}
