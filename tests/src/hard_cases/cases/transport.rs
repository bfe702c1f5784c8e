//! Light transport that is strong, ill-conditioned or singular.

use super::super::case::{Case, CaseOutcome, Demand, Trials, closed_loop};
use super::super::observations::Capture;
use super::super::{GRID, grid, theory};
use iltm::scene::coaxial::{CoaxialScene, Panels};
use iltm::solve::Compensation;

pub(super) const CASES: [Case; 7] = [
    Case {
        name: "albedo .99 in a 30 degree wedge",
        reason: "three quarters of all light come back: condition 7 by (1/rho + F) / (1/rho - F), F = 1 - sin(angle / 2)",
        theory: "error of the inverse times the condition number",
        run: white_wedge,
    },
    Case {
        name: "albedo .99 in a 30 degree wedge, light falls to a fiftieth",
        reason: "the same with a dim border: condition above 100",
        theory: "error of the inverse times the condition number",
        run: dim_wedge,
    },
    Case {
        name: "nearly singular: inside of a sphere, albedo .995",
        reason: "every cell lights every other alike, F = 1/N; 200 bounces are not enough",
        theory: "closed form: condition 1 / (1 - albedo) = 200; images are those that light can make",
        run: sphere,
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
        theory: "light that has nothing to do with a pattern is off by 0.5 to 0.7; at most 0.4 is used",
        run: shifted,
    },
];

fn white_wedge(trials: Trials) -> CaseOutcome {
    let grid = grid(GRID);
    let scene = CoaxialScene::new(grid, &Panels::corner(grid, 30.0), 0.99);
    let outcome = closed_loop(&scene, trials, Demand::default(), |seed| {
        Capture::new(&scene, 100, seed)
    });
    with_condition(&scene, 6.0, outcome)
}

fn dim_wedge(trials: Trials) -> CaseOutcome {
    let grid = grid(GRID);
    let scene = CoaxialScene::new(grid, &Panels::corner(grid, 30.0), 0.99).vignetted(0.02);
    let outcome = closed_loop(&scene, trials, Demand::default(), |seed| {
        Capture::new(&scene, 100, seed)
    });
    with_condition(&scene, 100.0, outcome)
}

fn sphere(trials: Trials) -> CaseOutcome {
    let grid = grid(GRID);
    let mut scene = CoaxialScene::new(grid, &Panels::corner(grid, 90.0), 0.995);
    scene.form_factors.fill(1.0 / grid.cells() as f64);
    // In focus; but light is so even there that only images it can make are fair.
    scene.blur = Some(nalgebra::DMatrix::identity(grid.cells(), grid.cells()));
    let outcome = closed_loop(&scene, trials, Demand::default(), |seed| {
        Capture::new(&scene, 100, seed)
    });
    let mut outcome = with_condition(&scene, 190.0, outcome);
    if let Ok((_, report)) = Capture::new(&scene, 100, 0).solve(trials.method) {
        outcome.holds &= report.left_out.is_empty();
        outcome.measured = format!(
            "{} cells left out; {}",
            report.left_out.len(),
            outcome.measured
        );
    }
    outcome
}

fn with_condition(scene: &CoaxialScene, least: f64, mut outcome: CaseOutcome) -> CaseOutcome {
    let condition = theory::condition(&scene.transport(), &scene.covered());
    outcome.holds &= condition > least;
    outcome.measured = format!("condition {condition:.0}: {}", outcome.measured);
    outcome
}

fn doubled_light(trials: Trials) -> CaseOutcome {
    let grid = grid(GRID);
    let mut scene =
        CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(0.4, 0.9, 1);
    let cells = grid.cells();
    let mut merge = nalgebra::DMatrix::identity(cells, cells);
    for cell in [30, 101, 200] {
        merge[(cell, cell)] = 0.0;
        merge[(cell - 1, cell)] = 1.0;
    }
    scene.blur = Some(merge);
    let demand = Demand {
        no_harm_only: true,
        ..Demand::default()
    };
    let mut outcome = closed_loop(&scene, trials, demand, |seed| {
        Capture::new(&scene, 80, seed)
    });
    if let Ok((_, report)) = Capture::new(&scene, 80, 0).solve(trials.method) {
        let left_out: Vec<usize> = report.left_out.iter().map(|out| out.cell).collect();
        outcome.holds &= left_out == [30, 101, 200];
        outcome.measured = format!("left out: {left_out:?}; {}", outcome.measured);
    }
    outcome
}

fn flat(trials: Trials) -> CaseOutcome {
    chosen(0.25, trials, Compensation::GainOnly)
}

fn even(trials: Trials) -> CaseOutcome {
    let outcome = chosen(0.95, trials, Compensation::Nothing);
    CaseOutcome {
        refused: outcome.holds,
        ..outcome
    }
}

/// What is chosen for a flat scene with albedos from `least` to .95, at 40 dB.
fn chosen(least: f64, trials: Trials, wanted: Compensation) -> CaseOutcome {
    let grid = grid(GRID);
    let mut scene =
        CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(least, 0.95, 1);
    scene.form_factors.fill(0.0);
    let mut names = Vec::new();
    let mut errors = String::new();
    for seed in 0..trials.seeds {
        match Capture::new(&scene, 60, seed)
            .noisy(40.0, seed)
            .solve(trials.method)
        {
            Ok((_, report)) => {
                names.push(report.compensation);
                let prediction = report.prediction;
                errors = format!(
                    "{} (operator {:.4}, gain alone {:.4}, nothing {:.4} predicted)",
                    report.compensation,
                    prediction.compensated,
                    prediction.gain_only,
                    prediction.uncompensated
                );
            }
            Err(error) => errors = error.to_string(),
        }
    }
    let all = names.len() as u64 == trials.seeds && names.iter().all(|name| *name == wanted);
    CaseOutcome::new(all, format!("{wanted} chosen"), errors)
}

fn shifted(trials: Trials) -> CaseOutcome {
    let grid = grid(GRID);
    let scene = CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7);
    let mut capture = Capture::new(&scene, 60, 1);
    let shown = capture.patterns.clone();
    for k in 1..shown.ncols() {
        capture
            .patterns
            .set_column(k, &shown.column((k + 1) % shown.ncols()));
    }
    let result = capture
        .solve(trials.method)
        .map(|(_, report)| format!("{:?}", report.prediction));
    CaseOutcome::refusal(
        result.map_err(|error| error.to_string()),
        "check that the patterns belong",
    )
}
