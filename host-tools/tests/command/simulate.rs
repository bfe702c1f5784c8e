//! `iltm simulate` as a user meets it, the wrong ways in particular.

use super::user::{User, contains, with_values};
use std::fs;
use std::path::Path;

/// A small scene, two walls that face each other.
pub(crate) const CORNER: &str = "name = \"Corner\"
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
/// With the small scene, in which words are replaced.
fn user(replaced: &[(&str, &str)]) -> User {
    let mut scene = CORNER.to_owned();
    for (from, to) in replaced {
        assert!(scene.contains(from), "{from}");
        scene = scene.replace(from, to);
    }
    let user = User::new();
    user.write("scene.toml", scene);
    user
}

#[test]
fn a_scene_becomes_a_capture_that_solve_takes() {
    let user = user(&[]);
    let data = user.json("simulate scene.toml -o capture --photos 40");
    // White, black, 2 bits of rows and 3 of columns with inverses, and 40 more.
    assert_eq!(data["photographs"], 52);
    assert_eq!(data["effects"].as_array().map(Vec::len), Some(19));
    assert_eq!(user.names(""), ["capture", "scene.toml"]);
    user.says("solve capture -o t.iltm");
}

#[test]
fn explain_says_of_every_effect_whether_and_why_and_writes_nothing() {
    let user = user(&[]);
    let said = user.says("simulate scene.toml --explain");
    contains(
        &said,
        &[
            "interreflection  on",
            "1 of 1 pairs of surfaces face each other",
            "shadows          off",
            "noise            on",
            "a full well of 20000 electrons",
            "camera's rays",
        ],
    );
    assert_eq!(user.names(""), ["scene.toml"]);
    let said = user.says("simulate scene.toml --explain --without interreflection");
    contains(&said, &["interreflection  off, asked for"]);
}

#[test]
fn an_effect_that_is_asked_for_and_that_the_scene_does_not_have_is_not_passed_over() {
    let said = user(&[])
        .run("simulate scene.toml --explain --with blur")
        .said;
    contains(&said, &["asked for, but the projector is in focus"]);
}

#[test]
fn ablate_says_what_each_effect_contributes() {
    let data = user(&[]).json("simulate scene.toml --ablate");
    let ablated = data["ablated"].as_array().expect("a list");
    let error = |name: &str| {
        let effect = ablated.iter().find(|a| a["effect"] == name);
        effect.expect("listed")["error"].as_f64().expect("a number")
    };
    // A right angle of albedo .8 returns some tenth of its light.
    let light = error("interreflection");
    assert!((0.03..0.3).contains(&light), "{light}");
    assert!(error("noise") > 1e-3);
}

#[test]
fn every_scene_that_comes_with_the_tools_is_explained() {
    let user = User::new();
    user.copy(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"),
        "scenes",
    );
    let names = user.names("scenes");
    let scenes: Vec<&str> = names
        .iter()
        .filter_map(|name| name.strip_suffix(".toml"))
        .collect();
    assert!(scenes.len() > 10, "{scenes:?}");
    // Its four projectors before a mesh take a minute with any number of cells.
    for name in scenes.into_iter().filter(|name| *name != "dome-of-four") {
        // As few cells take a fraction of the time.
        let path = format!("scenes/{name}.toml");
        let coarse = with_values(&user.text(&path), &[("rows", 6), ("cols", 6)]);
        user.write(&path, coarse);
        user.says(&format!("simulate {path} --explain"));
    }
}

#[test]
fn what_cannot_be_simulated_is_refused_with_its_place_and_the_next_step() {
    let panels = &CORNER[CORNER.find("[[panel").expect("two")..];
    let left = "albedo = 0.8\n[[";
    let one =
        &CORNER[CORNER.find("[projector").expect("one")..CORNER.find("[camera").expect("one")];
    // The same again, with a line that says something else.
    let two = |line: &str| {
        let key = line.split(' ').next().expect("a key");
        let table = one.replace("[projector]", "[[projector]]");
        let lines = table.lines().filter(|line| !line.starts_with(key));
        let second: Vec<&str> = lines.chain([line, ""]).collect();
        table.clone() + &second.join("\n")
    };
    let named = "name = \"wall\"";
    let named_alike = two(named).replacen("]]\n", &format!("]]\n{named}\n"), 1);
    for (from, to, words) in [
        ("rows = 4", "rovs = 4", &["rovs", "line 6"][..]),
        (left, "albedo = 1.8\n[[", &["`left`", "1.8"]),
        (left, "albedo = nan\n[[", &["`left`"]),
        (left, "albedo = \"none.png\"\n[[", &["none.png"]),
        (
            "[0, -0.6, 0], [-1, -0.6, 1]",
            "[0, -0.6, 0.3], [-1, -0.6, 1]",
            &["`left`", "off the plane"],
        ),
        (
            "field_of_view = 24",
            "field_of_view = inf",
            &["field_of_view"],
        ),
        (
            "look_at = [0, 0, 0]\nfield_of_view = 24",
            "look_at = [0, 0, 9]\nfield_of_view = 24",
            &["lights none"],
        ),
        (
            "look_at = [0, 0, 0]",
            "look_at = [0, 0, 4]",
            &["looks nowhere"],
        ),
        ("full_well", "read_noise", &["full_well"]),
        (one, "projector = []\n", &["there is no [projector]"]),
        (one, &two("clos = 6"), &["clos"]),
        (
            one,
            &two("name = \"1\""),
            &["[projector] name is \"1\"", "called by its number"],
        ),
        (
            one,
            &named_alike,
            &["[projector] name is \"wall\"", "another for each"],
        ),
        (panels, "", &["no [[panel]]"]),
    ] {
        let user = user(&[(from, to)]);
        let said = user.fails(30, "simulate scene.toml -o capture");
        contains(&said, words);
        contains(&said, &["next: "]);
        assert_eq!(user.names(""), ["scene.toml"], "nothing half-written");
    }
}

#[test]
fn a_folder_that_is_not_empty_is_left_alone() {
    let user = user(&[]);
    fs::create_dir(user.path("capture")).expect("made");
    user.write("capture/notes.txt", "mine");
    user.fails(9, "simulate scene.toml -o capture");
    assert_eq!(user.names("capture"), ["notes.txt"]);
}

#[test]
fn words_that_are_no_effect_and_scenes_that_are_not_there_have_codes_of_their_own() {
    let user = user(&[]);
    let said = user.fails(2, "simulate scene.toml --explain --with fog");
    contains(&said, &["there is no effect `fog`"]);
    user.fails(3, "simulate other.toml --explain");
    // Without -o there is nothing to do.
    user.fails(2, "simulate scene.toml");
}

/// With a capture `c` of the small scene whose photographs are in `taken`.
fn without_photographs() -> User {
    let user = user(&[]);
    without_photographs_in(&user, "c");
    user
}

/// Makes a capture of the small scene whose photographs are in `taken`.
pub(crate) fn without_photographs_in(user: &User, capture: &str) {
    user.write("scene.toml", CORNER);
    user.says(&format!("simulate scene.toml -o {capture} --photos 12"));
    user.rename(&format!("{capture}/photos"), "taken");
}

const PHOTOGRAPH: &str = "simulate scene.toml --photograph c";

/// Sum of the squared differences of two pictures' values.
fn difference(user: &User, a: &str, b: &str) -> f64 {
    let [a, b] = [a, b].map(|name| user.picture(name).into_luma16());
    let pairs = a.iter().zip(b.iter());
    pairs.map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum()
}

#[test]
fn a_folder_of_patterns_gets_the_photographs_that_it_lacks() {
    let user = without_photographs();
    user.says(&format!("{PHOTOGRAPH} --shot 7 -o one.png"));
    // Bounces end where the patterns of one pass have lost their light, so that a pattern
    // by itself differs by that little.
    let own = difference(&user, "one.png", "taken/007.png");
    let other = difference(&user, "one.png", "taken/008.png");
    assert!(own < 1e-4 * other, "{own} {other}");
    // White, black, three bits of columns and two of rows with inverses, 12 by chance.
    assert_eq!(user.json(PHOTOGRAPH)["photographs"], 24);
    for name in user.names("taken") {
        let same = user.read(&format!("c/photos/{name}")) == user.read(&format!("taken/{name}"));
        assert!(same, "{name}");
    }
    user.remove("c/photos/011.png");
    assert_eq!(user.json(PHOTOGRAPH)["photographs"], 1);
    let alone = difference(&user, "c/photos/011.png", "taken/011.png");
    assert!(alone < 1e-4 * other, "{alone} {other}");
    assert_eq!(user.json(PHOTOGRAPH)["photographs"], 0);
}

#[test]
fn what_goes_wrong_on_purpose_is_in_the_photographs() {
    let user = without_photographs();
    let faults = "--fault swapped=0.5 --fault dropped=0.9";
    user.says(&format!("{PHOTOGRAPH} {faults}"));
    assert!(!user.path("c/photos/021.png").exists());
    // The photograph named 12 shows the pattern of 13: the same but for the noise.
    let own = difference(&user, "c/photos/012.png", "taken/012.png");
    let other = difference(&user, "c/photos/012.png", "taken/013.png");
    assert!(other < 0.01 * own, "{own} {other}");
    let said = user.fails(2, &format!("{PHOTOGRAPH} --fault flikker"));
    contains(&said, &["auto-exposure"]);
    let said = user.fails(2, &format!("{PHOTOGRAPH} --shot 99 -o x.png"));
    contains(&said, &["index 99"]);
}

#[test]
fn patterns_of_another_grid_are_refused() {
    let user = without_photographs();
    user.write("scene.toml", CORNER.replace("cols = 6", "cols = 5"));
    let said = user.fails(4, PHOTOGRAPH);
    contains(&said, &["4 x 6 cells", "has 4 x 5"]);
}

#[test]
fn slides_of_one_of_several_projectors_are_photographed_while_the_others_show_black() {
    let user = user(&[
        ("[projector]\n", "[[projector]]\nname = \"near\"\n"),
        (
            "[camera]",
            "[[projector]]
position = [0.1, 0, 4]
look_at = [0, 0, 0]
field_of_view = 24
rows = 4
cols = 6
[camera]",
        ),
    ]);
    user.says("patterns -o near --rows 4 --cols 6 --photos 10 --projector 60x40");
    user.says("patterns -o both --rows 4 --cols 12 --photos 10 --projector 120x40");
    let simulate = "simulate scene.toml --photograph";
    let said = user.fails(2, &format!("{simulate} near --projector far"));
    contains(
        &said,
        &["no projector `far`", "there is `near`, `2`", "next: "],
    );
    let said = user.fails(2, "simulate scene.toml --explain --projector near");
    contains(&said, &["--photograph"]);
    let said = user.fails(4, &format!("{simulate} near"));
    contains(&said, &["side by side, have 4 x 12", "--projector"]);
    // By name and by number, all and one alone.
    user.says(&format!("{simulate} near --projector near"));
    user.says(&format!("{simulate} near --projector 1 --shot 0 -o 1.png"));
    user.says(&format!("{simulate} near --projector 2 --shot 0 -o 2.png"));
    user.says(&format!("{simulate} both --shot 0 -o both.png"));
    // But for the bounces, which end where the patterns of one pass have lost their light.
    let own = difference(&user, "1.png", "near/photos/000.png");
    let other = difference(&user, "1.png", "2.png");
    assert!(own < 1e-4 * other, "{own} {other}");
    let light = |name: &str| -> f64 {
        let picture = user.picture(name).into_luma16();
        picture.iter().map(|value| f64::from(*value)).sum()
    };
    // Both throw about as much onto the same walls, and their light adds up.
    let [one, two, both] = ["1.png", "2.png", "both.png"].map(light);
    assert!(
        ((one + two) / both - 1.0).abs() < 0.01,
        "{one} {two} {both}"
    );
    assert!((one / both - 0.5).abs() < 0.05, "{one} {both}");
    let said = user.says(&format!("{simulate} near --projector near"));
    contains(&said, &["every photograph is there"]);
}

#[test]
fn a_projector_that_is_the_only_one_may_be_named() {
    let user = without_photographs();
    user.says(&format!("{PHOTOGRAPH} --projector 1 --shot 3 -o one.png"));
    user.says(&format!("{PHOTOGRAPH} --shot 3 -o same.png"));
    assert_eq!(user.read("one.png"), user.read("same.png"));
}

#[test]
fn a_lamp_that_drifts_darkens_later_photographs_and_a_lens_bends_them() {
    let user = user(&[
        ("cols = 6", "cols = 6\ndrift = 0.1"),
        ("full_well = 20000", "distortion = [0.1, 0]"),
    ]);
    for without in ["c", "d --without drift", "e --without distortion"] {
        user.says(&format!("simulate scene.toml --photos 12 -o {without}"));
    }
    let sum = |name: &str| -> f64 {
        let picture = user.picture(name).into_luma16();
        picture.iter().map(|value| f64::from(*value)).sum()
    };
    // The last photograph has lost what the scene says, the first nothing.
    assert!((sum("c/photos/023.png") / sum("d/photos/023.png") - 0.9).abs() < 1e-3);
    assert!((sum("c/photos/000.png") / sum("d/photos/000.png") - 1.0).abs() < 1e-9);
    assert_ne!(user.read("c/photos/000.png"), user.read("e/photos/000.png"));
}
