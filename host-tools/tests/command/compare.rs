//! `iltm compare`, also the wrong ways.

use super::user::{User, contains, with_values};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

#[test]
fn a_capture_is_compared_on_with_every_method_and_a_source_for_each() {
    let user = User::new();
    let data = user.json("compare SAMPLE -o out");
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
    let (page, table) = (user.text("out/index.html"), user.text("out/compare.csv"));
    assert!(page.len() < 1_000_000 && !page.contains("http://"));
    for text in [page, table] {
        contains(&text, &["one light at a time", "exact inverse"]);
    }
}

/// A scene that comes with the tools.
fn scene(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    fs::read_to_string(folder.join(name)).expect("a scene")
}

#[test]
fn projectors_that_light_each_others_walls_are_compared_together_and_each_alone() {
    let user = User::new();
    let few = [("rows", 4), ("cols", 6), ("width", 160), ("height", 100)];
    user.write("walls.toml", with_values(&scene("two-walls.toml"), &few));
    let data = user.json("compare walls.toml -o out --photos 30");
    let alone = error(&data, "exact inverse of each projector alone");
    assert!(
        error(&data, "exact inverse") < 1e-6 && alone > 0.02,
        "{alone}"
    );
    assert!(!data["photographed"].as_array().expect("a list").is_empty());
    let page = user.text("out/index.html");
    contains(&page, &["exact inverse of each projector alone"]);
}

/// Error of what a method shows.
fn error(data: &Value, method: &str) -> f64 {
    let rows = data["inverted"].as_array().expect("a list");
    let row = rows.iter().find(|row| row["method"] == method);
    let error = &row.expect("a row")["compensation_error"];
    error.as_f64().expect("a number")
}

#[test]
fn projectors_that_overlap_are_compared_with_and_without_blending() {
    let user = User::new();
    let few = [("rows", 6), ("cols", 10), ("width", 240), ("height", 150)];
    user.write(
        "screen.toml",
        with_values(&scene("folded-screen.toml"), &few),
    );
    let data = user.json("compare screen.toml -o out");
    let together = error(&data, "all projectors together");
    let doubled = error(&data, "all projectors together, without blending");
    let alone = error(&data, "exact inverse of each projector alone");
    let gains = error(&data, "gain of each cell, d / flood");
    assert!(
        together < 0.02 && together < 0.6 * gains,
        "{together} {gains}"
    );
    assert!(doubled > 0.2 && alone > doubled, "{doubled} {alone}");
    // There is no one inverse that they could be judged by, and methods for one projector are left out.
    for row in data["inverted"].as_array().expect("a list") {
        assert_eq!(
            (&row["inverse_error"], &row["second_bounce_error"]),
            (&Value::Null, &Value::Null)
        );
    }
    assert_eq!(data["photographed"], json!([]));
    let page = user.text("out/index.html");
    contains(&page, &["its projectors overlap", "without blending"]);
    assert!(!page.contains("Ways to photograph"));
    let said = user.says("compare screen.toml -o again");
    contains(&said, &["its projectors overlap"]);
    assert!(!said.contains("ways to photograph"));
}

#[test]
fn what_cannot_be_compared_on_is_refused_with_its_own_code() {
    let user = User::new();
    fs::create_dir(user.path("empty")).expect("a folder");
    user.write("file", "x");
    user.write("bad.toml", "what = 1");
    for (line, code, word) in [
        ("compare -o out", 2, "CAPTURE|SCENE.toml"),
        ("compare SAMPLE --paper -o out", 2, "--paper"),
        ("compare nowhere.toml -o out", 3, "nowhere.toml"),
        ("compare empty -o out", 3, "capture.csv"),
        ("compare bad.toml -o out", 30, "bad.toml"),
        ("compare SAMPLE -o file", 9, "file"),
    ] {
        contains(&user.fails(code, line), &[word]);
    }
}
