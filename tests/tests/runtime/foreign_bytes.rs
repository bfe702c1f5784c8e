//! Fuzz targets in short runs: random bytes, and good files with some bytes changed.
//! `docs/fuzzing.md` says how to run them for long.

use iltm_tests::fuzz::{self, TARGETS, mutate};
use proptest::prelude::*;

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
}

/// As many executions of a target as a test has time for; the driver makes the same
/// ones with `--seed 1`.
fn short_run(name: &str, executions: u64) {
    let target = TARGETS.iter().find(|target| target.name == name);
    let target = target.expect("a target");
    let seeds = (target.seeds)();
    assert!(!seeds.is_empty(), "the samples are part of the repository");
    for index in 0..executions {
        let bytes = mutate::input(&seeds, target.groups, 1, index);
        let run = std::panic::catch_unwind(|| (target.run)(&bytes));
        assert!(run.is_ok(), "--seed 1 --first {index} --executions 1");
    }
}

/// A test for each target, with how often it is run.
macro_rules! short_runs {
    ($($test:ident, $target:literal, $executions:literal;)*) => {
        #[test]
        fn every_target_has_a_short_run() {
            let mut run = [$($target),*];
            let mut all = TARGETS.map(|target| target.name);
            run.sort_unstable();
            all.sort_unstable();
            assert_eq!(run, all);
        }

        $(
            #[test]
            fn $test() {
                short_run($target, $executions);
            }
        )*
    };
}

short_runs! {
    a_device_does_what_its_model_says_whatever_happens_to_it, "session", 12_000;
    a_device_starts_on_any_flash_and_takes_a_table, "flash", 3_000;
    nothing_gets_past_the_gate_that_was_not_signed_for_the_device, "gate", 20_000;
    a_table_with_right_checksums_and_changed_contents_is_no_trouble, "contents", 10_000;
    messages_are_read_as_they_were_written, "messages", 50_000;
    a_changed_table_is_no_trouble, "image", 2_000;
    changed_videos_and_pictures_are_no_trouble, "frames", 1_000;
    changed_photographs_of_every_format_are_no_trouble, "photograph", 4_000;
    changed_captures_are_no_trouble, "manifest", 1_000;
    changed_settings_are_no_trouble, "settings", 1_000;
    changed_requests_are_no_trouble, "link", 1_000;
    changed_scenes_are_no_trouble, "scene", 4_000;
    changed_meshes_are_no_trouble, "mesh", 4_000;
    changed_reference_transports_are_no_trouble, "reference", 20_000;
}
