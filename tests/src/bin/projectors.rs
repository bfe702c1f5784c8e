//! Several projectors: errors on the wall of the scene `two-walls`, solved together, each projector
//! alone, and with gains alone; and by pixels on all scenes of several projectors.
//!
//! `cargo run --release -p iltm-tests --bin projectors` prints the tables of
//! `docs/several-projectors.md`; with `-- FOLDER` it draws the pictures there, and nothing else.

use iltm::picture::png;
use iltm_tests::overlapping::{
    Screen, SeenOnScreen, learned_alone, learned_together, photograph_each, photograph_together,
};
use iltm_tests::simulated::{
    error_on_the_wall, inputs, inputs_of_each_alone, learned, overlaps, photograph, scene, showable,
};
use std::path::Path;

/// Scenes whose photographs are drawn, and the heading.
const DRAWN: [(&str, &str); 2] = [
    ("dome-of-four", "A dome with four projectors"),
    ("folded-screen", "A folded screen with two projectors"),
];

fn main() {
    if let Some(folder) = std::env::args_os().nth(1) {
        return draw(Path::new(&folder));
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
    println!("| scene | tables | whole screen | overlap | largest step |");
    println!("|---|---|---|---|---|");
    let place = tempfile::tempdir().expect("a folder");
    for name in ["two-walls", "cube-room", "folded-screen", "dome-of-four"] {
        let scene = scene(name, &[]);
        let captures = photograph_each(&scene, 60, &place.path().join(name));
        let together = if overlaps(name) {
            learned_together(&captures)
        } else {
            // Slides light all of them at once.
            let capture = place.path().join("wide").join(name);
            photograph_together(&scene, 60, &capture);
            learned(&capture)
        };
        let alone = learned_alone(&captures, together.white.light);
        let screen = Screen::new(&scene);
        row(name, "each alone", screen.seen_of_each(&alone));
        row(name, "together", screen.seen(&together));
    }
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
    } = seen;
    let overlap = overlap.map_or_else(String::new, |error| format!("{error:.4}"));
    let step = step.map_or_else(String::new, |step| format!("{:.1} %", 100.0 * step));
    println!("| {scene} | {tables} | {whole:.4} | {overlap} | {step} |");
}
