//! Interrupted commands: whatever the moment, nothing half-made has its final name, nothing
//! temporary is left, and the exit code says what happened.
//!
//! `ILTM_MOMENTS=20 cargo test -p iltm --test command interruption` interrupts each command at
//! twenty moments; without it, at two.

use crate::user::User;
use crate::{simulate, verify};
use std::cell::LazyCell;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::OnceLock;
use std::thread;
use std::time::Duration;

/// Exit code of an interrupted command.
const INTERRUPTED: i32 = 29;

/// What a command leaves when it is interrupted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Left {
    /// All that it writes, or nothing.
    AllOrNothing,
    /// Some of its files, each whole: the command goes on where it stopped.
    WholeFiles,
}
use Left::{AllOrNothing, WholeFiles};

/// Every command that writes and needs no device, and about how many milliseconds it takes.
const COMMANDS: [(&str, u64, Left); 17] = [
    ("demo --out d", 8_000, AllOrNothing),
    ("simulate scene.toml -o d --photos 10", 500, AllOrNothing),
    ("simulate scene.toml --photograph s", 500, WholeFiles),
    (
        "capture c --latency 0 --show true --camera 'cp c/slides/000.png {photo}'",
        4000,
        WholeFiles,
    ),
    ("check SAMPLE -o d", 900, AllOrNothing),
    (
        "patterns -o d --rows 12 --cols 16 --projector 640x400",
        1000,
        AllOrNothing,
    ),
    ("solve SAMPLE -o d.iltm --report d", 2000, WholeFiles),
    ("bounces SAMPLE -o d", 1300, AllOrNothing),
    ("tradeoff t.iltm -o d", 3000, AllOrNothing),
    ("compare SAMPLE -o d --photos 40", 4000, AllOrNothing),
    ("verify t.iltm -o d --projector 640x400", 800, AllOrNothing),
    ("verify t.iltm v --report d", 1500, AllOrNothing),
    ("refine t.iltm v -o d.iltm", 700, AllOrNothing),
    ("compensate t.iltm video.y4m -o d.y4m", 500, AllOrNothing),
    ("sign t.iltm --key k -o d.iltm", 20, AllOrNothing),
    ("man -o d", 60, AllOrNothing),
    ("support-bundle -o d.zip", 100, AllOrNothing),
];

/// A folder with what the commands need.
fn prepared() -> &'static User {
    static USER: OnceLock<User> = OnceLock::new();
    USER.get_or_init(|| {
        let user = verify::copy();
        simulate::without_photographs_in(&user, "s");
        user.says("patterns -o c --rows 3 --cols 4 --photos 12 --projector 64x48");
        user.says("key new -o k");
        let mut video = b"YUV4MPEG2 W640 H400 F25:1 C420jpeg\n".to_vec();
        for frame in 0..30_u8 {
            video.extend_from_slice(b"FRAME\n");
            video.extend(vec![8 * frame; 640 * 400 * 3 / 2]);
        }
        user.write("video.y4m", video);
        fs::create_dir(user.path("tmp")).expect("writable");
        user.write("tmp/here", "");
        user
    })
}

/// A copy of the prepared folder.
fn copy() -> User {
    let user = User::new();
    for (name, bytes) in files(&prepared().path("")) {
        let place = user.path("").join(name);
        fs::create_dir_all(place.parent().expect("a folder")).expect("writable");
        if !place.ends_with(EMPTY) {
            fs::write(place, bytes).expect("writable");
        }
    }
    user
}

/// The name by which [`files`] lists an empty folder.
const EMPTY: &str = "(empty)";

/// All files below a folder, hidden ones too, and empty folders as files called [`EMPTY`].
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn walk(at: &Path, root: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
        let entries: Vec<_> = fs::read_dir(at).expect("a folder").collect();
        let name = |path: &Path| path.strip_prefix(root).expect("below it").to_owned();
        if entries.is_empty() {
            found.insert(name(&at.join(EMPTY)), Vec::new());
        }
        for entry in entries {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                walk(&path, root, found);
            } else {
                found.insert(name(&path), fs::read(&path).expect("readable"));
            }
        }
    }
    let mut found = BTreeMap::new();
    walk(folder, folder, &mut found);
    found
}

/// Starts a command whose temporary files go to `tmp`.
fn start(user: &User, line: &str) -> Child {
    let mut command = user.iltm(line);
    command.env("TMPDIR", user.path("tmp"));
    command.spawn().expect("the binary is there")
}

/// Waits until a process handles interrupts; whether it still runs.
fn handles_interrupts(child: &mut Child) -> bool {
    let status = format!("/proc/{}/status", child.id());
    loop {
        let caught = fs::read_to_string(&status).unwrap_or_default();
        let caught = caught.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let caught = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        // Signal 2 is SIGINT.
        if caught.is_some_and(|mask| mask & 1 << 1 != 0) {
            return true;
        }
        if child.try_wait().expect("a child").is_some() {
            return false;
        }
        thread::sleep(Duration::from_micros(200));
    }
}

fn moments() -> u32 {
    let given = std::env::var("ILTM_MOMENTS").ok();
    given.map_or(2, |count| count.parse().expect("a number"))
}

#[test]
fn an_interrupted_command_leaves_nothing_half_made() {
    let before = files(&prepared().path(""));
    // The same moments in every run.
    let mut random = 1_u64;
    for (line, took, left) in COMMANDS {
        let took = Duration::from_millis(took);
        let done = LazyCell::new(|| {
            let user = copy();
            user.says(line);
            files(&user.path(""))
        });
        for moment in 0..moments() {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let wait = took.mul_f64((random >> 33) as f64 / f64::from(1_u32 << 31));
            let signal = if moment % 2 == 0 { "-INT" } else { "-TERM" };
            let context = format!("{line}: {signal} after {wait:?} of {took:?}");

            let user = copy();
            let mut child = start(&user, line);
            if handles_interrupts(&mut child) {
                thread::sleep(wait);
                let id = child.id().to_string();
                // It may have ended.
                let _ = Command::new("kill").args([signal, &id]).output();
            }
            let ended = child.wait_with_output().expect("a child");
            assert_eq!(ended.status.signal(), None, "{context}");
            let code = ended.status.code();
            let said = String::from_utf8_lossy(&ended.stderr);
            let is_done = code == Some(0);
            assert!(is_done || code == Some(INTERRUPTED), "{context}: {said}");

            let now = files(&user.path(""));
            let kept = |name: &PathBuf| before.contains_key(name);
            let new: Vec<_> = now.keys().filter(|name| !kept(name)).collect();
            if new.is_empty() && !is_done {
                continue;
            }
            let wanted: Vec<_> = done.keys().filter(|name| !kept(name)).collect();
            let strange: Vec<_> = new.iter().filter(|name| !wanted.contains(name)).collect();
            assert!(strange.is_empty(), "{context}: {strange:?}: {said}");
            for name in &new {
                let (is, whole) = (&now[*name], &done[*name]);
                if left == WholeFiles && name.to_string_lossy().contains("photos") {
                    assert!(is == whole, "{context}: {name:?} is another photograph");
                }
                // Dates and times make little difference to a length.
                let near = is.len().abs_diff(whole.len()) <= 200 + whole.len() / 20;
                assert!(near, "{context}: {name:?} has {} bytes", is.len());
            }
            let is_all = new == wanted;
            match left {
                _ if is_done => assert!(is_all, "{context}"),
                AllOrNothing => assert!(is_all || new.is_empty(), "{context}: {new:?}"),
                WholeFiles => {}
            }
        }
    }
}

#[test]
fn an_interrupt_is_an_object_for_programs() {
    let user = copy();
    let mut child = start(&user, "--json demo --out d");
    assert!(handles_interrupts(&mut child));
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-TERM", &id]).status();
    assert!(sent.expect("every system has it").success());
    let ended = crate::user::Ended::of(child);
    assert_eq!(ended.code, INTERRUPTED);
    let data = ended.json();
    assert_eq!(data["error"]["kind"], "interrupted");
    assert_eq!(data["last"], true);
}
