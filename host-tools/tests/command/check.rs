//! `iltm check`, and the same gates before `iltm solve`, on the sample capture.

use super::user::{User, contains};

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
    // They add up within 2.6 % only: too little to tell responses apart.
    assert_eq!(data["not_judged"], serde_json::json!(["response"]));
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
