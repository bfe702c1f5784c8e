//! Simulated photographs: captures of the scenes that come with the tools, tables learned
//! from them, and the errors that are on the wall then.

use iltm::build_table::{BuiltTable, TableOptions, build_table};
use iltm::capture::{CaptureOptions, NO_CELL, Registration, pattern_set};

use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::{Forced, Simulation, SimulationOptions, VirtualCamera, folder};
use iltm::solve::SolveOptions;
use std::path::{Path, PathBuf};

/// The folder of the tools, with `scenes` and `samples`.
pub fn host_tools() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-tools")
}

/// A scene that comes with the tools, with some words replaced.
pub fn scene(name: &str, replaced: &[(&str, &str)]) -> Scene {
    let path = host_tools().join(format!("scenes/{name}.toml"));
    let mut text = std::fs::read_to_string(&path).expect("part of the repository");
    for (from, to) in replaced {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Scene::parse(text.as_bytes(), &path).expect("a scene")
}

/// The light of a scene, with some effects on or off.
pub fn simulation(scene: &Scene, forced: Forced) -> Simulation<'_> {
    let options = SimulationOptions {
        forced,
        threshold: None,
    };
    Simulation::new(scene, &options, &Silent).expect("can be simulated")
}

/// Writes a capture with so many random patterns; patterns and noise follow from the seed.
pub fn photograph(scene: &Scene, bernoulli: usize, seed: u64, capture: &Path) {
    let simulation = simulation(scene, Forced::default());
    let patterns = pattern_set(simulation.grid(), bernoulli, seed);
    let camera = VirtualCamera::new(scene, &simulation, seed).expect("light");
    folder::write(&camera, &patterns, capture, &Silent).expect("written");
}

/// What is learned from a capture with the usual options.
pub fn learned(capture: &Path) -> BuiltTable {
    let (photographs, solve) = (CaptureOptions::default(), SolveOptions::default());
    build_table(
        capture,
        &photographs,
        &solve,
        &TableOptions::default(),
        &Silent,
    )
    .expect("a good capture")
}

/// Mean light of the pixels of each cell.
pub fn cell_means(registration: &Registration, plane: &[f32], cells: usize) -> Vec<f64> {
    let (mut sums, mut counts) = (vec![0.0; cells], vec![0.0; cells]);
    let pixels = registration.cell_of_pixel.iter().enumerate();
    for (pixel, cell) in pixels.filter(|(_, cell)| **cell != NO_CELL) {
        sums[*cell as usize] += f64::from(plane[pixel]);
        counts[*cell as usize] += 1.0;
    }
    let mean = |(sum, count): (f64, &f64)| sum / f64::max(*count, 1.0);
    sums.into_iter().zip(&counts).map(mean).collect()
}

/// `min_t |t seen - wanted| / |wanted|` over the live cells.
pub fn error<'w>(seen: &[f64], wanted: impl IntoIterator<Item = &'w f64>, live: &[bool]) -> f64 {
    let pairs = seen.iter().zip(wanted).zip(live);
    let pairs: Vec<_> = pairs
        .filter(|(_, live)| **live)
        .map(|(pair, _)| pair)
        .collect();
    let dot = |f: fn(f64, f64) -> f64| pairs.iter().map(|(s, w)| f(**s, **w)).sum::<f64>();
    let scale = dot(|s, w| s * w) / dot(|s, _| s * s);
    let off: f64 = pairs.iter().map(|(s, w)| (scale * *s - *w).powi(2)).sum();
    (off / dot(|_, w| w * w)).sqrt()
}
