//! `iltm verify` as a user meets it: the whole way with simulated photographs, and the
//! wrong ways.

use super::user::{User, contains};
use std::fs;
use std::sync::OnceLock;

/// With a table, and a folder `v` to verify it with, photographed.
fn photographed() -> &'static User {
    static USER: OnceLock<User> = OnceLock::new();
    USER.get_or_init(|| {
        let user = User::new();
        for line in [
            "simulate SCENES/m-panels.toml -o c --photos 80",
            "solve c -o t.iltm",
            "verify t.iltm -o v --projector 640x400 --border 3",
            "simulate SCENES/m-panels.toml --photograph v --seed 9",
        ] {
            user.says(line);
        }
        user
    })
}

/// The same in a folder that may be harmed.
pub(crate) fn copy() -> User {
    let user = User::new();
    user.write("t.iltm", photographed().read("t.iltm"));
    for part in ["v", "v/patterns", "v/photos", "v/slides", "v/wanted"] {
        user.copy(&photographed().path(part), part);
    }
    user
}

/// How far the brightness of white that photographs show is off the one that the table says.
fn brightness_off(verdict: &serde_json::Value, user: &User) -> f64 {
    let table = user.json("inspect t.iltm");
    let said = table["brightness"]["mean"].as_f64().unwrap();
    verdict["brightness"].as_f64().unwrap() / said - 1.0
}

#[test]
fn a_good_table_passes_and_a_bound_below_the_noise_tells_nothing_with_the_same_figures() {
    let user = photographed();
    let figures = user.json("verify t.iltm v --report r");
    assert_eq!(figures["outcome"], "passed");
    let off = brightness_off(&figures, user);
    assert!(off.abs() < 0.05, "{off}: {figures}");
    let error = |half: &str| figures["mean_error"][half].as_f64().unwrap();
    assert!(error("after") < 0.1 * error("before"), "{figures}");
    for file in [
        "verdict.html",
        "worst-cells.png",
        "drift.png",
        "worst-seen.png",
        "0-after.png",
    ] {
        assert!(user.path("r").join(file).is_file(), "{file}");
    }
    let failed = user.run("--json verify t.iltm v --bound 0.0001");
    let again = failed.json();
    // The noise of the photographs alone is more.
    assert_eq!(failed.code, 34);
    assert_eq!(again["error"]["kind"], "inconclusive");
    assert_eq!(
        (&again["outcome"], &again["mean_error"]),
        (&"inconclusive".into(), &figures["mean_error"])
    );
    // The slides have the projector's size, the border and the cells.
    let slide = user.picture("v/slides/000.png").into_luma8();
    assert_eq!(slide.dimensions(), (640, 400));
    let row = [2, 3, 637].map(|x| slide[(x, 200)][0]);
    assert_eq!(row, [0, 255, 0]);
}

#[test]
fn a_refined_table_errs_less_at_the_pixels_and_is_what_devices_take() {
    let user = copy();
    let before = user.json("verify t.iltm v")["viewer"].clone();
    let said = user.json("refine t.iltm v -o u.iltm");
    assert_eq!(said["refined"], true, "{said}");
    user.says("verify u.iltm -o w --projector 640x400 --border 3");
    user.says("simulate SCENES/m-panels.toml --photograph w --seed 10");
    let verdict = user.json("verify u.iltm w");
    assert_eq!(verdict["outcome"], "passed", "{verdict}");
    let after = &verdict["viewer"];
    let error = |of: &serde_json::Value| of["after"].as_f64().unwrap();
    assert!(error(after) < 0.85 * error(&before), "{before} {after}");
    // The step was held against images that it was not made from: they promise no more.
    let promised = said["error"]["after"].as_f64().unwrap();
    assert!(promised > 0.9 * error(after), "{said} {after}");
    let inspected = user.says("inspect u.iltm");
    contains(
        &inspected,
        &["refined     20", "by photographs of the wall"],
    );
    // Everything but gains, dates and words is the table's own.
    let [own, refined] = ["t", "u"].map(|name| user.json(&format!("inspect {name}.iltm")));
    assert_ne!(own["id"], refined["id"]);
    for field in ["effects", "name", "reference_white", "rows", "channels"] {
        assert_eq!(own[field], refined[field], "{field}");
    }
}

#[test]
fn a_table_is_refined_only_with_photographs_that_are_fit_for_it() {
    let user = copy();
    // Not of this folder's table.
    user.says("refine t.iltm v -o u.iltm");
    user.fails(37, "refine u.iltm v -o x.iltm");
    user.fails(9, "refine t.iltm v -o nowhere/x.iltm");
    fs::remove_dir_all(user.path("v/photos")).unwrap();
    user.says("simulate SCENES/m-panels.toml --photograph v --seed 9 --fault tripod=1");
    contains(
        &user.fails(34, "refine t.iltm v -o x.iltm"),
        &["cannot be fed back", "moved"],
    );
    user.says("verify t.iltm -o n --no-dense --projector 640x400");
    user.says("simulate SCENES/m-panels.toml --photograph n");
    contains(
        &user.fails(4, "refine t.iltm n -o x.iltm"),
        &["no fine stripes", "--no-dense"],
    );
    fs::remove_dir_all(user.path("v/photos")).unwrap();
    user.says("simulate SCENES/m-panels.toml --photograph v --seed 9");
    // Without a stripe there is a verdict on the cells, and none on what a viewer sees.
    let stripes = String::from_utf8(user.read("v/stripes.csv")).unwrap();
    let stripe = stripes
        .lines()
        .nth(1)
        .and_then(|line| line.rsplit(',').next());
    user.remove(&format!("v/{}", stripe.unwrap().trim()));
    let missing = "photographs of fine stripes are missing";
    contains(
        &user.says("verify t.iltm v"),
        &["viewer      not judged", missing, "PASSED"],
    );
    contains(&user.fails(5, "refine t.iltm v -o x.iltm"), &[missing]);
    user.remove("v/photos/030.png");
    contains(&user.fails(4, "refine t.iltm v -o x.iltm"), &["missing"]);
    assert!(!user.path("x.iltm").exists());
}

/// The same photographs taken anew with a fault, judged.
fn with_fault(user: &User, fault: &str) -> serde_json::Value {
    fs::remove_dir_all(user.path("v/photos")).unwrap();
    user.says(&format!(
        "simulate SCENES/m-panels.toml --photograph v --seed 9 --fault {fault}"
    ));
    user.run("--json verify t.iltm v").json()
}

#[test]
fn bad_photographs_pass_no_table_and_fail_none_and_the_cause_is_named() {
    let user = copy();
    for (fault, cause) in [("tripod=1", "moved"), ("gamma=1.2", "camera-response")] {
        let said = with_fault(&user, fault);
        assert_eq!(said["error"]["exit"], 34, "{fault}: {said}");
        let found = (&said["outcome"], &said["cause"]);
        assert_eq!(found, (&"inconclusive".into(), &cause.into()), "{said}");
        // Nor do they tell what a viewer sees, or how bright white is.
        assert!(said["viewer"].is_null(), "{said}");
        assert!(said["brightness"].is_null(), "{said}");
        let people = user.fails(34, "verify t.iltm v");
        let unknown = ["viewer      not judged", "brightness  Not judged"];
        contains(&people, &unknown);
    }
    // What is wrong on the wall stays wrong.
    let said = with_fault(&user, "vivid");
    assert_eq!(said["error"]["exit"], 31, "{said}");
    let people = user.fails(31, "verify t.iltm v");
    contains(&people, &["; it is their squares that add up)"]);
    let why = people
        .lines()
        .find_map(|it| it.strip_prefix("verdict     FAILED: "));
    assert_eq!(
        people.matches(why.expect("a verdict")).count(),
        1,
        "{people}"
    );
}

#[test]
fn a_chain_that_compensates_once_passes_and_every_other_is_named() {
    let user = copy();
    user.says("verify t.iltm -o w --wanted --projector 640x400 --border 3");
    for (chain, exit, said) in [
        ("once", 0, ""),
        ("off", 31, "does not compensate"),
        ("twice", 31, "compensates twice"),
        ("mirrored", 31, "is mirrored"),
        // One cell of the 21 that the projector's 634 pixels have.
        ("shifted=30", 31, "The picture lies 1.00 to the right"),
    ] {
        fs::remove_dir_all(user.path("w/photos")).unwrap();
        user.says(&format!(
            "simulate SCENES/m-panels.toml --photograph w --seed 9 --chain {chain} --table t.iltm"
        ));
        let run = user.run("--json verify t.iltm w");
        assert_eq!(run.code, exit, "{chain}: {}", run.said);
        let verdict = run.json();
        if exit == 0 {
            assert_eq!(verdict["outcome"], "passed", "{verdict}");
            let off = brightness_off(&verdict, &user);
            assert!(off.abs() < 0.05, "{off}: {verdict}");
        } else {
            assert_eq!(verdict["cause"], "chain", "{chain}: {verdict}");
            contains(verdict["error"]["next_step"].as_str().unwrap(), &[said]);
        }
    }
    // Another table is not what the folder was made for.
    let capture = photographed().path("c");
    user.says(&format!(
        "solve '{}' -o u.iltm --white 0.3",
        capture.display()
    ));
    user.fails(37, "verify u.iltm w");
}

#[test]
fn photographs_that_differ_among_themselves_are_not_fed_back() {
    let user = copy();
    // Below what the gate of movement sees, above what the table promises.
    let said = with_fault(&user, "tripod=0.2");
    let found = (&said["outcome"], &said["cause"]);
    assert_eq!(found, (&"inconclusive".into(), &"noise".into()), "{said}");
    let next = said["error"]["next_step"].as_str().unwrap();
    contains(next, &["Fix tripod"]);
    contains(
        &user.fails(34, "refine t.iltm v -o x.iltm"),
        &["cannot be fed back", "differ among themselves"],
    );
}

/// A card of a film as a camera sees it: smaller, on a dark wall.
fn card_seen(card: &image::GrayImage) -> image::GrayImage {
    let (width, height) = (card.width() * 4 / 5, card.height() * 4 / 5);
    let card = image::imageops::resize(card, width, height, image::imageops::Triangle);
    let mut seen = image::GrayImage::from_pixel(width + 90, height + 70, image::Luma([9]));
    for (x, y, code) in card.enumerate_pixels() {
        let dimmed = 9 + code[0] / 2;
        // As much as a projector's keystone.
        let shifted = x + 20 + (height - y) / 12;
        seen.put_pixel(shifted, y + 30, image::Luma([dimmed]));
    }
    seen
}

#[test]
fn photographs_of_a_film_are_recognised_by_its_cards_whatever_their_names_are() {
    let user = copy();
    user.says("verify t.iltm -o w --wanted --projector 640x400 --border 3");
    user.copy(&user.path("w"), "s");
    for part in ["patterns", "slides", "photos", "wanted"] {
        user.copy(&user.path("w").join(part), &format!("s/{part}"));
    }
    user.says("simulate SCENES/m-panels.toml --photograph s --seed 9 --chain once --table t.iltm");
    fs::create_dir(user.path("seen")).unwrap();
    let slides = user.names("s/photos");
    let mut number = 97;
    let mut name = || {
        number += 1;
        user.path(&format!("seen/IMG_{number}.png"))
    };
    for (at, slide) in slides.iter().enumerate() {
        let card = user
            .picture(&format!("w/film/{:03}.png", 2 * at))
            .into_luma8();
        card_seen(&card).save(name()).unwrap();
        for _ in 0..=at % 3 {
            fs::copy(user.path("s/photos").join(slide), name()).unwrap();
        }
    }
    let verdict = user.json("verify t.iltm w --photographs seen");
    assert_eq!(verdict["outcome"], "passed", "{verdict}");
    let found = &verdict["recognised"];
    assert_eq!(found["slides"], slides.len(), "{verdict}");
    assert_eq!(found["cards"], slides.len(), "{verdict}");
    for slide in &slides {
        let (own, copied) = (format!("s/photos/{slide}"), format!("w/photos/{slide}"));
        assert!(user.read(&own) == user.read(&copied), "{slide}");
    }
    // What is there is not replaced.
    contains(
        &user.fails(9, "verify t.iltm w --photographs seen"),
        &["there are photographs already", "Leave --photographs away"],
    );
    fs::remove_dir_all(user.path("w/photos")).unwrap();
    fs::create_dir(user.path("w/photos")).unwrap();
    // Without the card of slide 3, what follows the card of slide 2 is of two slides.
    user.remove("seen/IMG_107.png");
    contains(
        &user.fails(5, "verify t.iltm w --photographs seen"),
        &[
            "no card was read of slide 3; no photograph after the card is surely of slide 2",
            "Photograph these slides again",
        ],
    );
    // Nothing was copied, and nothing is left of the attempt.
    assert!(user.names("w/photos").is_empty());
    assert!(user.names("w").iter().all(|name| !name.starts_with('.')));
    contains(
        &user.fails(5, "verify t.iltm w --photographs s/photos"),
        &["none of its 61 pictures shows a card"],
    );
}

#[test]
fn what_is_missing_is_listed_and_what_was_made_with_another_table_fails() {
    let user = copy();
    for photo in ["004", "060"] {
        user.remove(&format!("v/photos/{photo}.png"));
    }
    let said = user.fails(4, "verify t.iltm v");
    let missing = "2 photographs are missing: photos/004.png, photos/060.png";
    contains(&said, &[missing]);
    let user = copy();
    // The same photographs, solved for another white.
    let capture = photographed().path("c");
    user.says(&format!(
        "solve '{}' -o u.iltm --white 0.3",
        capture.display()
    ));
    let said = user.fails(37, "verify u.iltm v");
    contains(&said, &["made with another table"]);
}

#[test]
fn a_folder_that_is_none_and_one_that_is_in_the_way_are_named() {
    let user = photographed();
    let said = user.fails(3, "verify t.iltm nowhere");
    contains(&said, &["nowhere: there is no verify.csv"]);
    user.fails(9, "verify t.iltm -o v");
    user.fails(2, "verify t.iltm -o w --projector 20x400");
    assert!(!user.path("w").exists());
    user.fails(2, "verify t.iltm");
}
