//! `iltm patterns` and `iltm capture` as a user meets them: a folder is made, and
//! photographed by a camera of a few shell commands; where X can be had without a
//! screen, on a display too.

use super::desktop::{Desktop, on_the_screen};
use super::user::{Ended, User, contains, interrupt};
use serde_json::Value;
use std::io::{BufRead, BufReader};

/// With a capture `c` of 3 x 4 cells that nobody has photographed.
fn patterns(more: &str) -> User {
    let user = User::new();
    let line = "patterns -o c --rows 3 --cols 4 --photos 10 --projector 64x48";
    user.says(&format!("{line} {more}"));
    user
}

/// Shows slides and photographs them, at once.
const SESSION: &str = "capture c --latency 0 --show 'cp {slide} now' --camera 'cp now {photo}'";

fn tells_progress_alone(said: &str) -> bool {
    said.lines().all(|line| line.starts_with("{\"progress\""))
}

fn slides(user: &User) -> usize {
    user.names("c/slides").len()
}

#[test]
fn a_folder_of_patterns_says_how_many_slides_it_has() {
    let user = User::new();
    let made = user.run("patterns -o c --rows 3 --cols 4 --json");
    assert!(tells_progress_alone(&made.said), "{}", made.said);
    assert_eq!(made.json()["slides"], slides(&user));
    // White, black, 9 + 3 * 8 levels, two probes, 2 * (2 + 2) stripes, 2 * (7 + 7) finer ones that
    // halve 480 and 360 pixels until 4 are left, 2 * 4 waves and 150 by chance; white and black
    // return after every 16 of all but the first two, and last.
    let others = 33 + 2 + 8 + 28 + 8 + 150_usize;
    assert_eq!(slides(&user), 2 + others + 2 * others.div_ceil(16));
    let again = user.run("patterns -o c --rows 3 --cols 4");
    insta::assert_snapshot!(again.with_code());
}

#[test]
fn cells_are_proposed_from_the_sizes_of_projector_and_camera() {
    let user = User::new();
    let size = "--projector 128x80 --camera-size 60x45";
    let made = user.run(&format!("patterns -o c --photos 10 {size}"));
    insta::assert_snapshot!(made.with_code());
    // Neither, half a grid, and both.
    let mut text = String::new();
    for cells in ["", "--rows 3", &format!("--rows 3 --cols 4 {size}")] {
        text += &user.run(&format!("patterns -o d {cells}")).with_code();
    }
    insta::assert_snapshot!(text);
    assert_eq!(user.names(""), ["c"]);
}

#[test]
fn sizes_that_cannot_be_are_refused_before_anything_is_written() {
    let user = User::new();
    let mut text = String::new();
    for (rows, cols) in [(30, 0), (300, 300), (15, 1921)] {
        let refused = user.run(&format!("patterns -o c --rows {rows} --cols {cols}"));
        text += &refused.with_code();
    }
    insta::assert_snapshot!(text);
    assert_eq!(user.names(""), [""; 0]);
}

#[test]
fn help_names_cameras_to_copy() {
    for command in ["patterns", "capture"] {
        let help = User::new().run(&format!("{command} --help"));
        insta::assert_snapshot!(command, help.out);
    }
}

#[test]
fn a_session_tells_programs_an_event_a_line() {
    let user = patterns("--no-calibration");
    let session = "capture c --json --show 'cp {slide} now' --camera 'cp now {photo}'";
    let done = user.run(session);
    assert_eq!(done.code, 0);
    assert!(tells_progress_alone(&done.said), "{}", done.said);
    let events = done.events();
    let named = |name: &str| events.iter().filter(|event| event["event"] == name).count();
    let slides = slides(&user);
    assert_eq!((named("begun"), named("latency"), named("done")), (1, 1, 1));
    assert_eq!((named("shown"), named("taken")), (slides, slides));
    assert_eq!(events.last().expect("some")["taken"], slides);
    // Nothing is left to do, so nothing is asked for.
    let said = format!("capture     c: {slides} of {slides} photographs are there\n");
    assert_eq!(user.says("capture c --list"), said);
}

#[test]
fn what_is_missing_is_listed() {
    let user = patterns("--no-calibration");
    for index in [0, 1, 2, 5, 7] {
        let slide = user.read(&format!("c/slides/{index:03}.png"));
        user.write(&format!("c/photos/{index:03}.png"), slide);
    }
    user.write("c/photos/003.png", "P");
    let text = user.run("capture c --list").with_code();
    let place = user.path(".").canonicalize().expect("there");
    insta::assert_snapshot!(text.replace(&*place.to_string_lossy(), "FOLDER"));
}

#[test]
fn a_session_without_a_camera_or_a_screen_is_a_mistake_in_the_command() {
    let user = patterns("--no-calibration");
    for arguments in [
        "",
        "--show true",
        "--camera 'cp now {photo}'",
        "--show true --camera 'cp now there'",
        "--show true --camera {photo} --again 9-7",
        "--show true --camera {photo} --again 99",
    ] {
        user.fails(2, &format!("capture c {arguments}"));
    }
}

#[test]
fn a_camera_that_fails_and_a_desktop_that_is_not_there_have_codes_of_their_own() {
    let user = patterns("--no-calibration");
    let camera = "--retries 0 --latency 0 --show true --camera 'echo no battery; exit 7 # {photo}'";
    let mut text = user.run(&format!("capture c {camera}")).with_code();
    let said = user.fails(33, "capture c --display 0 --camera 'cp now {photo}'");
    contains(&said, &["--show"]);
    text += &user.run("capture nowhere --list").with_code();
    insta::assert_snapshot!(text);
}

#[test]
fn ctrl_c_ends_a_session_that_can_go_on() {
    let user = patterns("--no-calibration");
    let slow = "if [ {index} = 4 ]; then touch four; sleep 60; fi; cp now {photo}";
    let mut session = user.spawn(&format!(
        "{} --json",
        SESSION.replace("cp now {photo}", slow)
    ));
    let mut lines = BufReader::new(session.stdout.take().expect("piped")).lines();
    // Until the fourth is on the wall.
    let shown = lines.by_ref().map(|line| line.expect("text"));
    let fourth = |line: &String| line.contains("\"shown\"") && line.contains("\"index\":4");
    assert!(shown.into_iter().any(|line| fourth(&line)));
    interrupt(&session);
    let rest: String = lines.map(|line| line.expect("text")).collect();
    assert_eq!(Ended::of(session).code, 29, "{rest}");
    contains(&rest, &["interrupted"]);
    let photos = user.names("c/photos");
    assert_eq!(photos.len(), 4, "{photos:?}");
    let events: Vec<Value> = user.events(SESSION);
    assert_eq!(events.last().expect("some")["taken"], slides(&user) - 4);
}

/// Runs `iltm capture c --display ...` on a desktop.
fn on(desktop: &Desktop, user: &User, display: &str) -> Ended {
    Ended::of(desktop.spawn(user, &format!("capture c --display {display}")))
}

#[test]
fn slides_fill_a_display_pixel_by_pixel() {
    let desktop = Desktop::start("64x48x24");
    let user = patterns("--ramp 2");
    // What is on the screen is kept; all photographs are alike.
    let screen = desktop.folder.path().join("Xvfb_screen0");
    let camera = format!(
        "cp {} {{index}}.xwd; cp c/slides/000.png {{photo}}",
        screen.display()
    );
    let shown = on(
        &desktop,
        &user,
        &format!("0 --latency 100 --camera '{camera}'"),
    );
    assert_eq!(shown.code, 0, "{}", shown.said);
    for index in 0..slides(&user) {
        let slide = user.picture(&format!("c/slides/{index:03}.png")).to_rgb8();
        let (width, pixels) = on_the_screen(&user.path(&format!("{index}.xwd")));
        assert_eq!((width, pixels.len() / width), (64, 48));
        let wanted = slide
            .pixels()
            .map(|pixel| u32::from_be_bytes([0, pixel[0], pixel[1], pixel[2]]));
        assert!(wanted.eq(pixels.iter().copied()), "slide {index}");
    }
}

/// Has what all displays of a desktop show together as a photograph.
fn camera_of(desktop: &Desktop) -> String {
    // One picture tells all: ffmpeg need not watch the desktop for a while first.
    let grab = "ffmpeg -loglevel error -probesize 32 -analyzeduration 0 -f x11grab -draw_mouse 0";
    let rest = "-frames:v 1 -pix_fmt rgb24 {photo}";
    format!("--camera '{grab} -i {} {rest}'", desktop.display)
}

/// The slides of a folder are on the wall from this column on, as far as these displays are, and all
/// else is black.
fn shown_from(user: &User, folder: &str, left: u32, displays: &[(u16, u16)]) {
    let heights = displays
        .iter()
        .flat_map(|(width, height)| vec![u32::from(*height); (*width).into()]);
    let heights: Vec<u32> = heights.collect();
    let names = user.names(&format!("{folder}/slides"));
    assert!(names.len() > 15, "{names:?}");
    for name in names {
        let slide = user.picture(&format!("{folder}/slides/{name}")).to_rgb8();
        let photo = user.picture(&format!("{folder}/photos/{name}")).to_rgb8();
        for (x, y, pixel) in photo.enumerate_pixels() {
            let column = x.checked_sub(left);
            let inside =
                column.filter(|x| heights.get(*x as usize).is_some_and(|height| y < *height));
            let wanted = inside.map_or(image::Rgb([0; 3]), |x| *slide.get_pixel(x, y));
            assert_eq!(*pixel, wanted, "{folder}: {name} at {x}, {y}");
        }
    }
}

#[test]
fn each_of_several_projectors_shows_its_slides_while_the_others_are_black() {
    let displays = [(64, 48), (80, 32), (32, 48)];
    let desktop = Desktop::with_displays(&displays);
    let user = User::new();
    let both = "--projector left=64x48 --projector right=80x32";
    let few = "--rows 3 --cols 4 --photos 10 --no-calibration --no-dense";
    let said = user.says(&format!("patterns -o . {few} {both}"));
    contains(&said, &["2 rows, 5 columns", "iltm capture ./left ./right"]);
    let camera = camera_of(&desktop);
    let line = format!("capture left right --display 0,1 --dark 2 --latency 100 {camera}");
    let ended = Ended::of(desktop.spawn(&user, &line));
    insta::assert_snapshot!(ended.with_code());
    shown_from(&user, "left", 0, &displays[..1]);
    shown_from(&user, "right", 64, &displays[1..2]);
    // What is missing is taken, and nothing else.
    user.remove("right/photos/003.png");
    let events = Ended::of(desktop.spawn(&user, &format!("{line} --json"))).events();
    let done = events.iter().filter(|event| event["event"] == "done");
    let taken: Vec<_> = done.map(|event| &event["taken"]).collect();
    assert_eq!(taken, [0, 1]);
    shown_from(&user, "right", 64, &displays[1..2]);
}

#[test]
fn projectors_that_cannot_stand_beside_each_other_get_no_patterns() {
    let user = User::new();
    let mut text = String::new();
    for (cols, projectors) in [
        (4, ["a=64x48", "80x48"]),
        (4, ["a=64x48", "a=80x48"]),
        (4, ["a=64x48", "b=80x50"]),
        (4, ["a=64x48", "b=72x48"]),
        (4, ["a=64x48", "b=80x40"]),
        (5, ["a=64x48", "b=64x48"]),
        (4, ["a=64x48", "../b=64x48"]),
    ] {
        let [one, two] = projectors;
        let line = format!("patterns -o d --rows 3 --cols {cols} --projector {one}");
        text += &user.run(&format!("{line} --projector {two}")).with_code();
        assert_eq!(user.names(""), [""; 0], "{one} {two}");
    }
    insta::assert_snapshot!(text);
}

#[test]
fn wide_slides_lie_over_all_displays_that_show_them() {
    let displays = [(64, 48), (80, 40)];
    let desktop = Desktop::with_displays(&displays);
    let user = User::new();
    let few = "--rows 3 --cols 9 --photos 10 --no-calibration --no-dense";
    user.says(&format!("patterns -o c {few} --projector 144x48"));
    let camera = camera_of(&desktop);
    let line = format!("capture c --display 0,1 --latency 100 {camera}");
    let ended = Ended::of(desktop.spawn(&user, &line));
    assert_eq!(ended.code, 0, "{}", ended.said);
    shown_from(&user, "c", 0, &displays);
    let mut text = String::new();
    for line in [
        "c --display 0",
        "c --display 1,1",
        "c --display 0 --dark 0",
        "c --display 0,1 --dark 2",
        "c c --display 0",
        "c c --display 0,1 --again 3",
        "c c --show true",
    ] {
        let ended = Ended::of(desktop.spawn(&user, &format!("capture {line} {camera}")));
        text += &ended.with_code();
    }
    insta::assert_snapshot!(text);
}

#[test]
fn a_display_that_is_not_there_or_of_another_size_is_refused_with_what_there_is() {
    let desktop = Desktop::start("80x48x24");
    let user = patterns("--no-calibration");
    let mut text = String::new();
    for display in ["0", "7"] {
        let refused = on(
            &desktop,
            &user,
            &format!("{display} --camera 'cp now {{photo}}'"),
        );
        text += &refused.with_code();
    }
    insta::assert_snapshot!(text);
}
