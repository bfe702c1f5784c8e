//! `iltm tradeoff` as a user meets it, on the sample capture and on its table.

use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/m-panels");

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command
        .current_dir(folder)
        .args(arguments)
        .stdin(Stdio::null());
    command.output().expect("the binary is there")
}

/// Exit code and what people read.
fn said(output: &Output) -> String {
    let code = output.status.code().expect("not killed");
    format!("exit {code}\n{}", String::from_utf8_lossy(&output.stderr))
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = run(folder, &[&["--json"], arguments].concat());
    assert!(output.status.success(), "{}", said(&output));
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

/// A folder with the sample's table, what `inspect` says of it, and what `tradeoff` says
/// of the sample and of the table.
struct Done {
    folder: TempDir,
    inspected: Value,
    capture: Value,
    table: Value,
}

fn done() -> &'static Done {
    static DONE: OnceLock<Done> = OnceLock::new();
    DONE.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = folder.path();
        json(at, &["solve", SAMPLE, "-o", "t.iltm"]);
        Done {
            inspected: json(at, &["inspect", "t.iltm"]),
            capture: json(at, &["tradeoff", SAMPLE, "-o", "of-capture"]),
            table: json(at, &["tradeoff", "t.iltm", "-o", "of-table"]),
            folder,
        }
    })
}

fn points<'v>(data: &'v Value, sweep: &str) -> Vec<&'v Value> {
    let points = data["points"].as_array().expect("points");
    points.iter().filter(|p| p["sweep"] == sweep).collect()
}

fn number(point: &Value, name: &str) -> f64 {
    point[name]
        .as_f64()
        .unwrap_or_else(|| panic!("{name} of {point}"))
}

#[test]
fn inspect_and_tradeoff_say_the_same_of_every_tier() {
    let done = done();
    let tiers = done.inspected["tiers"].as_array().expect("tiers");
    assert!(tiers.len() > 3);
    for data in [&done.table, &done.capture] {
        let own = points(data, "table");
        assert_eq!(own.len(), tiers.len());
        for (point, tier) in own.into_iter().zip(tiers) {
            for (of_point, of_tier) in [
                ("left_out", "error"),
                ("predicted_error", "total_error"),
                ("instructions", "instructions"),
                ("share", "share"),
                ("bytes", "bytes"),
            ] {
                assert_eq!(point[of_point], tier[of_tier], "{of_point} of {point}");
            }
        }
    }
}

#[test]
fn every_sweep_is_there_for_a_capture_with_true_errors() {
    let data = &done().capture;
    for sweep in ["table", "tiers", "photographs", "solver", "bits", "grid"] {
        let own = points(data, sweep);
        assert!(!own.is_empty(), "{sweep}");
        for point in own {
            assert!(number(point, "true_error") > 0.0);
            assert!(number(point, "solve_seconds") > 0.0);
            let parts = number(point, "left_out").hypot(number(point, "inverse_error"));
            let error = number(point, "predicted_error");
            assert!((error - parts).abs() < 1e-6 * error, "{point}");
            assert_eq!(point["hypothetical"], sweep == "bits");
            assert!(sweep == "bits" || number(point, "microseconds") > 0.0);
        }
    }
    let bits: BTreeSet<u64> = points(data, "bits")
        .iter()
        .filter_map(|p| p["bits"].as_u64())
        .collect();
    assert_eq!(bits, (4..16).collect());
}

#[test]
fn more_of_everything_errs_less_by_the_reference() {
    let data = &done().capture;
    let least = |sweep: &str, setting: &str| {
        let own = points(data, sweep).into_iter();
        let own = own.filter(|p| {
            p["setting"]
                .as_str()
                .is_some_and(|s| s.starts_with(setting))
        });
        own.map(|p| number(p, "true_error"))
            .fold(f64::INFINITY, f64::min)
    };
    let table = least("table", "");
    // `tests/tests/reference.rs` finds .008 at most, of brighter images.
    assert!(table < 0.008, "{table}");
    assert!(least("photographs", "10 ") > table);
    assert!(least("solver", "direct") > 2.0 * table);
    assert!(least("bits", "4 bits") > 1.2 * table);
    assert!(least("grid", "operator of 7 x 11") > table);
    assert!(least("grid", "operator of 4 x 6") > least("grid", "operator of 7 x 11"));
    let tiers = points(data, "table");
    let gain_only = number(tiers[0], "true_error");
    assert!(gain_only > 10.0 * table, "{gain_only}");
}

#[test]
fn the_front_is_what_no_other_point_beats() {
    let data = &done().capture;
    let all: Vec<&Value> = data["points"].as_array().expect("points").iter().collect();
    let real = || all.iter().filter(|p| p["hypothetical"] == false);
    let place = |p: &Value| (number(p, "instructions"), number(p, "predicted_error"));
    for point in &all {
        let (x, y) = place(point);
        let beaten = real().any(|other| {
            let (u, v) = place(other);
            (u <= x && v < y) || (u < x && v <= y)
        });
        let on = point["hypothetical"] == false && !beaten;
        assert_eq!(point["front"], on, "{point}");
    }
}

#[test]
fn the_page_is_complete_in_itself_and_smaller_than_a_megabyte() {
    let done = done();
    for folder in ["of-capture", "of-table"] {
        let file = |name: &str| {
            let path = done.folder.path().join(folder).join(name);
            fs::read_to_string(path).expect("written")
        };
        let page = file("tradeoff.html");
        assert!(page.len() < 1_000_000);
        for outside in ["http://", "https://", "<link", "src=", "@import", "url("] {
            let mut found = page.matches(outside).count();
            if outside == "http://" {
                // The name of SVG's elements.
                found -= page.matches("http://www.w3.org/2000/svg").count();
            }
            assert_eq!(found, 0, "{outside} in the page of {folder}");
        }
        let data = page.split("id=\"data\">").nth(1).expect("data");
        let data = data.split("</script>").next().expect("its end");
        let data: Value = serde_json::from_str(data).expect("JSON");
        let points = data["points"].as_array().expect("points").len();
        assert_eq!(file("tradeoff.csv").lines().count(), 1 + points);
        assert!(file("tradeoff.svg").starts_with("<svg"));
    }
}

#[test]
fn one_line_of_advice_is_said_and_is_in_the_json() {
    let done = done();
    let output = run(done.folder.path(), &["tradeoff", "t.iltm", "-o", "again"]);
    let said = said(&output);
    let advice = done.table["advice"].as_str().expect("words");
    assert!(said.starts_with("exit 0\n"), "{said}");
    assert!(said.contains(&format!("advice      {advice}\n")), "{said}");
    assert!(
        advice.contains("of a 60 Hz frame on a 216 MHz part"),
        "{advice}"
    );
    assert!(output.stdout.is_empty());
    // It says as well what a table cannot know.
    assert!(said.contains("a table holds no photographs"), "{said}");
}

#[test]
fn what_is_not_there_is_a_failure_to_read() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = run(folder.path(), &["tradeoff", "missing", "-o", "out"]);
    assert!(said(&output).starts_with("exit 3\n"), "{}", said(&output));
    assert!(said(&output).contains("missing"));
    assert!(!folder.path().join("out").exists());
}

#[test]
fn a_folder_that_is_no_capture_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::create_dir(folder.path().join("empty")).expect("a new folder");
    let output = run(folder.path(), &["tradeoff", "empty", "-o", "out"]);
    assert!(said(&output).starts_with("exit 3\n"), "{}", said(&output));
    assert!(said(&output).contains("capture.csv"), "{}", said(&output));
}

#[test]
fn a_file_that_is_no_table_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("t.iltm"), b"no table").expect("writable");
    let output = run(folder.path(), &["tradeoff", "t.iltm", "-o", "out"]);
    assert!(said(&output).starts_with("exit 7\n"), "{}", said(&output));
}

#[test]
fn a_file_in_the_way_of_the_folder_is_left_as_it_was() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("out"), b"mine").expect("writable");
    let output = run(folder.path(), &["tradeoff", SAMPLE, "-o", "out"]);
    assert!(said(&output).starts_with("exit 9\n"), "{}", said(&output));
    assert!(said(&output).contains("a file is in its place"));
    assert_eq!(fs::read(folder.path().join("out")).expect("there"), b"mine");
}

#[test]
fn a_folder_in_the_way_of_a_file_is_named() {
    let done = done();
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::create_dir_all(folder.path().join("out/tradeoff.html/mine")).expect("new folders");
    let table = done.folder.path().join("t.iltm");
    let table = table.to_str().expect("a plain name");
    let output = run(folder.path(), &["tradeoff", table, "-o", "out"]);
    assert!(said(&output).starts_with("exit 9\n"), "{}", said(&output));
    assert!(said(&output).contains("tradeoff.html"));
    // Nothing half-written beside it.
    let left = fs::read_dir(folder.path().join("out"))
        .expect("there")
        .count();
    assert_eq!(left, 1);
}

#[test]
fn a_reference_of_another_scene_is_refused_with_both_shapes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let capture = folder.path().join("capture");
    for part in ["patterns", "photos"] {
        fs::create_dir_all(capture.join(part)).expect("a new folder");
        for file in fs::read_dir(Path::new(SAMPLE).join(part)).expect("the sample") {
            let file = file.expect("the sample");
            fs::copy(file.path(), capture.join(part).join(file.file_name())).expect("a copy");
        }
    }
    for file in ["capture.csv", "capture.toml"] {
        fs::copy(Path::new(SAMPLE).join(file), capture.join(file)).expect("a copy");
    }
    // The header of the sample's, but for 137 x 273.
    let mut reference = fs::read(Path::new(SAMPLE).join("reference_T.npy")).expect("the sample");
    let at = reference
        .windows(10)
        .position(|text| text == b"(273, 273)")
        .expect("its shape");
    reference[at + 1..at + 4].copy_from_slice(b"137");
    fs::write(capture.join("reference_T.npy"), reference).expect("writable");
    let output = run(folder.path(), &["tradeoff", "capture", "-o", "out"]);
    let said = said(&output);
    assert!(said.starts_with("exit 4\n"), "{said}");
    assert!(
        said.contains("137 x 273") && said.contains("273 x 273"),
        "{said}"
    );
}
