//! `iltm verify` as a user meets it: the whole way with simulated photographs, and the
//! wrong ways.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/m-panels.toml");

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command.current_dir(folder).args(arguments);
    command
        .stdin(Stdio::null())
        .output()
        .expect("the binary is there")
}

fn done(folder: &Path, arguments: &[&str]) {
    let output = run(folder, arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// A table, and a folder `v` to verify it with, photographed.
fn photographed() -> &'static TempDir {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let at = folder.path();
        done(at, &["simulate", SCENE, "-o", "c", "--photos", "80"]);
        done(at, &["solve", "c", "-o", "t.iltm"]);
        done(
            at,
            &[
                "verify",
                "t.iltm",
                "-o",
                "v",
                "--projector",
                "640x400",
                "--border",
                "3",
            ],
        );
        done(at, &["simulate", SCENE, "--photograph", "v", "--seed", "9"]);
        folder
    })
}

/// A copy of the photographed folder that may be harmed.
fn copy() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let from = photographed().path();
    fs::copy(from.join("t.iltm"), folder.path().join("t.iltm")).expect("a copy");
    for part in ["v", "v/patterns", "v/photos", "v/wanted"] {
        fs::create_dir(folder.path().join(part)).expect("a folder");
        for file in fs::read_dir(from.join(part)).expect("written") {
            let file = file.expect("written");
            if file.path().is_file() {
                let to = folder.path().join(part).join(file.file_name());
                fs::copy(file.path(), to).expect("a copy");
            }
        }
    }
    folder
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn a_good_table_passes_and_a_bound_below_what_is_possible_fails_with_the_same_figures() {
    let folder = photographed().path();
    let passed = run(
        folder,
        &["--json", "verify", "t.iltm", "v", "--report", "r"],
    );
    let figures = json(&passed);
    assert_eq!(passed.status.code(), Some(0), "{figures}");
    assert_eq!(figures["passed"], true);
    let error = |figures: &Value, half: &str| figures["mean_error"][half].as_f64().unwrap();
    assert!(
        error(&figures, "after") < 0.1 * error(&figures, "before"),
        "{figures}"
    );
    for file in [
        "verdict.html",
        "worst-cells.png",
        "drift.png",
        "0-after.png",
    ] {
        assert!(folder.join("r").join(file).is_file(), "{file}");
    }
    let failed = run(
        folder,
        &["--json", "verify", "t.iltm", "v", "--bound", "0.0001"],
    );
    let again = json(&failed);
    assert_eq!(failed.status.code(), Some(31));
    assert_eq!(again["error"]["kind"], "verdict");
    assert_eq!(
        (&again["passed"], &again["mean_error"]),
        (&false.into(), &figures["mean_error"])
    );
    // The slides have the projector's size, the border and the cells.
    let slide = image::open(folder.join("v/slides/000.png"))
        .expect("a picture")
        .into_luma8();
    assert_eq!(slide.dimensions(), (640, 400));
    assert_eq!(
        [slide[(2, 200)][0], slide[(3, 200)][0], slide[(637, 200)][0]],
        [0, 255, 0]
    );
}

#[test]
fn what_is_missing_is_listed_and_what_was_made_with_another_table_fails() {
    let folder = copy();
    let at = folder.path();
    let said = |output: &Output| String::from_utf8_lossy(&output.stderr).into_owned();
    for photo in ["004", "060"] {
        fs::remove_file(at.join("v/photos").join(photo).with_extension("png")).expect("there");
    }
    let output = run(at, &["verify", "t.iltm", "v"]);
    assert_eq!(output.status.code(), Some(4));
    assert!(
        said(&output).contains("2 photographs are missing: photos/004.png, photos/060.png"),
        "{}",
        said(&output)
    );
    let folder = copy();
    let at = folder.path();
    // The same photographs, solved for another white.
    let capture = photographed().path().join("c");
    let capture = capture.to_str().expect("a plain path");
    done(at, &["solve", capture, "-o", "u.iltm", "--white", "0.3"]);
    let output = run(at, &["verify", "u.iltm", "v"]);
    assert_eq!(output.status.code(), Some(31), "{}", said(&output));
    assert!(
        said(&output).contains("made with another table"),
        "{}",
        said(&output)
    );
}

#[test]
fn a_folder_that_is_none_and_one_that_is_in_the_way_are_named() {
    let folder = photographed().path();
    let none = run(folder, &["verify", "t.iltm", "nowhere"]);
    assert_eq!(none.status.code(), Some(3));
    let text = String::from_utf8_lossy(&none.stderr).into_owned();
    assert!(text.contains("nowhere: there is no verify.csv"), "{text}");
    let taken = run(folder, &["verify", "t.iltm", "-o", "v"]);
    assert_eq!(taken.status.code(), Some(9));
    let small = run(
        folder,
        &["verify", "t.iltm", "-o", "w", "--projector", "20x400"],
    );
    assert_eq!(small.status.code(), Some(2));
    assert!(!folder.join("w").exists());
    assert_eq!(run(folder, &["verify", "t.iltm"]).status.code(), Some(2));
}
