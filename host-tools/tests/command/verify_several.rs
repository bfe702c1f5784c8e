//! `iltm check` and `iltm verify` where pictures of two projectors overlap: good photographs from anywhere,
//! what has changed since, and what is not as it must be.

use super::user::{User, contains, with_values};
use std::fs;
use std::sync::OnceLock;

/// The folded screen before a camera of fewer pixels, which takes half the time.
fn scene() -> String {
    let scene = include_str!("../../scenes/folded-screen.toml");
    with_values(scene, &[("width", 480), ("height", 300)])
}

/// With a table of two projectors, and a folder `v` to verify it with, not yet photographed.
fn prepared() -> &'static User {
    static USER: OnceLock<User> = OnceLock::new();
    USER.get_or_init(|| {
        let user = User::new();
        user.write("scene.toml", scene());
        for name in ["left", "right"] {
            user.says(&format!(
                "patterns -o {name} --rows 15 --cols 24 --photos 60 --projector 480x300"
            ));
            user.says(&format!(
                "simulate scene.toml --photograph {name} --projector {name}"
            ));
        }
        let data = user.json("solve left right -o t.iltm --report report");
        assert_eq!(data["report"], "report/report.html");
        contains(
            &user.says("verify t.iltm -o v --captures left right"),
            &["5 test images", "stripes of the projectors' own pixels"],
        );
        user
    })
}

/// The scene with `from` replaced in the table that is called `name`.
fn changed(name: &str, (from, to): (&str, &str)) -> String {
    let scene = scene();
    let start = scene.find(&format!("name = \"{name}\"")).unwrap();
    let (before, after) = scene.split_at(start);
    assert!(after.contains(from), "{from}");
    format!("{before}{}", after.replacen(from, to, 1))
}

/// Photographs of a copy of the folder in this scene, in a place of their own.
fn photographed(scene: &str) -> User {
    let user = User::new();
    user.write("t.iltm", prepared().read("t.iltm"));
    for part in ["v", "v/patterns", "v/photos", "v/slides", "v/wanted"] {
        user.copy(&prepared().path(part), part);
    }
    user.write("now.toml", scene);
    user.says("simulate now.toml --photograph v --seed 9");
    user
}

/// A copy of the folder with photographs of the scene as it was, in a place of its own.
fn photographed_unchanged() -> User {
    static USER: OnceLock<User> = OnceLock::new();
    let photographs = USER.get_or_init(|| photographed(&scene()));
    let user = User::new();
    for part in ["", "v", "v/patterns", "v/photos", "v/slides", "v/wanted"] {
        user.copy(&photographs.path(part), part);
    }
    user
}

fn refused(user: &User, line: &str, says: &str) {
    let said = user.run(line);
    assert_ne!(said.code, 0, "{line}");
    contains(&said.with_code(), &[says]);
}

fn moved(verdict: &serde_json::Value) -> f64 {
    assert_eq!(
        verdict["overlaps"].as_array().unwrap().len(),
        1,
        "{verdict}"
    );
    assert_eq!(
        verdict["overlaps"][0]["projectors"],
        serde_json::json!([1, 2])
    );
    verdict["overlaps"][0]["moved"].as_f64().unwrap()
}

#[test]
fn captures_of_two_projectors_are_checked_beside_each_other() {
    let user = prepared();
    contains(
        &user.says("check left right"),
        &[
            "left and right\n",
            "the camera stood still between left and right",
            "passed",
        ],
    );
    let data = user.json("check left right");
    assert_eq!(
        (&data["pass"], data["captures"].as_array().unwrap().len()),
        (&true.into(), 2)
    );
    assert_eq!(data["captures"][1]["cells"]["live"], 360);
    assert!(!data["between"].as_array().unwrap().is_empty());
    // A fifth of each picture's width is lit by both, far from the camera, and the halves of the screen
    // light each other.
    let light = data["light"].as_array().unwrap();
    assert_eq!(light.len(), 2);
    for crossing in light {
        let number = |key: &str| crossing[key].as_f64().unwrap();
        assert!((number("overlap") - 0.15).abs() < 0.03, "{crossing}");
        assert!((0.02..0.2).contains(&number("bounced")), "{crossing}");
    }
    for part in ["", "patterns", "photos", "calibration", "slides"] {
        user.copy(&user.path("left").join(part), &format!("again/{part}"));
    }
    let again = user.run("--json check left again");
    let data = again.json();
    assert_eq!((again.code, &data["pass"]), (5, &false.into()), "{data}");
    contains(
        &data["error"]["message"].to_string(),
        &["left and again", "coverage"],
    );
    for (line, says) in [
        ("check left left", "given twice"),
        (
            "check left right -o page",
            "--output and --map are of the capture of one",
        ),
        (
            "check left right --map map.npy",
            "--output and --map are of the capture of one",
        ),
    ] {
        refused(user, line, says);
    }
}

/// Copies of both captures in a place of their own.
fn captures() -> User {
    let user = User::new();
    for name in ["left", "right"] {
        for part in ["", "patterns", "photos", "calibration", "slides"] {
            let part = format!("{name}/{part}");
            user.copy(&prepared().path(&part), &part);
        }
    }
    user
}

/// Replaces samples of a photograph of `left`, each with its place in the file.
fn change(user: &User, name: &str, sample: impl Fn(usize, f32) -> f32) {
    let path = user.path(&format!("left/photos/{name}"));
    let mut photo = image::open(&path).unwrap().into_luma16();
    for (at, value) in photo.iter_mut().enumerate() {
        *value = sample(at, f32::from(*value)).round().clamp(0.0, 65535.0) as u16;
    }
    photo.save(&path).unwrap();
}

/// Light of the right projector's white, without black's.
fn white_of_right() -> Vec<f32> {
    let photo = |index: u32| {
        let path = prepared().path(&format!("right/photos/{index:03}.png"));
        image::open(path).unwrap().into_luma16()
    };
    let [white, black] = [photo(0), photo(1)];
    let pairs = white.iter().zip(black.iter());
    pairs
        .map(|(white, black)| f32::from(*white) - f32::from(*black))
        .collect()
}

#[test]
fn a_projector_that_was_not_dark_while_another_one_was_photographed_is_named() {
    let white = white_of_right();
    let checked = |share: f32| {
        let user = captures();
        for photo in user.names("left/photos") {
            change(&user, &photo, |at, light| light + share * white[at]);
        }
        user.run("check left right").with_code()
    };
    let said = "projector of right was not dark while left was photographed";
    let slight = checked(0.001);
    assert!(
        slight.contains("exit 0\n") && !slight.contains(said),
        "{slight}"
    );
    contains(
        &checked(0.015),
        &["exit 5\n", said, "1.5 % of its white", "Show black on all"],
    );
}

#[test]
fn photographs_that_another_projector_lit_are_named() {
    let white = white_of_right();
    let checked = |photographs: &[&str], share: f32| {
        let user = captures();
        for photo in photographs {
            change(&user, photo, |at, light| light + share * white[at]);
        }
        user.run("check left").with_code()
    };
    contains(
        &checked(&["120.png"], 0.2),
        &[
            "exit 0\n",
            "warn flicker",
            "1 photograph differs",
            "light: photos/120.png",
        ],
    );
    contains(
        &checked(&["120.png", "121.png", "122.png"], 1.0),
        &[
            "exit 5\n",
            "FAIL flicker",
            "photos/120.png, photos/121.png, photos/122.png",
        ],
    );
}

#[test]
fn photographs_that_a_projector_showed_nothing_for_are_named() {
    let user = captures();
    let black = image::open(user.path("left/photos/001.png"))
        .unwrap()
        .into_luma16();
    for index in 0_u16..5 {
        // No two are the same file.
        change(&user, &format!("{}.png", 120 + index), |at, _| {
            f32::from(black.as_raw()[at]) + f32::from(3 * index)
        });
    }
    contains(
        &user.fails(5, "check left"),
        &[
            "5 photographs are dark",
            "photos/120.png, photos/121.png",
            "the projector stays on",
        ],
    );
}

/// White of the second projector has less red and more blue, and the camera sees neighbouring channels.
#[test]
fn white_of_projectors_that_differ_in_colour_is_even() {
    let scene = include_str!("../../scenes/folded-screen.toml");
    let sizes = [("width", 240), ("height", 150), ("rows", 6), ("cols", 10)];
    let scene = with_values(scene, &sizes);
    let (left, right) = scene.split_at(scene.rfind("[[projector]]").unwrap());
    let with_mixing = |part: &str, mixing: &str| {
        part.replace(
            "black = 0.002",
            &format!("black = 0.002\nmixing = {mixing}"),
        )
    };
    let left = with_mixing(
        left,
        "[[0.9, 0.08, 0.02], [0.06, 0.88, 0.06], [0.02, 0.1, 0.88]]",
    );
    let right = with_mixing(
        right,
        "[[0.7, 0.1, 0.02], [0.05, 0.85, 0.08], [0.02, 0.14, 1.0]]",
    );
    let user = User::new();
    user.write("scene.toml", left + &right);
    for name in ["left", "right"] {
        user.says(&format!(
            "patterns -o {name} --rows 6 --cols 10 --photos 12 --projector 120x72"
        ));
        user.says(&format!(
            "simulate scene.toml --photograph {name} --projector {name}"
        ));
    }
    user.says("solve left right -o t.iltm");
    user.says("verify t.iltm -o v --captures left right");
    user.says("simulate scene.toml --photograph v");
    let verdict = user.json("verify t.iltm v");
    let drift = &verdict["drift"];
    for level in drift["level"].as_array().unwrap() {
        assert!((level.as_f64().unwrap() - 1.0).abs() < 0.002, "{drift}");
    }
    assert!(drift["shape"].as_f64().unwrap() < 0.003, "{drift}");
}

#[test]
fn a_report_of_two_projectors_draws_both_and_says_who_lights_whom_as_a_check_does() {
    let user = prepared();
    let page = user.text("report/report.html").replace('\u{202f}', " ");
    assert!(page.len() < 1 << 20);
    contains(
        &page,
        &[
            "<h1>left and right</h1>",
            "The projectors",
            "\u{a0}left</span>",
            "\u{a0}right</span>",
            "iltm solve left right -o t.iltm",
            "--captures left right",
        ],
    );
    let said = user.says("check left right");
    let lines: Vec<&str> = said
        .lines()
        .filter(|line| line.contains("white adds"))
        .collect();
    assert_eq!(lines.len(), 2);
    for line in lines {
        let between = |before: &str, after: &str| {
            let (_, rest) = line.split_once(before).unwrap();
            rest.split_once(after).unwrap().0.to_owned()
        };
        let bounced = between("white adds ", " to what");
        let overlap = between(", and ", " of ");
        contains(&page, &[&format!("bounces {bounced}<br>overlap {overlap}")]);
    }
    // The left projector lights what the camera sees on the left. Its colour is orange, the other blue.
    let room = user.picture("report/projectors.png").into_rgb8();
    let middle = room.width() / 2;
    let counts = |orange: bool| {
        let pixels = room.enumerate_pixels();
        let coloured = pixels.filter(|(_, _, pixel)| {
            let [red, _, blue] = pixel.0.map(i32::from);
            if orange {
                red > blue + 40
            } else {
                blue > red + 40
            }
        });
        let (left, right): (Vec<_>, Vec<_>) = coloured.partition(|(x, ..)| *x < middle);
        (left.len() as f64, right.len() as f64)
    };
    let ((own, other), (others, rights)) = (counts(true), counts(false));
    // Beyond the middle a tenth of its picture, every other stripe of it.
    assert!((0.01..0.15).contains(&(other / own)), "{other} of {own}");
    assert!(
        (0.01..0.15).contains(&(others / rights)),
        "{others} of {rights}"
    );
    // A place in the middle of the overlap is half of each one's light.
    for (name, edge) in [("blend-1", 0.9), ("blend-2", 0.1)] {
        let blend = user.picture(&format!("report/{name}.png")).into_rgb8();
        let at = |across: f64| {
            let x = (across * f64::from(blend.width())) as u32;
            i32::from(blend.get_pixel(x, blend.height() / 2).0[1])
        };
        // Viridis gets greener with the share.
        let (alone, half, none) = (at(0.5), at(edge), at(if edge > 0.5 { 0.999 } else { 0.0 }));
        assert!(
            alone > half + 30 && half > none + 30,
            "{alone} {half} {none}"
        );
    }
}

#[test]
fn a_good_table_passes_from_where_the_camera_stood_and_from_elsewhere() {
    let elsewhere = ("position = [0.0, 1.0, 4.6]", "position = [0.5, 1.3, 4.4]");
    let scene = scene();
    // The camera has no name.
    let changed = scene.replacen(elsewhere.0, elsewhere.1, 1);
    assert_ne!(scene, changed);
    let stood = photographed_unchanged();
    for user in [&stood, &photographed(&changed)] {
        let verdict = user.json("verify t.iltm v");
        assert_eq!(verdict["outcome"], "passed", "{verdict}");
        let after = verdict["viewer"]["after"].as_f64().unwrap();
        assert!(after < 0.01, "{verdict}");
        // Where both light the screen, pictures without a table are twice as bright.
        assert!(
            verdict["viewer"]["before"].as_f64().unwrap() > 0.15,
            "{verdict}"
        );
        assert!(moved(&verdict) < 0.2, "{verdict}");
        assert_eq!(verdict["cells"]["compared"], 720);
        assert!(user.path("v/verdict/verdict.html").is_file());
    }
    contains(
        &stood.says("verify t.iltm v"),
        &["overlap     the pictures of projectors 1 and 2 lie 0."],
    );
}

#[test]
fn a_projector_that_was_nudged_by_two_pixels_fails_and_by_half_a_pixel_passes() {
    // 5.5 mm are a pixel where it looks.
    let nudged = |to: &str| {
        let scene = changed("right", ("look_at = [0.937, 0.8, 0.656]", to));
        photographed(&scene).run("--json verify t.iltm v")
    };
    let little = nudged("look_at = [0.939, 0.8, 0.656]");
    assert_eq!(little.code, 0, "{}", little.with_code());
    let far = nudged("look_at = [0.937, 0.811, 0.656]");
    let verdict = far.json();
    assert_eq!(
        (far.code, verdict["cause"].as_str()),
        (31, Some("nudged")),
        "{verdict}"
    );
    assert!((moved(&verdict) - 2.0).abs() < 0.3, "{verdict}");
    let up = verdict["overlaps"][0]["down"].as_f64().unwrap();
    assert!((up + 2.0).abs() < 0.3, "{verdict}");
    contains(
        &verdict["error"]["message"].to_string(),
        &["projectors 1 and 2 lie 2.", "at most 1 pixel passes"],
    );
}

#[test]
fn an_overlap_that_the_camera_does_not_see_is_not_known() {
    // A pillar before the camera hides the middle of its picture.
    let user = photographed_unchanged();
    for name in user.names("v/photos") {
        let path = format!("v/photos/{name}");
        let mut photo = user.picture(&path).into_luma16();
        let width = photo.width();
        for (x, _, pixel) in photo.enumerate_pixels_mut() {
            if (width * 42 / 100..width * 58 / 100).contains(&x) {
                pixel.0 = [0];
            }
        }
        photo.save(user.path(&path)).unwrap();
    }
    let ended = user.run("--json verify t.iltm v");
    let verdict = ended.json();
    assert_eq!(verdict["overlaps"], serde_json::json!([]), "{verdict}");
    assert_eq!(verdict["overlaps_unseen"], serde_json::json!([[1, 2]]));
    contains(
        &user.run("verify t.iltm v").with_code(),
        &["overlap     not known whether the pictures of projectors 1 and 2 lie"],
    );
}

#[test]
fn exchanged_cables_are_named() {
    let scene = scene();
    let (left, right) = ("name = \"left\"", "name = \"right\"");
    let exchanged = scene
        .replacen(left, "name = \"other\"", 1)
        .replacen(right, left, 1)
        .replacen("name = \"other\"", right, 1);
    // Frames go to projectors in the order of the scene, not by name.
    let swap = |text: &str, a: &str, b: &str| text.replace(a, "@").replace(b, a).replace('@', b);
    let exchanged = swap(&exchanged, "[0.5, 0.8, 3.6]", "[-0.5, 0.8, 3.6]");
    let exchanged = swap(&exchanged, "[-0.937, 0.8, 0.656]", "[0.937, 0.8, 0.656]");
    let user = photographed(&exchanged);
    let said = user.fails(31, "verify t.iltm v");
    contains(
        &said,
        &[
            "Projectors 1 and 2 show each other's pictures",
            "Exchange their cables",
        ],
    );
}

#[test]
fn a_half_that_was_painted_is_a_changed_scene() {
    let scene = changed("right half", ("albedo = 0.75", "albedo = 0.70"));
    let user = photographed(&scene);
    let ended = user.run("--json verify t.iltm v");
    let verdict = ended.json();
    assert_eq!(
        (ended.code, verdict["cause"].as_str()),
        (31, Some("scene")),
        "{verdict}"
    );
    assert!(moved(&verdict) < 0.2, "{verdict}");
}

#[test]
fn photographs_that_are_missing_exchanged_or_too_bright_are_named() {
    let user = photographed_unchanged();
    let list = user.text("v/verify.csv");
    let photo = |role: &str| {
        let line = list
            .lines()
            .find(|line| line.split(',').nth(1) == Some(role));
        line.unwrap().rsplit(',').next().unwrap().to_owned()
    };
    let [first, second] = ["fine-compensated-0", "fine-compensated-1"].map(photo);
    let path = |photo: &str| user.path(&format!("v/{photo}"));
    fs::rename(path(&first), user.path("kept.png")).unwrap();
    contains(&user.fails(4, "verify t.iltm v"), &[&first, "missing"]);
    fs::rename(path(&second), path(&first)).unwrap();
    fs::rename(user.path("kept.png"), path(&second)).unwrap();
    contains(&user.fails(5, "verify t.iltm v"), &["shows the picture of"]);

    let bright = changed("left", ("bits = 12", "bits = 12\nwhite = 1.3"));
    let said = photographed(&bright).run("verify t.iltm v");
    contains(
        &said.with_code(),
        &["All projectors together: white is overexposed"],
    );
}

#[test]
fn a_table_of_overlapping_projectors_asks_for_its_captures() {
    let user = prepared();
    for (line, says) in [
        ("verify t.iltm -o w", "--captures LEFT RIGHT"),
        (
            "verify t.iltm -o w --captures left",
            "these captures have 15 x 24",
        ),
        ("verify t.iltm -o w --captures left left", "given twice"),
        (
            "verify t.iltm -o w --wanted --captures left right",
            "Leave --wanted",
        ),
        (
            "verify t.iltm -o w --projector 640x300 --captures left right",
            "960 x 300",
        ),
        (
            "verify t.iltm -o w --border 3 --captures left right",
            "no border",
        ),
    ] {
        refused(user, line, says);
        assert!(!user.path("w").exists(), "{line}");
    }
    let one = User::with_table();
    contains(
        &one.fails(2, "verify t.iltm -o w --captures c"),
        &["do not overlap"],
    );
    let harmed = photographed_unchanged();
    harmed.write("v/before.toml", "white = [[1.0]]\n");
    contains(
        &harmed.fails(4, "verify t.iltm v"),
        &["before.toml", "light of white"],
    );
}

#[test]
fn a_table_is_split_for_the_device_of_each_projector() {
    let user = prepared();
    let data = user.json("split t.iltm -o devices");
    for (number, part) in (1..).zip(data["projectors"].as_array().unwrap()) {
        assert_eq!(part["table"], format!("devices/t-{number}.iltm"));
        assert_eq!(part["cells"]["cols"], 24);
        // One for 4 x 4 of the other's 15 x 24, 16 bits of grey each.
        assert_eq!(part["neighbours"]["bytes"], 2 * 4 * 6);
        let top = part["tiers"].as_array().unwrap().last().unwrap();
        let error = |name: &str| top[name].as_f64().unwrap();
        assert!(
            error("wide") < 1e-6,
            "it is what the others are measured by"
        );
        assert!(error("together") < 0.01 && error("alone") > 0.03, "{top}");
    }
    let said = user.says("inspect devices/t-2.iltm");
    let neighbours = "4 x 6 cells of 1 projector on the left and 0 on the right: 48 bytes";
    contains(
        &said,
        &[
            "2/2",
            "15 x 24 cells",
            "480 x 300",
            neighbours,
            "iltm flash",
        ],
    );
    let finer = user.json("split t.iltm --projectors 2 --neighbours 1 -o finer");
    let together = |data: &serde_json::Value| {
        let tiers = data["projectors"][0]["tiers"].as_array().unwrap();
        tiers.last().unwrap()["together"].as_f64().unwrap()
    };
    assert!(together(&finer) < 0.2 * together(&data));
}

#[test]
fn what_cannot_be_split_or_is_for_a_device_is_refused() {
    let user = prepared();
    let own = User::new();
    own.write("t.iltm", user.read("t.iltm"));
    own.says("split t.iltm -o d");
    own.write("one.iltm", super::user::table());
    for (line, says) in [
        (
            "split t.iltm --projectors 5 -o e",
            "for 2 projectors, not 5",
        ),
        (
            "split t.iltm --projectors 1 -o e",
            "for 2 projectors, not 1",
        ),
        ("split one.iltm -o e", "does not say how many"),
        ("split one.iltm --projectors 9 -o e", "9 projectors alike"),
        ("split d/t-1.iltm -o e", "already"),
        ("split t.iltm --neighbours 0 -o e", "0 is not in 1.."),
        ("split none.iltm -o e", "none.iltm"),
    ] {
        refused(&own, line, says);
        assert!(!own.path("e").exists(), "{line}");
    }
    for line in [
        "compensate d/t-1.iltm wide.png -o own.png",
        "play d/t-1.iltm wide.y4m",
        "verify d/t-1.iltm -o v",
        "export d/t-1.iltm --as mpv -o shader",
        "refine d/t-1.iltm v -o r.iltm",
    ] {
        refused(&own, line, "for the device of one projector of several");
    }
}
