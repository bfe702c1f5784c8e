//! Capture files: what the camera does to the light of whole captures.

use super::super::case::{Case, CaseOutcome, Trials};
use super::super::closed_loop::errors;
use super::super::grid;
use super::super::observations::out_of_focus;
use super::super::photographs::TestCamera;
use iltm::build_table::{BuiltTable, TableOptions, build_table};
use iltm::capture::CaptureOptions;
use iltm::progress::Silent;
use iltm::scene::coaxial::{CoaxialScene, Panels};
use iltm::solve::InverseTransport;

pub(super) const CASES: [Case; 8] = [
    Case {
        name: "16 bits, well exposed",
        reason: "what the others are compared with",
        theory: "pixels average: noise / sqrt(36 pixels), as 66 dB",
        run: |trials| exact(trials, TestCamera::default(), "", 0.01),
    },
    Case {
        name: "8 bits",
        reason: "a step is 1/255 of full scale: noise of 1/255/sqrt 12, dithered by the camera's own",
        theory: "quantisation adds 1/(12 255^2) to each pixel's variance",
        run: |trials| {
            exact(
                trials,
                TestCamera {
                    full_scale: 255,
                    ..TestCamera::default()
                },
                "",
                0.01,
            )
        },
    },
    Case {
        name: "8 bits and a declared gamma of 2.2",
        reason: "steps are coarse where it is bright",
        theory: "quantisation at full scale is 2.2 / 255 wide",
        run: |trials| {
            let camera = TestCamera {
                full_scale: 255,
                gamma: 2.2,
                ..TestCamera::default()
            };
            exact(trials, camera, "[camera]\nresponse = 2.2\n", 0.015)
        },
    },
    Case {
        name: "a blur of half a cell, declared",
        reason: "camera pixels see light of neighbours, and B^-1 destroys the sign of K",
        theory: "T^-1 = B^-1 T0^-1; images are those that a blurred projector can make",
        run: |trials| {
            let scene = out_of_focus(scene(), 0.5);
            of_scene(
                trials,
                &scene,
                TestCamera::default(),
                "[projector]\nblur = 0.5\n",
                0.01,
            )
        },
    },
    Case {
        name: "a flat scene",
        reason: "there is nothing to cancel",
        theory: "K = 0: the table must have no operator",
        run: flat,
    },
    Case {
        name: "gamma of 2.2 that nobody declared",
        reason: "light does not add up: superposition fails",
        theory: "superposition must hold to 3 %",
        run: |trials| {
            let camera = TestCamera {
                gamma: 2.2,
                full_scale: 255,
                ..TestCamera::default()
            };
            refused(trials, camera, "light does not add up")
        },
    },
    Case {
        name: "saturated photographs",
        reason: "white is 1.5 times what the camera can tell",
        theory: "at most 10 % of the lit pixels may be saturated",
        run: |trials| {
            refused(
                trials,
                TestCamera {
                    exposure: 1.6,
                    ..TestCamera::default()
                },
                "overexposed",
            )
        },
    },
    Case {
        name: "too dark to tell anything",
        reason: "white is a fifth of the noise",
        theory: "a cell needs pixels that follow its pattern",
        run: |trials| {
            refused(
                trials,
                TestCamera {
                    exposure: 0.002,
                    noise: 0.01,
                    ..TestCamera::default()
                },
                "cells were found",
            )
        },
    },
];

fn scene() -> CoaxialScene {
    let grid = grid((9, 14));
    CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(0.3, 0.9, 1)
}

fn flat(trials: Trials) -> CaseOutcome {
    let mut scene = scene();
    scene.form_factors.fill(0.0);
    let bound = "a table with no operator entries";
    match table(trials, &scene, TestCamera::default(), "") {
        Ok(learned) => {
            let entries = learned.compiled.ladder.entries.len();
            let chosen = learned.report.compensation;
            CaseOutcome::new(
                entries == 0,
                bound,
                format!(
                    "{chosen}, {entries} entries; {:.5} of the light to cancel",
                    learned.report.prediction.cancelled()
                ),
            )
        }
        Err(error) => CaseOutcome::new(false, bound, error),
    }
}

fn table(
    trials: Trials,
    scene: &CoaxialScene,
    camera: TestCamera,
    settings: &str,
) -> Result<BuiltTable, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    camera
        .write(scene, folder.path(), settings)
        .map_err(|error| error.to_string())?;
    let learned = build_table(
        folder.path(),
        &CaptureOptions::default(),
        &trials.options(),
        &TableOptions::default(),
        &Silent,
    );
    let folder_name = folder.path().display().to_string();
    learned.map_err(|error| error.to_string().replace(&folder_name, "capture"))
}

/// Error of the closed loop of what was learned, or why nothing was.
fn learned(
    trials: Trials,
    scene: &CoaxialScene,
    camera: TestCamera,
    settings: &str,
) -> Result<(f64, f64), String> {
    let learned = table(trials, scene, camera, settings)?;
    let flood = scene.transport().column_sum().max();
    let errors = errors(
        scene,
        &in_scene_units(learned.inverse, camera.exposure / flood),
    );
    Ok((errors.compensated, errors.gain_only))
}

/// The inverse for the scene's own light, of which the camera gives `exposure`.
fn in_scene_units(mut inverse: InverseTransport, exposure: f64) -> InverseTransport {
    inverse.shared *= exposure;
    for channel in &mut inverse.channels {
        channel.gain.iter_mut().for_each(|gain| *gain *= exposure);
        channel.ambient.fill(0.0);
        if let Some(deviation) = &mut channel.deviation {
            *deviation *= exposure;
        }
    }
    inverse
}

fn exact(trials: Trials, camera: TestCamera, settings: &str, bound: f64) -> CaseOutcome {
    of_scene(trials, &scene(), camera, settings, bound)
}

fn of_scene(
    trials: Trials,
    scene: &CoaxialScene,
    camera: TestCamera,
    settings: &str,
    bound: f64,
) -> CaseOutcome {
    match learned(trials, scene, camera, settings) {
        Ok((error, gain_only)) => CaseOutcome::new(
            error <= bound.min(gain_only),
            format!("{bound}"),
            format!("{error:.4}; gain alone {gain_only:.4}"),
        ),
        Err(error) => CaseOutcome::new(false, format!("{bound}"), error),
    }
}

fn refused(trials: Trials, camera: TestCamera, words: &str) -> CaseOutcome {
    let what = |(error, gain): (f64, f64)| format!("a table: {error:.4}; gain alone {gain:.4}");
    CaseOutcome::refusal(learned(trials, &scene(), camera, "").map(what), words)
}
