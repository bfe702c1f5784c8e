//! Several projectors: errors on the wall of the scene `two-walls`, solved together, each projector
//! alone, and with gains alone; and on the scene `folded-screen`, where projectors overlap.
//!
//! `cargo run --release -p iltm-tests --bin projectors` prints the tables of
//! `docs/several-projectors.md`.

use iltm_tests::overlapping::{
    Screen, SeenOnScreen, learned_alone, learned_together, photograph_each,
};
use iltm_tests::simulated::{
    error_on_the_wall, inputs, inputs_of_each_alone, learned, photograph, scene, showable,
};

fn main() {
    side_by_side();
    println!();
    overlapping();
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

fn overlapping() {
    println!("| overlap | whole screen | overlap alone | largest step |");
    println!("|---|---|---|---|");
    let scene = scene("folded-screen", &[]);
    let place = tempfile::tempdir().expect("a folder");
    let captures = photograph_each(&scene, 60, place.path());
    let screen = Screen::new(&scene);
    let together = learned_together(&captures);
    let alone = learned_alone(&captures, together.white.light);
    let rows = [
        ("each alone", screen.seen_of_each(&alone)),
        ("together", screen.seen(&together)),
    ];
    for (name, seen) in rows {
        let SeenOnScreen {
            whole,
            overlap,
            step,
        } = seen;
        println!(
            "| {name} | {whole:.4} | {overlap:.4} | {:.1} % |",
            100.0 * step
        );
    }
}
