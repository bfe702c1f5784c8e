//! Study of the gates before a solve: random good sessions, and each fault in some of them.
//! `cargo run --release -p iltm-tests --bin gates` prints the tables of docs/gates.md.
//!
//! Arguments, all optional: good sessions, sessions with each fault, the first seed, then
//! faults as `NAME` or `NAME=SIZE`.

use iltm::scene::InjectedFault;
use iltm_tests::gates::{StudiedFault, Study};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, usual: u64| {
        let argument = arguments.get(at).and_then(|argument| argument.parse().ok());
        argument.unwrap_or(usual)
    };
    let asked: Vec<InjectedFault> = (arguments.iter().skip(3))
        .map(|argument| argument.parse().expect("a fault"))
        .collect();
    let faults = StudiedFault::ALL.iter().filter_map(|fault| {
        if asked.is_empty() {
            return Some(*fault);
        }
        let (argument, asked) =
            (arguments[3..].iter().zip(&asked)).find(|(_, asked)| asked.kind == fault.kind)?;
        let size = if argument.contains('=') {
            asked.size
        } else {
            fault.size
        };
        Some(StudiedFault { size, ..*fault })
    });
    let study = Study {
        good: number(0, 500) as usize,
        faulty: number(1, 200) as usize,
        first: number(2, 1),
        faults: faults.collect(),
        threads: std::thread::available_parallelism().map_or(1, usize::from),
    };
    let result = study.run(&|said| eprint!("{said}"));
    print!("{}", result.table(&study));
}
