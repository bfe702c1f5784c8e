//! `iltm emulate` with a key: what a technician can try of refusals without hardware.

use super::user::{User, interrupt};
use iltm::compile::sign::new_key;
use iltm::device::emulator::Board;
use iltm_runtime::image::Seal;
use iltm_tests::firmware::elf;
use iltm_tests::{signed, wedge_table};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};

/// A running `iltm emulate`, and the port that it said.
struct Emulated {
    child: Child,
    port: String,
}

impl Emulated {
    fn start(user: &User, arguments: &str) -> Self {
        let mut command = user.iltm(&format!("--json emulate {arguments}"));
        command.arg("--firmware").arg(elf(Board::An500, "firmware"));
        let mut child = command.stderr(Stdio::null()).spawn().expect("a binary");
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
        interrupt(&self.child);
        let _ = self.child.wait();
    }
}

#[test]
fn a_board_with_a_key_from_its_factory_takes_only_tables_that_are_signed_with_it() {
    let user = User::new();
    let key = new_key(&user.path("iltm.key")).expect("writable");
    let other = new_key(&user.path("other.key")).expect("writable");
    let [first, second] = [wedge_table(4, 6, 1), wedge_table(4, 5, 1)];
    let write = |name: &str, table: &[u8], key, version, device| {
        user.write(name, signed(table, key, version, 0, device));
    };
    write("first.iltm", &first, &key, 2, 9);
    user.write("unsigned.iltm", &second);
    write("wrong-key.iltm", &second, &other, 2, 9);
    write("older.iltm", &second, &key, 1, 9);
    write("other-device.iltm", &second, &key, 2, 10);
    write("good.iltm", &second, &key, 2, 0);

    let board = Emulated::start(&user, "first.iltm --key iltm.key --memory board --device 9");
    let status = || user.json(&format!("status --port {}", board.port));
    let before = status();
    let id = Seal::key_id(key.verifying_key().as_bytes());
    let id = format!("{:016x}", u64::from_be_bytes(id));
    assert_eq!(before["update"]["key"], id);
    assert_eq!(before["device"]["number"], "0000000000000009");
    assert_eq!(before["table"]["version"], 2, "the signed table is in use");
    let flash = |name: &str, code| {
        user.fails(
            code,
            &format!("flash {name} --confirm --port {}", board.port),
        );
    };
    for (name, code) in [
        ("unsigned.iltm", 21),
        ("wrong-key.iltm", 22),
        ("older.iltm", 24),
        ("other-device.iltm", 25),
    ] {
        flash(name, code);
        assert_eq!(status()["table"], before["table"], "{name}");
    }
    flash("good.iltm", 0);
    assert_ne!(status()["table"], before["table"]);
    drop(board);

    // A board keeps its key, and a number comes with a key.
    user.fails(28, "emulate --key other.key --memory board --device 9");
    user.fails(2, "emulate --device 9");
}
