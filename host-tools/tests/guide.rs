//! Follows the site's pages from the first to the last command, each in an empty folder, on
//! simulated photographs.
//!
//! Blocks of commands are marked ```` ```sh ````. `exit=N` says that the last command of a
//! block ends with that code, `hardware` that it needs a camera and a projector, `device`
//! that it needs a device. Those run with stand-ins: programs with the names of the real
//! ones that do to files what these do, slides shown to nobody, and the emulated board.

#![cfg(unix)]

use iltm_tests::firmware::elf;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Some commands of a page.
struct Block {
    marks: Vec<String>,
    commands: Vec<String>,
}

impl Block {
    fn is(&self, mark: &str) -> bool {
        self.marks.iter().any(|own| own == mark)
    }

    /// The exit code that its last command ends with.
    fn code(&self) -> i32 {
        let code = self
            .marks
            .iter()
            .find_map(|mark| mark.strip_prefix("exit="));
        code.map_or(0, |code| code.parse().expect("an exit code"))
    }
}

fn source(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The blocks of commands of a page, in order.
fn blocks(page: &str) -> Vec<Block> {
    let text = fs::read_to_string(source("../docs").join(page)).expect("a page");
    let mut blocks = Vec::new();
    let mut inside: Option<Block> = None;
    for line in text.lines() {
        match (&mut inside, line.strip_prefix("```")) {
            (None, Some(marks)) => {
                inside = Some(Block {
                    marks: marks.split_whitespace().map(str::to_owned).collect(),
                    commands: Vec::new(),
                });
            }
            (Some(_), Some(_)) => blocks.extend(inside.take()),
            (Some(block), None) => block.commands.push(line.to_owned()),
            (None, None) => {}
        }
    }
    blocks.retain(|block| block.is("sh"));
    blocks
}

/// Programs that the pages name beside `iltm`, as far as files are concerned. Cameras
/// write to their last argument what the slide that is shown looks like.
const STAND_INS: [(&str, &str); 5] = [
    ("gphoto2", CAMERA),
    ("v4l2-ctl", CAMERA),
    ("libcamera-still", CAMERA),
    ("ffmpeg", "exec cat loop.y4m"),
    ("mpv", "exec cat > played.y4m"),
];

const CAMERA: &str = "for photo; do :; done; exec cp \"$(cat shown)\" \"${photo#*=}\"";

/// Whoever follows a page.
struct Follower {
    folder: TempDir,
    board: Option<Child>,
}

impl Drop for Follower {
    fn drop(&mut self) {
        if let Some(board) = &mut self.board {
            // Asked to, it takes its emulator along.
            let pid = board.id().to_string();
            let _ = Command::new("kill").args(["-TERM", &pid]).status();
            let _ = board.wait();
        }
    }
}

impl Follower {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let place = folder.path();
        let programs = place.join("programs");
        fs::create_dir(&programs).expect("made");
        symlink(env!("CARGO_BIN_EXE_iltm"), programs.join("iltm")).expect("linked");
        for (name, script) in STAND_INS {
            let path = programs.join(name);
            fs::write(&path, format!("#!/bin/sh\n{script}\n")).expect("written");
            fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("allowed");
        }
        let scene = source("scenes/installation.toml");
        fs::copy(scene, place.join("installation.toml")).expect("copied");
        let poster = image::RgbImage::from_fn(320, 240, |x, y| {
            image::Rgb([80 + (x / 2) as u8, 120, 60 + (y / 2) as u8])
        });
        let poster = image::DynamicImage::from(poster).into_luma8();
        poster.save(place.join("poster.png")).expect("written");
        fs::write(place.join("loop.y4m"), video(3)).expect("written");
        Self {
            folder,
            board: None,
        }
    }

    fn bash(&self, command: &str) -> Output {
        let programs = self.folder.path().join("programs");
        let path = std::env::var("PATH").expect("a path");
        let mut bash = Command::new("bash");
        bash.args(["-o", "pipefail", "-c", command]);
        bash.current_dir(self.folder.path());
        bash.env("PATH", format!("{}:{path}", programs.display()));
        bash.env("ILTM_CONFIG_DIR", self.folder.path().join("config"));
        bash.env("ILTM_STATE_DIR", self.folder.path().join("state"));
        bash.stdin(Stdio::null());
        bash.output().expect("bash is there")
    }

    fn succeed(&self, command: &str) {
        self.end_with(command, 0);
    }

    fn end_with(&self, command: &str, code: i32) {
        let output = self.bash(command);
        let (said, printed) = (
            String::from_utf8_lossy(&output.stderr),
            String::from_utf8_lossy(&output.stdout[..output.stdout.len().min(2_000)]),
        );
        assert_eq!(
            output.status.code(),
            Some(code),
            "{command}\n{said}\n{printed}"
        );
    }

    fn follow(&mut self, block: &Block) {
        let last = block.commands.len().saturating_sub(1);
        for (at, command) in block.commands.iter().enumerate() {
            if block.is("hardware") {
                self.photograph(command);
                continue;
            }
            if block.is("device") && self.board.is_none() {
                self.board = Some(self.emulated());
            }
            self.end_with(command, if at == last { block.code() } else { 0 });
        }
    }

    /// Runs a command that shows slides and takes photographs. What the camera sees of
    /// each is simulated before. Where all photographs are there already, the camera is
    /// given three of them to take again.
    fn photograph(&self, command: &str) {
        let capture = command
            .split(' ')
            .nth(2)
            .expect("the folder is named third");
        let twin = self.folder.path().join("twin");
        if self
            .folder
            .path()
            .join(capture)
            .join("photos")
            .join(FIRST)
            .exists()
        {
            for name in [FIRST, "005.png", "017.png"] {
                fs::remove_file(self.folder.path().join(capture).join("photos").join(name))
                    .expect("a photograph");
            }
        } else {
            let _ = fs::remove_dir_all(&twin);
            self.succeed(&format!("cp -r {capture} twin"));
            self.succeed("iltm simulate installation.toml --photograph twin --without drift");
        }
        let show = "--show 'echo twin/photos/$(basename {slide}) > shown' --latency 0";
        assert!(command.contains("--display 1"), "{command}");
        self.succeed(&command.replace("--display 1", show));
        self.end_with(&format!("iltm capture {capture} --list"), 0);
    }

    /// An emulated board, ready to talk.
    fn emulated(&self) -> Child {
        let firmware = elf(iltm::device::emulator::Board::An500, "firmware");
        let mut emulate = Command::new(env!("CARGO_BIN_EXE_iltm"));
        emulate.arg("emulate").arg("--firmware").arg(firmware);
        emulate.current_dir(self.folder.path());
        emulate.env("ILTM_CONFIG_DIR", self.folder.path().join("config"));
        emulate.env("ILTM_STATE_DIR", self.folder.path().join("state"));
        emulate
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let board = emulate.spawn().expect("the binary is there");
        let limit = Instant::now() + Duration::from_mins(1);
        while !self.bash("iltm status").status.success() {
            assert!(Instant::now() < limit, "the board does not answer");
            thread::sleep(Duration::from_millis(100));
        }
        board
    }
}

/// Name of the first photograph of a session.
const FIRST: &str = "000.png";

/// A few frames of 320 x 240, brighter and brighter.
fn video(frames: u8) -> Vec<u8> {
    let mut video = b"YUV4MPEG2 W320 H240 F25:1 Ip A1:1 C420jpeg\n".to_vec();
    for frame in 0..frames {
        video.extend(b"FRAME\n");
        video.extend(std::iter::repeat_n(60 + 30 * frame, 320 * 240));
        video.extend(std::iter::repeat_n(128, 320 * 120));
    }
    video
}

fn follow(page: &str) -> Follower {
    let mut follower = Follower::new();
    let blocks = blocks(page);
    assert!(!blocks.is_empty(), "{page} has commands");
    for block in &blocks {
        follower.follow(block);
    }
    follower
}

#[test]
fn the_technicians_guide_is_followed_from_the_first_to_the_last_command() {
    let follower = follow("guide.md");
    let place = follower.folder.path();
    for page in [
        "foyer-check/check.html",
        "foyer-report/report.html",
        "foyer-verify/verdict/verdict.html",
    ] {
        assert!(place.join(page).exists(), "{page}");
    }
    let played = fs::read(place.join("played.y4m")).expect("the player got a video");
    assert_eq!(played.len(), video(3).len());
}

#[test]
fn the_quick_start_works_as_it_is_written() {
    let follower = follow("quick-start.md");
    let place = follower.folder.path();
    let page = fs::read_to_string(place.join("man/iltm-solve.1")).expect("a manual page");
    assert!(page.contains("iltm\\-solve"), "{page}");
    let script = fs::read_to_string(place.join("iltm.bash")).expect("completions");
    assert!(script.contains("complete -F _iltm"), "{script}");
}
