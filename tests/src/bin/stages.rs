//! Counts what the stages of the pipeline take on the reference board:
//!
//!     cargo run --release -p iltm-tests --bin stages > docs/stages.csv
//!     cargo run --release -p iltm-tests --bin stages -- sizes > docs/firmware-sizes.csv
//!
//! The second builds the firmware with every choice of stages, 32 in all.

use iltm_tests::stages::{choices, costs, csv, size_line};

fn main() {
    if std::env::args().nth(1).as_deref() == Some("sizes") {
        println!("stages,bytes of flash");
        for stages in choices() {
            println!("{}", size_line(&stages));
        }
    } else {
        print!("{}", csv(&costs()));
    }
}
