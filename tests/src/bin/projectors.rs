//! Several projectors: errors on the wall of the scene `two-walls`, solved together, each projector
//! alone, and with gains alone.
//!
//! `cargo run --release -p iltm-tests --bin projectors` prints the table of
//! `docs/several-projectors.md`.

use iltm_tests::simulated::{
    error_on_the_wall, inputs, inputs_of_each_alone, learned, photograph, scene, showable,
};

fn main() {
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
