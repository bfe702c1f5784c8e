//! A short run of every fuzz target: random bytes, and good files with some bytes
//! changed. `docs/fuzzing.md` says how to run them for long.

use iltm_tests::fuzz::{TARGETS, mutate};
use iltm_tests::{fuzz, wedge_table};
use proptest::prelude::*;

/// Bytes of a good file with a few of them changed, cut or doubled.
fn mutated(seed: Vec<u8>) -> impl Strategy<Value = Vec<u8>> {
    let length = seed.len();
    let change = (0..length, any::<u8>());
    (prop::collection::vec(change, 0..8), 0..=length).prop_map(move |(changes, end)| {
        let mut bytes = seed.clone();
        for (at, value) in changes {
            bytes[at] = value;
        }
        // Most cases keep the whole file.
        if end % 4 == 0 {
            bytes.truncate(end);
        }
        bytes
    })
}

fn sample(name: &str) -> Vec<u8> {
    let samples = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../host-tools/samples/m-panels/"
    );
    std::fs::read(format!("{samples}{name}")).expect("the sample is part of the repository")
}

/// Two frames of video, 6 x 4 pixels.
fn video() -> Vec<u8> {
    let mut stream = b"YUV4MPEG2 W6 H4 F25:1 Ip A1:1 C420jpeg\n".to_vec();
    for luma in [40, 200] {
        stream.extend(b"FRAME\n");
        stream.extend([luma; 24]);
        stream.extend([128; 12]);
    }
    stream
}

/// A hello, and a subscription to a status every half second.
fn requests() -> Vec<u8> {
    let mut bytes = fuzz::HELLO.to_vec();
    bytes.extend(fuzz::SUBSCRIBE);
    bytes.extend([0; 60]);
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn no_bytes_make_a_parser_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        fuzz::image(&bytes);
        fuzz::frames(&bytes);
        fuzz::manifest(&bytes);
        fuzz::settings(&bytes);
        fuzz::scene(&bytes);
        fuzz::mesh(&bytes);
        fuzz::reference(&bytes);
        fuzz::photograph(&bytes);
        fuzz::link(&bytes);
    }

    #[test]
    fn a_changed_table_is_no_trouble(bytes in mutated(wedge_table(3, 4, 3))) {
        fuzz::image(&bytes);
    }

    #[test]
    fn a_changed_video_is_no_trouble(bytes in mutated(video())) {
        fuzz::frames(&bytes);
    }

    #[test]
    fn a_changed_picture_is_no_trouble(bytes in mutated(sample("patterns/020.png"))) {
        fuzz::frames(&bytes);
        fuzz::photograph(&bytes);
    }

    #[test]
    fn a_changed_capture_is_no_trouble(bytes in mutated(sample("capture.csv"))) {
        fuzz::manifest(&bytes);
    }

    #[test]
    fn a_changed_request_is_no_trouble(bytes in mutated(requests())) {
        fuzz::link(&bytes);
    }

    #[test]
    fn changed_settings_are_no_trouble(bytes in mutated(sample("capture.toml"))) {
        fuzz::settings(&bytes);
    }
}

/// As many executions of a target as a test has time for; the driver makes the same
/// ones with `--seed 1`.
fn short_run(name: &str, executions: u64) {
    let target = TARGETS.iter().find(|target| target.name == name);
    let target = target.expect("a target");
    let seeds = (target.seeds)();
    for index in 0..executions {
        let bytes = mutate::input(&seeds, target.groups, 1, index);
        let run = std::panic::catch_unwind(|| (target.run)(&bytes));
        assert!(run.is_ok(), "--seed 1 --first {index} --executions 1");
    }
}

#[test]
fn a_device_does_what_its_model_says_whatever_happens_to_it() {
    short_run("session", 12_000);
}

#[test]
fn a_device_starts_on_any_flash_and_takes_a_table() {
    short_run("flash", 3_000);
}

#[test]
fn nothing_gets_past_the_gate_that_was_not_signed_for_the_device() {
    short_run("gate", 20_000);
}

#[test]
fn a_table_with_right_checksums_and_changed_contents_is_no_trouble() {
    short_run("contents", 10_000);
}

#[test]
fn messages_are_read_as_they_were_written() {
    short_run("messages", 50_000);
}

#[test]
fn changed_photographs_of_every_format_are_no_trouble() {
    short_run("photograph", 2_000);
}

#[test]
fn changed_scenes_and_meshes_are_no_trouble() {
    short_run("scene", 4_000);
    short_run("mesh", 4_000);
}

#[test]
fn changed_reference_transports_are_no_trouble() {
    short_run("reference", 20_000);
}
