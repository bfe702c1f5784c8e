//! Counts what frames take on the reference board and prints the list that
//! `docs/instructions.csv` holds: `cargo run --release -p iltm-tests --bin
//! instructions > docs/instructions.csv`.

use iltm_tests::instructions::{cases, count, csv};

fn main() {
    let counts: Vec<_> = cases().iter().flat_map(count).collect();
    print!("{}", csv(&counts));
}
