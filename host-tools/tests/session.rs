//! `iltm patterns` and `iltm capture` as a user meets them: a folder is made, and
//! photographed by a camera of a few shell commands; where X can be had without a
//! screen, on a display too.
#![cfg(unix)]

use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use tempfile::TempDir;

fn iltm(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command.current_dir(folder).args(arguments);
    command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    command.env_remove("WAYLAND_SOCKET");
    command.stdin(Stdio::null());
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let output = iltm(folder, arguments).output();
    output.expect("the binary is there")
}

/// Exit code and what people read.
fn said(output: &Output) -> String {
    let code = output.status.code().expect("not killed");
    format!("exit {code}\n{}", String::from_utf8_lossy(&output.stderr))
}

/// A folder with a capture `c` of 3 x 4 cells that nobody has photographed.
fn patterns(more: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut arguments = vec!["patterns", "-o", "c", "--rows", "3", "--cols", "4"];
    arguments.extend(["--photos", "2", "--projector", "64x48"]);
    arguments.extend(more);
    let output = run(folder.path(), &arguments);
    assert!(output.status.success(), "{}", said(&output));
    folder
}

fn events(output: &Output) -> Vec<Value> {
    let text = String::from_utf8_lossy(&output.stdout);
    let lines = text.lines();
    lines
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect()
}

#[test]
fn a_folder_of_patterns_says_how_many_slides_it_has() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let arguments = [
        "patterns", "-o", "c", "--rows", "3", "--cols", "4", "--json",
    ];
    let output = run(folder.path(), &arguments);
    assert!(output.stderr.is_empty());
    let data: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let slides = fs::read_dir(folder.path().join("c/slides"))
        .expect("made")
        .count();
    assert_eq!(data["slides"], slides);
    // White, black, 9 + 3 * 8 levels, two probes, 2 * (2 + 2) stripes and 150 by chance;
    // white and black return after every 16 of all but the first two, and last.
    let others = 33 + 2 + 8 + 150_usize;
    assert_eq!(slides, 2 + others + 2 * others.div_ceil(16));
    insta::assert_snapshot!(said(&run(folder.path(), &arguments[..7])));
}

#[test]
fn sizes_that_cannot_be_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut text = String::new();
    for more in [
        ["--rows", "30", "--cols", "0"],
        ["--rows", "300", "--cols", "300"],
        ["--rows", "15", "--cols", "1921"],
    ] {
        let arguments = [&["patterns", "-o", "c"], &more[..]].concat();
        text += &said(&run(folder.path(), &arguments));
    }
    insta::assert_snapshot!(text);
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 0);
}

#[test]
fn help_names_cameras_to_copy() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for command in ["patterns", "capture"] {
        let output = run(folder.path(), &[command, "--help"]);
        insta::assert_snapshot!(command, String::from_utf8_lossy(&output.stdout));
    }
}

#[test]
fn a_session_tells_programs_an_event_a_line() {
    let folder = patterns(&["--no-calibration"]);
    let arguments = ["capture", "c", "--json", "--show", "cp {slide} now"];
    let arguments = [&arguments[..], &["--camera", "cp now {photo}"]].concat();
    let output = run(folder.path(), &arguments);
    assert!(output.status.success(), "{}", said(&output));
    assert!(output.stderr.is_empty());
    let events = events(&output);
    let named = |name: &str| events.iter().filter(|event| event["event"] == name).count();
    let slides = fs::read_dir(folder.path().join("c/slides"))
        .expect("made")
        .count();
    assert_eq!((named("begun"), named("latency"), named("done")), (1, 1, 1));
    assert_eq!((named("shown"), named("taken")), (slides, slides));
    assert_eq!(events.last().expect("some")["taken"], slides);
    // Nothing is left to do, so nothing is asked for.
    let again = run(folder.path(), &["capture", "c", "--list"]);
    assert_eq!(
        said(&again),
        format!("exit 0\ncapture     c: {slides} of {slides} photographs are there\n")
    );
}

#[test]
fn what_is_missing_is_listed() {
    let folder = patterns(&["--no-calibration"]);
    for index in [0, 1, 2, 5, 7] {
        let (from, to) = (
            format!("c/slides/{index:03}.png"),
            format!("c/photos/{index:03}.png"),
        );
        fs::copy(folder.path().join(from), folder.path().join(to)).expect("a copy");
    }
    fs::write(folder.path().join("c/photos/003.png"), "P").expect("written");
    let text = said(&run(folder.path(), &["capture", "c", "--list"]));
    let place = folder.path().canonicalize().expect("there");
    insta::assert_snapshot!(text.replace(&*place.to_string_lossy(), "FOLDER"));
}

#[test]
fn a_session_without_a_camera_or_a_screen_is_a_mistake_in_the_command() {
    let folder = patterns(&["--no-calibration"]);
    for arguments in [
        &["capture", "c"][..],
        &["capture", "c", "--show", "true"],
        &["capture", "c", "--camera", "cp now {photo}"],
        &["capture", "c", "--show", "true", "--camera", "cp now there"],
        &[
            "capture", "c", "--show", "true", "--camera", "{photo}", "--again", "9-7",
        ],
        &[
            "capture", "c", "--show", "true", "--camera", "{photo}", "--again", "99",
        ],
    ] {
        let text = said(&run(folder.path(), arguments));
        assert!(text.starts_with("exit 2\n"), "{arguments:?}: {text}");
    }
}

#[test]
fn a_camera_that_fails_and_a_desktop_that_is_not_there_have_codes_of_their_own() {
    let folder = patterns(&["--no-calibration"]);
    let camera = [
        "capture",
        "c",
        "--retries",
        "0",
        "--latency",
        "0",
        "--show",
        "true",
    ];
    let camera = [
        &camera[..],
        &["--camera", "echo no battery; exit 7 # {photo}"],
    ]
    .concat();
    let mut text = said(&run(folder.path(), &camera));
    let display = [
        "capture",
        "c",
        "--display",
        "0",
        "--camera",
        "cp now {photo}",
    ];
    let no_desktop = said(&run(folder.path(), &display));
    assert!(no_desktop.starts_with("exit 33\n"), "{no_desktop}");
    assert!(no_desktop.contains("--show"), "{no_desktop}");
    text += &said(&run(folder.path(), &["capture", "nowhere", "--list"]));
    insta::assert_snapshot!(text);
}

#[test]
fn ctrl_c_ends_a_session_that_can_go_on() {
    let folder = patterns(&["--no-calibration"]);
    let camera = "if [ {index} = 4 ]; then touch four; sleep 60; fi; cp now {photo}";
    let arguments = [
        "capture",
        "c",
        "--json",
        "--latency",
        "0",
        "--show",
        "cp {slide} now",
    ];
    let mut session = iltm(
        folder.path(),
        &[&arguments[..], &["--camera", camera]].concat(),
    )
    .stdout(Stdio::piped())
    .spawn()
    .expect("the binary is there");
    let mut lines = BufReader::new(session.stdout.take().expect("piped")).lines();
    // Until the fourth is on the wall.
    let shown = lines.by_ref().map(|line| line.expect("text"));
    let fourth = |line: &String| line.contains("\"shown\"") && line.contains("\"index\":4");
    assert!(shown.into_iter().any(|line| fourth(&line)));
    let interrupted = Command::new("kill")
        .args(["-INT", &session.id().to_string()])
        .status();
    assert!(interrupted.expect("there is a kill").success());
    let mut rest = String::new();
    for line in lines {
        rest += &line.expect("text");
    }
    assert_eq!(session.wait().expect("ends").code(), Some(29), "{rest}");
    assert!(rest.contains("interrupted"), "{rest}");
    let mut photos: Vec<PathBuf> = fs::read_dir(folder.path().join("c/photos"))
        .expect("there")
        .map(|entry| entry.expect("there").path())
        .collect();
    photos.sort();
    assert_eq!(photos.len(), 4, "{photos:?}");
    let arguments = [
        "capture",
        "c",
        "--json",
        "--latency",
        "0",
        "--show",
        "cp {slide} now",
    ];
    let arguments = [&arguments[..], &["--camera", "cp now {photo}"]].concat();
    let output = run(folder.path(), &arguments);
    let slides = fs::read_dir(folder.path().join("c/slides"))
        .expect("made")
        .count();
    assert_eq!(events(&output).last().expect("some")["taken"], slides - 4);
}

/// An X server without a screen, its picture in a file.
struct Desktop {
    server: Child,
    display: String,
    folder: TempDir,
}

impl Desktop {
    fn start(size: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", size])
            .arg("-fbdir")
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb is installed: `sudo apt-get install xvfb`");
        let mut number = String::new();
        let mut said = BufReader::new(server.stdout.take().expect("piped"));
        said.read_line(&mut number).expect("a display number");
        Self {
            server,
            display: format!(":{}", number.trim()),
            folder,
        }
    }
}

impl Drop for Desktop {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// What an X server shows, `0RGB` a pixel, from its file in the format of `xwd`
/// (`XWDFile.h`): 25 big-endian words, the second pair of which are sizes, a colour map
/// of 12 bytes an entry, the pixels.
fn on_the_screen(file: &Path) -> (usize, Vec<u32>) {
    let mut bytes = Vec::new();
    let mut opened = fs::File::open(file).expect("kept");
    opened.read_to_end(&mut bytes).expect("readable");
    let word = |at: usize| {
        let word: [u8; 4] = bytes[4 * at..4 * at + 4].try_into().expect("four bytes");
        u32::from_be_bytes(word) as usize
    };
    let (header, width, height, line, colours) = (word(0), word(4), word(5), word(12), word(19));
    let little = word(7) == 0;
    let from = header + 12 * colours;
    let mut pixels = Vec::new();
    for y in 0..height {
        let row = &bytes[from + y * line..][..4 * width];
        for pixel in row.chunks_exact(4) {
            let pixel: [u8; 4] = pixel.try_into().expect("four bytes");
            let value = if little {
                u32::from_le_bytes(pixel)
            } else {
                u32::from_be_bytes(pixel)
            };
            pixels.push(value & 0xff_ff_ff);
        }
    }
    (width, pixels)
}

#[test]
fn slides_fill_a_display_pixel_by_pixel() {
    let desktop = Desktop::start("64x48x24");
    let folder = patterns(&["--ramp", "2"]);
    // What is on the screen is kept; all photographs are alike.
    let screen = desktop.folder.path().join("Xvfb_screen0");
    let camera = format!(
        "cp {} {{index}}.xwd; cp c/slides/000.png {{photo}}",
        screen.display()
    );
    let arguments = [
        "capture",
        "c",
        "--display",
        "0",
        "--latency",
        "100",
        "--camera",
        &camera,
    ];
    let output = iltm(folder.path(), &arguments)
        .env("DISPLAY", &desktop.display)
        .output()
        .expect("the binary is there");
    assert!(output.status.success(), "{}", said(&output));
    let slides = fs::read_dir(folder.path().join("c/slides"))
        .expect("made")
        .count();
    for index in 0..slides {
        let slide = folder.path().join(format!("c/slides/{index:03}.png"));
        let slide = image::open(slide).expect("a slide").to_rgb8();
        let (width, pixels) = on_the_screen(&folder.path().join(format!("{index}.xwd")));
        assert_eq!((width, pixels.len() / width), (64, 48));
        let wanted = slide
            .pixels()
            .map(|pixel| u32::from_be_bytes([0, pixel[0], pixel[1], pixel[2]]));
        assert!(wanted.eq(pixels.iter().copied()), "slide {index}");
    }
}

#[test]
fn a_display_that_is_not_there_or_of_another_size_is_refused_with_what_there_is() {
    let desktop = Desktop::start("80x48x24");
    let folder = patterns(&["--no-calibration"]);
    let mut text = String::new();
    for display in ["0", "7"] {
        let arguments = [
            "capture",
            "c",
            "--display",
            display,
            "--camera",
            "cp now {photo}",
        ];
        let output = iltm(folder.path(), &arguments)
            .env("DISPLAY", &desktop.display)
            .output();
        text += &said(&output.expect("the binary is there"));
    }
    insta::assert_snapshot!(text);
}
