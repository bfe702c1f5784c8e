//! See `iltm_tests::fuzz::reference`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| iltm_tests::fuzz::reference(bytes));
