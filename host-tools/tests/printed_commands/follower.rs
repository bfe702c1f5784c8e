//! Follower of a page: a fresh clone, stand-ins for hardware and for programs of others,
//! and commands run by bash.

use super::names::look_up;
use super::page::{ALL_TESTS, Block};
use iltm::device::emulator::Board;
use iltm_tests::firmware::{elf, without_cargos_variables};
use iltm_tests::reference_pages::root;
use serde_json::Value;
use std::env;
use std::ffi::OsStr;
use std::fs::{self, File, Permissions};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Programs that the pages name beside those of the repository and of the system, as far as
/// files are concerned. Cameras write to their last argument what the slide that is shown
/// looks like.
const STAND_INS: [(&str, &str); 7] = [
    ("CMD", CAMERA),
    ("gphoto2", CAMERA),
    ("v4l2-ctl", CAMERA),
    ("libcamera-still", CAMERA),
    ("ffmpeg", FFMPEG),
    ("mpv", "exec cat > played.y4m"),
    // Fuzzing has no end: only whether the target is there.
    (
        "cargo-fuzz",
        "for target; do :; done; exec test -f \"fuzz_targets/$target.rs\"",
    ),
];

/// Writes what it is given, if that is a Y4M file, or else a film, in the aspect that it is
/// asked for; of a picture the first frame, of numbered ones forty others. To its last argument,
/// which may be a pipe.
const FFMPEG: &str = "films=${0%/*}
for made; do [ \"$last\" = -i ] && input=$made; last=$made; done
case \"$input\" in
*.y4m) film=$input;;
*=1280x800:*) film=$films/wide.y4m;;
*) film=$films/film.y4m;;
esac
case \"$made\" in
-) exec cat \"$film\";;
*%02d.png) exec cp \"$films/frames/\"*.png \"${made%/*}\";;
*.png) exec cp \"$films/still.png\" \"$made\";;
*) exec cp \"$film\" \"$made\";;
esac";

const CAMERA: &str = "for photo; do :; done; exec cp \"$(cat shown)\" \"${photo#*=}\"";

/// Words on the pages that stand for what a reader has.
const YOUR_BOARD: &str = "YOUR-BOARD";
const YOUR_PORT: &str = "--port PORT";

/// The command that asks whether it is meant.
const ASKS: &str = "iltm key install";

/// Where cargo keeps what it builds, which clones share.
const BUILT: &str = "target";
const FIRMWARE_BUILT: &str = "runtime/firmware/target";

const SCENES: &str = "host-tools/scenes";
const SAMPLE: &str = "host-tools/samples/m-panels";

/// Name of the first photograph of a session.
const FIRST: &str = "000.png";

/// Longest until something that keeps running has begun: it may have to be built.
const PATIENCE: Duration = Duration::from_mins(30);

/// Whoever follows a page.
pub(crate) struct Follower {
    /// Folder of the clone, the stand-ins, the settings, and what is installed.
    place: PathBuf,
    /// A fresh clone; commands are run at its root.
    clone: PathBuf,
    /// Long blocks are run as well.
    full: bool,
    /// All pages have one place.
    _alone: MutexGuard<'static, ()>,
    running: Vec<Child>,
}

impl Drop for Follower {
    fn drop(&mut self) {
        for child in &mut self.running {
            // Of the process group: asked to, a board takes its emulator along.
            let group = format!("-{}", child.id());
            let _ = Command::new("kill").args(["-TERM", "--", &group]).status();
            let _ = child.wait();
        }
    }
}

impl Follower {
    /// Somebody with a fresh clone. It is always at the same place: cargo builds there what
    /// it did not build before, and tests that it builds look for their files at that place.
    pub(crate) fn new(full: bool) -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let pages = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pages");
        let place = pages.join("reader");
        let _ = fs::remove_dir_all(&place);
        let (clone, programs) = (place.join("clone"), place.join("programs"));
        fresh_clone(&clone);
        share(&pages.join(BUILT), &clone.join(BUILT));
        share(&root().join(FIRMWARE_BUILT), &clone.join(FIRMWARE_BUILT));
        fs::create_dir_all(&programs).expect("made");
        symlink(env!("CARGO_BIN_EXE_iltm"), programs.join("iltm")).expect("linked");
        for (name, script) in STAND_INS {
            let path = programs.join(name);
            fs::write(&path, format!("#!/bin/sh\n{script}\n")).expect("written");
            fs::set_permissions(&path, Permissions::from_mode(0o755)).expect("allowed");
        }
        fs::write(programs.join("film.y4m"), video(3, (320, 180))).expect("written");
        fs::write(programs.join("wide.y4m"), video(3, (320, 200))).expect("written");
        still(&programs.join("still.png"), (320, 200));
        frames(&programs.join("frames"));
        Self {
            place,
            clone,
            full,
            _alone: alone,
            running: Vec::new(),
        }
    }

    /// Runs a block. Where it is left to the full run, looks up what it names instead, and
    /// returns false.
    pub(crate) fn follow(&mut self, block: &Block) -> bool {
        for name in block.values("given") {
            self.give(name);
        }
        let hardware = block.values("hardware").next();
        if block.text.trim_end() == ALL_TESTS {
            self.run_all_tests();
        } else if block.is("long") && !self.full {
            self.succeed(&format!("bash -n <<'END'\n{}END", block.text));
            for line in block.text.lines() {
                look_up(line).unwrap_or_else(|why| panic!("{}: {why}", block.place));
            }
            return false;
        } else if let Some(scene) = hardware {
            for command in block.text.lines() {
                if command.starts_with("iltm capture ") {
                    self.photograph(command, scene);
                } else {
                    self.succeed(command);
                }
            }
        } else {
            if block.is("device") {
                self.connect();
            }
            let script = self.with_what_it_has(&block.text);
            if block.is("keeps-running") {
                self.keep_running(&script);
            } else {
                self.end_with(&script, block.code());
            }
        }
        true
    }

    /// Checks the clone after the last command, before the next page takes its place.
    pub(crate) fn finish(mut self, check: fn(&Path)) {
        self.check_what_runs();
        check(&self.clone);
    }

    fn bash(&self, script: &str) -> Command {
        let mut bash = Command::new("bash");
        without_cargos_variables(&mut bash);
        let installed = self.place.join("installed");
        let programs = [installed.join("bin"), self.place.join("programs")];
        let path = env::var_os("PATH").expect("a path");
        let path = env::join_paths(programs.into_iter().chain(env::split_paths(&path)));
        bash.args(["-e", "-x", "-o", "pipefail", "-c", script])
            .current_dir(&self.clone)
            .env("PATH", path.expect("no colons in it"))
            .env("CARGO_INSTALL_ROOT", installed)
            .env("BROWSER", "true")
            // In a container everything is root's.
            .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
            .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
            .env("ILTM_CONFIG_DIR", self.place.join("config"))
            .env("ILTM_STATE_DIR", self.place.join("state"))
            .env_remove("ILTM_PAGES")
            .stdin(Stdio::null());
        bash
    }

    fn succeed(&self, script: &str) -> Vec<u8> {
        self.end_with(script, 0)
    }

    /// Runs commands of which the last ends with a code, and all before with success;
    /// returns what they print.
    fn end_with(&self, script: &str, code: i32) -> Vec<u8> {
        let output = self.bash(script).output().expect("bash is there");
        assert_eq!(
            output.status.code(),
            Some(code),
            "{script}\n{}\n{}",
            String::from_utf8_lossy(&output.stderr),
            String::from_utf8_lossy(&output.stdout[..output.stdout.len().min(2_000)]),
        );
        output.stdout
    }

    /// Runs commands of which the last does not end, until it has printed something.
    fn keep_running(&mut self, script: &str) {
        let said = self.place.join(format!("said-{}", self.running.len()));
        let file = |path: &Path| File::create(path).expect("a file");
        let mut bash = self.bash(script);
        bash.process_group(0)
            .stdout(file(&said))
            .stderr(file(&said.with_extension("errors")));
        self.running.push(bash.spawn().expect("bash is there"));
        self.wait(|_| fs::metadata(&said).is_ok_and(|said| said.len() > 0));
    }

    /// Waits for something that is there while all keeps running.
    fn wait(&mut self, is_there: impl Fn(&Self) -> bool) {
        let limit = Instant::now() + PATIENCE;
        while !is_there(self) {
            self.check_what_runs();
            assert!(Instant::now() < limit, "nothing comes");
            thread::sleep(Duration::from_millis(100));
        }
    }

    fn check_what_runs(&mut self) {
        for (index, child) in self.running.iter_mut().enumerate() {
            let ended = child.try_wait().expect("a child");
            let said = self.place.join(format!("said-{index}.errors"));
            let said = fs::read_to_string(said).unwrap_or_default();
            assert!(
                ended.is_none(),
                "what should keep running has ended\n{said}"
            );
        }
    }

    /// Has a device that answers: the one that a page has started, or one that was there
    /// with a table in use.
    fn connect(&mut self) {
        if self.running.is_empty() {
            let firmware = elf(Board::An500, "firmware");
            let table = self.place.join("table-before.iltm");
            self.succeed(&format!("iltm solve {SAMPLE} -o '{}'", table.display()));
            self.keep_running(&format!(
                "iltm emulate --firmware '{}' '{}'",
                firmware.display(),
                table.display()
            ));
        }
        self.wait(|it| {
            let status = it.bash("iltm status").output();
            status.is_ok_and(|status| status.status.success())
        });
    }

    /// Commands with this reader's port and board in the place of the words for them, and
    /// with the answer to the one question that is asked at a terminal.
    fn with_what_it_has(&self, commands: &str) -> String {
        let commands = commands.replace(YOUR_BOARD, Board::An500.name());
        let commands = commands.replace(ASKS, &format!("{ASKS} --yes"));
        if !commands.contains(YOUR_PORT) {
            return commands;
        }
        let ports: Value =
            serde_json::from_slice(&self.succeed("iltm ports --json")).expect("one JSON object");
        let port = ports["devices"][0]["port"].as_str();
        commands.replace(YOUR_PORT, &format!("--port {}", port.expect("a device")))
    }

    /// Gives the reader a file that no command before has made.
    fn give(&self, name: &str) {
        let path = self.clone.join(name);
        assert!(!path.exists(), "{name} is there already");
        match path.extension().and_then(OsStr::to_str) {
            Some("toml") => {
                fs::copy(root().join(SCENES).join(name), path).expect("a scene");
            }
            Some("png") => {
                still(&path, (320, 180));
            }
            Some("y4m") => fs::write(path, video(3, (320, 180))).expect("written"),
            Some("iltm") => {
                self.succeed(&format!("iltm solve {SAMPLE}-colour -o {name}"));
            }
            _ => {
                self.succeed(&format!("cp -r {SAMPLE} {name}"));
            }
        }
    }

    /// Runs a command that shows slides and takes photographs. What the camera sees of
    /// each is simulated before. Where all photographs are there already, the camera is
    /// given three of them to take again.
    fn photograph(&self, command: &str, scene: &str) {
        let capture = command.split(' ').nth(2);
        let capture = capture.expect("the folder is named third");
        let photos = self.clone.join(capture).join("photos");
        if photos.join(FIRST).exists() {
            for name in [FIRST, "005.png", "017.png"] {
                fs::remove_file(photos.join(name)).expect("a photograph");
            }
        } else {
            self.succeed(&format!(
                "rm -rf twin; cp -r {capture} twin
                iltm simulate {SCENES}/{scene}.toml --photograph twin --without drift"
            ));
        }
        let show = "--show 'echo twin/photos/$(basename {slide}) > shown' --latency 0";
        assert!(command.contains("--display 1"), "{command}");
        self.succeed(&command.replace("--display 1", show));
        self.succeed(&format!("iltm capture {capture} --list"));
    }

    /// The command that runs this test cannot be run by it. The short run sees that it is
    /// what runs on every change, that bash understands it, and that it comes to this test.
    /// The full run gives it a clone in which nothing was built; its own run is a short one.
    fn run_all_tests(&self) {
        if self.full {
            for built in [BUILT, FIRMWARE_BUILT] {
                fs::remove_file(self.clone.join(built)).expect("a link");
            }
            self.succeed(ALL_TESTS);
            return;
        }
        let read = |path| fs::read_to_string(self.clone.join(path)).expect("a script");
        let on_change = format!("exec {ALL_TESTS}");
        assert_eq!(read(".ci/run").lines().last(), Some(on_change.as_str()));
        let script = ALL_TESTS.trim_start_matches("bash ");
        self.succeed(&format!("bash -n {script}"));
        let script = read(script);
        for line in [
            "tests=(cargo test --workspace ",
            "\"${tests[@]}\" --test printed_commands -- followed:: ",
            "\"${tests[@]}\" -- --skip followed:: ",
        ] {
            assert!(script.contains(&format!("\n{line}")), "{line}");
        }
    }
}

/// Files of the repository, changed and new ones included, from its root.
pub(crate) fn files() -> Vec<PathBuf> {
    let listed = Command::new("git")
        // Also where the folder belongs to another user, as in containers.
        .args(["-c", "safe.directory=*", "ls-files", "-z"])
        .args(["--cached", "--others", "--exclude-standard"])
        .current_dir(root())
        .output()
        .expect("git is there");
    assert!(
        listed.status.success(),
        "a clone of the repository is needed"
    );
    let names = listed.stdout.split(|byte| *byte == 0);
    let names = names.filter(|name| !name.is_empty());
    let paths = names.map(|name| PathBuf::from(OsStr::from_bytes(name)));
    paths.filter(|path| root().join(path).is_file()).collect()
}

/// Makes a repository with these files and nothing else. They keep their age, by which cargo
/// knows what it has built.
fn fresh_clone(clone: &Path) {
    for path in files() {
        let (from, to) = (root().join(&path), clone.join(&path));
        fs::create_dir_all(to.parent().expect("a folder")).expect("made");
        fs::copy(&from, &to).expect("copied");
        let modified = fs::metadata(&from).and_then(|from| from.modified());
        let copy = File::open(&to).expect("a copy");
        copy.set_modified(modified.expect("a time")).expect("set");
    }
    let git = Command::new("git").args(["init", "-q"]).arg(clone).status();
    assert!(git.is_ok_and(|status| status.success()));
}

/// Makes one name more for a folder.
fn share(folder: &Path, name: &Path) {
    fs::create_dir_all(folder).expect("made");
    symlink(folder, name).expect("linked");
}

/// A few frames of 320 x 240, brighter and brighter.
pub(crate) fn video(frames: u8, (width, height): (usize, usize)) -> Vec<u8> {
    let header = format!("YUV4MPEG2 W{width} H{height} F25:1 Ip A1:1 C420jpeg\n");
    let mut video = header.into_bytes();
    for frame in 0..frames {
        video.extend(b"FRAME\n");
        video.extend(std::iter::repeat_n(60 + 30 * frame, width * height));
        video.extend(std::iter::repeat_n(128, width * height / 2));
    }
    video
}

/// Forty pictures that differ from each other.
fn frames(folder: &Path) {
    fs::create_dir(folder).expect("made");
    let mut dice = fastrand::Rng::with_seed(1);
    for number in 0..40 {
        let picture = image::GrayImage::from_fn(16, 10, |_, _| image::Luma([dice.u8(..)]));
        let path = folder.join(format!("{number:02}.png"));
        picture.save(path).expect("written");
    }
}

/// A grey picture of this size.
fn still(path: &Path, (width, height): (u32, u32)) {
    let poster = image::RgbImage::from_fn(width, height, |x, y| {
        image::Rgb([80 + (x / 2) as u8, 120, 60 + (y / 2) as u8])
    });
    let poster = image::DynamicImage::from(poster).into_luma8();
    poster.save(path).expect("written");
}
