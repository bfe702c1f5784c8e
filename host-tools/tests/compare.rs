//! `iltm compare`, also the wrong ways.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/m-panels");

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_iltm"))
        .current_dir(folder)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .expect("the binary is there")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_capture_is_compared_on_with_every_method_and_a_source_for_each() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = run(folder.path(), &["compare", SAMPLE, "-o", "out", "--json"]);
    assert!(done.status.success(), "{}", said(&done));
    let data: Value = serde_json::from_slice(&done.stdout).expect("one JSON object");
    for group in ["photographed", "inverted"] {
        let rows = data[group].as_array().expect("rows");
        assert!(rows.len() >= 10, "{}", rows.len());
        for row in rows {
            assert!(row["source"].as_str().is_some_and(|s| s.contains(": ")));
            // A method that gives no answer says why.
            assert_ne!(
                row["compensation_error"].is_null(),
                row["no_answer"].is_null()
            );
        }
    }
    let error = |group: &str, name: &str| {
        let rows = data[group].as_array().expect("rows");
        let row = rows.iter().find(|row| row["method"].as_str() == Some(name));
        row.and_then(|row| row["compensation_error"].as_f64())
            .expect(name)
    };
    // This project's promise on a capture with noise.
    let ours = error("photographed", "iltm, 150");
    assert!(ours < error("photographed", "the paper's direct method, 150"));
    assert!(error("inverted", "exact inverse") < ours);
    let page = fs::read_to_string(folder.path().join("out/index.html")).expect("a page");
    let table = fs::read_to_string(folder.path().join("out/compare.csv")).expect("a table");
    assert!(page.len() < 1_000_000 && !page.contains("http://"));
    for name in ["one light at a time", "exact inverse"] {
        assert!(page.contains(name) && table.contains(name));
    }
}

#[test]
fn what_cannot_be_compared_on_is_refused_with_its_own_code() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::create_dir(folder.path().join("empty")).expect("a folder");
    fs::write(folder.path().join("file"), "x").expect("a file");
    fs::write(folder.path().join("bad.toml"), "what = 1").expect("a file");
    let cases: [(&[&str], i32, &str); 6] = [
        (&["compare", "-o", "out"], 2, "CAPTURE|SCENE.toml"),
        (&["compare", SAMPLE, "--paper", "-o", "out"], 2, "--paper"),
        (&["compare", "nowhere.toml", "-o", "out"], 3, "nowhere.toml"),
        (&["compare", "empty", "-o", "out"], 3, "capture.csv"),
        (&["compare", "bad.toml", "-o", "out"], 30, "bad.toml"),
        (&["compare", SAMPLE, "-o", "file"], 9, "file"),
    ];
    for (arguments, code, word) in cases {
        let output = run(folder.path(), arguments);
        assert_eq!(
            output.status.code(),
            Some(code),
            "{arguments:?}: {}",
            said(&output)
        );
        assert!(
            said(&output).contains(word),
            "{arguments:?}: {}",
            said(&output)
        );
    }
}
