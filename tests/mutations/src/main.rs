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
//! prints a table; areas are those of [`areas::AREAS`], all if none is named.

mod areas;
mod plant;
mod run;

use areas::{AREAS, Area};
use plant::Mutant;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Defects of an area, evenly spaced among all that there are.
const IN_AN_AREA: usize = 36;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let chosen: Vec<&Area> = AREAS
        .iter()
        .filter(|area| words.is_empty() || words.iter().any(|word| word == area.name))
        .collect();
    assert!(!chosen.is_empty(), "no area is called so");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let place = root.join("target/mutations");
    let copy = place.join("source");
    let mut refused = BTreeMap::new();
    let mutants: Vec<Mutant> = chosen
        .iter()
        .flat_map(|area| plant::choose(&root, area, IN_AN_AREA))
        .collect();
    let tests = loop {
        fresh(&root, &copy);
        let left: Vec<&Mutant> = (mutants.iter())
            .filter(|mutant| !refused.contains_key(&mutant.number))
            .collect();
        plant::plant(&copy, &left);
        match run::build(&copy, &place.join("target"), &chosen) {
            Ok(tests) => break tests,
            // Those that no compiler takes are none.
            Err(errors) => {
                let found = plant::blame(&copy, &errors);
                assert!(!found.is_empty(), "the copy does not build: {errors:#?}");
                eprintln!("{} defects do not compile", found.len());
                refused.extend(found.into_iter().map(|number| (number, ())));
            }
        }
    };
    let mutants: Vec<Mutant> = (mutants.into_iter())
        .filter(|mutant| !refused.contains_key(&mutant.number))
        .collect();
    run::all(&mutants, &tests, &copy);
}

/// Makes a copy of what is committed, anew where it differs, so that little is compiled again.
fn fresh(root: &Path, copy: &PathBuf) {
    let shell = "mkdir -p \"$1\" && git -C \"$0\" archive HEAD | tar x -C \"$1\"";
    let done = Command::new("sh").args(["-c", shell]).arg(root).arg(copy).status();
    assert!(done.is_ok_and(|status| status.success()), "no copy");
}
