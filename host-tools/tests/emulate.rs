//! `iltm emulate` with a key: what a technician can try of refusals without hardware.

#![cfg(unix)]

use iltm::compile::sign::{SealTerms, new_key, sign};
use iltm::device::emulator::Board;
use iltm_runtime::image::Seal;
use iltm_tests::firmware::elf;
use iltm_tests::wedge_table;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

fn iltm(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command.current_dir(folder).args(arguments);
    command.env("ILTM_CONFIG_DIR", folder.join("config"));
    command.env("ILTM_STATE_DIR", folder.join("state"));
    command.stdin(Stdio::null()).stderr(Stdio::null());
    command
}

/// A running `iltm emulate`, and the port that it said.
struct Emulated {
    child: Child,
    port: String,
}

impl Emulated {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut command = iltm(folder, &["--json", "emulate"]);
        command.arg("--firmware").arg(elf(Board::An500, "firmware"));
        command.args(arguments).stdout(Stdio::piped());
        let mut child = command.spawn().expect("the binary is there");
        let mut line = String::new();
        let mut out = BufReader::new(child.stdout.take().expect("piped"));
        out.read_line(&mut line).expect("text");
        let data: Value = serde_json::from_str(&line).expect("an object");
        let port = data["port"].as_str().expect("it runs").to_owned();
        Self { child, port }
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        // Not killed, or QEMU would be left behind.
        let id = self.child.id().to_string();
        let _ = Command::new("kill").args(["-INT", &id]).status();
        let _ = self.child.wait();
    }
}

#[test]
fn a_board_with_a_key_from_its_factory_takes_only_tables_that_are_signed_with_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    let key = new_key(&path.join("iltm.key")).expect("writable");
    let other = new_key(&path.join("other.key")).expect("writable");
    let terms = |version, device| SealTerms {
        version,
        oldest: 0,
        device,
    };
    let [first, second] = [wedge_table(4, 6, 1), wedge_table(4, 5, 1)];
    let write = |name: &str, file: &[u8]| fs::write(path.join(name), file).expect("writable");
    let signed = |key, terms| sign(&second, key, terms).expect("an image");
    write(
        "first.iltm",
        &sign(&first, &key, terms(2, 9)).expect("an image"),
    );
    write("unsigned.iltm", &second);
    write("wrong-key.iltm", &signed(&other, terms(2, 9)));
    write("older.iltm", &signed(&key, terms(1, 9)));
    write("other-device.iltm", &signed(&key, terms(2, 10)));
    write("good.iltm", &signed(&key, terms(2, 0)));

    let with = ["--memory", "board", "--device", "9"];
    let start = ["first.iltm", "--key", "iltm.key"];
    let board = Emulated::start(path, &[&start[..], &with].concat());
    let status = || {
        let status = iltm(path, &["--json", "status", "--port", &board.port]).output();
        let status = status.expect("the binary is there").stdout;
        serde_json::from_slice::<Value>(&status).expect("an object")
    };
    let before = status();
    let id = Seal::key_id(key.verifying_key().as_bytes());
    let id = format!("{:016x}", u64::from_be_bytes(id));
    assert_eq!(before["update"]["key"], id);
    assert_eq!(before["device"]["number"], "0000000000000009");
    assert_eq!(before["table"]["version"], 2, "the signed table is in use");
    let flash = |name: &str| {
        let flash = iltm(path, &["flash", name, "--confirm", "--port", &board.port]).status();
        flash.expect("the binary is there").code()
    };
    for (name, code) in [
        ("unsigned.iltm", 21),
        ("wrong-key.iltm", 22),
        ("older.iltm", 24),
        ("other-device.iltm", 25),
    ] {
        assert_eq!(flash(name), Some(code), "{name}");
        assert_eq!(status()["table"], before["table"], "{name}");
    }
    assert_eq!(flash("good.iltm"), Some(0));
    assert_ne!(status()["table"], before["table"]);
    drop(board);

    let again = [&["emulate", "--key", "other.key"][..], &with].concat();
    let again = iltm(path, &again).status().expect("the binary is there");
    assert_eq!(again.code(), Some(28), "a board keeps its key");
    let alone = iltm(path, &["emulate", "--device", "9"]).status();
    let alone = alone.expect("the binary is there");
    assert_eq!(alone.code(), Some(2), "a number comes with a key");
}
