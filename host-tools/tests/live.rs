//! `iltm compensate` on a pipe whose table is replaced while frames flow.

use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/m-panels");

const HEADER: &[u8] = b"YUV4MPEG2 W48 H26 F60:1 C444 XCOLORRANGE=FULL\n";

/// Bytes of a frame with its header.
const FRAME: usize = 6 + 3 * 48 * 26;

fn iltm(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command.current_dir(folder).args(arguments);
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let output = iltm(folder, arguments).stdin(Stdio::null()).output();
    output.expect("the binary is there")
}

/// Two tables of the sample, which differ in brightness.
fn tables(folder: &Path) -> [Vec<u8>; 2] {
    ["0.3", "0.15"].map(|white| {
        let solved = run(
            folder,
            &[
                "solve",
                SAMPLE,
                "-o",
                "made.iltm",
                "--photos",
                "20",
                "--white",
                white,
            ],
        );
        assert!(
            solved.status.success(),
            "{}",
            String::from_utf8_lossy(&solved.stderr)
        );
        fs::read(folder.join("made.iltm")).expect("written")
    })
}

fn frame() -> Vec<u8> {
    let grey = [&[140_u8; 48 * 26][..], &[128; 2 * 48 * 26]].concat();
    [b"FRAME\n", grey.as_slice()].concat()
}

/// The frames of the process, one by one as they come.
fn read_frames(mut out: ChildStdout) -> Receiver<Vec<u8>> {
    let (send, frames) = channel();
    thread::spawn(move || {
        let mut header = vec![0; HEADER.len()];
        out.read_exact(&mut header).expect("a header");
        let mut frame = vec![0; FRAME];
        while out.read_exact(&mut frame).is_ok() && send.send(frame.clone()).is_ok() {}
    });
    frames
}

struct Stream {
    child: Child,
    input: ChildStdin,
    frames: Receiver<Vec<u8>>,
}

impl Stream {
    /// Sends a frame and waits for what becomes of it.
    fn next(&mut self) -> Vec<u8> {
        self.input.write_all(&frame()).expect("a pipe");
        self.input.flush().expect("a pipe");
        let waited = self.frames.recv_timeout(Duration::from_mins(1));
        waited.expect("a frame for each frame")
    }

    /// Sends frames until one is other than `old`; it.
    fn until_other_than(&mut self, old: &[u8]) -> Vec<u8> {
        for _ in 0..3_000 {
            let frame = self.next();
            if frame != old {
                return frame;
            }
            thread::sleep(Duration::from_millis(10));
        }
        panic!("the new table is never used");
    }

    /// Closes the input; what people read.
    fn end(self) -> String {
        drop(self.input);
        let output = self.child.wait_with_output().expect("it ends");
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    }
}

#[test]
fn a_table_replaced_while_frames_flow_is_used_and_a_broken_one_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let [first, second] = tables(folder.path());
    let table = folder.path().join("t.iltm");
    fs::write(&table, &first).expect("written");
    let mut child = iltm(
        folder.path(),
        &["compensate", "t.iltm", "-", "-o", "-", "--watch"],
    )
    .stdin(Stdio::piped())
    .stdout(Stdio::piped())
    .stderr(Stdio::piped())
    .spawn()
    .expect("the binary is there");
    let mut input = child.stdin.take().expect("a pipe");
    input.write_all(HEADER).expect("a pipe");
    let frames = read_frames(child.stdout.take().expect("a pipe"));
    let mut stream = Stream {
        child,
        input,
        frames,
    };
    let old = stream.next();
    assert_eq!(stream.next(), old);
    // Beside its place, then renamed, as `iltm solve` does.
    let beside = folder.path().join("beside");
    fs::write(&beside, &second).expect("written");
    fs::rename(&beside, &table).expect("renamed");
    let new = stream.until_other_than(&old);
    assert_eq!(stream.next(), new);
    // Half a table: for a second and more nothing happens.
    fs::write(&table, &first[..first.len() / 2]).expect("written");
    for _ in 0..100 {
        assert_eq!(stream.next(), new);
        thread::sleep(Duration::from_millis(15));
    }
    fs::write(&table, &first).expect("written");
    assert_eq!(stream.until_other_than(&new), old);
    let said = stream.end();
    assert!(said.contains("the table before stays in use"), "{said}");
    assert!(said.contains("new tables: 2 taken, 1 refused"), "{said}");
}

#[test]
fn a_budget_tells_which_tiers_there_was_time_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let [table, _] = tables(folder.path());
    fs::write(folder.path().join("t.iltm"), table).expect("written");
    let video = [HEADER, &frame().repeat(40)].concat();
    fs::write(folder.path().join("v.y4m"), video).expect("written");
    let line = [
        "--json",
        "compensate",
        "t.iltm",
        "v.y4m",
        "-o",
        "o.y4m",
        "--budget",
    ];
    for (budget, top) in [("0.001", 0), ("10000", 2)] {
        let output = run(folder.path(), &[&line[..], &[budget]].concat());
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let events: Vec<serde_json::Value> = text
            .lines()
            .map(|line| serde_json::from_str(line).expect("an object a line"))
            .collect();
        let (end, changes) = events.split_last().expect("at least the end");
        assert_eq!((&end["event"], &end["frames"]), (&"end".into(), &40.into()));
        assert_eq!(end["overruns"], if top == 0 { 40 } else { 0 });
        let tiers = end["tiers"].as_array().expect("a list").len();
        assert!(tiers > top, "{text}");
        assert_eq!(changes.len() + 1, tiers, "{text}");
    }
}

#[test]
fn what_has_no_frames_to_change_between_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let [table, _] = tables(folder.path());
    fs::write(folder.path().join("t.iltm"), table).expect("written");
    fs::copy(
        Path::new(SAMPLE).join("patterns/000.png"),
        folder.path().join("p.png"),
    )
    .expect("a copy");
    let output = run(
        folder.path(),
        &[
            "compensate",
            "t.iltm",
            "p.png",
            "-o",
            "o.png",
            "--budget",
            "16",
        ],
    );
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("still picture"));
    assert!(!folder.path().join("o.png").exists());
}
