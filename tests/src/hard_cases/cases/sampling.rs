//! Noise, and photographs that say less than they should.

use super::super::case::{Case, CaseOutcome, Demand, Trials, closed_loop};
use super::super::observations::Capture;
use super::super::{GRID, grid};
use iltm::scene::coaxial::{CoaxialScene, Panels};
use nalgebra::DMatrix;

const LASSO: &str = "cond sigma sqrt(s ln N / m) and the tail of K";
const FOLDS: &str = "every pattern is held out once; without proof there is no operator";

pub(super) const CASES: [Case; 11] = [
    Case {
        name: "noise, 60 dB",
        reason: "200 photographs of a textured scene",
        theory: LASSO,
        run: |s| noise(s, 60.0, None),
    },
    Case {
        name: "noise, 50 dB",
        reason: "200 photographs of a textured scene",
        theory: LASSO,
        run: |s| noise(s, 50.0, Some(0.004)),
    },
    Case {
        name: "noise, 40 dB",
        reason: "200 photographs of a textured scene",
        theory: LASSO,
        run: |s| noise(s, 40.0, Some(0.008)),
    },
    Case {
        name: "noise, 30 dB",
        reason: "200 photographs of a textured scene",
        theory: LASSO,
        run: |s| noise(s, 30.0, None),
    },
    Case {
        name: "noise, 20 dB",
        reason: "noise is a tenth of the light and more than the interreflection of most cells",
        theory: LASSO,
        run: |s| noise(s, 20.0, None),
    },
    Case {
        name: "8 random photographs",
        reason: "far fewer than any theory of recovery asks for",
        theory: FOLDS,
        run: |trials| few(trials, 8),
    },
    Case {
        name: "no random photographs",
        reason: "Gray code alone: 19 photographs for 273 unknowns a row",
        theory: FOLDS,
        run: |trials| few(trials, 0),
    },
    Case {
        name: "5 photographs",
        reason: "nothing can be learned from them",
        theory: "fewer than 8 are refused",
        run: five,
    },
    Case {
        name: "each pattern photographed six times",
        reason: "60 photographs of 10 patterns: a held-out photograph of a known pattern proves nothing",
        theory: "all photographs of a pattern are held out together",
        run: repeated,
    },
    Case {
        name: "dependent patterns",
        reason: "3 x 3 cells are always lit together: 35 dimensions of 273",
        theory: FOLDS,
        run: dependent,
    },
    Case {
        name: "the same photographs and no others, all white",
        reason: "10 photographs of white: nothing tells cells apart",
        theory: FOLDS,
        run: white_only,
    },
];

fn scene() -> CoaxialScene {
    let grid = grid(GRID);
    CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(0.25, 0.95, 1)
}

fn noise(trials: Trials, decibels: f64, required: Option<f64>) -> CaseOutcome {
    let scene = scene();
    let demand = Demand {
        noise: 10_f64.powf(-decibels / 20.0),
        required,
        ..Demand::default()
    };
    closed_loop(&scene, trials, demand, |seed| {
        Capture::new(&scene, 200, seed).noisy(decibels, seed)
    })
}

fn no_harm(trials: Trials, make: impl Fn(&CoaxialScene, u64) -> Capture) -> CaseOutcome {
    let scene = scene();
    let demand = Demand {
        no_harm_only: true,
        ..Demand::default()
    };
    closed_loop(&scene, trials, demand, |seed| make(&scene, seed))
}

fn few(trials: Trials, bernoulli: usize) -> CaseOutcome {
    no_harm(trials, |scene, seed| {
        Capture::new(scene, bernoulli, seed).noisy(50.0, seed)
    })
}

/// Keeps the photographs whose index passes.
fn kept(mut capture: Capture, filter: impl Fn(usize) -> bool) -> Capture {
    let chosen: Vec<usize> = (0..capture.roles.len()).filter(|k| filter(*k)).collect();
    capture.patterns = capture.patterns.select_columns(&chosen);
    for light in &mut capture.light {
        *light = light.select_columns(&chosen);
    }
    capture.roles = chosen.iter().map(|k| capture.roles[*k]).collect();
    capture
}

fn five(trials: Trials) -> CaseOutcome {
    let capture = kept(Capture::new(&scene(), 20, 1), |k| k % 8 == 0);
    let result = capture
        .solve(trials.method)
        .map(|_| "an inverse".to_owned());
    CaseOutcome::refusal(
        result.map_err(|error| error.to_string()),
        "it needs at least 8",
    )
}

/// Photographs of other patterns, without noise.
fn taken(
    scene: &CoaxialScene,
    seed: u64,
    bernoulli: usize,
    change: impl Fn(&mut DMatrix<f64>),
) -> Capture {
    let mut capture = Capture::new(scene, bernoulli, seed);
    change(&mut capture.patterns);
    capture.light = vec![scene.transport() * &capture.patterns];
    capture
}

/// White, Gray code and its inverse.
const CODED: usize = 19;

fn repeated(trials: Trials) -> CaseOutcome {
    no_harm(trials, |scene, seed| {
        let repeat = |patterns: &mut DMatrix<f64>| {
            for k in CODED..patterns.ncols() {
                let first = patterns.column(CODED + (k - CODED) % 10).into_owned();
                patterns.set_column(k, &first);
            }
        };
        taken(scene, seed, 60, repeat).noisy(40.0, seed)
    })
}

fn dependent(trials: Trials) -> CaseOutcome {
    no_harm(trials, |scene, seed| {
        let block = |patterns: &mut DMatrix<f64>| {
            for k in CODED..patterns.ncols() {
                for cell in 0..patterns.nrows() {
                    let (row, col) = (cell / 21 / 3 * 3, cell % 21 / 3 * 3);
                    patterns[(cell, k)] = patterns[(row * 21 + col, k)];
                }
            }
        };
        let all = taken(scene, seed, 60, block).noisy(50.0, seed);
        kept(all, |k| k == 0 || k >= CODED)
    })
}

fn white_only(trials: Trials) -> CaseOutcome {
    no_harm(trials, |scene, seed| {
        taken(scene, seed, 10, |patterns| patterns.fill(1.0)).noisy(50.0, seed)
    })
}
