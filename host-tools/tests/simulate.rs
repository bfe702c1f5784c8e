//! `iltm simulate` as a user meets it, the wrong ways in particular.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command.current_dir(folder).args(arguments);
    command.stdin(Stdio::null());
    command.output().expect("the binary is there")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A folder with a small scene, two walls that face each other, changed by `change`.
fn folder(change: impl Fn(String) -> String) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = "name = \"Corner\"
[projector]
position = [0, 0, 4]
look_at = [0, 0, 0]
field_of_view = 24
rows = 4
cols = 6
[camera]
position = [0.3, 0.2, 4]
look_at = [0, 0, 0]
field_of_view = 28
width = 60
height = 44
full_well = 20000
[[panel]]
name = \"left\"
corners = [[-1, 0.6, 1], [0, 0.6, 0], [0, -0.6, 0], [-1, -0.6, 1]]
albedo = 0.8
[[panel]]
name = \"right\"
corners = [[0, 0.6, 0], [1, 0.6, 1], [1, -0.6, 1], [0, -0.6, 0]]
albedo = 0.8
";
    let text = change(scene.to_owned());
    fs::write(folder.path().join("scene.toml"), text).expect("written");
    folder
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let name = |entry: std::io::Result<fs::DirEntry>| {
        entry
            .expect("an entry")
            .file_name()
            .to_string_lossy()
            .into_owned()
    };
    let mut names: Vec<_> = entries.map(name).collect();
    names.sort();
    names
}

#[test]
fn a_scene_becomes_a_capture_that_solve_takes() {
    let folder = folder(|scene| scene);
    let simulate = [
        "simulate",
        "scene.toml",
        "-o",
        "capture",
        "--photos",
        "40",
        "--json",
    ];
    let output = run(folder.path(), &simulate);
    assert!(output.status.success(), "{}", said(&output));
    let data: Value = serde_json::from_slice(&output.stdout).expect("one object");
    // White, black, 2 bits of rows and 3 of columns with inverses, and 40 more.
    assert_eq!(data["photographs"], 52);
    assert_eq!(data["effects"].as_array().map(Vec::len), Some(19));
    assert_eq!(names(folder.path()), ["capture", "scene.toml"]);
    let solve = ["solve", "capture", "-o", "t.iltm"];
    let output = run(folder.path(), &solve);
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn explain_says_of_every_effect_whether_and_why_and_writes_nothing() {
    let folder = folder(|scene| scene);
    let output = run(folder.path(), &["simulate", "scene.toml", "--explain"]);
    assert!(output.status.success());
    let text = said(&output);
    for words in [
        "interreflection  on",
        "1 of 1 pairs of surfaces face each other",
        "shadows          off",
        "noise            on",
        "a full well of 20000 electrons",
        "camera's rays",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert_eq!(names(folder.path()), ["scene.toml"]);
    let asked = [
        "simulate",
        "scene.toml",
        "--explain",
        "--without",
        "interreflection",
    ];
    let text = said(&run(folder.path(), &asked));
    assert!(text.contains("interreflection  off, asked for"), "{text}");
}

#[test]
fn an_effect_that_is_asked_for_and_that_the_scene_does_not_have_is_not_passed_over() {
    let folder = folder(|scene| scene);
    let asked = ["simulate", "scene.toml", "--explain", "--with", "blur"];
    let text = said(&run(folder.path(), &asked));
    assert!(
        text.contains("asked for, but the projector is in focus"),
        "{text}"
    );
}

#[test]
fn ablate_says_what_each_effect_contributes() {
    let folder = folder(|scene| scene);
    let output = run(
        folder.path(),
        &["simulate", "scene.toml", "--ablate", "--json"],
    );
    assert!(output.status.success());
    let data: Value = serde_json::from_slice(&output.stdout).expect("one object");
    let ablated = data["ablated"].as_array().expect("a list");
    let of = |name: &str| {
        ablated
            .iter()
            .find(|a| a["effect"] == name)
            .expect("listed")
    };
    // A right angle of albedo .8 returns some tenth of its light.
    let error = of("interreflection")["error"].as_f64().expect("a number");
    assert!((0.03..0.3).contains(&error), "{error}");
    assert!(of("noise")["error"].as_f64().expect("a number") > 1e-3);
}

#[test]
fn every_scene_that_comes_with_the_tools_is_explained() {
    for scene in [
        "flat-screen",
        "m-panels",
        "m-panels-painted",
        "painted-corner",
        "dome",
        "stage",
    ] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = scenes().join(format!("{scene}.toml"));
        let path = path.to_str().expect("a path");
        let output = run(folder.path(), &["simulate", path, "--explain"]);
        assert!(output.status.success(), "{scene}: {}", said(&output));
    }
}

/// Exit code and words of a scene that something is wrong with.
#[track_caller]
fn refused(change: impl Fn(String) -> String, code: i32, words: &[&str]) {
    let folder = folder(change);
    let output = run(folder.path(), &["simulate", "scene.toml", "-o", "capture"]);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(code), "{text}");
    for word in words {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert!(text.contains("next: "), "{text}");
    assert_eq!(names(folder.path()), ["scene.toml"], "nothing half-written");
}

#[test]
fn what_cannot_be_simulated_is_refused_with_its_place_and_the_next_step() {
    refused(
        |s| s.replace("rows = 4", "rovs = 4"),
        30,
        &["rovs", "line 6"],
    );
    refused(
        |s| s.replace("albedo = 0.8\n[[", "albedo = 1.8\n[["),
        30,
        &["`left`", "1.8"],
    );
    refused(
        |s| s.replace("albedo = 0.8\n[[", "albedo = nan\n[["),
        30,
        &["`left`"],
    );
    refused(
        |s| {
            s.replace(
                "[0, -0.6, 0], [-1, -0.6, 1]",
                "[0, -0.6, 0.3], [-1, -0.6, 1]",
            )
        },
        30,
        &["`left`", "off the plane"],
    );
    refused(
        |s| s.replace("field_of_view = 24", "field_of_view = inf"),
        30,
        &["field_of_view"],
    );
    refused(
        |s| {
            s.replace(
                "look_at = [0, 0, 0]\nfield_of_view = 24",
                "look_at = [0, 0, 9]\nfield_of_view = 24",
            )
        },
        30,
        &["lights none"],
    );
    refused(
        |s| s.replace("look_at = [0, 0, 0]", "look_at = [0, 0, 4]"),
        30,
        &["looks nowhere"],
    );
    refused(
        |s| s.replace("albedo = 0.8\n[[", "albedo = \"none.png\"\n[["),
        30,
        &["none.png"],
    );
    refused(|s| s.replace("full_well", "read_noise"), 30, &["full_well"]);
    refused(
        |s| s[..s.find("[[panel").unwrap_or(0)].to_owned(),
        30,
        &["no [[panel]]"],
    );
}

#[test]
fn a_folder_that_is_not_empty_is_left_alone() {
    let folder = folder(|scene| scene);
    fs::create_dir(folder.path().join("capture")).expect("made");
    fs::write(folder.path().join("capture/notes.txt"), "mine").expect("written");
    let output = run(folder.path(), &["simulate", "scene.toml", "-o", "capture"]);
    assert_eq!(output.status.code(), Some(9), "{}", said(&output));
    assert_eq!(names(&folder.path().join("capture")), ["notes.txt"]);
}

#[test]
fn words_that_are_no_effect_and_scenes_that_are_not_there_have_codes_of_their_own() {
    let folder = folder(|scene| scene);
    let output = run(
        folder.path(),
        &["simulate", "scene.toml", "--explain", "--with", "fog"],
    );
    assert_eq!(output.status.code(), Some(2));
    assert!(
        said(&output).contains("there is no effect `fog`"),
        "{}",
        said(&output)
    );
    let output = run(folder.path(), &["simulate", "other.toml", "--explain"]);
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    let output = run(folder.path(), &["simulate", "scene.toml"]);
    assert_eq!(
        output.status.code(),
        Some(2),
        "without -o there is nothing to do"
    );
}

/// A capture of the small scene, without photographs.
fn without_photographs(folder: &Path) {
    let made = run(
        folder,
        &["simulate", "scene.toml", "-o", "c", "--photos", "12"],
    );
    assert!(made.status.success(), "{}", said(&made));
    fs::rename(folder.join("c/photos"), folder.join("taken")).expect("moved");
}

fn photograph(folder: &Path, more: &[&str]) -> Output {
    let arguments = ["simulate", "scene.toml", "--photograph", "c"];
    run(folder, &[&arguments, more].concat())
}

/// Sum of the squared differences of two pictures' values.
fn difference(a: &Path, b: &Path) -> f64 {
    let values = |path: &Path| image::open(path).expect("a PNG").into_luma16();
    let (a, b) = (values(a), values(b));
    let squares = a
        .iter()
        .zip(b.iter())
        .map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
    squares.sum()
}

#[test]
fn a_folder_of_patterns_gets_the_photographs_that_it_lacks() {
    let folder = folder(|scene| scene);
    let place = folder.path();
    without_photographs(place);
    let same = |name: &str| {
        let read = |from: &str| fs::read(place.join(from).join(name)).expect("a photograph");
        read("c/photos") == read("taken")
    };
    let one = photograph(place, &["--shot", "7", "-o", "one.png"]);
    assert!(one.status.success(), "{}", said(&one));
    // Bounces end where the patterns of one pass have lost their light, so that a pattern
    // by itself differs by that little.
    let taken = |name: &str| place.join("taken").join(name);
    let (own, other) = (
        difference(&place.join("one.png"), &taken("007.png")),
        difference(&place.join("one.png"), &taken("008.png")),
    );
    assert!(own < 1e-4 * other, "{own} {other}");
    let all = photograph(place, &["--json"]);
    let data: Value = serde_json::from_slice(&all.stdout).expect("one JSON object");
    // White, black, three bits of columns and two of rows with inverses, 12 by chance.
    assert_eq!(data["photographs"], 24);
    assert!(names(&place.join("taken")).iter().all(|name| same(name)));
    fs::remove_file(place.join("c/photos/011.png")).expect("removed");
    let again = photograph(place, &["--json"]);
    let data: Value = serde_json::from_slice(&again.stdout).expect("one JSON object");
    assert_eq!(data["photographs"], 1);
    let alone = difference(&place.join("c/photos/011.png"), &taken("011.png"));
    assert!(alone < 1e-4 * other, "{alone} {other}");
}

#[test]
fn what_goes_wrong_on_purpose_is_in_the_photographs() {
    let folder = folder(|scene| scene);
    let place = folder.path();
    without_photographs(place);
    let taken = photograph(place, &["--fault", "swapped=0.5", "--fault", "dropped=0.9"]);
    assert!(taken.status.success(), "{}", said(&taken));
    assert!(!place.join("c/photos/021.png").exists());
    // The photograph named 12 shows the pattern of 13: the same but for the noise.
    let (own, other) = (
        difference(
            &place.join("c/photos/012.png"),
            &place.join("taken/012.png"),
        ),
        difference(
            &place.join("c/photos/012.png"),
            &place.join("taken/013.png"),
        ),
    );
    assert!(other < 0.01 * own, "{own} {other}");
    let refused = photograph(place, &["--fault", "flikker"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        said(&refused).contains("auto-exposure"),
        "{}",
        said(&refused)
    );
    let refused = photograph(place, &["--shot", "99", "-o", "x.png"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(said(&refused).contains("index 99"), "{}", said(&refused));
}

#[test]
fn patterns_of_another_grid_are_refused() {
    let folder = folder(|scene| scene);
    let place = folder.path();
    without_photographs(place);
    let other = fs::read_to_string(place.join("scene.toml")).expect("there");
    fs::write(
        place.join("scene.toml"),
        other.replace("cols = 6", "cols = 5"),
    )
    .expect("written");
    let refused = photograph(place, &[]);
    assert_eq!(refused.status.code(), Some(4));
    let said = said(&refused);
    assert!(
        said.contains("4 x 6 cells") && said.contains("has 4 x 5"),
        "{said}"
    );
}

#[test]
fn a_lamp_that_drifts_darkens_later_photographs_and_a_lens_bends_them() {
    let folder = folder(|scene| {
        let scene = scene.replace("cols = 6", "cols = 6\ndrift = 0.1");
        scene.replace("full_well = 20000", "distortion = [0.1, 0]")
    });
    let place = folder.path();
    let made = run(
        place,
        &["simulate", "scene.toml", "-o", "c", "--photos", "12"],
    );
    assert!(made.status.success(), "{}", said(&made));
    let made = run(
        place,
        &[
            "simulate",
            "scene.toml",
            "-o",
            "d",
            "--photos",
            "12",
            "--without",
            "drift",
        ],
    );
    assert!(made.status.success(), "{}", said(&made));
    let sum = |name: &str| -> f64 {
        let picture = image::open(place.join(name)).expect("a PNG").into_luma16();
        picture.iter().map(|value| f64::from(*value)).sum()
    };
    // The last photograph has lost what the scene says, the first nothing.
    assert!((sum("c/photos/023.png") / sum("d/photos/023.png") - 0.9).abs() < 1e-3);
    assert!((sum("c/photos/000.png") / sum("d/photos/000.png") - 1.0).abs() < 1e-9);
    let made = run(
        place,
        &[
            "simulate",
            "scene.toml",
            "-o",
            "e",
            "--photos",
            "12",
            "--without",
            "distortion",
        ],
    );
    assert!(made.status.success(), "{}", said(&made));
    assert_ne!(
        fs::read(place.join("c/photos/000.png")).expect("there"),
        fs::read(place.join("e/photos/000.png")).expect("there")
    );
}
