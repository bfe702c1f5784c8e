//! Runs of tests against defects.

use crate::areas::{Area, Tests};
use crate::plant::Mutant;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// How many times as long as without a defect a test may take; beyond, it is noticed too.
const PATIENCE: u32 = 5;

/// Test binaries, by package and target, with the folder of the package.
pub type Binaries = BTreeMap<(String, String), (PathBuf, PathBuf)>;

/// Builds the tests of areas; errors are files and lines.
pub fn build(
    copy: &Path,
    target: &Path,
    areas: &[&Area],
) -> Result<Binaries, Vec<(String, usize)>> {
    let mut command = Command::new("cargo");
    command.args(["test", "--no-run", "--locked", "--message-format", "json"]);
    let packages = areas.iter().flat_map(|area| area.tests);
    let mut packages: Vec<&str> = packages.map(|tests| tests.package).collect();
    packages.sort_unstable();
    packages.dedup();
    for package in packages {
        command.args(["--package", package]);
    }
    command.env("CARGO_TARGET_DIR", target);
    command.env("RUSTFLAGS", "--cap-lints=warn");
    let output = command.current_dir(copy).stderr(Stdio::inherit()).output();
    let output = output.expect("cargo is there");
    let messages = || {
        let lines = output.stdout.split(|byte| *byte == b'\n');
        lines.filter_map(|line| serde_json::from_slice::<Value>(line).ok())
    };
    if output.status.success() {
        return Ok(messages().filter_map(|message| binary(&message)).collect());
    }
    let spans = messages().flat_map(|message| {
        let error = message["message"]["level"] == "error";
        let spans = message["message"]["spans"].as_array().cloned();
        spans.filter(|_| error).unwrap_or_default()
    });
    let place = |span: Value| {
        let line = span["line_start"].as_u64()? as usize;
        Some((span["file_name"].as_str()?.to_owned(), line))
    };
    Err(spans.filter_map(place).collect())
}

fn binary(message: &Value) -> Option<((String, String), (PathBuf, PathBuf))> {
    let executable = PathBuf::from(message["executable"].as_str()?);
    if message["profile"]["test"] != true {
        return None;
    }
    let manifest = PathBuf::from(message["manifest_path"].as_str()?);
    let folder = manifest.parent()?.to_owned();
    let text = std::fs::read_to_string(&manifest).ok()?;
    let name = text.lines().find_map(|line| line.strip_prefix("name = "))?;
    let package = name.trim_matches('"').to_owned();
    let target = message["target"]["name"].as_str()?.to_owned();
    Some(((package, target), (executable, folder)))
}

/// Runs the tests of every defect and prints what became of it.
pub fn all(mutants: &[Mutant], binaries: &Binaries) {
    let mut without = BTreeMap::new();
    let mut wanted: Vec<Tests> = Vec::new();
    for tests in mutants.iter().flat_map(|mutant| mutant.area.tests) {
        if !wanted.contains(tests) {
            wanted.push(*tests);
        }
    }
    for tests in wanted {
        let begin = Instant::now();
        let passed = passes(&tests, binaries, 0, Duration::from_secs(1_800));
        assert!(passed, "{tests:?} fail without a defect");
        let took = begin.elapsed();
        eprintln!("{tests:?}: {took:.1?}");
        let key = (tests.package, tests.target, tests.arguments);
        without.insert(key, took);
    }
    let next = AtomicUsize::new(0);
    let lines = Mutex::new(BTreeMap::new());
    let threads = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(mutant) = mutants.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let caught = mutant.area.tests.iter().find(|tests| {
                        let usual = without[&(tests.package, tests.target, tests.arguments)];
                        let limit = PATIENCE * threads as u32 * (usual + Duration::from_secs(2));
                        !passes(tests, binaries, mutant.number, limit)
                    });
                    let word = caught.map_or("**nobody**", |tests| tests.target);
                    let line = format!("| {} | {} | {word} |", mutant.area.name, mutant.words());
                    eprintln!("{line}");
                    let mut lines = lines.lock().expect("nobody panics");
                    lines.insert(mutant.number, (mutant.area.name, line, caught.is_some()));
                }
            });
        }
    });
    let lines = lines.into_inner().expect("nobody panics");
    println!("| area | defects | noticed |\n|---|---|---|");
    let mut sums: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for (area, _, caught) in lines.values() {
        let sum = sums.entry(area).or_default();
        *sum = (sum.0 + 1, sum.1 + usize::from(*caught));
    }
    for (area, (all, caught)) in &sums {
        println!("| {area} | {all} | {caught} |");
    }
    println!("\n| area | defect | noticed by |\n|---|---|---|");
    for (_, line, _) in lines.values() {
        println!("{line}");
    }
}

/// Whether tests pass with a defect in time.
fn passes(tests: &Tests, binaries: &Binaries, mutant: u32, limit: Duration) -> bool {
    let key = (tests.package.to_owned(), tests.target.to_owned());
    let (executable, folder) = binaries.get(&key).unwrap_or_else(|| panic!("no {key:?}"));
    let mut command = Command::new(executable);
    command.args(tests.arguments).current_dir(folder);
    command.env("ILTM_MUTANT", mutant.to_string());
    command
        .env("PROPTEST_RNG_SEED", "1")
        .env("RUST_BACKTRACE", "0");
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut child = command.spawn().expect("a test binary");
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("it is ours") {
            return status.success();
        }
        if begin.elapsed() > limit {
            let _ = child.kill();
            let _ = child.wait();
            return false;
        }
        thread::sleep(Duration::from_millis(20));
    }
}
