//! `iltm emulate` with a key: what a technician can try of refusals without hardware.

use super::desktop::{Desktop, on_the_screen};
use super::user::{User, contains, interrupt};
use iltm::compile::sign::new_key;
use iltm::device::emulator::Board;
use iltm_runtime::image::Seal;
use iltm_tests::firmware::elf;
use iltm_tests::{signed, wedge_table};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A running `iltm emulate`, and the port that it said.
struct Emulated {
    child: Child,
    port: String,
}

impl Emulated {
    fn start(user: &User, arguments: &str) -> Self {
        Self::of(user.iltm(&format!("--json emulate {arguments}")))
    }

    fn of(mut command: Command) -> Self {
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
    assert_eq!(before["device"]["number"], "9");
    assert_eq!(before["table"]["version"], 2, "the signed table is in use");
    let flash = |name: &str, code| {
        user.fails(
            code,
            &format!(
                "flash {name} --confirm --key iltm.key --port {}",
                board.port
            ),
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

#[test]
fn a_board_without_a_table_gets_frames_for_any_table_that_is_flashed_to_it() {
    let user = User::new();
    // Grey; colour; more rows than the film that the board begins with has.
    let tables = [
        wedge_table(4, 6, 1),
        wedge_table(5, 4, 3),
        wedge_table(100, 1, 1),
    ];
    let board = Emulated::start(&user, "");
    let status = || user.json(&format!("status --port {}", board.port));
    for (index, table) in tables.iter().enumerate() {
        user.write("t.iltm", table);
        user.says(&format!("flash t.iltm --port {}", board.port));
        assert_eq!(status()["mode"], "compensating", "table {index}");
        user.says(&format!("confirm --port {}", board.port));
    }
    // The way back is one to frames of another kind, too.
    user.says(&format!("rollback --port {}", board.port));
    let end = Instant::now() + Duration::from_secs(20);
    while status()["mode"] != "compensating" {
        assert!(Instant::now() < end, "{}", status());
    }
}

#[test]
fn a_firmware_that_is_none_is_an_error() {
    let user = User::new();
    user.write("notes.txt", "no firmware at all");
    let said = user.fails(13, "emulate --firmware notes.txt");
    contains(&said, &["notes.txt", "not an ELF file for Arm"]);
}

#[test]
fn what_a_board_gets_and_sends_is_in_a_window_and_in_a_video() {
    let desktop = Desktop::start("640x320x24");
    let user = User::new();
    user.write("t.iltm", wedge_table(4, 6, 3));
    let still = image::RgbImage::from_fn(128, 96, |x, y| {
        image::Rgb([60 + x as u8, 250 - y as u8, 100 + (x / 16 * 10) as u8])
    });
    still.save(user.path("still.png")).unwrap();
    user.says("compensate t.iltm still.png -o expected.png");
    let expected = user.picture("expected.png").to_rgb8();
    let line = "--json emulate t.iltm --frames still.png --window --save sent.y4m";
    let mut command = user.iltm(line);
    command.env("DISPLAY", &desktop.display);
    let board = Emulated::of(command);
    let screen = desktop.folder.path().join("Xvfb_screen0");
    // Two pictures and a gap, as large as they are or larger: colours of both are there.
    let end = Instant::now() + Duration::from_mins(1);
    let shows = |picture: &image::RgbImage| {
        let (_, pixels) = on_the_screen(&screen);
        let near = |wanted: &image::Rgb<u8>| {
            pixels.iter().any(|pixel| {
                let [_, codes @ ..] = pixel.to_be_bytes();
                codes.iter().zip(wanted.0).all(|(a, b)| a.abs_diff(b) <= 2)
            })
        };
        picture.pixels().step_by(97).all(near)
    };
    while !(shows(&still) && shows(&expected)) {
        assert!(Instant::now() < end, "the window does not show both");
        std::thread::sleep(Duration::from_millis(500));
    }
    drop(board);
    user.ffmpeg("-i sent.y4m -update 1 sent.png");
    let sent = user.picture("sent.png").to_rgb8();
    assert_eq!(sent.dimensions(), (128, 96));
    let apart = sent
        .iter()
        .zip(expected.iter())
        .map(|(a, b)| a.abs_diff(*b));
    assert!(
        apart.max() <= Some(2),
        "the video is not what the board sends"
    );
    assert!(still != expected, "nothing was done");
}
