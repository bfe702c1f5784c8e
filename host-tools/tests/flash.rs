//! Tables on their way to devices as a user meets them: `ports`, `flash`, `confirm`,
//! `rollback`, `key`, `report`, with devices at the end of pseudo-terminals.

#![cfg(unix)]

use ed25519_dalek::SigningKey;
use iltm::compile::sign::{SealTerms, sign};
use iltm::user::{Folders, emulated};
use iltm_runtime::link::SlotState;
use iltm_tests::fake_device::{FakeDevice, FakePort};
use iltm_tests::fake_tables::{FakeTables, SECTOR, slot};
use iltm_tests::wedge_table;
use serde_json::Value;
use std::fs::{self, File};
use std::io::Read;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Bytes of a chunk.
const CHUNK: usize = 512;

/// A table of several sectors, and another one.
fn tables() -> &'static [Vec<u8>; 2] {
    static TABLES: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    TABLES.get_or_init(|| [wedge_table(12, 16, 1), wedge_table(10, 14, 1)])
}

fn key() -> SigningKey {
    SigningKey::from_bytes(&[7; 32])
}

fn signed(table: &[u8], version: u32) -> Vec<u8> {
    let terms = SealTerms {
        version,
        oldest: 0,
        device: 0,
    };
    sign(table, &key(), terms).expect("a table")
}

/// A user with folders and files of their own, who has no serial ports but those that
/// a test makes.
struct User {
    folder: TempDir,
}

impl User {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let user = Self { folder };
        user.exclude(&[]);
        user.write("a.iltm", &tables()[0]);
        user.write("b.iltm", &tables()[1]);
        user
    }

    /// Ports that are never opened: those of the machine, and these.
    fn exclude(&self, more: &[&str]) {
        let mut exclude = vec!["/dev/tty*", "/dev/cu*"];
        exclude.extend(more);
        fs::create_dir_all(self.path("config")).expect("writable");
        self.write(
            "config/config.toml",
            format!("exclude = {exclude:?}\n").as_bytes(),
        );
    }

    fn folders(&self) -> Folders {
        Folders {
            config: self.path("config"),
            state: self.path("state"),
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).expect("writable");
    }

    fn iltm(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
        command.current_dir(self.folder.path()).args(arguments);
        command.env("ILTM_CONFIG_DIR", self.path("config"));
        command.env("ILTM_STATE_DIR", self.path("state"));
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.iltm(arguments).output().expect("the binary is there")
    }

    /// What a command that succeeds says.
    fn says(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{text}");
        text
    }

    /// The objects that a command prints.
    fn events(&self, arguments: &[&str]) -> Vec<Value> {
        let output = self.run(&[&["--json"], arguments].concat());
        let lines = String::from_utf8(output.stdout).expect("text");
        let parse = |line| serde_json::from_str(line).expect("an object a line");
        lines.lines().map(parse).collect()
    }

    /// What a command that fails with this code says.
    fn fails(&self, code: i32, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{text}");
        text
    }
}

fn device() -> FakePort {
    FakePort::new(FakeDevice::with_tables(FakeTables::default()))
}

/// A device that takes tables of [`key`] only, and has version 5 of one in use.
fn strict_device() -> FakePort {
    let public = key().verifying_key().to_bytes();
    let port = FakePort::new(FakeDevice::with_tables(FakeTables::provisioned(public, 9)));
    let user = User::new();
    user.write("5.iltm", &signed(&tables()[0], 5));
    user.says(&["flash", "5.iltm", "--confirm", "--port", port.path()]);
    port
}

fn states(port: &FakePort) -> [SlotState; 2] {
    port.look(|device| device.tables().updater().states())
}

/// Number of chunks that came so far.
fn writes(port: &FakePort) -> usize {
    port.look(|device| device.tables().writes.len())
}

/// Id and version of the table in use.
fn in_use(port: &FakePort) -> String {
    let table = port.look(|device| device.tables().updater().table());
    table.expect("a table").to_string()
}

fn until(what: &str, mut done: impl FnMut() -> bool) {
    let end = Instant::now() + Duration::from_secs(20);
    while !done() {
        assert!(Instant::now() < end, "not in time: {what}");
        thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_table_is_flashed_looked_at_and_confirmed() {
    let (user, port) = (User::new(), device());
    let said = user.says(&["flash", "a.iltm", "--port", port.path()]);
    assert!(said.contains("on trial for 300 s"), "{said}");
    assert!(said.contains("iltm confirm"), "{said}");
    assert_eq!(states(&port), [SlotState::Trial, SlotState::Empty]);
    let said = user.says(&["status", "--port", port.path()]);
    assert!(said.contains("A trial, "), "{said}");
    assert!(said.contains("takes tables from anybody"), "{said}");
    let said = user.says(&["confirm", "--port", port.path()]);
    assert_eq!(
        said,
        format!("Table {} is in use, confirmed.\n", in_use(&port))
    );
    assert_eq!(states(&port), [SlotState::Active, SlotState::Empty]);
    let said = user.says(&["confirm", "--port", port.path()]);
    assert!(said.contains("needs no confirmation"), "{said}");
}

#[test]
fn in_json_every_step_is_a_line_and_the_last_one_the_result() {
    let (user, port) = (User::new(), device());
    let events = user.events(&["flash", "a.iltm", "--confirm", "--port", port.path()]);
    let names: Vec<_> = events.iter().map(|event| event["event"].as_str()).collect();
    let mut kinds = names.clone();
    kinds.dedup();
    let kinds: Vec<_> = kinds.into_iter().flatten().collect();
    assert_eq!(kinds, ["started", "progress", "verified", "trial", "done"]);
    let (started, done) = (&events[0], &events[events.len() - 1]);
    assert_eq!(started["bytes"], tables()[0].len());
    assert_eq!(started["to_send"], tables()[0].len());
    assert_eq!(done["confirmed"], true);
    assert_eq!(done["active"]["known"], true);
    assert_eq!(done["active"]["table"]["id"], started["table"]["id"]);
    assert_eq!(done["sent"], tables()[0].len());
}

#[test]
fn after_the_host_was_killed_half_way_only_the_missing_sectors_are_sent() {
    let (user, port) = (User::new(), device());
    port.look(|device| device.tables().mute_after = Some(3 * SECTOR / CHUNK + 2));
    let mut child = user.iltm(&["flash", "a.iltm", "--port", port.path()]);
    let mut child = child.spawn().expect("the binary is there");
    until("three sectors and a bit", || {
        port.look(|device| device.tables().is_mute())
    });
    child.kill().expect("it runs");
    child.wait().expect("killed");
    let before = port.look(|device| {
        device.tables().mute_after = None;
        device.tables().writes.len()
    });
    let said = user.says(&["status", "--port", port.path()]);
    assert!(said.contains("A no whole table: erased "), "{said}");
    let events = user.events(&["flash", "a.iltm", "--port", port.path()]);
    let missing = tables()[0].len() - 3 * SECTOR;
    assert_eq!(events[0]["to_send"], missing);
    assert_eq!(writes(&port) - before, missing.div_ceil(CHUNK));
    assert_eq!(states(&port)[0], SlotState::Trial);
}

#[test]
fn a_device_that_restarts_in_the_middle_gets_the_rest() {
    let (user, port) = (User::new(), device());
    port.look(|device| device.tables().restart_after = Some(20));
    let events = user.events(&["flash", "a.iltm", "--port", port.path()]);
    assert!(
        events.iter().any(|event| event["event"] == "restarted"),
        "{events:?}"
    );
    let done = &events[events.len() - 1];
    assert_eq!(
        (&done["event"], &done["restarts"]),
        (&"done".into(), &1.into())
    );
    assert_eq!(states(&port)[0], SlotState::Trial);
}

#[test]
fn the_table_that_is_in_use_is_not_sent_again() {
    let (user, port) = (User::new(), device());
    user.says(&["flash", "a.iltm", "--port", port.path()]);
    let before = port.look(|device| device.tables().contents());
    let sent = writes(&port);
    let said = user.says(&["flash", "a.iltm", "--port", port.path()]);
    assert!(said.contains("is in use already, on trial"), "{said}");
    let said = user.says(&["flash", "a.iltm", "--confirm", "--port", port.path()]);
    assert!(said.contains("is in use already, confirmed"), "{said}");
    let said = user.says(&["flash", "a.iltm", "--port", port.path()]);
    assert!(said.ends_with("is in use already.\n"), "{said}");
    assert_eq!(writes(&port), sent);
    let after = port.look(|device| device.tables().contents());
    assert_eq!(after[slot(0)], before[slot(0)]);
}

#[test]
fn a_table_that_was_signed_again_to_revoke_others_is_another_file() {
    let (user, port) = (User::new(), strict_device());
    let sent = writes(&port);
    let flash = |name: &str| {
        let flash = ["flash", name, "--confirm", "--port", port.path()];
        user.says(&flash)
    };
    user.write("5.iltm", &signed(&tables()[0], 5));
    let said = flash("5.iltm");
    assert!(said.ends_with("is in use already.\n"), "{said}");
    assert_eq!(writes(&port), sent);
    let terms = SealTerms {
        version: 5,
        oldest: 5,
        device: 0,
    };
    let revoking = sign(&tables()[0], &key(), terms).expect("a table");
    user.write("revoking.iltm", &revoking);
    let said = user.says(&["flash", "revoking.iltm", "--port", port.path()]);
    assert!(said.contains("is in use, on trial"), "{said}");
    assert_eq!(writes(&port), sent + revoking.len().div_ceil(CHUNK));
    // By now both are there under one name, and the device tells them apart.
    user.fails(26, &["flash", "5.iltm", "--port", port.path()]);
    let said = flash("revoking.iltm");
    assert!(said.contains("is in use already, confirmed"), "{said}");
    assert_eq!(writes(&port), sent + revoking.len().div_ceil(CHUNK));
}

#[test]
fn who_signed_a_table_matters_on_a_device_that_has_no_key_yet() {
    let (user, port) = (User::new(), device());
    let terms = SealTerms {
        version: 1,
        oldest: 0,
        device: 0,
    };
    for seed in [8, 7] {
        let key = SigningKey::from_bytes(&[seed; 32]);
        let file = sign(&tables()[0], &key, terms).expect("a table");
        user.write("t.iltm", &file);
        let said = user.says(&["flash", "t.iltm", "--confirm", "--port", port.path()]);
        assert!(said.contains("is in use, confirmed"), "{said}");
        let contents = port.look(|device| device.tables().contents());
        let slots = [slot(0), slot(1)].map(|slot| contents[slot].starts_with(&file));
        assert!(slots.contains(&true), "seed {seed}");
    }
}

#[test]
fn a_dry_run_changes_nothing_and_says_what_would_be_sent() {
    let (user, port) = (User::new(), device());
    user.says(&["flash", "a.iltm", "--confirm", "--port", port.path()]);
    let before = port.look(|device| device.tables().contents());
    let said = user.says(&["flash", "b.iltm", "--dry-run", "--port", port.path()]);
    let sectors = tables()[1].len().div_ceil(SECTOR);
    let what = format!(
        "slot B   {sectors} of {sectors} sectors differ, {} bytes to send, about ",
        tables()[1].len()
    );
    assert!(said.contains(&what), "{said}");
    assert!(
        said.ends_with("Nothing was changed: this was a dry run.\n"),
        "{said}"
    );
    let after = port.look(|device| device.tables().contents());
    assert!(before == after, "the flash has changed");
}

#[test]
fn every_cause_of_refusal_has_its_code_and_says_which_table_is_in_use() {
    let (user, port) = (User::new(), strict_device());
    let used = in_use(&port);
    let sent = writes(&port);
    let [_, table] = tables();
    let other = SigningKey::from_bytes(&[8; 32]);
    let terms = SealTerms {
        version: 6,
        oldest: 0,
        device: 0,
    };
    let mut damaged = signed(table, 6);
    damaged[200] ^= 1;
    let with = |terms, key: &SigningKey| sign(table, key, terms).expect("a table");
    let elsewhere = SealTerms {
        device: 10,
        ..terms
    };
    for (name, code, file) in [
        ("damaged", 7, damaged),
        ("unsigned", 21, table.clone()),
        ("wrong-key", 22, with(terms, &other)),
        ("older-version", 24, signed(table, 4)),
        ("other-device", 25, with(elsewhere, &key())),
    ] {
        user.write("t.iltm", &file);
        let said = user.fails(code, &["flash", "t.iltm", "--port", port.path()]);
        let active = match name {
            "damaged" => "goes on with the table that it has.".to_owned(),
            _ => format!("Table {used} is in use."),
        };
        assert!(said.contains(&active), "{name}: {said}");
        assert_eq!(
            writes(&port),
            sent,
            "{name}: refused before anything is sent"
        );
    }
    // Only the device can tell.
    let mut false_signature = signed(table, 6);
    *false_signature.last_mut().expect("long") ^= 1;
    user.write("t.iltm", &false_signature);
    let said = user.fails(23, &["flash", "t.iltm", "--port", port.path()]);
    assert!(said.contains("signature"), "{said}");
    assert!(said.contains(&format!("Table {used} is in use.")), "{said}");
    assert_eq!(in_use(&port), used);
}

#[test]
fn a_table_that_is_too_large_is_refused_before_it_is_sent() {
    let (user, port) = (User::new(), device());
    let large = wedge_table(24, 32, 3);
    let room = slot(0).len();
    assert!(large.len() > room, "{} bytes", large.len());
    user.write("t.iltm", &large);
    let said = user.fails(20, &["flash", "t.iltm", "--port", port.path()]);
    assert!(said.contains(&format!("room for {room}")), "{said}");
    assert!(said.contains("No table is in use"), "{said}");
    assert_eq!(writes(&port), 0);
}

#[test]
fn another_table_on_trial_must_be_decided_on_first() {
    let (user, port) = (User::new(), device());
    user.says(&["flash", "a.iltm", "--port", port.path()]);
    let said = user.fails(26, &["flash", "b.iltm", "--port", port.path()]);
    assert!(said.contains("iltm confirm"), "{said}");
    assert_eq!(states(&port), [SlotState::Trial, SlotState::Empty]);
}

#[test]
fn a_trial_that_nobody_confirms_ends_with_the_old_table() {
    let (user, port) = (User::new(), device());
    user.says(&["flash", "a.iltm", "--confirm", "--port", port.path()]);
    let old = in_use(&port);
    user.says(&["flash", "b.iltm", "--trial", "1", "--port", port.path()]);
    until("the trial is over", || in_use(&port) == old);
    assert_eq!(states(&port), [SlotState::Active, SlotState::Valid]);
    let said = user.says(&["status", "--port", port.path()]);
    assert!(said.contains("B valid"), "{said}");
}

#[test]
fn rolling_back_says_which_table_is_in_use_now() {
    let (user, port) = (User::new(), device());
    let said = user.fails(27, &["rollback", "--port", port.path()]);
    assert!(said.contains("No table is in use"), "{said}");
    user.says(&["flash", "a.iltm", "--confirm", "--port", port.path()]);
    let a = in_use(&port);
    let said = user.fails(27, &["rollback", "--port", port.path()]);
    assert!(said.contains(&format!("Table {a} is in use.")), "{said}");
    user.says(&["flash", "b.iltm", "--port", port.path()]);
    let b = in_use(&port);
    let said = user.says(&["rollback", "--port", port.path()]);
    assert_eq!(
        said,
        format!("Table {a} is in use again, instead of {b}.\n")
    );
    assert_eq!(in_use(&port), a);
    // Not on to the one that nobody confirmed; but back and forth between two that
    // somebody did.
    let said = user.fails(27, &["rollback", "--port", port.path()]);
    assert!(said.contains(&format!("Table {a} is in use.")), "{said}");
    user.says(&["flash", "b.iltm", "--confirm", "--port", port.path()]);
    user.says(&["rollback", "--port", port.path()]);
    let said = user.says(&["rollback", "--port", port.path()]);
    assert_eq!(
        said,
        format!("Table {b} is in use again, instead of {a}.\n")
    );
}

#[test]
fn ctrl_c_stops_between_chunks_and_the_next_run_goes_on() {
    let (user, port) = (User::new(), device());
    port.look(|device| device.tables().mute_after = Some(2 * SECTOR / CHUNK));
    let mut child = user.iltm(&["flash", "a.iltm", "--port", port.path()]);
    let child = child.spawn().expect("the binary is there");
    until("two sectors", || {
        port.look(|device| device.tables().is_mute())
    });
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &id]).status();
    assert!(sent.expect("every system has it").success());
    port.look(|device| device.tables().mute_after = None);
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(29), "{said}");
    assert!(said.contains("No table is in use"), "{said}");
    assert!(said.contains("goes on where it stopped"), "{said}");
    let events = user.events(&["flash", "a.iltm", "--port", port.path()]);
    let to_send = events[0]["to_send"].as_u64().expect("a number") as usize;
    assert!(to_send <= tables()[0].len() - 2 * SECTOR, "{to_send}");
}

#[test]
fn the_only_device_is_found_and_remembered() {
    let (user, first, second) = (User::new(), device(), device());
    let folders = user.folders();
    let _first = emulated::register(&folders, first.path(), "one").expect("writable");
    user.says(&["status"]);
    let config = fs::read_to_string(user.path("config/config.toml")).expect("there");
    assert!(
        config.contains(&format!("port = \"{}\"", first.path())),
        "{config}"
    );
    // Now another one answers as well.
    let _second = emulated::register(&folders, second.path(), "two").expect("writable");
    let data = &user.events(&["status"])[0];
    assert_eq!(data["port"], first.path());
    let ports = &user.events(&["ports"])[0];
    assert_eq!(ports["devices"].as_array().map(Vec::len), Some(2));
    assert_eq!(ports["remembered"], first.path());
}

#[test]
fn several_devices_are_an_error_where_nobody_can_be_asked() {
    let (user, first, second) = (User::new(), device(), device());
    let folders = user.folders();
    let _first = emulated::register(&folders, first.path(), "one").expect("writable");
    let _second = emulated::register(&folders, second.path(), "two").expect("writable");
    let said = user.fails(15, &["flash", "a.iltm"]);
    assert!(
        said.contains(first.path()) && said.contains(second.path()),
        "{said}"
    );
    assert!(said.contains("--port"), "{said}");
    assert_eq!(writes(&first) + writes(&second), 0);
}

#[test]
fn an_excluded_port_is_never_opened() {
    let (user, port) = (User::new(), device());
    user.exclude(&[port.path()]);
    let folders = user.folders();
    let _board = emulated::register(&folders, port.path(), "one").expect("writable");
    user.fails(14, &["status"]);
    let ports = &user.events(&["ports"])[0];
    assert_eq!(ports["devices"].as_array().map(Vec::len), Some(0));
    assert_eq!(ports["others"].as_array().map(Vec::len), Some(0));
    assert_eq!(port.look(|device| device.heard), 0);
    user.exclude(&[]);
    user.says(&["status"]);
    assert_ne!(port.look(|device| device.heard), 0);
}

#[test]
fn a_terminal_that_has_the_remembered_name_by_now_is_not_asked() {
    let (user, port) = (User::new(), device());
    let folders = user.folders();
    let board = emulated::register(&folders, port.path(), "one").expect("writable");
    user.says(&["status"]);
    let config = fs::read_to_string(user.path("config/config.toml")).expect("there");
    assert!(config.contains(port.path()), "remembered: {config}");
    drop(board);
    let heard = port.look(|device| device.heard);
    let said = user.fails(14, &["status"]);
    assert!(said.contains("there is no serial port to ask"), "{said}");
    assert_eq!(port.look(|device| device.heard), heard);
    // Whoever names it means it.
    user.says(&["status", "--port", port.path()]);
}

#[test]
fn an_included_port_is_asked_and_one_that_is_excluded_too_is_not() {
    let (user, port) = (User::new(), device());
    let settings = |exclude: &str| {
        let (path, own) = (port.path(), "\"/dev/tty*\", \"/dev/cu*\"");
        let text = format!("include = [\"{path}\"]\nexclude = [{own}{exclude}]\n");
        user.write("config/config.toml", text.as_bytes());
    };
    settings(", \"/dev/pts/*\"");
    user.fails(14, &["status"]);
    assert_eq!(port.look(|device| device.heard), 0);
    settings("");
    let data = &user.events(&["status"])[0];
    assert_eq!(data["port"], port.path());
}

#[test]
fn broken_settings_are_an_error_and_no_port_is_opened() {
    let (user, port) = (User::new(), device());
    let folders = user.folders();
    let _board = emulated::register(&folders, port.path(), "one").expect("writable");
    user.write("config/config.toml", b"exclude = 3\n");
    let said = user.fails(16, &["status"]);
    assert!(said.contains("config.toml"), "{said}");
    assert_eq!(port.look(|device| device.heard), 0);
}

#[test]
fn a_key_is_made_installed_and_tables_signed_with_it_are_taken() {
    let (user, port) = (User::new(), device());
    let said = user.says(&["key", "new"]);
    assert!(said.contains("key id"), "{said}");
    user.fails(17, &["key", "new"]);
    let shown = &user.events(&["key", "show", "iltm.key"])[0];
    let install = [
        "key",
        "install",
        "iltm.key",
        "--device",
        "9",
        "--port",
        port.path(),
    ];
    let said = user.fails(2, &install);
    assert!(said.contains("--yes"), "{said}");
    user.says(&[&install[..], &["--yes"]].concat());
    let public = port.look(|device| device.tables().updater().trust().key);
    let id = public.and_then(|key| key.first_chunk().copied());
    let id = format!("{:016x}", u64::from_be_bytes(id.expect("a key")));
    assert_eq!(shown["id"], id);
    let said = user.says(&["status", "--port", port.path()]);
    assert!(
        said.contains(&id) && said.contains("number 0000000000000009"),
        "{said}"
    );

    user.fails(21, &["flash", "a.iltm", "--port", port.path()]);
    user.says(&[
        "sign",
        "a.iltm",
        "--key",
        "iltm.key",
        "--table-version",
        "3",
        "--for-device",
        "9",
    ]);
    let said = user.says(&["inspect", "a.iltm", "--key", "iltm.key"]);
    assert!(
        said.contains("version          3, for device 0000000000000009 only"),
        "{said}"
    );
    assert!(said.contains("(verified)"), "{said}");
    user.says(&["flash", "a.iltm", "--confirm", "--port", port.path()]);

    fs::rename(user.path("iltm.key"), user.path("old.key")).expect("there");
    user.says(&["key", "new"]);
    let other = ["key", "install", "iltm.key", "--yes", "--port", port.path()];
    user.fails(28, &other);
    user.fails(22, &["inspect", "a.iltm", "--key", "iltm.key"]);
}

#[test]
fn a_report_has_what_support_needs_and_no_keys() {
    let (user, port) = (User::new(), device());
    user.says(&["key", "new"]);
    user.says(&["key", "install", "iltm.key", "--yes", "--port", port.path()]);
    user.says(&["sign", "a.iltm", "--key", "iltm.key"]);
    user.says(&["flash", "a.iltm", "--port", port.path()]);
    user.says(&[
        "support-bundle",
        "-o",
        "r.zip",
        "--seconds",
        "0",
        "--port",
        port.path(),
    ]);
    let file = File::open(user.path("r.zip")).expect("written");
    let mut zip = zip::ZipArchive::new(file).expect("a zip file");
    let mut files = Vec::new();
    for index in 0..zip.len() {
        let mut entry = zip.by_index(index).expect("there");
        let mut text = String::new();
        entry.read_to_string(&mut text).expect("text");
        let name = entry.name().expect("text").into_owned();
        files.push((name, text));
    }
    let file = |name: &str| {
        let found = files.iter().find(|(found, _)| found.starts_with(name));
        found.unwrap_or_else(|| panic!("no {name}")).1.as_str()
    };
    assert!(file("versions.json").contains("\"protocol\": 1"));
    assert!(file("status.json").contains("compensating"));
    assert!(file("slots.json").contains("trial"));
    assert!(file("config.toml").contains("exclude"));
    assert!(file("transcript.txt").contains("> #"));
    let transcript = file("flash/flash-");
    assert!(transcript.contains("Write { transfer: ") && transcript.contains("Written"));
    let secret = fs::read_to_string(user.path("iltm.key")).expect("the key");
    let secret = secret.lines().nth(1).expect("a line of base 64");
    let shown = &user.events(&["key", "show", "iltm.key"])[0];
    let public = shown["public_key"].as_str().expect("hexadecimal");
    for (name, text) in &files {
        assert!(
            !text.contains(secret) && !text.contains(public),
            "{name} has a key"
        );
    }
}

#[test]
fn a_report_without_a_device_says_why() {
    let user = User::new();
    let said = user.says(&["report", "-o", "r.zip", "--port", "/dev/no-such-port"]);
    assert!(said.contains("device-error.txt"), "{said}");
    assert!(said.contains("/dev/no-such-port"), "{said}");
}
