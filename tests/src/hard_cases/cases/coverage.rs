//! Coverage: cells that no light reaches, that reflect none, that the camera does not see,
//! or that the surface covers in part.

use super::super::case::{Case, CaseOutcome, Demand, Trials, closed_loop};
use super::super::observations::Capture;
use super::super::{GRID, grid};
use iltm::scene::coaxial::{CoaxialScene, Panels};
use iltm::solve::WhyLeftOut;

pub(super) const CASES: [Case; 7] = [
    Case {
        name: "black cells",
        reason: "albedo 0: no gain makes them bright",
        theory: "10 cells left out, the rest as without them",
        run: black,
    },
    Case {
        name: "cells that nothing lights",
        reason: "the projector's frame is masked: T has empty columns",
        theory: "21 cells left out, the rest as without them",
        run: unlit,
    },
    Case {
        name: "cells that the camera cannot see",
        reason: "they light the others, but their own light is not known",
        theory: "their pattern stands for their light; eliminating them leaves an M-matrix",
        run: unseen,
    },
    Case {
        name: "partly covered cells",
        reason: "the frame is larger than the scene: border cells are covered to 60 %, 30 % and not at all",
        theory: "K's columns scale with the coverage and stay sparse and non-negative",
        run: |trials| partly(trials, 0.4, None),
    },
    Case {
        name: "partly covered cells, 50 dB",
        reason: "the same with noise",
        theory: "the same, and noise that the coefficients fit",
        run: |trials| partly(trials, 0.4, Some(50.0)),
    },
    Case {
        name: "partly covered cells, none of them seen",
        reason: "every border cell throws light that the camera cannot measure",
        theory: "the same",
        run: |trials| partly(trials, 0.95, None),
    },
    Case {
        name: "partly covered cells in colour, 50 dB",
        reason: "three channels vote on one operator, and the unseen cells' albedo differs in each",
        theory: "the same; a small deviation a channel",
        run: colour,
    },
];

fn textured() -> CoaxialScene {
    let grid = grid(GRID);
    CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(0.4, 0.9, 2)
}

/// Ten cells, spread out.
fn spread(cell: usize) -> bool {
    cell % 27 == 5 && cell < 270
}

fn black(trials: Trials) -> CaseOutcome {
    let mut scene = textured();
    for (cell, albedo) in scene.albedo.iter_mut().enumerate() {
        if spread(cell) {
            *albedo = 0.0;
        }
    }
    named(&scene, trials, spread, WhyLeftOut::Black)
}

fn unlit(trials: Trials) -> CaseOutcome {
    let mut scene = textured();
    for light in scene.irradiance.iter_mut().take(21) {
        *light = 0.0;
    }
    named(&scene, trials, |cell| cell < 21, WhyLeftOut::Unlit)
}

/// The closed loop over the other cells, and whether all of `wanted` and no
/// others are left out for the right reason.
fn named(
    scene: &CoaxialScene,
    trials: Trials,
    wanted: fn(usize) -> bool,
    why: WhyLeftOut,
) -> CaseOutcome {
    let demand = Demand {
        noise: 1e-3,
        ..Demand::default()
    };
    let make = |seed| Capture::new(scene, 80, seed).noisy(60.0, seed);
    let mut outcome = closed_loop(scene, trials, demand, make);
    let Ok((_, report)) = make(0).solve(trials.method) else {
        return outcome;
    };
    let right = report
        .left_out
        .iter()
        .filter(|out| wanted(out.cell) && out.why == why)
        .count();
    let cells = (0..scene.grid.cells()).filter(|cell| wanted(*cell)).count();
    outcome.holds &= right == cells && report.left_out.len() == cells;
    outcome.measured = format!("{right} of {cells} named ({why:?}); {}", outcome.measured);
    outcome
}

fn unseen(trials: Trials) -> CaseOutcome {
    let scene = textured();
    // A block of 4 x 5 cells at a valley.
    let hidden = |cell: usize| (4..8).contains(&(cell / 21)) && (3..8).contains(&(cell % 21));
    let demand = Demand {
        required: Some(0.015),
        ..Demand::default()
    };
    closed_loop(&scene, trials, demand, |seed| {
        Capture::new(&scene, 80, seed).unseen(hidden)
    })
}

fn partly_covered() -> CoaxialScene {
    let grid = grid(GRID);
    let panels = Panels {
        folds: vec![1.7, 6.1, 10.6, 15.2, 19.4],
        rows: (0.4, 11.6),
        wedge: 75.0,
    };
    CoaxialScene::new(grid, &panels, 0.7).textured(0.4, 0.9, 2)
}

/// Judged in the first channel.
fn colour(trials: Trials) -> CaseOutcome {
    let scene = partly_covered();
    let others = [3, 4].map(|texture| scene.clone().textured(0.2, 0.8, texture));
    let demand = Demand {
        noise: 10_f64.powf(-2.5),
        required: Some(0.015),
        ..Demand::default()
    };
    closed_loop(&scene, trials.at_most(2), demand, |seed| {
        let mut capture = Capture::new(&scene, 80, seed);
        for other in &others {
            capture.light.push(other.transport() * &capture.patterns);
        }
        capture
            .unseen(|cell| scene.coverage[cell] < 0.4)
            .noisy(50.0, seed)
    })
}

/// Cells covered to less than `least` are too small for the camera.
fn partly(trials: Trials, least: f64, decibels: Option<f64>) -> CaseOutcome {
    let scene = partly_covered();
    let noise = decibels.map_or(0.0, |decibels| 10_f64.powf(-decibels / 20.0));
    let demand = Demand {
        noise,
        required: Some(0.015),
        ..Demand::default()
    };
    closed_loop(&scene, trials, demand, |seed| {
        let capture = Capture::new(&scene, 80, seed).unseen(|cell| scene.coverage[cell] < least);
        match decibels {
            Some(decibels) => capture.noisy(decibels, seed),
            None => capture,
        }
    })
}
