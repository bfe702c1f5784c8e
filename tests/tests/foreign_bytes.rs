//! A short run of every fuzz target: random bytes, and good files with some bytes
//! changed. `docs/measured.md` says how to run them for long.

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
