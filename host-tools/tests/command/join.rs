//! `iltm join`: photographs from two places as one capture of each projector; what cannot be joined.

use super::user::{User, contains, with_values};
use std::fs;

const PARTS: [&str; 5] = ["", "patterns", "photos", "calibration", "slides"];

/// With slides of both projectors for two places, `a` and `b`, not yet photographed.
fn prepared() -> User {
    let user = User::new();
    let few = [("rows", 5), ("cols", 8), ("width", 200), ("height", 125)];
    let scene = include_str!("../../scenes/folded-screen.toml");
    user.write("scene.toml", with_values(scene, &few));
    for place in ["a", "b"] {
        user.says(&format!(
            "patterns -o {place} --rows 5 --cols 8 --photos 10 --projector left=80x50 --projector right=80x50"
        ));
    }
    user
}

#[test]
fn photographs_from_two_places_become_one_capture_of_each_projector() {
    let user = prepared();
    let taken = user.says("simulate scene.toml --photograph a --pose 'before left'");
    contains(&taken, &["session     a: 170 photographs taken"]);
    user.says("simulate scene.toml --photograph b --pose 2");
    let again = user.says("simulate scene.toml --photograph b --pose 2");
    contains(&again, &["every photograph is there"]);
    let said = user.says("join a b -o whole");
    contains(
        &said,
        &[
            "ok   drift",
            "as bright as from a",
            "ok   movement",
            "pose        a sees cells: 40 of left, ",
            "together    cells: 40 of left, 40 of right, of 80 in all",
            "next        iltm check whole/left whole/right",
        ],
    );
    contains(
        &user.says("check whole/left whole/right"),
        &["40 of 40 cells", "passed"],
    );
    let data = user.json("join b a -o turned");
    assert_eq!(data["captures"][1]["capture"], "turned/right");
    assert_eq!(data["captures"][1]["seen"], 40);
    assert_eq!(data["poses"][0]["pose"], "b");
    assert_eq!(data["gates"][0]["verdict"], "pass");
    // A capture is a pose as well as a folder of captures is. A photograph of the calibration that is not
    // there from both places is left out.
    let calibration = user.text("a/left/calibration.csv");
    let photo = calibration
        .lines()
        .last()
        .unwrap()
        .rsplit(',')
        .next()
        .unwrap();
    user.remove(&format!("b/left/{photo}"));
    contains(
        &user.says("join a/left b/left -o left"),
        &["together    cells: 40, of 40 in all"],
    );
    assert!(user.path("left/capture.csv").exists());
    assert!(user.path("whole/left").join(photo).exists());
    assert!(!user.path("left").join(photo).exists());
    // Nothing is written over.
    let refused = user.run("join a b -o whole");
    assert_ne!(refused.code, 0);
    contains(&refused.with_code(), &["whole/left"]);
    let refused = user.run("join a a -o twice");
    contains(&refused.with_code(), &["given twice"]);
}

#[test]
fn what_is_no_pose_is_refused_before_photographs_are_read() {
    let user = prepared();
    for part in PARTS {
        user.copy(&user.path("a/left").join(part), &format!("one/left/{part}"));
    }
    fs::create_dir(user.path("empty")).unwrap();
    for (line, says) in [
        ("join a none -o c", "none: "),
        (
            "join a empty -o c",
            "neither a capture nor a folder of captures",
        ),
        (
            "join a one -o c",
            "one: its captures have other names than those of a",
        ),
        (
            "join a a/left -o c",
            "a/left: its captures have other names than those of a",
        ),
        ("join a b -o c", "a/left"),
        (
            "simulate scene.toml --photograph a --pose middle",
            "there is `before left`, `before right`",
        ),
        (
            "simulate SCENES/dome.toml --explain --pose 1",
            "the scene has no [[pose]]",
        ),
    ] {
        let said = user.run(line);
        assert_ne!(said.code, 0, "{line}");
        contains(&said.with_code(), &[says]);
        assert!(!user.path("c/left").exists(), "{line}");
    }
}
