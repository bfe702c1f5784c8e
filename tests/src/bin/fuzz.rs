//! Fuzz driver: runs fuzz targets for long, on all cores, without any other tool:
//!
//! ```text
//! cargo run --profile fuzz -p iltm-tests --bin fuzz -- TARGET|all
//!     [--executions N] [--seconds S] [--seed S] [--first I] [--threads T]
//! ```
//!
//! Every execution is made from the seed and its number: a finding is printed with
//! both, and `--seed S --first I --executions 1` repeats it.

use iltm_tests::fuzz::{TARGETS, Target, described, mutate};
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

thread_local! {
    /// What the last panic of this thread said.
    static SAID: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Findings after which a target is left.
const ENOUGH: usize = 3;

struct Limits {
    executions: u64,
    seconds: u64,
    seed: u64,
    first: u64,
    threads: u64,
}

fn main() -> ExitCode {
    let Some((name, limits)) = arguments() else {
        let names: Vec<_> = TARGETS.iter().map(|target| target.name).collect();
        eprintln!(
            "usage: fuzz TARGET|all [--executions N] [--seconds S] [--seed S] [--first I] [--threads T]\ntargets: {}",
            names.join(", ")
        );
        return ExitCode::from(2);
    };
    set_hook(Box::new(|panic| {
        SAID.with(|said| *said.borrow_mut() = panic.to_string());
    }));
    let mut findings = 0;
    for target in TARGETS
        .iter()
        .filter(|target| name == "all" || name == target.name)
    {
        findings += run(target, &limits);
    }
    ExitCode::from(u8::from(findings > 0))
}

fn arguments() -> Option<(String, Limits)> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next()?;
    let known = |target: &Target| target.name == name;
    if name != "all" && !TARGETS.iter().any(known) {
        return None;
    }
    let mut limits = Limits {
        executions: 100_000,
        seconds: u64::MAX,
        seed: 1,
        first: 0,
        threads: thread::available_parallelism().map_or(1, |cores| cores.get() as u64),
    };
    while let Some(option) = arguments.next() {
        let place = match option.as_str() {
            "--executions" => &mut limits.executions,
            "--seconds" => &mut limits.seconds,
            "--seed" => &mut limits.seed,
            "--first" => &mut limits.first,
            "--threads" => &mut limits.threads,
            _ => return None,
        };
        *place = arguments.next()?.parse().ok()?;
    }
    Some((name, limits))
}

/// Whether a target fails on these bytes, and what it says then.
fn failure(target: &Target, bytes: &[u8]) -> Option<String> {
    let run = catch_unwind(AssertUnwindSafe(|| (target.run)(bytes)));
    run.err().map(|_| SAID.with(|said| said.borrow().clone()))
}

/// Returns the number of findings.
fn run(target: &Target, limits: &Limits) -> usize {
    let seeds = (target.seeds)();
    let next = AtomicU64::new(limits.first);
    let done = AtomicU64::new(0);
    let end = limits.first.saturating_add(limits.executions);
    let found = Mutex::new(Vec::new());
    let start = Instant::now();
    let late = Duration::from_secs(limits.seconds);
    thread::scope(|scope| {
        for _ in 0..limits.threads {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let enough = found.lock().is_ok_and(|found| found.len() >= ENOUGH);
                    if index >= end || start.elapsed() > late || enough {
                        return;
                    }
                    let bytes = mutate::input(&seeds, target.groups, limits.seed, index);
                    if failure(target, &bytes).is_some()
                        && let Ok(mut found) = found.lock()
                    {
                        found.push((index, bytes));
                    }
                    done.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
    });
    let seconds = start.elapsed().as_secs_f64();
    let done = done.into_inner();
    let found = found.into_inner().unwrap_or_default();
    println!(
        "{:10} {done:>10} executions {seconds:>8.1} s {:>9.0} /s {:>3} findings (seed {})",
        target.name,
        done as f64 / seconds,
        found.len(),
        limits.seed,
    );
    for (index, bytes) in &found {
        let fails = |bytes: &[u8]| failure(target, bytes).is_some();
        let least = mutate::minimised(bytes.clone(), target.groups, fails);
        let said = failure(target, &least).unwrap_or_default();
        println!(
            "\n--seed {} --first {index}: {least:?}\n{said}",
            limits.seed
        );
        if target.name == "session" {
            println!("{}", described(&least));
        }
    }
    found.len()
}
