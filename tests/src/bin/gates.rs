//! Gates before a solve: takes simulated photographs with every fault at several sizes and
//! prints which gates notice: `cargo run --release -p iltm-tests --bin gates`.
//!
//! Words choose the faults whose names contain one of them.

use iltm::capture::Verdict;
use iltm_tests::gates::{GateRig, GateSession, table, tried};
use iltm_tests::simulated::scene;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let scene = scene("m-panels", &[]);
    let rig = GateRig::new(&scene);
    let say = |session: &GateSession| {
        let name = session
            .fault
            .map_or_else(|| "no fault".to_owned(), |f| f.to_string());
        let (fail, warn) = (session.that(Verdict::Fail), session.that(Verdict::Warn));
        eprintln!(
            "{name:18} fail {fail:?} remark {warn:?} {}",
            session.first_words()
        );
    };
    say(&rig.session(None));
    let mut all = Vec::new();
    for (kind, what, sizes) in tried() {
        if !words.is_empty() && !words.iter().any(|word| kind.to_string().contains(word)) {
            continue;
        }
        let sessions = sizes.into_iter().map(|size| {
            let session = rig.session(Some(iltm::scene::InjectedFault { kind, size }));
            say(&session);
            session
        });
        all.push((what, sessions.collect()));
    }
    print!("{}", table(&all));
}
