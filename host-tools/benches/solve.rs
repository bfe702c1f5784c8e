//! How the time and the memory of a solve grow with cells and photographs.
//!
//! `cargo bench -p iltm --bench solve` prints one line a size: the median of a
//! few whole solves (`lambda` by held-out photographs included) of a simulated
//! corner with noisy photographs, the most memory that one held at a time
//! beyond its input, and the error of natural images that are compensated with
//! it. `cargo bench -p iltm --bench solve -- 48x64 links` does one size by one method.

#![allow(missing_docs)]

#[path = "../crates/solve/src/test_scene.rs"]
#[allow(dead_code, unreachable_pub)]
mod test_scene;

use iltm::capture::Role;
use iltm::progress::Silent;
use iltm::solve::{
    CellNoise, Method, Observed, ObservedChannel, SolveOptions, solve_observed, wanted_images,
};
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVectorView};
use peak_alloc::PeakAlloc;
use std::time::Instant;
use test_scene::{Corner, add_noise, patterns};

/// Rows, columns, Bernoulli photographs, channels, solves.
const SIZES: [(u16, u16, usize, usize, usize); 12] = [
    (13, 21, 40, 1, 7),
    (13, 21, 150, 1, 7),
    (13, 21, 300, 1, 7),
    (16, 24, 150, 1, 5),
    (16, 24, 150, 3, 3),
    (32, 32, 150, 1, 3),
    (32, 32, 300, 1, 3),
    (24, 32, 60, 1, 3),
    (24, 32, 250, 1, 3),
    (45, 45, 300, 1, 1),
    (48, 64, 60, 1, 1),
    (48, 64, 250, 1, 1),
];

/// Cells beyond which the paper's methods take very long.
const MOST_CELLS: usize = 2048;

/// Brute force needs more patterns than cells.
const METHODS: [Method; 4] = [
    Method::Joint,
    Method::Links,
    Method::Direct,
    Method::TwoStage,
];

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with("--"))
        .collect();
    let (methods, grids): (Vec<_>, Vec<_>) = words
        .into_iter()
        .partition(|word| word.parse::<Method>().is_ok());
    let wanted = |among: &[String], name: String| among.is_empty() || among.contains(&name);
    println!(
        "method  grid     cells  photographs  channels  seconds (choose + solve)  peak MB  iterations  error"
    );
    for method in METHODS {
        for size in SIZES {
            let grid = format!("{}x{}", size.0, size.1);
            let few = usize::from(size.0) * usize::from(size.1) <= MOST_CELLS;
            let ours = matches!(method, Method::Joint | Method::Links);
            let chosen = wanted(&methods, method.to_string()) && wanted(&grids, grid);
            if chosen && (few || ours) {
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
    let scenes: Vec<Corner> = (0..channels)
        .map(|channel| {
            let albedo = |cell: usize| 0.5 + 0.3 * ((cell + 7 * channel) as f64 * 0.7).sin();
            Corner::new(grid.rows(), grid.cols(), albedo)
        })
        .collect();
    let light: Vec<DMatrix<f64>> = scenes
        .iter()
        .map(|scene| {
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
        method: Some(method),
        ..SolveOptions::default()
    };
    let mut seconds = Vec::new();
    let mut last = None;
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    for _ in 0..solves {
        let start = Instant::now();
        match solve_observed(&observed, &options, &Silent) {
            Ok(found) => last = Some(found),
            Err(error) => {
                println!("{method} {grid}: {error}");
                return;
            }
        }
        seconds.push(start.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    let Some((found, report)) = last else { return };
    let peak = MEMORY.peak_usage() - before;
    let scenes = scenes.iter().enumerate();
    let errors = scenes.map(|(channel, scene)| error(&found.channel(channel).dense(), scene, grid));
    let error = errors.sum::<f64>() / channels.len() as f64;
    println!(
        "{:7} {:8} {:5}  {:11}  {:8}  {:7.3} ({:.3} + {:.3})  {:15.1}  {:10}  {:.5}",
        method,
        format!("{rows}x{cols}"),
        grid.cells(),
        bernoulli + 1,
        channels.len(),
        seconds[seconds.len() / 2],
        report.seconds.choose,
        report.seconds.solve,
        peak as f64 / 1e6,
        report.iterations,
        error,
    );
}

/// Mean over natural images of `||light - wanted|| / ||wanted||`, compensated without clipping.
fn error(inverse: &DMatrix<f64>, scene: &Corner, grid: Grid) -> f64 {
    let wanted = wanted_images(grid);
    let seen = scene.photograph(&(inverse * &wanted));
    let of_image = |(seen, wanted): (DVectorView<'_, f64>, DVectorView<'_, f64>)| {
        (seen - wanted).norm() / wanted.norm()
    };
    let pairs = seen.column_iter().zip(wanted.column_iter());
    pairs.map(of_image).sum::<f64>() / wanted.ncols() as f64
}

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;
