//! Power cuts: an emulated board that is killed at random moments of a real `iltm flash`, and
//! started again on the same memory.
//!
//! Five kills on every test run; a hundred, with their figures, by
//!
//! ```text
//! ILTM_KILLS=100 cargo test -p iltm --test power -- --nocapture
//! ```

mod board;

use board::{Board, Flash};
use iltm_runtime::image::Table;
use iltm_tests::firmware::{Effects, random_table};
use iltm_tests::signed;
use serde_json::Value;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A table's file.
struct File {
    name: String,
    bytes: Vec<u8>,
    id: String,
}

/// Signed tables of which no sector is like another.
fn files(board: &Board) -> [File; 3] {
    let effects = Effects {
        deviation: false,
        ..Effects::ALL
    };
    [1, 2, 3].map(|seed| {
        let image = random_table(board::cells(), 1, effects, seed);
        let bytes = signed(&image, &board::key(), 1, 0, board::DEVICE);
        let table = Table::check(&image).expect("compile checked it");
        let id = format!("{:08x}", table.id());
        let name = format!("{seed}.iltm");
        board.write(&name, &bytes);
        File { name, bytes, id }
    })
}

/// When the board is killed: so long after this event, or after the beginning.
type Moment = (Option<&'static str>, Duration);

/// How long the steps of an undisturbed update took.
#[derive(Clone, Copy, Debug)]
struct Steps {
    /// All.
    whole: Duration,
    /// From the first chunk to the end.
    sending: Duration,
    /// The device's check of the table, signature included.
    check: Duration,
    /// The confirmation.
    confirm: Duration,
}

impl Steps {
    fn of(flash: &Flash) -> Self {
        let at = |name: &str| {
            let mut events = flash.events.iter();
            let event = events.find(|(_, event)| event["event"] == name);
            event.unwrap_or_else(|| panic!("no {name}")).0
        };
        Self {
            whole: at("done") - flash.begun,
            sending: at("done") - at("started"),
            check: at("trial") - at("verified"),
            confirm: at("done") - at("trial"),
        }
    }

    /// Of ten kills one comes at any time, two are aimed at the check, two at the
    /// confirmation, and five at the time from the first chunk to the end.
    fn moment(&self, kill: usize, random: &mut fastrand::Rng) -> Moment {
        let mut part = |of: Duration| of.mul_f64(random.f64());
        match kill % 10 {
            1 | 6 => (Some("verified"), part(self.check)),
            3 | 8 => (Some("trial"), part(self.confirm)),
            5 => (None, part(self.whole)),
            _ => (Some("started"), part(self.sending)),
        }
    }
}

/// What `iltm flash` was at when the board was killed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Phase {
    /// It compared what there was.
    Comparison,
    /// Chunks were on their way, or all had come and were compared.
    Transfer,
    /// The device checked the table.
    Check,
    /// The device had the table on trial, and was asked to confirm it.
    Trial,
    /// The update was done.
    After,
}

impl Phase {
    fn of(events: &[(Instant, Value)]) -> Self {
        let names = events.iter().rev();
        let mut names = names.filter_map(|(_, event)| event["event"].as_str());
        match names.next() {
            None => Self::Comparison,
            Some("started" | "progress") => Self::Transfer,
            Some("verified") => Self::Check,
            Some("trial") => Self::Trial,
            Some("done") => Self::After,
            Some(other) => panic!("an event {other}"),
        }
    }
}

/// Figures of all kills.
#[derive(Default)]
struct Figures {
    /// Kills, then how often the old and the new table were found.
    by_phase: BTreeMap<Phase, [u32; 3]>,
    /// Updates that went on where they had stopped.
    resumed: u32,
    /// Bytes that these did not send again, of so many.
    skipped: [usize; 2],
}

impl Figures {
    fn print(&self) {
        for (phase, [kills, old, new]) in &self.by_phase {
            println!(
                "  {phase:?}: {kills} kills; then {old} times the old table, {new} times the new one"
            );
        }
        let [skipped, all] = self.skipped;
        println!(
            "  {} updates went on where they had stopped: {skipped} of {all} bytes not sent again",
            self.resumed
        );
    }
}

/// An update that is cut.
#[derive(Clone, Copy)]
struct Update<'a> {
    old: &'a File,
    new: &'a File,
    /// Slot of the old table.
    slot: usize,
}

impl Update<'_> {
    /// What was said of it; the board does not answer any more.
    fn check_words(&self, phase: Phase, flash: &Flash) {
        if phase == Phase::After {
            assert_eq!(flash.code, Some(0));
            return;
        }
        assert_eq!(flash.code, Some(11), "{:?}", flash.events);
        let error = &flash.last()["error"];
        assert!(error["next_step"].is_string(), "{error}");
        let active = &error["active"];
        assert_eq!(active["known"], false, "{error}");
        let asked = match phase {
            Phase::Comparison => return,
            Phase::Transfer => "transfer",
            Phase::Check => "trial",
            Phase::Trial | Phase::After => "confirmation",
        };
        assert_eq!(active["asked"], asked, "{phase:?}: {error}");
        assert_eq!(active["before"]["id"], self.old.id, "{error}");
    }

    /// The board started again: which table it has, and that it is whole. Returns whether
    /// it is the new one.
    fn check_board(&self, phase: Phase, board: &Board) -> bool {
        let shown = board.show();
        let status = board.status();
        assert_eq!(status["mode"], "compensating", "{phase:?}: {status}");
        assert!(status["last_fault"].is_null(), "{phase:?}: {status}");
        assert_eq!(status["update"]["trial_ms"], 0, "{phase:?}: {status}");
        let is_new = status["table"]["id"] == self.new.id;
        let (used, slot) = if is_new {
            (self.new, 1 - self.slot)
        } else {
            (self.old, self.slot)
        };
        assert_eq!(status["table"]["id"], used.id, "{phase:?}: {status}");
        assert!(board.holds(slot, &used.bytes), "{phase:?}: {status}");
        assert!(board.is_shown_with(&shown, &used.bytes), "{status}");
        match phase {
            Phase::Comparison | Phase::Transfer | Phase::Check => {
                assert!(!is_new, "{phase:?}: {status}");
            }
            // The confirmation had arrived or not.
            Phase::Trial => {}
            Phase::After => assert!(is_new, "{status}"),
        }
        is_new
    }

    /// Once more, to the end. `missing` bytes are in sectors that had not arrived whole:
    /// exactly these are sent.
    fn finish(&self, missing: usize, is_new: bool, board: &Board) {
        let again = board.flash(&self.new.name).wait();
        let done = again.last();
        assert_eq!(again.code, Some(0), "{done}");
        assert_eq!(done["event"], "done");
        assert_eq!(done["confirmed"], true, "{done}");
        assert_eq!(done["active"]["table"]["id"], self.new.id, "{done}");
        if is_new {
            assert_eq!(done["sent"], 0, "{done}");
        } else {
            assert_eq!(again.events[0].1["to_send"], missing);
            assert_eq!(done["sent"], missing, "{done}");
        }
        assert!(board.holds(1 - self.slot, &self.new.bytes), "{done}");
    }
}

#[test]
fn a_board_that_is_killed_at_any_moment_of_an_update_has_a_whole_table_and_takes_the_rest() {
    let number = |name: &str, usual: u64| {
        let given = std::env::var(name).map_or(Ok(usual), |text| text.parse());
        given.expect("a number")
    };
    let (kills, seed) = (number("ILTM_KILLS", 5) as usize, number("ILTM_SEED", 1));
    let mut random = fastrand::Rng::with_seed(seed);
    let mut figures = Figures::default();
    let mut board = Board::new();
    let files = files(&board);
    let begin = Instant::now();

    board.start();
    let first = board.flash(&files[0].name).wait();
    assert_eq!(first.code, Some(0), "{}", first.last());
    let mut steps = Steps::of(&first);
    for kill in 0..kills {
        let update = Update {
            old: &files[kill % 3],
            new: &files[(kill + 1) % 3],
            slot: kill % 2,
        };
        let mut flash = board.flash(&update.new.name);
        let (event, time) = steps.moment(kill, &mut random);
        flash.wait_for(event, time);
        board.kill();
        let flash = flash.wait();
        let phase = Phase::of(&flash.events);
        update.check_words(phase, &flash);
        if phase == Phase::After {
            // It goes faster by now.
            steps = Steps::of(&flash);
        }
        let all = update.new.bytes.len();
        let missing = board.missing(1 - update.slot, &update.new.bytes);

        board.start();
        let is_new = update.check_board(phase, &board);
        update.finish(missing, is_new, &board);
        let [kills, old, new] = figures.by_phase.entry(phase).or_default();
        *kills += 1;
        *if is_new { new } else { old } += 1;
        if !is_new && missing < all {
            figures.resumed += 1;
            figures.skipped[0] += all - missing;
            figures.skipped[1] += all;
        }
    }
    println!(
        "{kills} kills (seed {seed}) in {:.0?}; tables of {} bytes, undisturbed {steps:.2?}",
        begin.elapsed(),
        files[0].bytes.len(),
    );
    figures.print();
    assert!(
        figures.resumed > 0,
        "no kill came after a sector had arrived"
    );
}
