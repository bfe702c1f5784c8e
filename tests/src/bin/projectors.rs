//! Several projectors: errors on the wall of the scene `two-walls`, solved together, each projector
//! alone, and with gains alone; and by pixels on all scenes of several projectors.
//!
//! `cargo run --release -p iltm-tests --bin projectors` prints the tables of
//! `docs/several-projectors.md`; with `-- verdicts` that of verifications, with `-- photographs` that of
//! fewer photographs, and with `-- FOLDER` it draws the pictures there, and nothing else.

use iltm::compile::NEIGHBOURS_FACTOR;
use iltm::picture::png;
use iltm::verify::{Cause, TableVerdict};
use iltm_tests::overlapping::{
    Screen, SeenOnScreen, joined, learned_alone, learned_together, learned_with_even_black,
    photograph_each, photograph_from_poses, photograph_together, refined, verified, with_smaller,
};
use iltm_tests::simulated::{
    error_on_the_wall, inputs, inputs_of_each_alone, learned, overlaps, photograph, scene, showable,
};
use std::path::Path;

/// All scenes of several projectors.
const SCENES: [&str; 4] = ["two-walls", "cube-room", "folded-screen", "dome-of-four"];

/// The folded screen whose projectors have other sizes.
const OTHER_SIZES: &str = "folded-screen, other sizes";

/// Scenes whose photographs are drawn, and the heading.
const DRAWN: [(&str, &str); 2] = [
    ("dome-of-four", "A dome with four projectors"),
    ("folded-screen", "A folded screen with two projectors"),
];

fn main() {
    match std::env::args_os().nth(1) {
        Some(word) if word == "verdicts" => return verdicts(),
        Some(word) if word == "photographs" => return photographs(),
        Some(folder) => return draw(Path::new(&folder)),
        None => {}
    }
    side_by_side();
    println!();
    by_pixels();
}

fn side_by_side() {
    println!("| Bernoulli patterns | gains alone | each alone | together |");
    println!("|---|---|---|---|");
    let scene = scene("two-walls", &[]);
    for bernoulli in [60, 250] {
        let place = tempfile::tempdir().expect("a folder");
        let capture = place.path().join("capture");
        photograph(&scene, bernoulli, 1, &capture);
        let learned = learned(&capture);
        let wanted = showable(&learned.inverse);
        let [together, gains] = inputs(&learned, &wanted);
        let alone = inputs_of_each_alone(&scene, bernoulli, &wanted);
        let error = |inputs| error_on_the_wall(&scene, &learned, &wanted, inputs);
        println!(
            "| {bernoulli} | {:.4} | {:.4} | {:.4} |",
            error(&gains),
            error(&alone),
            error(&together)
        );
    }
}

/// By pixels of a camera without noise.
fn by_pixels() {
    println!("| scene | tables | whole screen | overlap | largest step | of black |");
    println!("|---|---|---|---|---|---|");
    let place = tempfile::tempdir().expect("a folder");
    for name in SCENES.into_iter().chain([OTHER_SIZES]) {
        let scene = match name {
            OTHER_SIZES => with_smaller(),
            _ => scene(name, &[]),
        };
        let captures = photograph_each(&scene, 60, &place.path().join(name));
        let together = if name == OTHER_SIZES || overlaps(name) {
            learned_together(&captures)
        } else {
            // Slides light all of them at once.
            let capture = place.path().join("wide").join(name);
            photograph_together(&scene, 60, &capture);
            learned(&capture)
        };
        let alone = learned_alone(&captures, together.white.light);
        let screen = Screen::new(&scene);
        if !scene.poses.is_empty() {
            let place = place.path().join(format!("{name}-poses"));
            let poses = photograph_from_poses(&scene, 60, &place);
            let captures = joined(&poses, &place.join("joined"));
            let of_poses = screen.seen(&learned_together(&captures));
            row(name, "together, from two places", of_poses);
        }
        row(name, "each alone", screen.seen_of_each(&alone));
        let seen = screen.seen(&together);
        row(name, "together", seen);
        if seen.step_of_black.is_some() {
            let even = learned_with_even_black(&captures);
            row(name, "together, --match-black", screen.seen(&even));
        }
        let devices = |factor, heard| screen.seen_of_devices(&together, factor, heard);
        let usual = NEIGHBOURS_FACTOR;
        row(name, "together, by a device each", devices(usual, true));
        row(name, "the same, --neighbours 2", devices(2, true));
        row(name, "the same, neighbours silent", devices(usual, false));
    }
}

/// Errors by pixels after fewer Bernoulli patterns: shown by each projector while the others are dark,
/// and by all at once.
fn photographs() {
    println!("| scene | patterns | whole screen | overlap | largest step | of black |");
    println!("|---|---|---|---|---|---|");
    let place = tempfile::tempdir().expect("a folder");
    for name in SCENES {
        let scene = scene(name, &[]);
        let screen = Screen::new(&scene);
        for bernoulli in [15, 30, 60] {
            let place = place.path().join(format!("{name}-{bernoulli}"));
            let alone = learned_together(&photograph_each(&scene, bernoulli, &place));
            row(name, &format!("{bernoulli} each"), screen.seen(&alone));
            if !overlaps(name) {
                let capture = place.join("wide");
                photograph_together(&scene, bernoulli, &capture);
                let all = learned(&capture);
                row(name, &format!("{bernoulli} at once"), screen.seen(&all));
            }
        }
    }
}

/// What verifications say of the folded screen's table after something has changed.
fn verdicts() {
    let nudged = |to| ("look_at = [0.937, 0.8, 0.656]", to);
    let painted = "[0, 1.6, 0], [1.966, 1.6, 1.3766], [1.966, 0, 1.3766], [0, 0, 0]]\nalbedo = 0.7";
    let half = format!("{painted}5");
    let elsewhere = ("position = [0.0, 1.0, 4.6]", "position = [0.5, 1.3, 4.4]");
    let changes = [
        ("nothing", None),
        ("the camera stands elsewhere", Some(elsewhere)),
        (
            "the right projector looks 3 mm farther",
            Some(nudged("look_at = [0.94, 0.8, 0.656]")),
        ),
        (
            "10 mm farther and 10 mm up",
            Some(nudged("look_at = [0.947, 0.81, 0.656]")),
        ),
        (
            "half of the screen has the albedo .70",
            Some((&half[..], painted)),
        ),
    ];
    let place = tempfile::tempdir().expect("a folder");
    let folded = |change: Option<(&str, &str)>| scene("folded-screen", change.as_slice());
    let captures = photograph_each(&folded(None), 60, &place.path().join("captures"));
    let built = learned_together(&captures);
    let image = &built.compiled.image;
    println!("| since the table was made | a viewer sees off | pictures moved | verdict |");
    println!("|---|---|---|---|");
    for (at, (words, change)) in changes.into_iter().enumerate() {
        let (now, proof) = (folded(change), place.path().join(at.to_string()));
        verdict(words, &verified(&captures, image, &now, &proof));
        if words.contains("albedo") {
            let again = place.path().join("again");
            let better = refined(image, &proof);
            verdict("... refined", &verified(&captures, &better, &now, &again));
        }
    }
    let mut exchanged = folded(None);
    exchanged.projectors.swap(0, 1);
    let proof = place.path().join("exchanged");
    verdict(
        "cables are exchanged",
        &verified(&captures, image, &exchanged, &proof),
    );
}

fn verdict(words: &str, verdict: &TableVerdict) {
    let seen = verdict
        .pixels
        .as_ref()
        .map_or(f64::NAN, |pixels| pixels.error[1]);
    let moved = match verdict.farthest() {
        Some(shift) if shift.pixels.is_finite() => format!("{:.1}", shift.pixels),
        _ => "elsewhere".to_owned(),
    };
    let cause = verdict.cause.map_or("", Cause::name);
    println!(
        "| {words} | {:.2} % | {moved} | {} {cause} |",
        100.0 * seen,
        verdict.outcome.name()
    );
}

/// Photographs before and after, a file for each scene.
fn draw(folder: &Path) {
    for (name, heading) in DRAWN {
        let place = tempfile::tempdir().expect("a folder");
        let scene = scene(name, &[]);
        let captures = photograph_each(&scene, 60, &place.path().join(name));
        let built = learned_together(&captures);
        let picture = Screen::new(&scene).before_and_after(heading, &built);
        let mut bytes = Vec::new();
        png::write(&mut bytes, &picture).expect("a picture");
        std::fs::write(folder.join(format!("{name}.png")), bytes).expect("written");
    }
}

fn row(scene: &str, tables: &str, seen: SeenOnScreen) {
    let SeenOnScreen {
        whole,
        overlap,
        step,
        step_of_black,
    } = seen;
    let overlap = overlap.map_or_else(String::new, |error| format!("{error:.4}"));
    let percent =
        |step: Option<f64>| step.map_or_else(String::new, |step| format!("{:.1} %", 100.0 * step));
    let (step, black) = (percent(step), percent(step_of_black));
    println!("| {scene} | {tables} | {whole:.4} | {overlap} | {step} | {black} |");
}
