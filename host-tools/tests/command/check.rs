//! `iltm check`, and the same gates before `iltm solve`, on the sample capture.

use super::user::{User, contains};
use iltm::picture::npy::FloatArray;
use std::fs;

#[test]
fn the_sample_passes_every_gate_and_has_a_page() {
    let user = User::new();
    let checked = user.run("check SAMPLE -o page");
    assert_eq!(checked.code, 0, "{}", checked.said);
    // The result goes to standard output, so that it can be piped.
    assert_eq!(checked.out, checked.said);
    assert!(!checked.said.contains("FAIL"), "{}", checked.said);
    contains(&checked.said, &["order"]);
    let page = user.text("page/check.html");
    assert_eq!(page.matches("<details class=\"gate").count(), 11);
    contains(
        &page,
        &[
            "Passed",
            "White as the camera sees it",
            "No pixel is clipped",
        ],
    );
    let data = user.json("check SAMPLE");
    assert_eq!(data["pass"], true);
    assert_eq!(data["not_judged"], serde_json::json!([]));
    assert_eq!(data["cells"]["live"], 273);
}

#[test]
fn a_gate_that_fails_stops_check_and_solve_unless_it_is_ignored() {
    let user = User::with_capture();
    user.rename("capture/photos/030.png", "other");
    user.rename("capture/photos/044.png", "capture/photos/030.png");
    user.rename("other", "capture/photos/044.png");
    let checked = user.run("check capture --json");
    assert_eq!(checked.code, 5);
    let found = checked.json();
    let gates = found["gates"].as_array().expect("gates");
    // What follows from exchanged photographs is neither good nor bad yet.
    for (name, verdict) in [
        ("order", "fail"),
        ("complete", "pass"),
        ("noise", "not-judged"),
    ] {
        let gate = gates.iter().find(|gate| gate["name"] == name);
        assert_eq!(gate.expect("judged")["verdict"], verdict, "{name}");
    }
    assert_eq!(found["error"]["kind"], "photographs");
    let refused = user.run("solve capture -o t.iltm --json");
    assert_eq!(refused.code, 5);
    let message = refused.json()["error"]["message"].to_string();
    let exchanged = "photos/030.png and photos/044.png are exchanged";
    contains(&message, &[exchanged]);
    assert!(!user.path("t.iltm").exists());
    let solved = user.json("solve capture -o t.iltm --ignore order");
    assert_eq!(solved["ignored_gates"][0], "order");
    let inspected = user.json("inspect t.iltm").to_string();
    contains(&inspected, &["ignored_gates"]);
}

#[test]
fn names_in_a_stranger_s_folder_do_not_command_the_terminal() {
    let user = User::with_capture();
    let list = user.text("capture/capture.csv");
    // Sets the title of a terminal's window.
    let title = "\x1b]0;mine\x07";
    user.write("capture/capture.csv", list.replacen("white", title, 1));
    let ended = user.run("check capture");
    assert_ne!(ended.code, 0);
    contains(&ended.said, &["mine"]);
    let obeyed = |c: char| c.is_control() && c != '\n';
    assert!(!ended.said.contains(obeyed), "{:?}", ended.said);
}

#[test]
fn too_few_patterns_for_a_solve_are_refused_before_the_work() {
    let said = User::new().fails(2, "patterns -o p --rows 4 --cols 4 --photos 9");
    contains(&said, &["at least 10"]);
}

#[test]
fn a_gate_that_does_not_exist_is_a_mistake_in_the_command() {
    let said = User::new().fails(2, "solve SAMPLE -o t.iltm --ignore exposure");
    contains(&said, &["saturation"]);
}

/// A session of the M-shaped panels with fine stripes, photographed.
fn with_stripes() -> User {
    let user = User::new();
    user.says("patterns -o c --rows 13 --cols 21 --photos 10 --projector 174x110 --border 3 --no-calibration");
    user.says("simulate SCENES/m-panels.toml --photograph c");
    user
}

#[test]
fn a_map_says_which_pixel_of_the_projector_each_pixel_of_the_camera_sees() {
    let user = with_stripes();
    let map = &user.json("check c --map wall.npy")["map"];
    assert_eq!(map["source"], "waves", "{map}");
    assert_eq!(map["projector"], serde_json::json!([174, 110]));
    assert!(map["uncertainty"].as_f64().unwrap() < 0.2, "{map}");
    let array = FloatArray::read(&user.read("wall.npy")).unwrap();
    assert_eq!(array.shape, [132, 192, 2]);
    // The middle of the projection, seen from beside it.
    let middle = 2 * (66 * 192 + 96);
    assert!((60.0..110.0).contains(&array.values[middle]));
    assert!(array.values[0].is_nan());
    let known = array.values.iter().filter(|at| !at.is_nan()).count();
    assert_eq!(Some(known as u64 / 2), map["known"].as_u64());
    let said = user.says("check c --map wall.exr");
    contains(&said, &["wall.exr: ", "from fine stripes"]);
    let picture = user.picture("wall.exr").into_rgb32f();
    assert_eq!(picture.dimensions(), (192, 132));
    user.fails(2, "check c --map wall.png");
    let without = user.json("check SAMPLE --map cells.npy");
    assert_eq!(without["map"]["source"], "cells");
}

#[test]
fn fine_stripes_that_are_missing_or_out_of_order_are_named_and_the_rest_is_used() {
    let user = with_stripes();
    let slide = |role: &str| {
        let list = user.text("c/stripes.csv");
        let line = list
            .lines()
            .find(|line| line.contains(&format!(",{role},")))
            .unwrap();
        line.split(',').nth(3).unwrap().to_owned()
    };
    let [wave, code] = ["column-wave-2", "column-5-inverse"].map(slide);
    user.rename(&format!("c/{wave}"), "kept");
    let said = user.fails(5, "check c --map wall.npy");
    contains(&said, &[&wave, "1 in all"]);
    assert!(!user.path("wall.npy").exists());
    let said = user.says("check c");
    contains(&said, &["warn stripes", "iltm capture"]);
    let said = user.says("solve c -o t.iltm");
    contains(&said, &["gains follow the cells alone"]);
    user.rename("kept", &format!("c/{wave}"));
    assert!(user.json("check c")["map_fault"].is_null());
    let other = slide("column-5");
    user.rename(&format!("c/{code}"), "kept");
    user.rename(&format!("c/{other}"), &format!("c/{code}"));
    user.rename("kept", &format!("c/{other}"));
    let said = user.fails(5, "check c --map wall.npy");
    contains(&said, &["contradict each other"]);
}

#[test]
fn calibration_photographs_that_are_missing_are_named_and_the_last_line_says_so() {
    let user = User::new();
    user.says("patterns -o c --rows 13 --cols 21 --photos 20 --projector 174x110 --border 3");
    user.says("simulate SCENES/m-panels.toml --photograph c");
    let whole = user.says("check c");
    assert!(!whole.contains("calibration   "), "{whole}");
    let list = user.text("c/calibration.csv");
    let line = list.lines().nth(3).unwrap();
    user.remove(&format!("c/{}", line.rsplit(',').next().unwrap().trim()));
    let said = user.says("check c");
    contains(
        &said,
        &[
            "warn calibration   1 of ",
            "see the remarks on ",
            "calibration above",
        ],
    );
    contains(&user.says("solve c -o t.iltm"), &["note        1 of "]);
}

/// The camera has a pixel for 7.6 of the projector's along a row, and for 4.6 along a column.
#[test]
fn a_camera_that_sees_waves_along_one_axis_alone_gets_the_map_that_it_can_tell() {
    let user = User::new();
    user.says(
        "patterns -o c --rows 13 --cols 21 --photos 10 --projector 1200x420 --no-calibration",
    );
    user.says("simulate SCENES/m-panels.toml --photograph c");
    let told = user.json("check c");
    assert!(told["map_fault"].is_null(), "{told}");
    let map = &user.json("check c --map wall.npy")["map"];
    assert_eq!(map["source"], "code", "{map}");
    // The code's stripes are four pixels wide at most.
    assert!(map["uncertainty"].as_f64().unwrap() < 2.0, "{map}");
}

/// A rig of others: Gray code down to the pixel of a small projector, seen by a camera with four
/// pixels for each.
#[test]
fn a_gray_code_to_the_pixel_gives_a_map_without_any_other_pattern() {
    let user = User::new();
    let (width, height) = (256_u32, 160);
    let mut roles = vec!["white".to_owned(), "black".to_owned()];
    for axis in ["column", "row"] {
        for bit in 0..8 {
            roles.push(format!("{axis}-{bit}"));
            roles.push(format!("{axis}-{bit}-inverse"));
        }
    }
    let lit = |role: &str, x: u32, y: u32| {
        let words: Vec<&str> = role.split('-').collect();
        let at = if words[0] == "column" { x } else { y };
        match words.get(1) {
            None => role == "white",
            Some(bit) => {
                let bit = 7 - bit.parse::<u32>().unwrap();
                ((at ^ (at >> 1)) >> bit) & 1 == u32::from(words.len() == 2)
            }
        }
    };
    let mut list = vec!["index,role,pattern,photo".to_owned()];
    for folder in ["c", "c/patterns", "c/photos"] {
        fs::create_dir(user.path(folder)).unwrap();
    }
    for (index, role) in roles.iter().enumerate() {
        let name = format!("{index:03}.png");
        list.push(format!("{index},{role},patterns/{name},photos/{name}"));
        let code = |x, y| image::Luma([255 * u8::from(lit(role, x, y))]);
        let pattern = image::ImageBuffer::from_fn(width, height, code);
        pattern.save(user.path("c/patterns").join(&name)).unwrap();
        let photo = image::ImageBuffer::from_fn(2 * width + 40, 2 * height + 20, |x, y| {
            let seen = x.checked_sub(20).zip(y.checked_sub(10));
            let lit = seen
                .is_some_and(|(x, y)| x < 2 * width && y < 2 * height && lit(role, x / 2, y / 2));
            image::Luma([12 + 180 * u8::from(lit)])
        });
        photo.save(user.path("c/photos").join(&name)).unwrap();
    }
    user.write("c/capture.csv", list.join("\n"));
    let run = user.run("check c --map wall.npy --json");
    let map = &run.json()["map"];
    assert_eq!(map["source"], "code", "{}", run.said);
    assert_eq!(map["projector"], serde_json::json!([256, 160]));
    let array = FloatArray::read(&user.read("wall.npy")).unwrap();
    for (x, y) in [(20, 10), (201, 77), (531, 329), (288, 200)] {
        let at = 2 * (y * 552 + x);
        // Two pixels of the camera see one of the projector, each a quarter off its middle.
        let wanted = [x as f64 - 20.5, y as f64 - 10.5].map(|at| at / 2.0);
        for (found, wanted) in array.values[at..].iter().zip(wanted) {
            assert!((found - wanted).abs() < 0.3, "{x} {y}: {found} {wanted}");
        }
    }
    assert!(array.values[0].is_nan());
}
