//! Whole captures, as files: what the camera does to the light.

use super::super::case::{Case, Outcome};
use super::super::closed_loop::errors;
use super::super::grid;
use super::super::photographs::Camera;
use super::super::scene::{Panels, Scene};
use iltm::capture::CaptureOptions;
use iltm::learn::learn;
use iltm::progress::Silent;
use iltm::solve::SolveOptions;

pub(super) const CASES: [Case; 6] = [
    Case {
        name: "16 bits, well exposed",
        reason: "what the others are compared with",
        theory: "pixels average: noise / sqrt(36 pixels), as 66 dB",
        run: |_| exact(Camera::default(), "", 0.01),
    },
    Case {
        name: "8 bits",
        reason: "a step is 1/255 of full scale: noise of 1/255/sqrt 12, dithered by the camera's own",
        theory: "quantisation adds 1/(12 255^2) to each pixel's variance",
        run: |_| exact(Camera { full_scale: 255, ..Camera::default() }, "", 0.01),
    },
    Case {
        name: "8 bits and a declared gamma of 2.2",
        reason: "steps are coarse where it is bright",
        theory: "quantisation at full scale is 2.2 / 255 wide",
        run: |_| {
            let camera = Camera { full_scale: 255, gamma: 2.2, ..Camera::default() };
            exact(camera, "[camera]\nresponse = 2.2\n", 0.015)
        },
    },
    Case {
        name: "gamma of 2.2 that nobody declared",
        reason: "light does not add up: superposition fails",
        theory: "superposition must hold to 8 %",
        run: |_| {
            let camera = Camera { gamma: 2.2, full_scale: 255, ..Camera::default() };
            refused(camera, "light does not add up")
        },
    },
    Case {
        name: "saturated photographs",
        reason: "white is 1.5 times what the camera can tell",
        theory: "at most 10 % of the lit pixels may be saturated",
        run: |_| refused(Camera { exposure: 1.6, ..Camera::default() }, "overexposed"),
    },
    Case {
        name: "too dark to tell anything",
        reason: "white is a fifth of the noise",
        theory: "a cell needs pixels that follow its pattern",
        run: |_| refused(Camera { exposure: 0.002, noise: 0.01, ..Camera::default() }, "cells were found"),
    },
];

fn scene() -> Scene {
    let grid = grid((9, 14));
    Scene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(0.3, 0.9, 1)
}

/// Error of the closed loop of what was learned, or why nothing was.
fn learned(camera: Camera, settings: &str) -> Result<(f64, f64), String> {
    let scene = scene();
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    camera.write(&scene, folder.path(), settings).map_err(|error| error.to_string())?;
    let learned = learn(
        folder.path(),
        &CaptureOptions::default(),
        &SolveOptions::default(),
        None,
        &Silent,
    );
    let folder_name = folder.path().display().to_string();
    let learned = learned.map_err(|error| error.to_string().replace(&folder_name, "capture"))?;
    let errors = errors(&scene, &learned.inverse);
    Ok((errors.compensated, errors.gain_only))
}

fn exact(camera: Camera, settings: &str, bound: f64) -> Outcome {
    match learned(camera, settings) {
        Ok((error, gain_only)) => Outcome::new(
            error <= bound.min(gain_only),
            format!("{bound}"),
            format!("{error:.4}; gain alone {gain_only:.4}"),
        ),
        Err(error) => Outcome::new(false, format!("{bound}"), error),
    }
}

fn refused(camera: Camera, words: &str) -> Outcome {
    let what = |(error, gain): (f64, f64)| format!("a table: {error:.4}; gain alone {gain:.4}");
    Outcome::refusal(learned(camera, "").map(what), words)
}
