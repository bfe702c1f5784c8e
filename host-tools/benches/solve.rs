//! How the time and the memory of a solve grow with cells and photographs.
//!
//! `cargo bench -p iltm --bench solve` prints one line a size: the median of a
//! few whole solves (`lambda` by held-out photographs included) of a simulated
//! corner with noisy photographs, and the most memory that one held at a time
//! beyond its input. `cargo bench -p iltm --bench solve -- 64x64` does one size.

#![allow(missing_docs)]

#[path = "../crates/solve/src/test_scene.rs"]
#[allow(dead_code, unreachable_pub)]
mod test_scene;

use iltm::capture::Role;
use iltm::progress::Silent;
use iltm::solve::{CellNoise, Method, Observed, ObservedChannel, SolveOptions, solve_observed};
use iltm_runtime::Grid;
use nalgebra::DMatrix;
use peak_alloc::PeakAlloc;
use std::time::Instant;
use test_scene::{Corner, add_noise, patterns};

/// Rows, columns, Bernoulli photographs, channels, solves.
const SIZES: [(u16, u16, usize, usize, usize); 8] = [
    (13, 21, 40, 1, 7),
    (13, 21, 150, 1, 7),
    (13, 21, 300, 1, 7),
    (16, 24, 150, 1, 5),
    (16, 24, 150, 3, 3),
    (32, 32, 150, 1, 3),
    (32, 32, 300, 1, 3),
    (45, 45, 300, 1, 1),
];

/// Brute force needs more patterns than cells.
const METHODS: [Method; 3] = [Method::Joint, Method::Direct, Method::TwoStage];

fn main() {
    let only = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    println!(
        "method  grid     cells  photographs  channels  seconds (choose + solve)  peak MB  iterations"
    );
    for method in METHODS {
        for size in SIZES {
            let grid = format!("{}x{}", size.0, size.1);
            if only.as_ref().is_none_or(|only| *only == grid) {
                measure(method, size);
            }
        }
    }
}

fn measure(
    method: Method,
    (rows, cols, bernoulli, channels, solves): (u16, u16, usize, usize, usize),
) {
    let Ok(grid) = Grid::new(rows, cols) else {
        return;
    };
    let patterns = patterns(grid.cells(), bernoulli);
    let light: Vec<DMatrix<f64>> = (0..channels)
        .map(|channel| {
            let albedo = |cell: usize| 0.5 + 0.3 * ((cell + 7 * channel) as f64 * 0.7).sin();
            let scene = Corner::new(grid.rows(), grid.cols(), albedo);
            let mut light = scene.photograph(&patterns);
            add_noise(&mut light, 2e-3);
            light
        })
        .collect();
    let mut roles = vec![Role::Bernoulli; bernoulli + 1];
    roles[0] = Role::White;
    let nothing = vec![0.0; grid.cells()];
    let noise = CellNoise {
        lit: 1e-3,
        unlit: 4e-4,
    };
    let channels: Vec<_> = light
        .iter()
        .map(|light| ObservedChannel {
            patterns: &patterns,
            light,
            ambient: &nothing,
            noise: vec![noise; grid.cells()],
        })
        .collect();
    let observed = Observed {
        grid,
        roles: &roles,
        live: &vec![true; grid.cells()],
        channels: channels.clone(),
        blur: 0.0,
    };
    let options = SolveOptions {
        method,
        ..SolveOptions::default()
    };
    let mut seconds = Vec::new();
    let mut last = None;
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    for _ in 0..solves {
        let start = Instant::now();
        match solve_observed(&observed, &options, &Silent) {
            Ok((_, report)) => last = Some(report),
            Err(error) => {
                println!("{method} {grid}: {error}");
                return;
            }
        }
        seconds.push(start.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    let Some(report) = last else { return };
    println!(
        "{:7} {:8} {:5}  {:11}  {:8}  {:7.3} ({:.3} + {:.3})  {:15.1}  {:10}",
        method,
        format!("{rows}x{cols}"),
        grid.cells(),
        bernoulli + 1,
        channels.len(),
        seconds[seconds.len() / 2],
        report.seconds.choose,
        report.seconds.solve,
        (MEMORY.peak_usage() - before) as f64 / 1e6,
        report.iterations,
    );
}

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;
