//! Links against the dense solver: errors on the wall of every described scene at its own grid, by both
//! methods and by the one that held-out photographs choose, from the same simulated photographs.
//!
//! `cargo run --release -p iltm-tests --bin links` prints the table of `docs/measured.md`. The scene
//! `m-panels-fine` has so many cells that `joint` would take 18 GB; it is left out, and so are scenes
//! whose projectors' pictures overlap.

use iltm::picture::Response;
use iltm::solve::Method;
use iltm_tests::simulated::{
    error_on_the_wall, inputs, learned_by, overlaps, photograph, scene, scene_names, showable,
};

/// Cells of a scene above which it is left out.
const MOST_CELLS: usize = 3072;

/// Fewer photographs than cells; the pages of the tool ask for this many or more.
const BERNOULLI: [usize; 2] = [60, 250];

fn main() {
    println!("| scene | cells | Bernoulli patterns | gains alone | joint | links | default |");
    println!("|---|---|---|---|---|---|---|");
    for name in scene_names() {
        // The solvers are compared: what an 8-bit camera and an unknown response cost is another matter.
        let mut scene = scene(&name, &[]);
        if scene.grid().cells() > MOST_CELLS || overlaps(&name) {
            continue;
        }
        scene.camera.bits = Some(12);
        scene.camera.response = Response::Linear;
        for bernoulli in BERNOULLI {
            let place = tempfile::tempdir().expect("a folder");
            let capture = place.path().join("capture");
            photograph(&scene, bernoulli, 1, &capture);
            let [joint, links, chosen] =
                [Some(Method::Joint), Some(Method::Links), None].map(|method| {
                    let learned = learned_by(method, &capture);
                    let wanted = showable(&learned.inverse);
                    inputs(&learned, &wanted)
                        .map(|inputs| error_on_the_wall(&scene, &learned, &wanted, &inputs))
                });
            let grid = scene.grid();
            println!(
                "| `{name}` | {} x {} | {bernoulli} | {:.4} | {:.4} | {:.4} | {:.4} |",
                grid.rows(),
                grid.cols(),
                joint[1],
                joint[0],
                links[0],
                chosen[0],
            );
        }
    }
}
