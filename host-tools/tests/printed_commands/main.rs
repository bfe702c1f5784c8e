//! Printed commands are run: those of the README and of every page of the site, each page
//! from its first to its last command, in a fresh clone of the repository.
//!
//! **For whoever writes a page:** commands stand in a fenced block marked ```` ```sh ````,
//! and bash runs the block as it is printed, from the root of the clone. Commands that look
//! like some but stand in another block fail the test, and so does a page that is not in the
//! list below. Words behind `sh` say what a block needs:
//!
//! | mark | meaning |
//! |---|---|
//! | `exit=N` | its last command ends with this code |
//! | `given=NAME` | the reader has this already: a scene, a picture, a video, a table, or a folder of photographs |
//! | `hardware=SCENE` | `iltm capture` has a camera and a projector, before this scene of `host-tools/scenes` |
//! | `device` | a device is connected; `PORT` in a command is its port |
//! | `keeps-running` | its last command does not end by itself; it goes on until the page ends |
//! | `long` | takes minutes, or what it does is part of `bash tests/run.sh` anyway |
//!
//! Hardware and programs of others are stand-ins: the board is the emulated one, a camera
//! copies simulated photographs, slides are shown to nobody. Of a long block only programs,
//! packages, targets and options are looked up, and how many blocks that were is printed. The
//! full run leaves nothing out, `bash tests/run.sh` in a clone without a target folder
//! included; it takes about an hour, and the name of a test below chooses one page:
//!
//! ```sh
//! ILTM_PAGES=full cargo test -p iltm --test printed_commands
//! ```

mod follower;
mod names;
mod page;

use follower::{Follower, video};
use page::{Page, pages};
use std::collections::BTreeSet;
use std::env;
use std::fs;
use std::io::{Write, stderr};
use std::path::Path;
use std::process::Command;

/// Follows a page, and checks the clone in which this was done.
fn follow(page: &str, check: fn(&Path)) {
    let full = env::var("ILTM_PAGES").is_ok_and(|pages| pages == "full");
    let mut follower = Follower::new(full);
    let (mut run, mut left) = (0, 0);
    for block in Page::read(page).commands() {
        if follower.follow(block) {
            run += 1;
        } else {
            left += 1;
        }
    }
    // Past the harness, which keeps to itself what a test prints that passes.
    let _ = writeln!(
        stderr(),
        "{page}: {run} blocks run, {left} left to the full run"
    );
    follower.finish(check);
}

/// A test for each page, with what must be there at its end. `tests/run.sh` chooses them by their
/// module.
macro_rules! pages {
    ($($test:ident, $page:literal, $check:expr;)*) => {
        /// Pages that print commands.
        const PAGES: &[&str] = &[$($page),*];

        mod followed {
            use super::{follow, fs, refuses_gpu, refuses_ranks, there, video};

            $(
                #[test]
                fn $test() {
                    follow($page, $check);
                }
            )*
        }
    };
}

pages! {
    the_readme, "README.md", |clone| {
        there(clone, &["iltm-demo/report.html", "TRADEOFF/tradeoff.html", "BOUNCES", "COMPARE/index.html"]);
    };
    the_quick_start, "docs/quick-start.md", |clone| {
        let page = fs::read_to_string(clone.join("man/iltm-solve.1")).expect("a manual page");
        assert!(page.contains("iltm\\-solve"), "{page}");
        let script = fs::read_to_string(clone.join("iltm.bash")).expect("completions");
        assert!(script.contains("complete -F _iltm"), "{script}");
        refuses_ranks(&clone.join("target/release/iltm"));
        refuses_gpu(&clone.join("target/release/iltm"), clone);
    };
    the_technicians_guide, "docs/guide.md", |clone| {
        there(clone, &[
            "foyer-check/check.html",
            "foyer-report/report.html",
            "foyer-verify/verdict/verdict.html",
        ]);
        let played = fs::read(clone.join("played.y4m")).expect("the player got a video");
        assert_eq!(played.len(), video(3, (320, 200)).len());
    };
    the_page_of_the_firmware, "docs/firmware.md", |_| ();
    the_page_of_flashing, "docs/flashing.md", |_| ();
    the_page_of_players, "docs/players.md", |clone| there(clone, &["SHADER/iltm.glsl", "MAPS/alpha.png"]);
    the_page_of_several_projectors, "docs/several-projectors.md", |clone| {
        there(clone, &["proof/verdict/verdict.html", "wide.png"]);
        there(clone, &["screen-proof/verdict/verdict.html", "better.iltm", "screen-report/report.html"]);
        there(clone, &["whole/right/capture.csv", "proof-1/verdict/verdict.html"]);
    };
    the_page_of_scenes, "docs/scenes.md", |_| ();
    the_page_of_figures, "docs/measured.md", |_| ();
    the_results, "docs/results/README.md", |_| ();
    the_hard_cases, "docs/hard-cases.md", |_| ();
    the_page_of_gates, "docs/gates.md", |_| ();
    the_page_of_testing, "docs/testing.md", |_| ();
    the_page_of_fuzzing, "docs/fuzzing.md", |_| ();
    the_page_of_porting, "docs/porting.md", |_| ();
    the_page_of_clusters, "docs/cluster.md", |_| ();
}

fn there(clone: &Path, names: &[&str]) {
    for name in names {
        assert!(clone.join(name).exists(), "{name}");
    }
}

/// Built as the quick start says, without MPI: ranks would all do the same.
fn refuses_ranks(iltm: &Path) {
    let run = |count: &str, line: &[&str]| {
        let mut command = Command::new(iltm);
        let output = command.env("OMPI_COMM_WORLD_SIZE", count).args(line);
        output.output().expect("built")
    };
    let refused = run("2", &["ports"]);
    assert_eq!(refused.status.code(), Some(2));
    let words = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        words.contains("without MPI") && words.contains("--features mpi"),
        "{words}"
    );
    let refused = run("2", &["ports", "--json"]);
    let object: serde_json::Value = serde_json::from_slice(&refused.stdout).expect("an object");
    assert_eq!(object["error"]["kind"], "usage");
    assert_ne!(run("1", &["ports"]).status.code(), Some(2));
}

/// Built as the quick start says, without its part for graphics processors.
fn refuses_gpu(iltm: &Path, clone: &Path) {
    let mut command = Command::new(iltm);
    command
        .current_dir(clone)
        .args(["compensate", "foyer.iltm", "--gpu"]);
    command.args([
        "host-tools/samples/m-panels/patterns/000.png",
        "-o",
        "none.png",
    ]);
    let refused = command.output().expect("built");
    assert_eq!(refused.status.code(), Some(39));
    let words = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(words.contains("--features gpu"), "{words}");
    assert!(!clone.join("none.png").exists());
}

#[test]
fn every_page_that_prints_commands_is_followed() {
    let mut with_commands = BTreeSet::new();
    for path in pages() {
        let page = Page::read(&path);
        let loose = page.loose_commands();
        assert!(loose.is_empty(), "not in blocks marked ```sh: {loose:?}");
        if page.commands().next().is_some() {
            with_commands.insert(path);
        }
    }
    let followed = PAGES.iter().map(|&page| page.to_owned()).collect();
    assert_eq!(with_commands, followed);
}
