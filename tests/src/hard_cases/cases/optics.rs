//! Optics: what projector, camera and surface do to light besides Lambert's law.

use super::super::case::{Case, CaseOutcome, Demand, Trials, closed_loop};
use super::super::observations::{Capture, out_of_focus};
use super::super::{GRID, grid};
use iltm::scene::coaxial::{CoaxialScene, Panels};
use iltm::solve::Method;
use nalgebra::DMatrix;

const REACHABLE: &str = "T0^-1 as sharp; wanted are images that a blurred projector can make";
const NO_HARM: &str = "outside the model: the held-out prediction must keep it from harm";

pub(super) const CASES: [Case; 10] = [
    Case {
        name: "texture",
        reason: "another albedo in every cell, .25 to .95",
        theory: "texture is in the gains alone; K is as sparse as without",
        run: |trials| {
            noiseless(
                &uniform().textured(0.25, 0.95, 1),
                trials,
                Some(1.0 / 255.0),
            )
        },
    },
    Case {
        name: "texture at cell frequency",
        reason: "albedos .25 and .95 in turn: as rough as can be",
        theory: "texture is in the gains alone; K is as sparse as without",
        run: |trials| {
            // An 8-bit step is asked of the default, which `links` is not for so few cells.
            let required = (trials.method == Method::Joint).then_some(1.0 / 255.0);
            noiseless(&uniform().checkered(0.25, 0.95), trials, required)
        },
    },
    Case {
        name: "vignetting",
        reason: "corners get 40 % of the light: K is no longer symmetric",
        theory: "diag(flux) K is symmetric; sign and sparsity stay",
        run: |trials| noiseless(&uniform().vignetted(0.4), trials, Some(1.0 / 255.0)),
    },
    Case {
        name: "projector blur of half a cell",
        reason: "B^-1 destroys the sign of K",
        theory: REACHABLE,
        run: |trials| blurred(trials, 0.5, Some(0.002)),
    },
    Case {
        name: "projector blur of one cell",
        reason: "condition of B about 2,000: fine detail is gone",
        theory: NO_HARM,
        run: |trials| blurred(trials, 1.0, None),
    },
    Case {
        name: "projector blur of two cells",
        reason: "B is singular to working precision",
        theory: NO_HARM,
        run: |trials| blurred(trials, 2.0, None),
    },
    Case {
        name: "blur of half a cell that nobody stated",
        reason: "K needs negative elements, which the solve forbids",
        theory: NO_HARM,
        run: |trials| {
            let scene = out_of_focus(uniform(), 0.5);
            no_harm(&scene, trials)
        },
    },
    Case {
        name: "blur of half a cell, stated as .55",
        reason: "nobody measures blur to better than a tenth",
        theory: NO_HARM,
        run: |trials| {
            let scene = out_of_focus(uniform(), 0.5);
            let demand = Demand {
                no_harm_only: true,
                ..Demand::default()
            };
            closed_loop(&scene, trials, demand, |seed| {
                Capture::new(&scene, 60, seed).with_blur(0.55)
            })
        },
    },
    Case {
        name: "glossy panels",
        reason: "the camera sees a tenth of the panel opposite mirrored: no sign, no symmetry",
        theory: NO_HARM,
        run: |trials| no_harm(&mirrored(0.1), trials),
    },
    Case {
        name: "mirror panels",
        reason: "the camera sees as much mirrored as its own",
        theory: NO_HARM,
        run: |trials| no_harm(&mirrored(0.9), trials),
    },
];

fn uniform() -> CoaxialScene {
    let grid = grid(GRID);
    CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7)
}

fn noiseless(scene: &CoaxialScene, trials: Trials, required: Option<f64>) -> CaseOutcome {
    let demand = Demand {
        required,
        ..Demand::default()
    };
    closed_loop(scene, trials, demand, |seed| Capture::new(scene, 60, seed))
}

fn no_harm(scene: &CoaxialScene, trials: Trials) -> CaseOutcome {
    let demand = Demand {
        no_harm_only: true,
        ..Demand::default()
    };
    closed_loop(scene, trials, demand, |seed| {
        Capture::new(scene, 60, seed).noisy(50.0, seed)
    })
}

fn blurred(trials: Trials, deviation: f64, required: Option<f64>) -> CaseOutcome {
    let scene = out_of_focus(uniform(), deviation);
    let demand = Demand {
        required,
        no_harm_only: required.is_none(),
        ..Demand::default()
    };
    closed_loop(&scene, trials, demand, |seed| {
        Capture::new(&scene, 60, seed).with_blur(deviation)
    })
}

/// Each cell shows `part` of the cell that stands opposite in the same valley.
fn mirrored(part: f64) -> CoaxialScene {
    let mut scene = uniform();
    let cells = scene.grid.cells();
    let mut mirror = DMatrix::zeros(cells, cells);
    for i in 0..cells {
        let row = scene.form_factors.row(i);
        let opposite = (0..cells).max_by(|a, b| row[*a].total_cmp(&row[*b]));
        if let Some(j) = opposite.filter(|j| row[*j] > 0.0) {
            mirror[(i, j)] = part;
        }
    }
    scene.mirror = Some(mirror);
    scene
}
