//! What a table is said to be, and where its frames go: the words and the pixels that a
//! technician gets.

use super::user::{Ended, User, contains, with_values};
use image::{GrayImage, Luma};
use std::fs;
use std::process::Command;
use std::sync::OnceLock;
use std::thread;

/// With a table `b.iltm` of a projector of 320 x 200 pixels with a border of 20, learned
/// from photographs of slides that had it.
fn bordered() -> &'static User {
    static USER: OnceLock<User> = OnceLock::new();
    USER.get_or_init(|| {
        let user = User::new();
        let size = "--projector 320x200 --border 20 --camera linear --no-calibration";
        user.says(&format!(
            "patterns -o c --rows 13 --cols 21 --photos 40 {size}"
        ));
        user.says("simulate SCENES/m-panels.toml --photograph c");
        user.says("solve c -o b.iltm");
        user
    })
}

fn grey(user: &User, name: &str, (width, height): (u32, u32)) {
    let picture = GrayImage::from_pixel(width, height, Luma([200]));
    picture.save(user.path(name)).expect("writable");
}

#[test]
fn a_border_stays_black_and_frames_of_the_size_inside_it_are_put_there() {
    let user = bordered();
    for size in [(320, 200), (280, 160)] {
        grey(user, "w.png", size);
        user.says("compensate b.iltm w.png -o p.png");
        let made = user.picture("p.png").into_luma8();
        assert_eq!(made.dimensions(), (320, 200));
        for (x, y, pixel) in made.enumerate_pixels() {
            let inside = (20..300).contains(&x) && (20..180).contains(&y);
            assert!(inside || pixel.0 == [0], "{x} {y}: {}", pixel.0[0]);
        }
        // Where the panels' left wedge is folded, least light is needed of its own; it is a
        // little less than half way from the middle of the cells to their edge.
        let darkest = (30..160).min_by_key(|x| made.get_pixel(*x, 100).0[0]);
        let darkest = darkest.expect("some");
        assert!((80..115).contains(&darkest), "{darkest}");
    }
    let inspected = user.json("inspect b.iltm");
    assert_eq!(inspected["projector"]["border"], 20);
}

#[cfg(unix)]
#[test]
fn what_is_said_of_a_table_can_be_done_with_it() {
    let user = bordered();
    let next = "iltm verify b.iltm -o VERIFY";
    let said = user.says("inspect b.iltm");
    contains(&said, &[" % off the wanted light; ", next]);
    // A pipe cannot be verified.
    let pipe = user.path("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("every system has it").success());
    let table = user.read("b.iltm");
    let writer = thread::spawn(move || fs::write(pipe, table));
    let of_pipe = user.says("inspect pipe");
    writer.join().expect("no panic").expect("a reader");
    let without: Vec<&str> = said.lines().filter(|line| !line.contains(next)).collect();
    assert_eq!(of_pipe.lines().collect::<Vec<_>>(), without);
}

#[test]
fn gains_are_as_fine_as_the_camera_tells_or_as_was_said() {
    let user = bordered();
    let size = |table: &str| {
        let fine = &user.json(&format!("inspect {table}"))["fine_gain"];
        (fine["cols"].as_u64(), fine["rows"].as_u64())
    };
    let (wide, tall) = size("b.iltm");
    // Whole samples of a cell, not more than the 280 x 160 pixels inside the border.
    assert!(
        wide.is_some_and(|wide| wide % 21 == 0 && (84..=280).contains(&wide)),
        "{wide:?}"
    );
    assert!(
        tall.is_some_and(|tall| tall % 13 == 0 && (52..=160).contains(&tall)),
        "{tall:?}"
    );
    user.says("solve c -o coarse.iltm --gain-resolution 50x50");
    assert_eq!(size("coarse.iltm"), (Some(42), Some(39)));
    user.says("solve c -o cells.iltm --gain-resolution 41x25");
    assert_eq!(size("cells.iltm"), (None, None));
}

#[test]
fn ambient_light_is_left_as_it_is_when_asked() {
    let user = bordered();
    user.says("solve c -o kept.iltm --keep-ambient");
    let effects = |table: &str| {
        let inspected = user.json(&format!("inspect {table}"));
        let kept = inspected["provenance"]["ambient_kept"].as_bool();
        (inspected["effects"].to_string().contains("ambient"), kept)
    };
    assert_eq!(effects("b.iltm"), (true, None));
    assert_eq!(effects("kept.iltm"), (false, Some(true)));
}

#[test]
fn black_is_raised_where_asked_or_it_is_said_why_not() {
    let user = bordered();
    let said = user.says("solve c -o even.iltm --match-black");
    contains(&said, &["black       raised to 0.", " of white everywhere"]);
    let black = |table: &str| {
        let inspected = user.json(&format!("inspect {table}"));
        let raised = inspected["effects"].to_string().contains("raised black");
        (raised, inspected["black"].as_f64().expect("a number") > 0.0)
    };
    assert_eq!(black("even.iltm"), (true, true));
    assert_eq!(black("b.iltm"), (false, false));
    let said = user.fails(2, "solve c -o never.iltm --match-black --keep-ambient");
    contains(&said, &["cannot be used with"]);
    // A scene without a room's light.
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/m-panels.toml");
    let scene = fs::read_to_string(scene).expect("part of the repository");
    user.write("dark.toml", with_values(&scene, &[("ambient", 0)]));
    let cells = "--rows 13 --cols 21 --photos 20 --projector 160x100";
    user.says(&format!(
        "patterns -o dark {cells} --camera linear --no-calibration"
    ));
    user.says("simulate dark.toml --photograph dark --without noise");
    let said = user.says("solve dark -o dark.iltm --match-black");
    contains(&said, &["black is not raised"]);
    assert_eq!(black("dark.iltm"), (false, false));
}

#[test]
fn another_aspect_is_refused_everywhere_unless_it_is_said_how() {
    let user = bordered();
    grey(user, "wide.png", (192, 108));
    let said = user.fails(8, "compensate b.iltm wide.png -o p.png");
    contains(&said, &["192 x 108", "320 x 200", "--fit letterbox"]);
    let said = user.fails(8, "solve c -o never.iltm --content wide.png");
    contains(&said, &["wide.png", "192 x 108", "--fit letterbox"]);
    assert!(!user.path("never.iltm").exists());
    for (fit, size) in [
        ("letterbox", (192, 120)),
        ("crop", (173, 108)),
        ("stretch", (192, 108)),
    ] {
        user.says(&format!("compensate b.iltm wide.png -o p.png --fit {fit}"));
        let made = user.picture("p.png");
        assert_eq!((made.width(), made.height()), size, "{fit}");
    }
    user.says("solve c -o fitted.iltm --content wide.png --fit crop");
    user.fails(2, "solve c -o never.iltm --fit crop");
    user.fails(2, "compensate b.iltm wide.png -o p.png --fit zoom");
    // A table that knows no projector.
    let plain = User::with_table();
    grey(&plain, "wide.png", (192, 108));
    plain.says("compensate t.iltm wide.png -o p.png");
    plain.fails(2, "compensate t.iltm wide.png -o p.png --fit crop");
}

#[test]
fn a_solve_says_how_good_and_how_bright_in_few_lines_and_all_else_when_asked() {
    let user = User::new();
    let few = user.says("solve SAMPLE -o t.iltm");
    contains(
        &few,
        &[
            "fair ",
            "Delta E 2000 ",
            "without a table",
            "brightness ",
            "% as bright",
            "13 x 21 cells",
            "ms a frame",
            "iltm verify t.iltm",
        ],
    );
    for theory in ["kappa", "Gershgorin", "condition", "Gray code", "lambda"] {
        assert!(!few.contains(theory), "{few}");
    }
    assert!(few.lines().count() <= 8, "{few}");
    let inspected = user.says("inspect t.iltm");
    assert!(inspected.lines().count() <= 7, "{inspected}");
    assert!(!inspected.contains("made_by"), "{inspected}");
    // The same words of the same table.
    for line in few.lines().take(4) {
        assert!(inspected.contains(line), "{line}: {inspected}");
    }
    contains(
        &user.says("solve SAMPLE -o t.iltm -v"),
        &["kappa", "condition", "Gray code"],
    );
    contains(
        &user.says("inspect t.iltm -v"),
        &["overflow proof", "made_by", "tier"],
    );
}

#[test]
fn gains_alone_have_one_number_that_is_better_than_nothing() {
    let user = User::with_table();
    let inspected = user.json("inspect t.iltm");
    let gains = inspected["tiers"][0]["total_error"]
        .as_f64()
        .expect("a number");
    let nothing = inspected["provenance"]["predicted_error"]["uncompensated"].as_f64();
    assert!(gains < nothing.expect("a number"), "{inspected}");
    let said = user.says("inspect t.iltm");
    let end = said.find(" % with gains alone").expect("said");
    let start = said[..end].rfind(' ').expect("a word before") + 1;
    let percent: f64 = said[start..end].parse().expect("a number");
    assert!((percent / (100.0 * gains) - 1.0).abs() < 0.01, "{said}");
}

#[test]
fn what_is_cut_off_is_told_apart_and_advice_is_for_white() {
    let user = User::with_table();
    let half = GrayImage::from_fn(210, 130, |x, _| Luma([if x < 105 { 255 } else { 0 }]));
    half.save(user.path("w.png")).expect("writable");
    let said = user.says("compensate t.iltm w.png -o p.png");
    contains(
        &said,
        &[
            "% as bright",
            "too bright for the projector's white",
            "darker than its black",
        ],
    );
    let data = user.json("compensate t.iltm w.png -o p.png");
    let number = |name: &str| data[name].as_u64().expect("a number");
    assert!(number("clipped") > number("clipped_white"), "{data}");
    let black = GrayImage::new(210, 130);
    black.save(user.path("b.png")).expect("writable");
    let said = user.says("compensate t.iltm b.png -o p.png");
    contains(&said, &["0.00 % of the samples are too bright"]);
    assert!(!said.contains("--content"), "{said}");
}

#[test]
fn options_that_would_be_dropped_are_refused() {
    let user = User::with_table();
    for terms in [
        "--for-device 3",
        "--table-version 7",
        "--revoke-below 1",
        "--method direct --lambda 0.1",
    ] {
        user.fails(2, &format!("solve SAMPLE -o u.iltm {terms}"));
    }
    user.write("scene.toml", super::simulate::CORNER);
    user.says("simulate scene.toml -o c --photos 12");
    for command in [
        "simulate scene.toml --photograph c -o d",
        "simulate scene.toml --photograph c --photos 3",
        "simulate scene.toml --explain --fault tripod",
        "simulate scene.toml --explain --photos 3",
        "capture c --list --timeout 3",
        "compensate t.iltm w.png -o p.png --verbose",
    ] {
        user.fails(2, command);
    }
    assert!(!user.path("d").exists() && !user.path("u.iltm").exists());
    // A folder that lacks nothing: no light is computed.
    let said = user.says("simulate scene.toml --photograph c");
    contains(&said, &["every photograph is there"]);
}

#[test]
fn the_help_of_capture_fits_eighty_columns_and_its_commands_can_be_copied() {
    let help = User::new().run("capture --help").out;
    let from = help.find("Commands are run by the shell").expect("there");
    for line in help[from..].lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    // A line that goes on says so to the shell.
    let gphoto = help.find("gphoto2").expect("there");
    let end = gphoto + help[gphoto..].find('\'').expect("quoted");
    let (first, rest) = help[gphoto..end].split_once('\n').expect("two lines");
    assert!(
        first.ends_with('\\') && rest.contains("{stem}.jpg"),
        "{help}"
    );
}

#[test]
fn what_cannot_be_is_said_before_the_work_and_with_the_right_code() {
    let user = User::with_table();
    let said = user.fails(9, "solve SAMPLE -o no/folder/t.iltm");
    contains(&said, &["there is no folder no/folder"]);
    std::fs::create_dir(user.path("taken")).expect("made");
    contains(&user.fails(9, "solve SAMPLE -o taken"), &["it is a folder"]);
    let said = user.fails(3, "solve SAMPLE -o u.iltm --content missing.y4m");
    assert_eq!(said.matches("missing.y4m").count(), 1, "{said}");
    let said = user.fails(2, "solve SAMPLE -o u.iltm --white 5");
    contains(&said, &["times", "--content"]);
    user.write("header.y4m", "YUV4MPEG2 W64 H40 F25:1\n");
    let said = user.fails(8, "compensate t.iltm header.y4m -o out.y4m");
    contains(&said, &["no frame"]);
    assert!(!user.path("out.y4m").exists());
    let said = user.fails(2, "compensate t.iltm header.y4m -o out.png");
    contains(&said, &["out.png", "Y4M"]);
}

#[test]
fn a_table_of_an_even_wall_leaves_pictures_as_they_are() {
    let user = User::new();
    let size = "--projector 128x96 --no-calibration";
    user.says(&format!(
        "patterns -o c --rows 24 --cols 32 --photos 20 {size}"
    ));
    user.says("simulate SCENES/flat-screen.toml --photograph c");
    let said = user.says("solve c -o t.iltm");
    contains(
        &said,
        &["pictures are left as they are", "the table changes nothing"],
    );
    let codes = |x: u32, y: u32| Luma([((x + 128 * y) % 251) as u8]);
    let picture = GrayImage::from_fn(128, 96, codes);
    picture.save(user.path("p.png")).expect("writable");
    user.says("compensate t.iltm p.png -o q.png");
    let made = user.picture("q.png").into_luma8();
    for (was, is) in picture.pixels().zip(made.pixels()) {
        assert!(was.0[0].abs_diff(is.0[0]) <= 1, "{was:?} {is:?}");
    }
    // Who asks for a white does not want pictures as they are.
    let said = user.says("solve c -o w.iltm --white 0.3");
    assert!(!said.contains("pictures are left"), "{said}");
}

#[test]
fn a_date_that_is_given_is_the_tables_and_one_that_is_none_is_refused() {
    let user = User::with_capture();
    let solved = |date: &str| {
        let mut command = user.iltm("solve capture -o dated.iltm");
        let child = command.env("SOURCE_DATE_EPOCH", date).spawn();
        Ended::of(child.expect("a binary"))
    };
    for wrong in ["", "yesterday", "1e9", "99999999999999999"] {
        let refused = solved(wrong);
        assert_eq!(refused.code, 2, "{}", refused.said);
        contains(
            &refused.said,
            &["SOURCE_DATE_EPOCH", "no number of seconds"],
        );
    }
    assert!(!user.path("dated.iltm").exists());
    assert_eq!(solved("1000000000").code, 0);
    let date = user.json("inspect dated.iltm")["date"].to_string();
    assert!(date.contains("2001-09-09"), "{date}");
}
