//! Counts frames of many shapes on the reference board and prints the list that
//! `docs/costs.csv` holds: `cargo run --release -p iltm-tests --bin costs >
//! docs/costs.csv`.

use iltm_tests::costs::{counts, csv};

fn main() {
    print!("{}", csv(&counts()));
}
