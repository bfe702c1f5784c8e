//! Instruction counts on the reference board, and bytes of firmware: prints the lists that
//! `docs` holds:
//!
//!     cargo run --release -p iltm-tests --bin counts -- instructions > docs/instructions.csv
//!     cargo run --release -p iltm-tests --bin counts -- costs > docs/costs.csv
//!     cargo run --release -p iltm-tests --bin counts -- stages > docs/stages.csv
//!     cargo run --release -p iltm-tests --bin counts -- sizes > docs/firmware-sizes.csv
//!     cargo run --release -p iltm-tests --bin counts -- rights
//!     cargo run --release -p iltm-tests --bin counts -- neighbours
//!
//! `sizes` builds the firmware with every choice of stages, 33 in all. `rights` says what a device
//! takes to look at a right (`docs/flashing.md`), `neighbours` what the light of other projectors takes
//! (`docs/firmware.md`).

use iltm_tests::instructions::{self, count};
use iltm_tests::{costs, neighbours, rights, stages};

fn main() {
    match std::env::args().nth(1).as_deref() {
        Some("instructions") => {
            let all = [instructions::cases(), instructions::slow_cases()].concat();
            let counts: Vec<_> = all.iter().flat_map(count).collect();
            print!("{}", instructions::csv(&counts));
        }
        Some("costs") => {
            let counts: Vec<_> = costs::cases().iter().flat_map(count).collect();
            print!("{}", costs::csv(&counts));
        }
        Some("stages") => print!("{}", stages::csv(&stages::costs())),
        Some("sizes") => {
            println!("stages,bytes of flash");
            for stages in stages::choices() {
                println!("{}", stages::size_line(&stages));
            }
        }
        Some("rights") => rights::print(),
        Some("neighbours") => {
            neighbours::print_fixed();
            for cells in [(24, 32), (48, 64)] {
                neighbours::print(cells);
            }
        }
        _ => panic!("name a list: instructions, costs, stages, sizes, rights or neighbours"),
    }
}
