//! `iltm compare`, also the wrong ways.

use super::user::{User, contains, with_values};
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

/// A scene that comes with the tools, of few cells and pixels.
fn coarse(scene: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let text = fs::read_to_string(folder.join(scene)).expect("a scene");
    let few = [("rows", 4), ("cols", 6), ("width", 160), ("height", 100)];
    with_values(&text, &few)
}

#[test]
fn projectors_that_light_each_others_walls_are_compared_together_and_each_alone() {
    let user = User::new();
    user.write("walls.toml", coarse("two-walls.toml"));
    let data = user.json("compare walls.toml -o out --photos 30");
    let rows = data["inverted"].as_array().expect("a list");
    let error = |name: &str| {
        let row = rows.iter().find(|row| row["method"] == name);
        row.expect("a row")["compensation_error"]
            .as_f64()
            .expect("a number")
    };
    let alone = error("exact inverse of each projector alone");
    assert!(error("exact inverse") < 1e-6 && alone > 0.02, "{alone}");
    let page = user.text("out/index.html");
    contains(&page, &["exact inverse of each projector alone"]);
    user.write("screen.toml", coarse("folded-screen.toml"));
    let said = user.fails(2, "compare screen.toml -o none");
    contains(&said, &["overlap", "docs/several-projectors.md"]);
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
