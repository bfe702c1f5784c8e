//! Hard cases: runs every one and prints the page that lists them, or writes it: `cargo
//! run --release -p iltm-tests --bin hard_cases -- --write docs/hard-cases.md`.
//!
//! `--seeds N` (5) says how often each case is run; other words choose the cases
//! whose names contain one of them.

use iltm_tests::hard_cases::case::{METHODS, Trials};
use iltm_tests::hard_cases::{cases, page};
use iltm_tests::hard_frames;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut words: Vec<String> = std::env::args().skip(1).collect();
    let mut take = |name: &str| {
        let at = words.iter().position(|word| word == name)?;
        words.remove(at);
        (at < words.len()).then(|| words.remove(at))
    };
    let file = take("--write");
    let seeds = take("--seeds")
        .and_then(|seeds| seeds.parse().ok())
        .unwrap_or(5);
    let mut groups = Vec::new();
    for (title, cases) in cases::all() {
        let chosen = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word));
        let mut rows = Vec::new();
        for case in cases.into_iter().filter(|case| chosen(case.name)) {
            let outcomes = METHODS.map(|method| {
                let start = std::time::Instant::now();
                let outcome = (case.run)(Trials { seeds, method });
                eprintln!(
                    "{:12} {}, {} ({:.1} s): {} [{}]",
                    outcome.verdict(),
                    case.name,
                    method,
                    start.elapsed().as_secs_f64(),
                    outcome.measured,
                    outcome.bound
                );
                outcome
            });
            rows.push((case, outcomes));
        }
        groups.push((title, rows));
    }
    let frames = if words.is_empty() {
        hard_frames::page::rows()
    } else {
        Vec::new()
    };
    let (page, failures) = page::render(&groups, &frames);
    match file {
        Some(file) => {
            if let Err(error) = std::fs::write(&file, page) {
                eprintln!("{file}: {error}");
                return ExitCode::FAILURE;
            }
        }
        None => print!("{page}"),
    }
    if failures > 0 {
        eprintln!("{failures} cases fail");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
