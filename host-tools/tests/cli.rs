//! The command line as a user meets it: the wrong ways in particular. Every one
//! has a message with its place and the next step, an exit code of its kind, and
//! leaves no half-written output.

use ed25519_dalek::{Signature, VerifyingKey};
use image::{ImageReader, Luma};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/m-panels");

fn iltm(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command.current_dir(folder).args(arguments);
    command.stdin(Stdio::null());
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    iltm(folder, arguments)
        .output()
        .expect("the binary is there")
}

/// Exit code and what people read.
fn said(output: &Output) -> String {
    let code = output.status.code().expect("not killed");
    format!("exit {code}\n{}", String::from_utf8_lossy(&output.stderr))
}

/// A copy of the sample capture as `capture` in a folder of its own.
fn capture() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for part in ["patterns", "photos"] {
        let to = folder.path().join("capture").join(part);
        fs::create_dir_all(&to).expect("a new folder");
        for file in fs::read_dir(Path::new(SAMPLE).join(part)).expect("the sample") {
            let file = file.expect("the sample");
            fs::copy(file.path(), to.join(file.file_name())).expect("a copy");
        }
    }
    for file in ["capture.csv", "capture.toml"] {
        let to = folder.path().join("capture").join(file);
        fs::copy(Path::new(SAMPLE).join(file), to).expect("a copy");
    }
    folder
}

/// The table of the sample, solved once.
fn table() -> &'static [u8] {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let output = run(folder.path(), &["solve", SAMPLE, "-o", "t.iltm"]);
        assert!(output.status.success(), "{}", said(&output));
        fs::read(folder.path().join("t.iltm")).expect("written")
    })
}

/// What `iltm solve capture` says of a capture that something was done to.
fn solve_after(harm: impl FnOnce(&Path), more: &[&str]) -> String {
    let folder = capture();
    harm(&folder.path().join("capture"));
    let mut arguments = vec!["solve", "capture", "-o", "t.iltm"];
    arguments.extend(more);
    let output = run(folder.path(), &arguments);
    assert!(output.stdout.is_empty());
    let left: Vec<PathBuf> = files(folder.path());
    assert_eq!(
        left,
        [folder.path().join("capture")],
        "nothing half-written"
    );
    said(&output)
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("readable");
    let mut files: Vec<_> = entries
        .map(|entry| entry.expect("readable").path())
        .collect();
    files.sort();
    files
}

fn without_lines(capture: &Path, unwanted: &str) {
    let path = capture.join("capture.csv");
    let lines = fs::read_to_string(&path).expect("the sample");
    let kept = lines.lines().filter(|line| !line.contains(unwanted));
    let kept: Vec<&str> = kept.collect();
    fs::write(path, kept.join("\n")).expect("writable");
}

fn change_picture(path: &Path, change: impl Fn(u32, u32, u8) -> u8) {
    let reader = ImageReader::open(path).expect("the sample");
    let mut picture = reader.decode().expect("a good picture").into_luma8();
    for (x, y, Luma([value])) in picture.enumerate_pixels_mut() {
        *value = change(x, y, *value);
    }
    picture.save(path).expect("writable");
}

#[test]
fn a_missing_photograph_is_named() {
    let said = solve_after(
        |capture| fs::remove_file(capture.join("photos/007.png")).expect("there"),
        &[],
    );
    insta::assert_snapshot!(said);
}

#[test]
fn a_photograph_of_another_size_is_named() {
    let said = solve_after(
        |capture| {
            let small = image::GrayImage::new(100, 132);
            small
                .save(capture.join("photos/012.png"))
                .expect("writable");
        },
        &[],
    );
    insta::assert_snapshot!(said);
}

#[test]
fn a_pattern_with_a_grey_cell_is_named_with_the_cell() {
    let grey = |x, y, value| if (x, y) == (5, 2) { 128 } else { value };
    let said = solve_after(
        |capture| change_picture(&capture.join("patterns/020.png"), grey),
        &[],
    );
    insta::assert_snapshot!(said);
}

#[test]
fn an_overexposed_flood_photograph_is_refused() {
    let burnt = |_, _, value| if value > 150 { 255 } else { value };
    let said = solve_after(
        |capture| change_picture(&capture.join("photos/000.png"), burnt),
        &[],
    );
    insta::assert_snapshot!(said);
}

#[test]
fn a_capture_without_black_is_refused() {
    insta::assert_snapshot!(solve_after(
        |capture| without_lines(capture, ",black,"),
        &[]
    ));
}

#[test]
fn a_capture_without_white_is_refused() {
    insta::assert_snapshot!(solve_after(
        |capture| without_lines(capture, ",white,"),
        &[]
    ));
}

#[test]
fn too_few_photographs_are_refused() {
    insta::assert_snapshot!(solve_after(|_| (), &["--photos", "3"]));
}

#[test]
fn more_photographs_than_there_are_is_a_mistake_in_the_command() {
    insta::assert_snapshot!(solve_after(|_| (), &["--photos", "41"]));
}

#[test]
fn a_grid_that_the_gray_code_does_not_cover_is_refused() {
    insta::assert_snapshot!(solve_after(
        |capture| without_lines(capture, ",column-4"),
        &[]
    ));
}

#[test]
fn photographs_said_to_be_linear_that_are_not_are_refused() {
    let said = solve_after(
        |capture| fs::remove_file(capture.join("capture.toml")).expect("there"),
        &[],
    );
    insta::assert_snapshot!(said);
}

#[test]
fn a_folder_that_is_no_capture_is_named() {
    let said = solve_after(
        |capture| fs::remove_file(capture.join("capture.csv")).expect("there"),
        &[],
    );
    insta::assert_snapshot!(said);
}

#[test]
fn a_folder_that_cannot_be_written_is_a_failure_to_write() {
    let folder = capture();
    let output = run(folder.path(), &["solve", "capture", "-o", "no/such/t.iltm"]);
    insta::assert_snapshot!(said(&output));
}

/// What a command says that gets these bytes as `t.iltm` and `in.y4m`.
fn with(table: &[u8], video: &[u8], arguments: &[&str]) -> (String, Vec<String>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("t.iltm"), table).expect("writable");
    fs::write(folder.path().join("in.y4m"), video).expect("writable");
    let said = said(&run(folder.path(), arguments));
    let name = |path: PathBuf| {
        path.file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    (said, files(folder.path()).into_iter().map(name).collect())
}

const COMPENSATE: [&str; 5] = ["compensate", "t.iltm", "in.y4m", "-o", "out.y4m"];

#[test]
fn a_truncated_table_is_refused() {
    let cut = &table()[..table().len() - 1];
    let (said, left) = with(cut, b"", &["inspect", "t.iltm"]);
    let said = said.replace(&cut.len().to_string(), "LENGTH-1");
    insta::assert_snapshot!(said.replace(&table().len().to_string(), "LENGTH"));
    assert_eq!(left, ["in.y4m", "t.iltm"]);
}

#[test]
fn an_altered_table_is_refused_and_no_frame_written() {
    let mut altered = table().to_vec();
    let middle = altered.len() / 2;
    altered[middle] ^= 1;
    let (said, left) = with(&altered, b"", &COMPENSATE);
    insta::assert_snapshot!(said);
    assert_eq!(left, ["in.y4m", "t.iltm"]);
}

#[test]
fn a_video_whose_header_lies_leaves_no_output() {
    // 64 x 40 needs 3,840 bytes a frame; the second one is cut short.
    let mut video = b"YUV4MPEG2 W64 H40 F25:1 C420jpeg\nFRAME\n".to_vec();
    video.extend([128; 3_840]);
    video.extend(b"FRAME\n");
    video.extend([128; 100]);
    let (said, left) = with(table(), &video, &COMPENSATE);
    insta::assert_snapshot!(said);
    assert_eq!(left, ["in.y4m", "t.iltm"]);
}

#[test]
fn a_video_that_claims_an_impossible_size_is_refused() {
    let (said, left) = with(table(), b"YUV4MPEG2 W99999999 H40 F25:1\n", &COMPENSATE);
    insta::assert_snapshot!(said);
    assert_eq!(left, ["in.y4m", "t.iltm"]);
}

#[test]
fn a_frame_smaller_than_the_grid_is_refused() {
    let (said, _) = with(table(), b"YUV4MPEG2 W16 H8 F25:1 Cmono\n", &COMPENSATE);
    insta::assert_snapshot!(said);
}

#[test]
fn neither_picture_nor_video_is_refused() {
    let (said, _) = with(table(), b"RIFF....AVI LIST", &COMPENSATE);
    insta::assert_snapshot!(said);
}

#[test]
fn a_tier_that_the_table_lacks_is_a_mistake_in_the_command() {
    let mut arguments = COMPENSATE.to_vec();
    arguments.extend(["--tier", "99"]);
    let (said, _) = with(table(), b"", &arguments);
    assert!(said.starts_with("exit 2\n"), "{said}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_a_failure_to_write() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("t.iltm"), table()).expect("writable");
    let mut video = b"YUV4MPEG2 W64 H40 F25:1 C420jpeg\n".to_vec();
    for _ in 0..3 {
        video.extend(b"FRAME\n");
        video.extend([128; 3_840]);
    }
    fs::write(folder.path().join("in.y4m"), video).expect("writable");
    // `/dev/full` answers every write like a disk without room.
    let full = File::options()
        .write(true)
        .open("/dev/full")
        .expect("Linux has it");
    let mut command = iltm(
        folder.path(),
        &["compensate", "t.iltm", "in.y4m", "-o", "-"],
    );
    let output = command.stdout(full).output().expect("the binary is there");
    insta::assert_snapshot!(said(&output));
}

#[test]
fn json_and_frames_do_not_share_standard_output() {
    let (said, _) = with(
        table(),
        b"",
        &["--json", "compensate", "t.iltm", "in.y4m", "-o", "-"],
    );
    insta::assert_snapshot!(said);
}

#[test]
fn a_failure_in_json_is_one_object_with_kind_and_next_step() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = run(folder.path(), &["--json", "inspect", "missing.iltm"]);
    assert_eq!(output.status.code(), Some(3));
    let data: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(data["error"]["kind"], "read");
    assert_eq!(data["error"]["exit"], 3);
    assert!(data["error"]["next_step"].is_string());
}

#[test]
fn solve_in_json_is_one_object_with_the_figures() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = run(folder.path(), &["--json", "solve", SAMPLE, "-o", "t.iltm"]);
    assert!(output.status.success(), "{}", said(&output));
    assert!(output.stderr.is_empty(), "not a terminal: no progress bars");
    let data: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(data["rows"], 13);
    assert_eq!(data["photographs"]["bernoulli"], 40);
    let error = |name: &str| data["predicted_error"][name].as_f64().expect("a number");
    assert!(error("compensated") < error("gain_only"));
    assert!(error("gain_only") < error("uncompensated"));
}

/// A folder with a key, and the sample's table signed with it in one go as
/// `signed.iltm`, and afterwards as `later.iltm`.
fn signed() -> &'static TempDir {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("plain.iltm"), table()).expect("writable");
        let terms = ["--key", "iltm.key", "--table-version", "3"];
        let solve = ["solve", SAMPLE, "-o", "signed.iltm"];
        let sign = ["sign", "plain.iltm", "-o", "later.iltm"];
        for command in [
            vec!["key", "new"],
            [&solve[..], &terms].concat(),
            [&sign[..], &terms].concat(),
        ] {
            let output = run(folder.path(), &command);
            assert!(output.status.success(), "{}", said(&output));
        }
        folder
    })
}

#[test]
fn a_table_signed_by_solve_and_one_signed_afterwards_have_the_key_s_signature() {
    let folder = signed();
    let output = run(folder.path(), &["--json", "key", "show", "iltm.key"]);
    let shown: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let digits = shown["public_key"].as_str().expect("hexadecimal");
    let byte = |at| u8::from_str_radix(&digits[2 * at..2 * at + 2], 16).expect("hexadecimal");
    let public: [u8; 32] = std::array::from_fn(byte);
    let public = VerifyingKey::from_bytes(&public).expect("a point");
    let [once, later] = ["signed.iltm", "later.iltm"].map(|name| {
        let file = fs::read(folder.path().join(name)).expect("written");
        // Image and the first 32 bytes of the seal, then the signature.
        let (message, signature) = file.split_at(file.len() - 64);
        let signature = Signature::from_slice(signature).expect("64 bytes");
        public.verify_strict(message, &signature).expect("good");
        let (image, seal) = message.split_at(message.len() - 32);
        assert_eq!(&seal[..4], b"SEAL");
        assert_eq!(seal[8..12], 3_u32.to_le_bytes());
        let output = run(folder.path(), &["inspect", name, "--key", "iltm.key"]);
        assert!(said(&output).contains("(verified)"), "{}", said(&output));
        image.to_vec()
    });
    assert_eq!(later, table());
    // But for the time, which solve notes.
    assert_eq!(once.len(), later.len());
}

#[test]
fn inspect_refuses_a_table_that_another_key_signed_or_nobody() {
    let folder = signed();
    let output = run(folder.path(), &["key", "new", "-o", "other.key"]);
    assert!(output.status.success(), "{}", said(&output));
    let inspect = |name, key| {
        let output = run(folder.path(), &["inspect", name, "--key", key]);
        output.status.code()
    };
    assert_eq!(inspect("signed.iltm", "other.key"), Some(22));
    assert_eq!(inspect("plain.iltm", "iltm.key"), Some(21));
    let mut altered = fs::read(folder.path().join("signed.iltm")).expect("written");
    *altered.last_mut().expect("long") ^= 1;
    fs::write(folder.path().join("altered.iltm"), altered).expect("writable");
    assert_eq!(inspect("altered.iltm", "iltm.key"), Some(23));
}

#[test]
fn a_signed_table_compensates_as_the_same_one_unsigned() {
    let folder = signed();
    let wanted = image::GrayImage::from_fn(64, 40, |x, y| Luma([(3 * x + 2 * y) as u8]));
    wanted.save(folder.path().join("w.png")).expect("writable");
    let [plain, signed] = ["plain", "later"].map(|name| {
        let (table, picture) = (format!("{name}.iltm"), format!("{name}.png"));
        let output = run(
            folder.path(),
            &["compensate", &table, "w.png", "-o", &picture],
        );
        assert!(output.status.success(), "{}", said(&output));
        let reader = ImageReader::open(folder.path().join(picture)).expect("written");
        reader.decode().expect("a picture").into_luma8()
    });
    assert_eq!(plain, signed);
    assert_ne!(plain, wanted);
}

/// What `iltm bounces` says where it has to refuse; nothing may be left behind.
fn bounces_refused(arguments: &[&str]) -> String {
    let folder = capture();
    let before = files(folder.path());
    let mut all = vec!["bounces"];
    all.extend(arguments);
    let output = run(folder.path(), &all);
    assert!(output.stdout.is_empty());
    assert_eq!(files(folder.path()), before, "nothing half-written");
    said(&output)
}

#[test]
fn bounces_of_what_is_no_photograph_of_the_projection_are_refused() {
    let said = bounces_refused(&["capture", "-o", "b", "--photo", "1"]);
    assert!(said.starts_with("exit 2\n"), "{said}");
    assert!(said.contains("line 3: the photograph with the index 1 is of black"));
    assert!(said.contains("next: Choose another index"), "{said}");
    let said = bounces_refused(&["capture", "-o", "b", "--photo", "999"]);
    assert!(said.starts_with("exit 2\n"), "{said}");
    assert!(
        said.contains("no photograph with the index 999; the last one is 59"),
        "{said}"
    );
    let said = bounces_refused(&["nowhere", "-o", "b"]);
    assert!(said.starts_with("exit 3\n"), "{said}");
    let said = bounces_refused(&["capture", "-o", "capture/photos"]);
    assert!(said.starts_with("exit 9\n"), "{said}");
    assert!(
        said.contains("it is there already, and not empty"),
        "{said}"
    );
}

#[test]
fn bounces_add_up_to_the_photograph_in_files_too() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = run(folder.path(), &["--json", "bounces", SAMPLE, "-o", "b"]);
    assert!(output.status.success(), "{}", said(&output));
    let data: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    let layers = data["layers"].as_array().expect("a list");
    let shares = layers
        .iter()
        .filter_map(|layer| layer["light_share"].as_f64());
    assert!((shares.sum::<f64>() - 1.0).abs() < 1e-6, "{data}");
    assert!(
        data["largest_gap"].as_f64().expect("a number") < 1e-6,
        "{data}"
    );
    let bytes = fs::read(folder.path().join("b/bounces.npy")).expect("written");
    let array = npyz::NpyFile::new(&bytes[..]).expect("an array");
    let shape = array.shape().to_vec();
    assert_eq!(shape, [132, 192, 1, layers.len() as u64]);
    let values: Vec<f32> = array.into_vec().expect("float32");
    let picture = |name: &str| {
        let reader = ImageReader::open(folder.path().join("b").join(name)).expect("written");
        reader.decode().expect("a picture").into_luma16()
    };
    let photograph = picture("photograph.png");
    let first = picture("bounce-1.png");
    let samples = values.chunks_exact(layers.len());
    for ((parts, whole), first) in samples.zip(photograph.pixels()).zip(first.pixels()) {
        let sum: f64 = parts.iter().map(|part| f64::from(*part)).sum();
        let (whole, first) = (f64::from(whole.0[0]), f64::from(first.0[0]));
        // Half a code of rounding; negative light is black.
        assert!((65_535.0 * sum.max(0.0) - whole).abs() < 0.6);
        assert!((65_535.0 * f64::from(parts[0].max(0.0)) - first).abs() < 0.6);
    }
    for layer in layers {
        let name = format!("{}.png", layer["layer"].as_str().expect("a name"));
        picture(&name);
    }
    let lines = fs::read_to_string(folder.path().join("b/bounces.csv")).expect("written");
    assert_eq!(lines.lines().count(), layers.len() + 1);
}

#[test]
fn inspect_says_of_the_theorem_what_solve_said() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let solved = said(&run(folder.path(), &["solve", SAMPLE, "-o", "t.iltm"]));
    let inspected = said(&run(folder.path(), &["inspect", "t.iltm"]));
    let sentence = |said: &str| -> Vec<String> {
        let lines = said
            .lines()
            .skip_while(|line| !line.starts_with("recovery "));
        let words = |line: &str| line.trim_start_matches("recovery").trim().to_owned();
        lines.take(4).map(words).collect()
    };
    assert_eq!(sentence(&solved).len(), 4);
    assert_eq!(sentence(&solved), sentence(&inspected));
    assert!(
        sentence(&solved)[2].contains("the theorem asks for less than 2.41"),
        "{solved}"
    );
}

#[test]
fn help_lists_commands_and_exit_codes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = run(folder.path(), &["--help"]);
    insta::assert_snapshot!(String::from_utf8_lossy(&output.stdout));
}

#[test]
fn a_picture_comes_out_with_its_own_size_and_kind() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("t.iltm"), table()).expect("writable");
    for (width, height) in [(21, 13), (64, 40)] {
        let wanted = image::GrayImage::from_pixel(width, height, Luma([200]));
        wanted.save(folder.path().join("w.png")).expect("writable");
        let output = run(
            folder.path(),
            &["compensate", "t.iltm", "w.png", "-o", "p.png"],
        );
        assert!(output.status.success(), "{}", said(&output));
        let reader = ImageReader::open(folder.path().join("p.png")).expect("written");
        let picture = reader.decode().expect("a picture");
        assert_eq!((picture.width(), picture.height()), (width, height));
        assert!(matches!(picture, image::DynamicImage::ImageLuma8(_)));
    }
}
