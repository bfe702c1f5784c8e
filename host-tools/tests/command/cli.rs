//! `iltm solve`, `compensate`, `sign` and `bounces`, the wrong ways in particular. Every one
//! has a message with its place and the next step, an exit code of its kind, and leaves no
//! half-written output.

use super::user::{Ended, User, contains, table};
use ed25519_dalek::{Signature, VerifyingKey};
use image::Luma;
use std::fmt::Write as _;
#[cfg(target_os = "linux")]
use std::fs::File;
#[cfg(target_os = "linux")]
use std::io::Write as _;
#[cfg(target_os = "linux")]
use std::process::Stdio;
use std::sync::OnceLock;

fn without_lines(user: &User, unwanted: &str) {
    let lines = user.text("capture/capture.csv");
    let kept = lines.lines().filter(|line| !line.contains(unwanted));
    let kept: Vec<&str> = kept.collect();
    user.write("capture/capture.csv", kept.join("\n"));
}

fn change_picture(user: &User, name: &str, change: impl Fn(u32, u32, u8) -> u8) {
    let mut picture = user.picture(name).into_luma8();
    for (x, y, Luma([value])) in picture.enumerate_pixels_mut() {
        *value = change(x, y, *value);
    }
    picture.save(user.path(name)).expect("writable");
}

/// What is refused, what was done to the capture, and arguments beside it.
type Case = (&'static str, fn(&User), &'static str);

/// What `iltm solve` says of captures that something was done to.
#[test]
fn captures_that_cannot_be_solved_are_refused_with_the_place_and_the_next_step() {
    let cases: [Case; 12] = [
        (
            "a missing photograph is named",
            |user| user.remove("capture/photos/007.png"),
            "",
        ),
        (
            "a photograph of another size is named",
            |user| {
                let small = image::GrayImage::new(100, 132);
                let saved = small.save(user.path("capture/photos/012.png"));
                saved.expect("writable");
            },
            "",
        ),
        (
            "a pattern with a grey cell is named with the cell",
            |user| {
                let grey = |x, y, value| if (x, y) == (5, 2) { 128 } else { value };
                change_picture(user, "capture/patterns/020.png", grey);
            },
            "",
        ),
        (
            "an overexposed flood photograph is refused",
            |user| {
                let burnt = |_, _, value| if value > 150 { 255 } else { value };
                change_picture(user, "capture/photos/000.png", burnt);
            },
            "",
        ),
        (
            "a capture without black is refused",
            |user| without_lines(user, ",black,"),
            "",
        ),
        (
            "a capture without white is refused",
            |user| without_lines(user, ",white,"),
            "",
        ),
        ("too few photographs are refused", |_| (), "--photos 3"),
        (
            "more photographs than there are is a mistake in the command",
            |_| (),
            "--photos 41",
        ),
        (
            "a grid that the Gray code does not cover is refused",
            |user| without_lines(user, ",column-4"),
            "",
        ),
        (
            "photographs said to be linear that are not are refused",
            |user| user.remove("capture/capture.toml"),
            "",
        ),
        (
            "a folder that is no capture is named",
            |user| user.remove("capture/capture.csv"),
            "",
        ),
        (
            "a folder that cannot be written is a failure to write",
            |_| (),
            "-o no/such/t.iltm",
        ),
    ];
    let mut text = String::new();
    for (case, harm, more) in cases {
        let user = User::with_capture();
        harm(&user);
        let out = if more.contains("-o") { "" } else { "-o t.iltm" };
        let refused = user.run(&format!("solve capture {out} {more}"));
        assert_eq!(refused.out, "", "{case}");
        assert_eq!(user.names(""), ["capture"], "{case}: nothing half-written");
        let _ = writeln!(text, "{case}\n{}", refused.with_code());
    }
    insta::assert_snapshot!(text);
}

/// What commands say of tables and videos of which something is wrong.
#[test]
fn tables_and_videos_that_cannot_be_used_are_refused_and_nothing_is_written() {
    let cut = &table()[..table().len() - 1];
    let mut altered = table().to_vec();
    let middle = altered.len() / 2;
    altered[middle] ^= 1;
    // 64 x 40 needs 3,840 bytes a frame; the second one is cut short.
    let mut lies = b"YUV4MPEG2 W64 H40 F25:1 C420jpeg\nFRAME\n".to_vec();
    lies.extend([128; 3_840]);
    lies.extend(b"FRAME\n");
    lies.extend([128; 100]);
    let compensate = "compensate t.iltm in.y4m -o out.y4m";
    let cases: [(&str, &[u8], &[u8], &str); 9] = [
        ("a truncated table", cut, b"", "inspect t.iltm"),
        ("an altered table", &altered, b"", compensate),
        ("a video whose header lies", table(), &lies, compensate),
        (
            "a video that claims an impossible size",
            table(),
            b"YUV4MPEG2 W99999999 H40 F25:1\n",
            compensate,
        ),
        (
            "a frame smaller than the grid",
            table(),
            b"YUV4MPEG2 W16 H8 F25:1 Cmono\n",
            compensate,
        ),
        (
            "neither picture nor video",
            table(),
            b"RIFF....AVI LIST",
            compensate,
        ),
        (
            "JSON and frames on one standard output",
            table(),
            b"",
            "--json compensate t.iltm in.y4m -o -",
        ),
        (
            "a tier that the table lacks",
            table(),
            b"",
            "compensate t.iltm in.y4m -o out.y4m --tier 99",
        ),
        ("a table that is not there", table(), b"", "inspect no.iltm"),
    ];
    let mut text = String::new();
    for (case, table, video, line) in cases {
        let user = User::new();
        user.write("t.iltm", table);
        user.write("in.y4m", video);
        let refused = user.run(line).with_code();
        assert_eq!(user.names(""), ["in.y4m", "t.iltm"], "{case}");
        let _ = writeln!(text, "{case}\n{refused}");
    }
    let text = text.replace(&cut.len().to_string(), "LENGTH-1");
    insta::assert_snapshot!(text.replace(&table().len().to_string(), "LENGTH"));
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_a_failure_to_write() {
    let user = User::with_table();
    let frame = [&b"FRAME\n"[..], &[128; 3_840]].concat();
    let header = b"YUV4MPEG2 W64 H40 F25:1 C420jpeg\n";
    user.write("in.y4m", [&header[..], &frame.repeat(3)].concat());
    // `/dev/full` answers every write like a disk without room.
    let full = File::options().write(true).open("/dev/full");
    let mut command = user.iltm("compensate t.iltm in.y4m -o -");
    let child = command.stdout(full.expect("Linux has it")).spawn();
    insta::assert_snapshot!(Ended::of(child.expect("a binary")).with_code());
}

#[test]
fn a_failure_in_json_is_one_object_with_kind_and_next_step() {
    let failed = User::new().run("--json inspect missing.iltm");
    assert_eq!(failed.code, 3);
    let error = &failed.json()["error"];
    assert_eq!(
        (&error["kind"], &error["exit"]),
        (&"read".into(), &3.into())
    );
    assert!(error["next_step"].is_string());
}

#[test]
fn solve_in_json_is_one_object_with_the_figures() {
    let solved = User::new().run("--json solve SAMPLE -o t.iltm");
    assert_eq!(solved.code, 0, "{}", solved.said);
    // Not a terminal: no progress bars.
    let mut said = solved.said.lines();
    assert!(said.all(|line| line.starts_with("{\"progress\"")));
    let data = solved.json();
    assert_eq!(data["rows"], 13);
    assert_eq!(data["photographs"]["bernoulli"], 40);
    let error = |name: &str| data["predicted_error"][name].as_f64().expect("a number");
    assert!(error("compensated") < error("gain_only"));
    assert!(error("gain_only") < error("uncompensated"));
}

/// With a key, and the sample's table signed with it in one go as `signed.iltm`, and
/// afterwards as `later.iltm`.
fn signed() -> &'static User {
    static USER: OnceLock<User> = OnceLock::new();
    USER.get_or_init(|| {
        let user = User::with_table();
        let terms = "--key iltm.key --table-version 3";
        user.says("key new");
        user.says(&format!("solve SAMPLE -o signed.iltm {terms}"));
        user.says(&format!("sign t.iltm -o later.iltm {terms}"));
        user
    })
}

#[test]
fn a_table_signed_by_solve_and_one_signed_afterwards_have_the_key_s_signature() {
    let user = signed();
    let shown = user.json("key show iltm.key");
    let digits = shown["public_key"].as_str().expect("hexadecimal");
    let byte = |at| u8::from_str_radix(&digits[2 * at..2 * at + 2], 16).expect("hexadecimal");
    let public: [u8; 32] = std::array::from_fn(byte);
    let public = VerifyingKey::from_bytes(&public).expect("a point");
    let [once, later] = ["signed.iltm", "later.iltm"].map(|name| {
        let file = user.read(name);
        // Image and the first 32 bytes of the seal, then the signature.
        let (message, signature) = file.split_at(file.len() - 64);
        let signature = Signature::from_slice(signature).expect("64 bytes");
        public.verify_strict(message, &signature).expect("good");
        let (image, seal) = message.split_at(message.len() - 32);
        assert_eq!(&seal[..4], b"SEAL");
        assert_eq!(seal[8..12], 3_u32.to_le_bytes());
        let said = user.says(&format!("inspect {name} --key iltm.key"));
        contains(&said, &["(verified)"]);
        image.to_vec()
    });
    assert_eq!(later, table());
    // But for the time, which solve notes.
    assert_eq!(once.len(), later.len());
}

#[test]
fn inspect_refuses_a_table_that_another_key_signed_or_nobody() {
    let user = signed();
    user.says("key new -o other.key");
    user.fails(22, "inspect signed.iltm --key other.key");
    user.fails(21, "inspect t.iltm --key iltm.key");
    let mut altered = user.read("signed.iltm");
    *altered.last_mut().expect("long") ^= 1;
    user.write("altered.iltm", altered);
    user.fails(23, "inspect altered.iltm --key iltm.key");
}

#[test]
fn a_signed_table_compensates_as_the_same_one_unsigned() {
    let user = signed();
    let wanted = image::GrayImage::from_fn(64, 40, |x, y| Luma([(3 * x + 2 * y) as u8]));
    wanted.save(user.path("w.png")).expect("writable");
    let [plain, signed] = ["t", "later"].map(|name| {
        user.says(&format!("compensate {name}.iltm w.png -o {name}.png"));
        user.picture(&format!("{name}.png")).into_luma8()
    });
    assert_eq!(plain, signed);
    assert_ne!(plain, wanted);
}

#[test]
fn bounces_of_what_is_no_photograph_of_the_projection_are_refused() {
    let user = User::with_capture();
    for (line, code, words) in [
        (
            "capture -o b --photo 1",
            2,
            &[
                "line 3: the photograph with the index 1 is of black",
                "next: Choose another index",
            ][..],
        ),
        (
            "capture -o b --photo 999",
            2,
            &["no photograph with the index 999; the last one is 59"],
        ),
        ("nowhere -o b", 3, &[]),
        (
            "capture -o capture/photos",
            9,
            &["it holds 0", ".png, which this command does not make"],
        ),
    ] {
        let refused = user.run(&format!("bounces {line}"));
        assert_eq!((refused.code, &*refused.out), (code, ""), "{line}");
        contains(&refused.said, words);
        assert_eq!(user.names(""), ["capture"], "nothing half-written");
    }
}

#[test]
fn what_is_there_is_replaced_or_left_alone_or_kept_from_being_lost() {
    let user = User::with_table();
    std::fs::create_dir(user.path("full")).expect("writable");
    user.write("full/mine", "mine");
    user.says("key new -o k");
    for (code, line) in [
        (9, "patterns -o full --rows 3 --cols 4 --projector 64x48"),
        (9, "simulate SCENES/stage.toml -o full"),
        (9, "verify t.iltm -o full --projector 640x400"),
        (9, "bounces SAMPLE -o full"),
        (17, "key new -o full/mine"),
        (0, "man -o full"),
        (0, "man -o full"),
        (0, "sign t.iltm --key k -o t.iltm"),
    ] {
        user.fails(code, line);
        assert_eq!(user.text("full/mine"), "mine", "{line}");
    }
    for line in ["solve SAMPLE -o full", "sign t.iltm --key k -o full"] {
        contains(&user.fails(9, line), &["next: Name a file."]);
    }
}

#[test]
fn bounces_add_up_to_the_photograph_in_files_too() {
    let user = User::new();
    user.says("bounces SAMPLE -o b --photo 4");
    let data = user.json("bounces SAMPLE -o b");
    let layers = data["layers"].as_array().expect("a list");
    let shares = layers
        .iter()
        .filter_map(|layer| layer["light_share"].as_f64());
    assert!((shares.sum::<f64>() - 1.0).abs() < 1e-6, "{data}");
    assert!(
        data["largest_gap"].as_f64().expect("a number") < 1e-6,
        "{data}"
    );
    let bytes = user.read("b/bounces.npy");
    let array = npyz::NpyFile::new(&bytes[..]).expect("an array");
    let shape = array.shape().to_vec();
    assert_eq!(shape, [132, 192, 1, layers.len() as u64]);
    let values: Vec<f32> = array.into_vec().expect("float32");
    let picture = |name: &str| user.picture(&format!("b/{name}.png")).into_luma16();
    let (photograph, first) = (picture("photograph"), picture("bounce-1"));
    let samples = values.chunks_exact(layers.len());
    for ((parts, whole), first) in samples.zip(photograph.pixels()).zip(first.pixels()) {
        let sum: f64 = parts.iter().map(|part| f64::from(*part)).sum();
        let (whole, first) = (f64::from(whole.0[0]), f64::from(first.0[0]));
        // Half a code of rounding; negative light is black.
        assert!((65_535.0 * sum.max(0.0) - whole).abs() < 0.6);
        assert!((65_535.0 * f64::from(parts[0].max(0.0)) - first).abs() < 0.6);
    }
    for layer in layers {
        picture(layer["layer"].as_str().expect("a name"));
    }
    let files = data["files"].as_array().expect("a list");
    assert_eq!(
        user.names("b").len(),
        files.len(),
        "nothing of the first run"
    );
    contains(
        &user.text("b/bounces.html"),
        &["straight from the projector", "1st bounce: direct"],
    );
    let lines = user.text("b/bounces.csv");
    assert_eq!(lines.lines().count(), layers.len() + 1);
}

#[test]
fn inspect_says_of_the_theorem_what_solve_said() {
    let user = User::new();
    let solved = user.says("solve SAMPLE -o t.iltm --verbose");
    let inspected = user.says("inspect t.iltm --verbose");
    let sentence = |said: &str| -> Vec<String> {
        let lines = said
            .lines()
            .skip_while(|line| !line.starts_with("recovery "));
        let words = |line: &str| line.trim_start_matches("recovery").trim().to_owned();
        lines.take(4).map(words).collect()
    };
    assert_eq!(sentence(&solved).len(), 4);
    assert_eq!(sentence(&solved), sentence(&inspected));
    let asks = "the theorem asks for less than 2.41";
    assert!(sentence(&solved)[2].contains(asks), "{solved}");
}

#[test]
fn a_mistake_in_the_command_line_is_an_object_for_programs() {
    for (line, what) in [
        ("solve SAMPLE --json", "--output <TABLE.iltm>"),
        ("--json nosuch", "'nosuch'"),
        ("--json simulate x.toml -o c --fault fog", "fog"),
        ("--json solve SAMPLE -o t --ignore fog", "fog"),
    ] {
        let refused = User::new().run(line);
        assert_eq!(refused.code, 2, "{line}");
        let data = refused.json();
        assert_eq!(data["error"]["kind"], "usage", "{line}");
        contains(data["error"]["message"].as_str().expect("words"), &[what]);
    }
}

#[test]
fn completions_know_the_names_of_gates_effects_faults_methods_and_boards() {
    let script = User::new().says("completions bash");
    let names = ["superposition", "interreflection", "tripod", "brute-force"];
    contains(&script, &names);
    #[cfg(unix)]
    contains(&script, &["mps2-an386"]);
}

#[test]
fn the_manual_page_of_a_command_has_the_options_of_all_commands() {
    let user = User::new();
    user.says("man -o m");
    for page in ["iltm-solve.1", "iltm-key-new.1"] {
        contains(&user.text(&format!("m/{page}")), &["json", "iltm(1)"]);
    }
    contains(&user.text("m/iltm.1"), &["Exit codes:"]);
}

#[test]
fn help_lists_commands_and_exit_codes() {
    insta::assert_snapshot!(User::new().run("--help").out);
}

#[test]
fn a_picture_comes_out_with_its_own_size_and_kind() {
    let user = User::with_table();
    for (width, height) in [(21, 13), (64, 40)] {
        let wanted = image::GrayImage::from_pixel(width, height, Luma([200]));
        wanted.save(user.path("w.png")).expect("writable");
        user.says("compensate t.iltm w.png -o p.png");
        let picture = user.picture("p.png");
        assert_eq!((picture.width(), picture.height()), (width, height));
        assert!(matches!(picture, image::DynamicImage::ImageLuma8(_)));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn files_without_an_end_are_refused() {
    let user = User::with_capture();
    user.write("t.iltm", table());
    std::os::unix::fs::symlink("/dev/zero", user.path("zero.iltm")).expect("writable");
    user.remove("capture/capture.csv");
    let list = user.path("capture/capture.csv");
    std::os::unix::fs::symlink("/dev/zero", list).expect("writable");
    for (code, line) in [
        (3, "inspect zero.iltm"),
        (3, "verify zero.iltm -o v"),
        (3, "tradeoff zero.iltm -o o"),
        (3, "flash zero.iltm"),
        (3, "compensate zero.iltm w.png -o p.png --watch"),
        (3, "compensate t.iltm zero.iltm -o p.png"),
        (3, "check capture"),
        (3, "solve SAMPLE -o s.iltm --content zero.iltm"),
        (17, "key show zero.iltm"),
        (17, "sign t.iltm --key zero.iltm"),
        (3, "simulate zero.iltm -o c"),
    ] {
        let refused = user.fails(code, line);
        contains(&refused, &["neither a regular file nor a pipe"]);
    }
    // A pipe has no length that could be asked before.
    let mut child = user.iltm("inspect /dev/stdin");
    let mut child = child.stdin(Stdio::piped()).spawn().expect("it is there");
    let mut pipe = child.stdin.take().expect("a pipe");
    while pipe.write_all(&[0; 1 << 14]).is_ok() {}
    let refused = Ended::of(child);
    assert_eq!(refused.code, 7, "{}", refused.said);
    contains(&refused.said, &["longer than 268435456 bytes"]);
}
