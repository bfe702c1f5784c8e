//! Grids of odd sizes.

use super::super::case::{Case, CaseOutcome, Demand, Trials, closed_loop};
use super::super::grid;
use super::super::observations::Capture;
use iltm::scene::coaxial::{CoaxialScene, Panels};

const THEORY: &str = "Haar functions exist on any grid: the bound of any other scene";

pub(super) const CASES: [Case; 6] = [
    Case {
        name: "one cell",
        reason: "no other cell, no wavelet, no interreflection",
        theory: "the gain is exact; nothing proves any table better than none",
        run: one_cell,
    },
    Case {
        name: "one row of 7",
        reason: "no rows to split",
        theory: THEORY,
        run: |s| wedge(s, (1, 7), 30),
    },
    Case {
        name: "one row of 40",
        reason: "no rows to split",
        theory: THEORY,
        run: |s| wedge(s, (1, 40), 60),
    },
    Case {
        name: "one column of 33",
        reason: "cells of one wall do not see each other",
        theory: "K = 0",
        run: column,
    },
    Case {
        name: "11 x 17",
        reason: "both primes: every split is uneven",
        theory: THEORY,
        run: |s| wedge(s, (11, 17), 60),
    },
    Case {
        name: "257 x 3",
        reason: "a prime just above a power of two, and hardly any width",
        theory: THEORY,
        run: |s| wedge(s.at_most(1), (257, 3), 60),
    },
];

fn wedge(trials: Trials, size: (u16, u16), bernoulli: usize) -> CaseOutcome {
    let grid = grid(size);
    let scene = CoaxialScene::new(grid, &Panels::corner(grid, 75.0), 0.7).textured(0.4, 0.9, 1);
    let demand = Demand {
        noise: 1e-3,
        ..Demand::default()
    };
    closed_loop(&scene, trials, demand, |seed| {
        Capture::new(&scene, bernoulli, seed).noisy(60.0, seed)
    })
}

fn one_cell(trials: Trials) -> CaseOutcome {
    let grid = grid((1, 1));
    let scene = CoaxialScene::new(
        grid,
        &Panels {
            folds: vec![0.0, 1.0],
            rows: (0.0, 1.0),
            wedge: 90.0,
        },
        0.5,
    );
    match Capture::new(&scene, 12, 1).solve(trials.method) {
        Ok((found, report)) => {
            let gain = found.channels[0].gain[0];
            let right = (gain - 2.0).abs() < 1e-6 && found.shared.is_none();
            CaseOutcome::new(
                right,
                "gain 2, no operator",
                format!("gain {gain:.6}, {}", report.compensation),
            )
        }
        Err(error) => CaseOutcome::new(false, "an inverse", error.to_string()),
    }
}

fn column(trials: Trials) -> CaseOutcome {
    let grid = grid((33, 1));
    let panels = Panels {
        folds: vec![0.0, 1.0],
        rows: (0.0, 33.0),
        wedge: 90.0,
    };
    let scene = CoaxialScene::new(grid, &panels, 0.5).textured(0.3, 0.9, 1);
    closed_loop(
        &scene,
        trials,
        Demand {
            noise: 1e-3,
            ..Demand::default()
        },
        |seed| Capture::new(&scene, 40, seed).noisy(60.0, seed),
    )
}
