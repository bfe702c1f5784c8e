//! `iltm check`, and the same gates before `iltm solve`, on the sample capture.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/m-panels");

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command.current_dir(folder).args(arguments);
    command.stdin(Stdio::null());
    command.output().expect("the binary is there")
}

fn data(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

/// Verdict of a gate.
fn verdict<'d>(data: &'d Value, name: &str) -> &'d str {
    let gates = data["gates"].as_array().expect("gates");
    let gate = gates.iter().find(|gate| gate["name"] == name);
    gate.and_then(|gate| gate["verdict"].as_str())
        .expect("judged")
}

/// The sample with two photographs exchanged, as `capture` in a folder of its own.
fn exchanged() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let capture = folder.path().join("capture");
    for part in ["patterns", "photos"] {
        fs::create_dir_all(capture.join(part)).expect("a new folder");
        for file in fs::read_dir(Path::new(SAMPLE).join(part)).expect("the sample") {
            let file = file.expect("the sample");
            let to = capture.join(part).join(file.file_name());
            fs::copy(file.path(), to).expect("a copy");
        }
    }
    for file in ["capture.csv", "capture.toml"] {
        fs::copy(Path::new(SAMPLE).join(file), capture.join(file)).expect("a copy");
    }
    let photo = |name: &str| capture.join("photos").join(name);
    fs::rename(photo("030.png"), photo("other")).expect("there");
    fs::rename(photo("044.png"), photo("030.png")).expect("there");
    fs::rename(photo("other"), photo("044.png")).expect("there");
    folder
}

#[test]
fn the_sample_passes_every_gate_and_has_a_page() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = run(folder.path(), &["check", SAMPLE, "-o", "page"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && output.stdout.is_empty(),
        "{said}"
    );
    assert!(!said.contains("FAIL") && said.contains("order"), "{said}");
    let page = fs::read_to_string(folder.path().join("page/check.html")).expect("written");
    assert_eq!(page.matches("<section class=\"gate").count(), 11);
    let output = run(folder.path(), &["--json", "check", SAMPLE]);
    assert_eq!(data(&output)["pass"], true);
    assert_eq!(data(&output)["cells"]["live"], 273);
}

#[test]
fn a_gate_that_fails_stops_check_and_solve_unless_it_is_ignored() {
    let folder = exchanged();
    let output = run(folder.path(), &["--json", "check", "capture"]);
    assert_eq!(output.status.code(), Some(5));
    let found = data(&output);
    assert_eq!(verdict(&found, "order"), "fail");
    assert_eq!(verdict(&found, "complete"), "pass");
    assert_eq!(found["error"]["kind"], "photographs");
    let solve = |more: &[&str]| {
        let arguments = ["--json", "solve", "capture", "-o", "t.iltm"];
        run(folder.path(), &[&arguments, more].concat())
    };
    let refused = solve(&[]);
    assert_eq!(refused.status.code(), Some(5));
    let message = data(&refused)["error"]["message"].to_string();
    assert!(
        message.contains("photos/030.png and photos/044.png are exchanged"),
        "{message}"
    );
    assert!(!folder.path().join("t.iltm").exists());
    let output = solve(&["--ignore", "order"]);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(data(&output)["ignored_gates"][0], "order");
    let output = run(folder.path(), &["--json", "inspect", "t.iltm"]);
    let inspected = String::from_utf8_lossy(&output.stdout);
    assert!(inspected.contains("ignored_gates"), "{inspected}");
}

#[test]
fn a_gate_that_does_not_exist_is_a_mistake_in_the_command() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let arguments = ["solve", SAMPLE, "-o", "t.iltm", "--ignore", "exposure"];
    let output = run(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("saturation"), "{said}");
}
