//! See `iltm_tests::fuzz::contents`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| iltm_tests::fuzz::contents(bytes));
