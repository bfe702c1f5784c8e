//! `iltm tradeoff` as a user meets it, on the sample capture and on its table.

use super::user::{SAMPLE, User, contains};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

/// With the sample's table, what `inspect` says of it, and what `tradeoff` says of the
/// sample and of the table.
struct Done {
    user: User,
    inspected: Value,
    capture: Value,
    table: Value,
}

fn done() -> &'static Done {
    static DONE: OnceLock<Done> = OnceLock::new();
    DONE.get_or_init(|| {
        let user = User::with_table();
        Done {
            inspected: user.json("inspect t.iltm"),
            capture: user.json("tradeoff SAMPLE -o of-capture"),
            table: user.json("tradeoff t.iltm -o of-table"),
            user,
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
    // `tests/tests/scenes/reference.rs` finds .008 at most, of brighter images.
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
        let file = |name: &str| done.user.text(&format!("{folder}/{name}"));
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
    let again = done.user.run("tradeoff t.iltm -o again");
    let advice = done.table["advice"].as_str().expect("words");
    assert_eq!(again.code, 0, "{}", again.said);
    let line = format!("advice      {advice}\n");
    // It says as well what a table cannot know.
    contains(&again.said, &[&line, "a table holds no photographs"]);
    contains(advice, &["of a frame’s time on the reference device"]);
}

#[test]
fn what_is_no_capture_no_table_or_in_the_way_is_refused_and_left_as_it_was() {
    let user = User::with_table();
    fs::create_dir(user.path("empty")).expect("a new folder");
    fs::create_dir_all(user.path("taken/tradeoff.html/mine")).expect("new folders");
    user.write("none.iltm", b"no table");
    user.write("mine", b"mine");
    for (line, code, words) in [
        ("tradeoff missing -o unmade", 3, "missing"),
        ("tradeoff empty -o out", 3, "capture.csv"),
        ("tradeoff none.iltm -o out", 7, "none.iltm"),
        ("tradeoff SAMPLE -o mine", 9, "a file is in its place"),
        ("tradeoff t.iltm -o taken", 9, "tradeoff.html"),
    ] {
        contains(&user.fails(code, line), &[words]);
    }
    assert!(!user.path("unmade").exists());
    assert_eq!(user.read("mine"), b"mine");
    // Nothing half-written beside it.
    assert_eq!(user.names("taken"), ["tradeoff.html"]);
}

#[test]
fn a_reference_of_another_scene_is_refused_with_both_shapes() {
    let user = User::with_capture();
    // The header of the sample's, but for 137 x 273.
    let mut reference = fs::read(Path::new(SAMPLE).join("reference_T.npy")).expect("the sample");
    let mut texts = reference.windows(10);
    let at = texts.position(|text| text == b"(273, 273)").expect("shape");
    reference[at + 1..at + 4].copy_from_slice(b"137");
    user.write("capture/reference_T.npy", reference);
    let said = user.fails(4, "tradeoff capture -o out");
    contains(&said, &["137 x 273", "273 x 273"]);
}
