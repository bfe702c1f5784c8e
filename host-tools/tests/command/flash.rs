//! `iltm flash` as a user meets it, and `ports`, `confirm`, `rollback`, `key` and
//! `report`, with devices at the end of pseudo-terminals.

use super::user::{Ended, User, contains, interrupt};
use ed25519_dalek::SigningKey;
use iltm::user::Folders;
use iltm::user::emulated::{self, BoardRegistration};
use iltm_runtime::frame_buffers::psram;
use iltm_runtime::link::{FrameKind, SlotState};
use iltm_tests::fake_device::{FakeDevice, FakePort, FakeTables, SECTOR, slot};
use iltm_tests::{fine_table, key_file, named_table, signing_key, wedge_table};
use serde_json::Value;
use std::fs::{self, File};
use std::io::Read;
use std::ops::Deref;
use std::process::Child;
use std::sync::OnceLock;
use std::thread;
use std::time::{Duration, Instant};

/// Bytes of a chunk.
const CHUNK: usize = 512;

/// A table of several sectors, and another one.
fn tables() -> &'static [Vec<u8>; 2] {
    static TABLES: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    TABLES.get_or_init(|| [wedge_table(12, 16, 1), wedge_table(10, 14, 1)])
}

fn key() -> SigningKey {
    signing_key(7)
}

/// For any device.
fn signed(table: &[u8], version: u32) -> Vec<u8> {
    iltm_tests::signed(table, &key(), version, 0, 0)
}

/// A user who has no serial ports but those that a test makes, and two tables.
fn user() -> User {
    let user = User::new();
    exclude(&user, &[]);
    user.write("a.iltm", &tables()[0]);
    user.write("b.iltm", &tables()[1]);
    user.write("site.key", key_file(&key()));
    user
}

/// Ports that are never opened: those of the machine, and these.
fn exclude(user: &User, more: &[&str]) {
    let exclude = [&["/dev/tty*", "/dev/cu*"], more].concat();
    fs::create_dir_all(user.path("config")).expect("writable");
    user.write("config/config.toml", format!("exclude = {exclude:?}\n"));
}

/// Lets a port be found, until what is returned is dropped.
fn register(user: &User, port: &FakePort, name: &str) -> BoardRegistration {
    let folders = Folders {
        config: user.path("config"),
        state: user.path("state"),
    };
    emulated::register(&folders, port.path(), name).expect("writable")
}

/// A device at a port.
struct Device(FakePort);

impl Deref for Device {
    type Target = FakePort;

    fn deref(&self) -> &FakePort {
        &self.0
    }
}

impl Device {
    fn new() -> Self {
        Self::with(FakeTables::default())
    }

    fn with(tables: FakeTables) -> Self {
        Self(FakePort::new(FakeDevice::with_tables(tables)))
    }

    /// One that takes tables of [`key`] only, and has version 5 of one in use.
    fn strict() -> Self {
        let public = key().verifying_key().to_bytes();
        let device = Self::with(FakeTables::provisioned(public, 9));
        let user = user();
        user.write("5.iltm", signed(&tables()[0], 5));
        user.says(&device.at("flash 5.iltm --confirm --key site.key"));
        device
    }

    /// A command to its port.
    fn at(&self, command: &str) -> String {
        format!("{command} --port {}", self.path())
    }

    fn states(&self) -> [SlotState; 2] {
        self.look(|device| device.tables().updater().states())
    }

    /// Number of chunks that came so far.
    fn writes(&self) -> usize {
        self.look(|device| device.tables().writes.len())
    }

    fn contents(&self) -> Vec<u8> {
        self.look(|device| device.tables().contents())
    }

    /// Id and version of the table in use.
    fn in_use(&self) -> String {
        let table = self.look(|device| device.tables().updater().table());
        table.expect("a table").to_string()
    }

    /// Begins to flash a table to it; returns when so many chunks have come and the device
    /// falls silent.
    fn flash_until(&self, user: &User, chunks: usize) -> Child {
        self.look(move |device| device.tables().mute_after = Some(chunks));
        let child = user.spawn(&self.at("flash a.iltm"));
        let end = Instant::now() + Duration::from_secs(20);
        while !self.look(|device| device.tables().is_mute()) {
            assert!(Instant::now() < end, "{chunks} chunks do not come");
            thread::sleep(Duration::from_millis(10));
        }
        child
    }
}

#[test]
fn a_table_is_flashed_looked_at_and_confirmed() {
    let (user, device) = (user(), Device::new());
    let said = user.says(&device.at("flash a.iltm"));
    contains(&said, &["on trial for 300 s", "iltm confirm"]);
    assert_eq!(device.states(), [SlotState::Trial, SlotState::Empty]);
    let said = user.says(&device.at("status"));
    contains(&said, &["A trial, ", "takes tables from anybody"]);
    let said = user.says(&device.at("confirm"));
    let confirmed = format!("Table {} is in use, confirmed.\n", device.in_use());
    assert_eq!(said, confirmed);
    assert_eq!(device.states(), [SlotState::Active, SlotState::Empty]);
    let said = user.says(&device.at("confirm"));
    contains(&said, &["needs no confirmation"]);
    // What comes when nobody confirms is for `tests/tests/device/firmware_update.rs`.
    let said = user.says(&device.at("flash b.iltm --trial 77"));
    contains(&said, &["on trial for 77 s"]);
}

#[test]
fn in_json_every_step_is_a_line_and_the_last_one_the_result() {
    let events = user().events(&Device::new().at("flash a.iltm --confirm"));
    let mut kinds: Vec<_> = events.iter().map(|event| &event["event"]).collect();
    kinds.dedup();
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
    let (user, device) = (user(), Device::new());
    let mut child = device.flash_until(&user, 3 * SECTOR / CHUNK + 2);
    child.kill().expect("it runs");
    child.wait().expect("killed");
    device.look(|device| device.tables().mute_after = None);
    let before = device.writes();
    let said = user.says(&device.at("status"));
    contains(&said, &["A no whole table: erased "]);
    let events = user.events(&device.at("flash a.iltm"));
    let missing = tables()[0].len() - 3 * SECTOR;
    assert_eq!(events[0]["to_send"], missing);
    assert_eq!(device.writes() - before, missing.div_ceil(CHUNK));
    assert_eq!(device.states()[0], SlotState::Trial);
}

#[test]
fn a_device_that_restarts_in_the_middle_gets_the_rest() {
    for after in [1, 9, 20, 41] {
        let device = Device::new();
        device.look(move |device| device.tables().restart_after = Some(after));
        let events = user().events(&device.at("flash a.iltm"));
        let restarted = |event: &Value| event["event"] == "restarted";
        assert!(events.iter().any(restarted), "{after}: {events:?}");
        let done = &events[events.len() - 1];
        assert_eq!(done["event"], "done", "{after}");
        assert_eq!(done["restarts"], 1, "{after}");
        assert_eq!(device.states()[0], SlotState::Trial, "{after}");
        let (chunks, sector) = (tables()[0].len().div_ceil(CHUNK), SECTOR / CHUNK);
        let writes = device.writes();
        assert!(writes <= chunks + sector + 3, "{writes} of {chunks}");
    }
}

#[test]
fn the_table_that_is_in_use_is_not_sent_again() {
    let (user, device) = (user(), Device::new());
    user.says(&device.at("flash a.iltm"));
    let (before, sent) = (device.contents(), device.writes());
    let said = user.says(&device.at("flash a.iltm"));
    contains(&said, &["is in use already, on trial"]);
    let said = user.says(&device.at("flash a.iltm --confirm"));
    contains(&said, &["is in use already, confirmed"]);
    let said = user.says(&device.at("flash a.iltm"));
    assert!(said.ends_with("is in use already.\n"), "{said}");
    assert_eq!(device.writes(), sent);
    assert_eq!(device.contents()[slot(0)], before[slot(0)]);
}

#[test]
fn a_table_that_was_signed_again_to_revoke_others_is_another_file() {
    let (user, device) = (user(), Device::strict());
    let sent = device.writes();
    user.write("5.iltm", signed(&tables()[0], 5));
    let said = user.says(&device.at("flash 5.iltm --confirm"));
    assert!(said.ends_with("is in use already.\n"), "{said}");
    assert_eq!(device.writes(), sent);
    // A file of the same table whose signature is false is not what is in use.
    let mut tampered = signed(&tables()[0], 5);
    *tampered.last_mut().expect("long") ^= 1;
    user.write("tampered.iltm", &tampered);
    let said = user.fails(23, &device.at("flash tampered.iltm --key site.key"));
    contains(&said, &["signature"]);
    assert_eq!(device.writes(), sent);
    let revoking = iltm_tests::signed(&tables()[0], &key(), 5, 5, 0);
    user.write("revoking.iltm", &revoking);
    let said = user.says(&device.at("flash revoking.iltm --key site.key"));
    contains(&said, &["is in use, on trial"]);
    assert_eq!(device.writes(), sent + revoking.len().div_ceil(CHUNK));
    // By now both are there under one name, and the device tells them apart.
    user.fails(26, &device.at("flash 5.iltm"));
    let said = user.says(&device.at("flash revoking.iltm --confirm --key site.key"));
    contains(&said, &["is in use already, confirmed"]);
    assert_eq!(device.writes(), sent + revoking.len().div_ceil(CHUNK));
}

#[test]
fn who_signed_a_table_matters_on_a_device_that_has_no_key_yet() {
    let (user, device) = (user(), Device::new());
    for seed in [8, 7] {
        let file = iltm_tests::signed(&tables()[0], &signing_key(seed), 1, 0, 0);
        user.write("t.iltm", &file);
        let said = user.says(&device.at("flash t.iltm --confirm"));
        contains(&said, &["is in use, confirmed"]);
        let contents = device.contents();
        let slots = [slot(0), slot(1)].map(|slot| contents[slot].starts_with(&file));
        assert!(slots.contains(&true), "seed {seed}");
    }
}

#[test]
fn a_dry_run_changes_nothing_and_says_what_would_be_sent() {
    let (user, device) = (user(), Device::new());
    user.says(&device.at("flash a.iltm --confirm"));
    let before = device.contents();
    let said = user.says(&device.at("flash b.iltm --dry-run"));
    let bytes = tables()[1].len();
    let sectors = bytes.div_ceil(SECTOR);
    let what = format!("{sectors} of {sectors} sectors differ, {bytes} bytes to send, about ");
    contains(&said, &[&format!("slot B   {what}")]);
    let end = "Nothing was changed: this was a dry run.\n";
    assert!(said.ends_with(end), "{said}");
    assert!(before == device.contents(), "the flash has changed");
}

#[test]
fn every_cause_of_refusal_has_its_code_and_says_which_table_is_in_use() {
    let (user, device) = (user(), Device::strict());
    let (used, sent) = (device.in_use(), device.writes());
    let in_use = format!("Table {used} is in use.");
    let [_, table] = tables();
    let with = |key: &SigningKey, device| iltm_tests::signed(table, key, 6, 0, device);
    let mut damaged = signed(table, 6);
    damaged[200] ^= 1;
    for (name, code, file) in [
        ("damaged", 7, damaged),
        ("unsigned", 21, table.clone()),
        ("wrong-key", 22, with(&signing_key(8), 0)),
        ("older-version", 24, signed(table, 4)),
        ("other-device", 25, with(&key(), 10)),
    ] {
        user.write("t.iltm", &file);
        let said = user.fails(code, &device.at("flash t.iltm"));
        let goes_on = "goes on with the table that it has.";
        contains(&said, &[if code == 7 { goes_on } else { &in_use }]);
        // Refused before anything is sent.
        assert_eq!(device.writes(), sent, "{name}");
    }
    let mut false_signature = signed(table, 6);
    *false_signature.last_mut().expect("long") ^= 1;
    user.write("t.iltm", &false_signature);
    let said = user.fails(23, &device.at("flash t.iltm --key site.key"));
    contains(&said, &["signature", &in_use]);
    assert_eq!(device.writes(), sent, "the public key is known here");
    assert_eq!(device.in_use(), used);
}

#[test]
fn a_table_that_is_too_large_is_refused_before_it_is_sent() {
    let (user, device) = (user(), Device::new());
    let large = wedge_table(24, 32, 3);
    let room = slot(0).len();
    assert!(large.len() > room, "{} bytes", large.len());
    user.write("t.iltm", &large);
    let said = user.fails(20, &device.at("flash t.iltm"));
    contains(&said, &[&format!("room for {room}"), "No table is in use"]);
    assert_eq!(device.writes(), 0);
}

#[test]
fn a_table_that_its_gains_make_too_large_is_refused_with_as_many_as_fit() {
    let (user, device) = (user(), Device::new());
    let gains = |room: usize| {
        let fits = (1..).take_while(|side| fine_table(*side).len() <= room);
        fits.last().expect("one fits")
    };
    // The board's memory is larger than that of the device in the tests.
    for (room, command) in [
        (slot(0).len(), device.at("flash l.iltm")),
        (psram::SLOT_A.len(), "emulate l.iltm".to_owned()),
    ] {
        let most = gains(room);
        user.write("l.iltm", fine_table(most + 1));
        let said = user.fails(20, &command);
        let advice = format!("--gain-resolution {}x{}:", 6 * most, 4 * most);
        contains(&said, &[&format!("room for {room}"), &advice]);
    }
    assert_eq!(device.writes(), 0);
}

#[test]
fn another_table_on_trial_must_be_decided_on_first() {
    let (user, device) = (user(), Device::new());
    user.says(&device.at("flash a.iltm"));
    let said = user.fails(26, &device.at("flash b.iltm"));
    contains(&said, &["iltm confirm"]);
    assert_eq!(device.states(), [SlotState::Trial, SlotState::Empty]);
}

#[test]
fn rolling_back_says_which_table_is_in_use_now() {
    let (user, device) = (user(), Device::new());
    let refused = |words: &str| contains(&user.fails(27, &device.at("rollback")), &[words]);
    let rolled_back = |to: &str, from: &str| {
        let said = user.says(&device.at("rollback"));
        assert_eq!(
            said,
            format!("Table {to} is in use again, instead of {from}.\n")
        );
        assert_eq!(device.in_use(), to);
    };
    refused("No table is in use");
    user.says(&device.at("flash a.iltm --confirm"));
    let a = device.in_use();
    refused(&format!("Table {a} is in use."));
    user.says(&device.at("flash b.iltm"));
    let b = device.in_use();
    rolled_back(&a, &b);
    contains(&user.says(&device.at("status")), &["B never confirmed"]);
    // Not on to the one that nobody confirmed; but back and forth between two that
    // somebody did.
    refused(&format!("Table {a} is in use."));
    user.says(&device.at("flash b.iltm --confirm"));
    rolled_back(&a, &b);
    rolled_back(&b, &a);
}

#[test]
fn ctrl_c_stops_between_chunks_and_the_next_run_goes_on() {
    let (user, device) = (user(), Device::new());
    let child = device.flash_until(&user, 2 * SECTOR / CHUNK);
    interrupt(&child);
    device.look(|device| device.tables().mute_after = None);
    let stopped = Ended::of(child);
    assert_eq!(stopped.code, 29, "{}", stopped.said);
    contains(
        &stopped.said,
        &["No table is in use", "goes on where it stopped"],
    );
    let events = user.events(&device.at("flash a.iltm"));
    let to_send = events[0]["to_send"].as_u64().expect("a number") as usize;
    assert!(to_send <= tables()[0].len() - 2 * SECTOR, "{to_send}");
}

#[test]
fn the_only_device_is_found_and_remembered() {
    let (user, first, second) = (user(), Device::new(), Device::new());
    let _first = register(&user, &first, "one");
    user.says("status");
    let remembered = format!("port = \"{}\"", first.path());
    contains(&user.text("config/config.toml"), &[&remembered]);
    // Now another one answers as well.
    let _second = register(&user, &second, "two");
    assert_eq!(user.json("status")["port"], first.path());
    let ports = user.json("ports");
    assert_eq!(ports["devices"].as_array().map(Vec::len), Some(2));
    assert_eq!(ports["remembered"], first.path());
}

#[test]
fn several_devices_are_an_error_where_nobody_can_be_asked() {
    let (user, first, second) = (user(), Device::new(), Device::new());
    let _first = register(&user, &first, "one");
    let _second = register(&user, &second, "two");
    let said = user.fails(15, "flash a.iltm");
    contains(&said, &[first.path(), second.path(), "--port"]);
    assert_eq!(first.writes() + second.writes(), 0);
}

#[test]
fn an_excluded_port_is_never_opened() {
    let (user, device) = (user(), Device::new());
    exclude(&user, &[device.path()]);
    let _board = register(&user, &device, "one");
    user.fails(14, "status");
    let ports = user.json("ports");
    assert_eq!(ports["devices"].as_array().map(Vec::len), Some(0));
    assert_eq!(ports["others"].as_array().map(Vec::len), Some(0));
    assert_eq!(device.look(|device| device.heard), 0);
    exclude(&user, &[]);
    user.says("status");
    assert_ne!(device.look(|device| device.heard), 0);
}

#[test]
fn a_terminal_that_has_the_remembered_name_by_now_is_not_asked() {
    let (user, device) = (user(), Device::new());
    let board = register(&user, &device, "one");
    user.says("status");
    contains(&user.text("config/config.toml"), &[device.path()]);
    drop(board);
    let heard = device.look(|device| device.heard);
    let said = user.fails(14, "status");
    contains(&said, &["there is no serial port to ask"]);
    assert_eq!(device.look(|device| device.heard), heard);
    // Whoever names it means it.
    user.says(&device.at("status"));
}

#[test]
fn an_included_port_is_asked_and_one_that_is_excluded_too_is_not() {
    let (user, device) = (user(), Device::new());
    let settings = |exclude: &str| {
        let (path, own) = (device.path(), "\"/dev/tty*\", \"/dev/cu*\"");
        let text = format!("include = [\"{path}\"]\nexclude = [{own}{exclude}]\n");
        user.write("config/config.toml", text);
    };
    settings(", \"/dev/pts/*\"");
    user.fails(14, "status");
    assert_eq!(device.look(|device| device.heard), 0);
    settings("");
    assert_eq!(user.json("status")["port"], device.path());
}

#[test]
fn broken_settings_are_an_error_and_no_port_is_opened() {
    let (user, device) = (user(), Device::new());
    let _board = register(&user, &device, "one");
    user.write("config/config.toml", "exclude = 3\n");
    let said = user.fails(16, "status");
    contains(&said, &["config.toml"]);
    assert_eq!(device.look(|device| device.heard), 0);
}

#[test]
fn a_key_is_made_installed_and_tables_signed_with_it_are_taken() {
    let (user, device) = (user(), Device::new());
    contains(&user.says("key new"), &["key id"]);
    user.fails(17, "key new");
    let shown = user.json("key show iltm.key");
    let install = device.at("key install iltm.key --device 9");
    contains(&user.fails(2, &install), &["--yes"]);
    user.says(&format!("{install} --yes"));
    let public = device.look(|device| device.tables().updater().trust().key);
    let id = public.and_then(|key| key.first_chunk().copied());
    let id = format!("{:016x}", u64::from_be_bytes(id.expect("a key")));
    assert_eq!(shown["id"], id);
    let said = user.says(&device.at("status"));
    contains(&said, &[&id, "number 9,"]);

    user.fails(21, &device.at("flash a.iltm"));
    user.says("sign a.iltm --key iltm.key --table-version 3 --for-device 9");
    let said = user.says("inspect a.iltm --key iltm.key");
    let version = "3, for device 9 only";
    contains(&said, &[version, "(verified)"]);
    user.says(&device.at("flash a.iltm --confirm --key iltm.key"));

    user.rename("iltm.key", "old.key");
    user.says("key new");
    user.fails(28, &device.at("key install iltm.key --yes"));
    user.fails(22, "inspect a.iltm --key iltm.key");
}

#[test]
fn a_report_has_what_support_needs_and_no_keys() {
    let (user, device) = (user(), Device::new());
    user.says("key new");
    user.says(&device.at("key install iltm.key --yes"));
    user.says("sign a.iltm --key iltm.key");
    user.says(&device.at("flash a.iltm --key iltm.key"));
    user.says(&device.at("report -o r.zip --seconds 0"));
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
    for (name, words) in [
        ("versions.json", "\"protocol\": 2"),
        ("status.json", "compensating"),
        ("slots.json", "trial"),
        ("config.toml", "exclude"),
        ("transcript.txt", "> #"),
        ("flash/flash-", "Write { transfer: "),
        ("flash/flash-", "Written"),
    ] {
        let found = files.iter().find(|(found, _)| found.starts_with(name));
        contains(&found.expect(name).1, &[words]);
    }
    let secret = user.text("iltm.key");
    let secret = secret.lines().nth(1).expect("a line of base 64");
    let shown = user.json("key show iltm.key");
    let public = shown["public_key"].as_str().expect("hexadecimal");
    for (name, text) in &files {
        let told = text.contains(secret) || text.contains(public);
        assert!(!told, "{name} has a key");
    }
}

#[test]
fn a_report_without_a_device_says_why() {
    let said = user().says("report -o r.zip --port /dev/no-such-port");
    contains(&said, &["device-error.txt", "/dev/no-such-port"]);
}

/// Frames that come into a device.
fn gets(device: &Device, input: Option<(u16, u16, u8)>) {
    let input = input.map(|(width, height, channels)| FrameKind {
        width,
        height,
        channels,
    });
    device.look(move |device| device.status.input = input);
}

#[test]
fn a_table_for_other_frames_is_an_error_and_the_one_before_comes_back() {
    let (user, device) = (user(), Device::new());
    user.says(&device.at("flash a.iltm --confirm"));
    let a = device.in_use();
    user.write("colour.iltm", wedge_table(10, 14, 3));
    for confirm in ["", " --confirm"] {
        let said = user.fails(35, &device.at(&format!("flash colour.iltm{confirm}")));
        contains(
            &said,
            &[
                "the device gets grey frames of 320 x 240",
                "this table is for colour frames of 14 x 10 or more",
                &format!("Table {a} is in use."),
            ],
        );
        assert_eq!(device.in_use(), a);
        assert_eq!(device.states()[0], SlotState::Active);
    }
    // Frames that are too small.
    gets(&device, Some((15, 12, 1)));
    let said = user.fails(35, &device.at("flash a.iltm"));
    contains(
        &said,
        &["grey frames of 15 x 12", "grey frames of 16 x 12 or more"],
    );
    assert_eq!(device.in_use(), a, "it was confirmed before");
    let said = user.says(&device.at("status"));
    assert!(said.starts_with("mode         NOT COMPENSATING"), "{said}");
}

#[test]
fn a_table_that_compensates_nothing_is_not_confirmed() {
    let (user, device) = (user(), Device::new());
    user.says(&device.at("flash a.iltm"));
    gets(&device, Some((320, 240, 3)));
    let said = user.fails(35, &device.at("confirm"));
    contains(
        &said,
        &["colour frames of 320 x 240", "Nothing was confirmed."],
    );
    assert_eq!(device.states()[0], SlotState::Trial);
    gets(&device, Some((320, 240, 1)));
    contains(
        &user.says(&device.at("confirm")),
        &["is in use, confirmed."],
    );
}

#[test]
fn where_no_frames_arrive_nobody_says_that_the_table_fits() {
    let (user, device) = (user(), Device::new());
    gets(&device, None);
    let words = "No frames arrive: whether the table fits them cannot be told.\n";
    for command in ["flash a.iltm", "confirm", "flash b.iltm --confirm"] {
        let said = user.says(&device.at(command));
        assert!(said.ends_with(words), "{command}: {said}");
    }
    let done = user.events(&device.at("flash b.iltm"));
    let done = done.last().expect("a last line");
    assert!(done["compensating"].is_null(), "{done}");
}

#[test]
fn a_confirmation_that_comes_too_late_is_an_error() {
    let (user, device) = (user(), Device::new());
    user.says(&device.at("flash a.iltm --confirm"));
    let a = device.in_use();
    user.says(&device.at("flash b.iltm --trial 1"));
    let b = device.in_use();
    thread::sleep(Duration::from_millis(1_500));
    let back = format!("the device went back to {a}");
    let again = "Nothing was confirmed. Flash the table again";
    let said = user.fails(27, &device.at("confirm"));
    let ended = format!("the trial of {b} ended ");
    contains(&said, &[&ended, " s ago", &back, again]);
    // After a restart it is known that nobody confirmed it.
    device.restart();
    let said = user.fails(27, &device.at("confirm"));
    let gone = format!("{b} is not in use: the device has restarted");
    contains(&said, &[&gone, "a trial ends with a restart", &back, again]);
    user.says(&device.at("flash b.iltm --confirm"));
    contains(
        &user.says(&device.at("confirm")),
        &["needs no confirmation"],
    );
}

#[test]
fn a_trial_that_is_lost_while_it_is_confirmed_has_to_be_flashed_again() {
    let (user, device) = (user(), Device::new());
    user.says(&device.at("flash a.iltm --confirm"));
    let a = device.in_use();
    user.says(&device.at("flash b.iltm"));
    let b = device.in_use();
    // Without frames the host goes on asking for half a second before it confirms.
    gets(&device, None);
    let heard = || device.look(|device| device.heard);
    let before = heard();
    let confirming = user.spawn(&device.at("confirm"));
    let end = Instant::now() + Duration::from_secs(20);
    while heard() < before + 30 {
        assert!(Instant::now() < end, "nothing is asked");
        thread::sleep(Duration::from_millis(5));
    }
    device.restart();
    let ended = Ended::of(confirming);
    assert_eq!(ended.code, 27, "{}", ended.said);
    let gone = format!("{b} is not in use: the device has restarted");
    let back = format!("the device went back to {a}");
    let again = "Nothing was confirmed. Flash the table again";
    contains(&ended.said, &[&gone, &back, again]);
}

#[test]
fn tables_have_names_on_the_device() {
    let (user, device) = (user(), Device::new());
    user.write("foyer.iltm", named_table("foyer", 20_261_123));
    user.write("evil.iltm", named_table("a\u{1b}]0;b\u{7}", 0));
    let said = user.says(&device.at("flash foyer.iltm"));
    let id = device.in_use();
    let name = format!("foyer, 2026-11-23, {id}");
    contains(&said, &[&format!("Table {name} is in use, on trial")]);
    contains(&user.says(&device.at("confirm")), &[&name]);
    contains(
        &user.says(&device.at("status")),
        &[&format!("table        {name}")],
    );
    let status = user.json(&device.at("status"));
    let table = &status["update"]["slots"][0]["table"];
    assert_eq!(
        (&table["name"], &table["date"]),
        (&"foyer".into(), &"2026-11-23".into())
    );
    let board = register(&user, &device, "one");
    contains(&user.says("ports"), &[&name]);
    drop(board);
    let inspected = user.json("inspect foyer.iltm");
    let short = inspected["id"].as_str().expect("text");
    assert!(id.starts_with(short), "{id}");
    contains(
        &user.says("inspect foyer.iltm"),
        &["foyer, 2026-11-23, ", short],
    );
    // A terminal gets nothing that it would obey.
    for said in [
        user.says("inspect evil.iltm"),
        user.says(&device.at("flash evil.iltm")),
        user.says(&device.at("status")),
    ] {
        contains(&said, &["a\\u{1b}]0;b\\u{7}"]);
        assert!(!said.contains('\u{1b}'), "{said}");
    }
    let said = user.says(&device.at("rollback"));
    contains(&said, &[&format!("Table {name} is in use again")]);
}

#[test]
fn a_device_with_a_key_wants_to_be_shown_the_right() {
    let (user, device) = (user(), Device::strict());
    let sent = device.writes();
    user.write("6.iltm", signed(&tables()[1], 6));
    let said = user.fails(36, &device.at("flash 6.iltm"));
    contains(&said, &["--key", "is in use."]);
    assert_eq!(device.writes(), sent, "nothing was sent");
    user.says("key new -o other.key");
    let said = user.fails(36, &device.at("flash 6.iltm --key other.key"));
    contains(&said, &["next: The key of --key is not the device's key"]);
    // A technician of this device flashes, confirms and rolls back, and signs nothing.
    user.says("key technician site.key -o anna.key --device 9");
    user.says("key technician site.key -o ben.key --device 10");
    user.fails(17, "sign a.iltm --key anna.key");
    let said = user.fails(36, &device.at("flash 6.iltm --key ben.key"));
    contains(&said, &["for the device 10"]);
    user.says(&device.at("flash 6.iltm --key anna.key"));
    for command in ["confirm", "rollback"] {
        let said = user.fails(36, &device.at(command));
        contains(&said, &["on trial for", "--key"]);
    }
    user.says(&device.at("confirm --key anna.key"));
    let said = user.says(&device.at("rollback --key anna.key"));
    contains(&said, &["is in use again"]);
    // What was confirmed once is not undercut from the line.
    user.write("5.iltm", signed(&wedge_table(9, 9, 1), 5));
    user.fails(24, &device.at("flash 5.iltm --key site.key"));
}

#[test]
fn a_key_is_not_installed_over_a_table_that_it_would_lose() {
    let (user, device) = (user(), Device::new());
    user.says(&device.at("flash a.iltm --confirm"));
    let a = device.in_use();
    let install = device.at("key install site.key --device 42 --yes");
    let said = user.fails(21, &install);
    contains(&said, &["nothing was installed", &a, "--lose-table"]);
    user.write("1.iltm", signed(&tables()[0], 1));
    user.says(&device.at("flash 1.iltm --confirm"));
    let said = user.says(&install);
    contains(&said, &["number 42"]);
}

#[test]
fn terms_of_a_seal_without_a_key_are_an_error() {
    let user = user();
    for terms in ["--for-device 3", "--table-version 7", "--revoke-below 2"] {
        let said = user.fails(2, &format!("solve nowhere -o t.iltm {terms}"));
        contains(&said, &["--key"]);
    }
}

#[test]
fn a_version_that_nobody_chose_rises_with_the_time() {
    let user = user();
    user.says("sign a.iltm --key site.key");
    let seal = &user.json("inspect a.iltm")["seal"];
    // Minutes; 2026-01-01 was minute 29,453,760.
    assert!(seal["version"].as_u64() > Some(29_453_760), "{seal}");
}

#[test]
fn a_port_that_cannot_be_opened_has_one_code_named_or_found() {
    let user = user();
    user.write("no-port", "not a terminal");
    let path = user.path("no-port").display().to_string();
    let folders = Folders {
        config: user.path("config"),
        state: user.path("state"),
    };
    let _board = emulated::register(&folders, &path, "one").expect("writable");
    let named = user.fails(10, &format!("status --port {path}"));
    for said in [named, user.fails(10, "status")] {
        contains(&said, &["the port cannot be opened"]);
    }
}
