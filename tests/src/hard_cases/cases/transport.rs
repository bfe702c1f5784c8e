//! Transport that is strong, ill-conditioned or singular.

use super::super::capture::Capture;
use super::super::case::{Case, Demand, Outcome, closed_loop};
use super::super::scene::{Panels, Scene};
use super::super::{GRID, grid, theory};
use iltm::solve::{Compensation, SolveError};

pub(super) const CASES: [Case; 6] = [
    Case {
        name: "albedo .99 in a 30 degree wedge",
        reason: "light bounces dozens of times before it leaves: condition above 100",
        theory: "error of the inverse times the condition number",
        run: white_wedge,
    },
    Case {
        name: "nearly singular: albedo .999 in a 10 degree wedge",
        reason: "almost nothing is lost at a bounce; the floor of the wedge gets hardly any direct light",
        theory: "error of the inverse times the condition number",
        run: deep_wedge,
    },
    Case {
        name: "exactly singular: two lights on one patch",
        reason: "two columns of T are equal, no inverse exists",
        theory: "the cell without light of its own is left out; the rest is regular",
        run: doubled_light,
    },
    Case {
        name: "flat scene",
        reason: "there is nothing to cancel; an operator would be noise",
        theory: "K = 0: the table must have no operator",
        run: flat,
    },
    Case {
        name: "flat, even scene",
        reason: "the picture is right as it is; gains would be noise",
        theory: "no table is better than chance",
        run: even,
    },
    Case {
        name: "photographs of other patterns",
        reason: "every photograph shows the pattern before: no transport explains them",
        theory: "the held-out misfit of independent patterns is near 1",
        run: shifted,
    },
];

fn white_wedge(seeds: u64) -> Outcome {
    let grid = grid(GRID);
    let scene = Scene::new(grid, &Panels::corner(grid, 30.0), 0.99);
    let outcome = closed_loop(&scene, seeds, Demand::default(), |seed| Capture::new(&scene, 100, seed));
    with_condition(&scene, 100.0, outcome)
}

fn deep_wedge(seeds: u64) -> Outcome {
    let grid = grid(GRID);
    let scene = Scene::new(grid, &Panels::corner(grid, 10.0), 0.999);
    let outcome = closed_loop(&scene, seeds, Demand::default(), |seed| Capture::new(&scene, 100, seed));
    with_condition(&scene, 300.0, outcome)
}

fn with_condition(scene: &Scene, least: f64, mut outcome: Outcome) -> Outcome {
    let condition = theory::condition(&scene.transport(), &scene.covered());
    outcome.holds &= condition > least;
    outcome.measured = format!("condition {condition:.0}: {}", outcome.measured);
    outcome
}

fn doubled_light(seeds: u64) -> Outcome {
    let grid = grid(GRID);
    let mut scene = Scene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(0.4, 0.9, 1);
    let cells = grid.cells();
    let mut merge = nalgebra::DMatrix::identity(cells, cells);
    for cell in [30, 100, 200] {
        merge[(cell, cell)] = 0.0;
        merge[(cell - 1, cell)] = 1.0;
    }
    scene.blur = Some(merge);
    let mut left_out = Vec::new();
    for seed in 0..seeds {
        match Capture::new(&scene, 80, seed).solve() {
            Ok((_, report)) => left_out = report.left_out.iter().map(|out| out.cell).collect(),
            Err(error) => return Outcome::new(false, "an inverse", error.to_string()),
        }
    }
    Outcome::new(left_out == [30, 100, 200], "cells 30, 100, 200 left out", format!("left out: {left_out:?}"))
}

fn flat(seeds: u64) -> Outcome {
    chosen(0.25, seeds, Compensation::GainOnly)
}

fn even(seeds: u64) -> Outcome {
    let outcome = chosen(0.95, seeds, Compensation::Nothing);
    Outcome { refused: outcome.holds, ..outcome }
}

/// What is chosen for a flat scene with albedos from `least` to .95, at 40 dB.
fn chosen(least: f64, seeds: u64, wanted: Compensation) -> Outcome {
    let grid = grid(GRID);
    let mut scene = Scene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(least, 0.95, 1);
    scene.form_factors.fill(0.0);
    let mut names = Vec::new();
    let mut errors = String::new();
    for seed in 0..seeds {
        match Capture::new(&scene, 60, seed).noisy(40.0, seed).solve() {
            Ok((_, report)) => {
                names.push(report.compensation);
                let prediction = report.prediction;
                errors = format!(
                    "{} (operator {:.4}, gain alone {:.4}, nothing {:.4} predicted)",
                    report.compensation.name(),
                    prediction.compensated,
                    prediction.gain_only,
                    prediction.uncompensated
                );
            }
            Err(error) => errors = error.to_string(),
        }
    }
    let all = names.len() as u64 == seeds && names.iter().all(|name| *name == wanted);
    Outcome::new(all, format!("{} chosen", wanted.name()), errors)
}

fn shifted(_: u64) -> Outcome {
    let grid = grid(GRID);
    let scene = Scene::new(grid, &Panels::m_shape(grid, 75.0), 0.7);
    let mut capture = Capture::new(&scene, 60, 1);
    let shown = capture.patterns.clone();
    for k in 1..shown.ncols() {
        capture.patterns.set_column(k, &shown.column((k + 1) % shown.ncols()));
    }
    let message = match capture.solve() {
        Ok((_, report)) if report.compensation == Compensation::Operator => {
            Ok(format!("{:?}", report.prediction))
        }
        Ok((_, report)) => Err(format!("no operator: predicted error {:.3}", report.prediction.compensated)),
        Err(error @ SolveError::NotPhysical { .. }) => Err(format!("no operator: {error}")),
        Err(error) => Err(format!("no operator: {error}")),
    };
    Outcome::refusal(message, "no operator")
}
