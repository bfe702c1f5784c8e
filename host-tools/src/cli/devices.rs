//! Projector, camera and cells as a capture shows them, for people and programs.

use crate::capture::CameraFit;
use crate::capture::{Devices, Diagnostics, FileFormat, LeftOut, Measurements, Why};
use crate::solve::{Flux, InverseTransport};
use serde_json::{Value, json};

/// Projector and camera, for programs.
pub(super) fn devices(devices: &Devices) -> Value {
    let ramp = devices.ramp.as_ref();
    let responses = devices.projector.channels().iter();
    json!({
        "camera_response": devices.camera.to_string(),
        "camera_fit": devices.camera_fit.as_ref().map(camera_fit),
        "projector_response": responses.map(ToString::to_string).collect::<Vec<_>>(),
        "projector_gamma": devices.projector.channels().iter().map(gamma).collect::<Vec<_>>(),
        "projector_steps_from_declared": devices.projector_steps(),
        "ramp_levels": ramp.map(|ramp| ramp.points.len()),
        "white_excess": ramp.and_then(|ramp| ramp.white_excess),
        "ramp_fall": ramp.and_then(|ramp| ramp.fall).map(|fall| fall.share),
        "mixing": devices.mixing().map(|mixing| mixing.matrix),
        "unmixed": devices.unmixed,
        "blur": devices.blur,
        "blur_measured": devices.probe.map(|probe| probe.blur),
        "calibration_photographs": {
            "listed": devices.calibration.0,
            "taken": devices.calibration.1,
        },
    })
}

fn camera_fit(fit: &CameraFit) -> Value {
    json!({
        "declared": fit.declared.to_string(),
        "declared_misfit": fit.declared_misfit,
        "best": fit.best.to_string(),
        "best_misfit": fit.best_misfit,
        "tells": fit.tells(),
    })
}

/// The power that a response is nearest to; `null` for a formula that is none.
fn gamma(response: &iltm_picture::DeviceResponse) -> Option<f64> {
    use iltm_picture::{DeviceResponse, Response};
    match response {
        DeviceResponse::Measured(curve) => Some(curve.gamma()),
        DeviceResponse::Known(Response::Gamma(gamma)) => Some(*gamma),
        DeviceResponse::Known(Response::Linear) => Some(1.0),
        DeviceResponse::Known(Response::Srgb) => None,
    }
}

/// Projector and camera, a line each thing, for people; empty if nothing is worth a
/// word.
pub(super) fn device_lines(measurements: &Measurements) -> Vec<String> {
    let mut lines = measurements.devices.words();
    lines.extend(file_line(&measurements.diagnostics));
    let share = ambient_share(measurements);
    if share > AMBIENT_WORTH_A_WORD {
        let percent = 100.0 * share;
        lines.push(format!(
            "{percent:.0} % of the light under white is ambient or projector black"
        ));
    }
    lines
}

/// Ambient light, of that under white, from which people should darken the room.
const AMBIENT_WORTH_A_WORD: f64 = 0.1;

/// Light under black relative to that under white, over all live cells and channels.
pub(super) fn ambient_share(measurements: &Measurements) -> f64 {
    let (mut dark, mut lit) = (0.0, 0.0);
    for channel in &measurements.channels {
        let flood = channel.observations.column(Measurements::WHITE);
        let cells = flood.iter().zip(&channel.ambient).zip(&measurements.live);
        for ((flood, ambient), _) in cells.filter(|(_, live)| **live) {
            dark += ambient.max(0.0);
            lit += flood + ambient.max(0.0);
        }
    }
    if lit > 0.0 { dark / lit } else { 0.0 }
}

fn file_line(diagnostics: &Diagnostics) -> Option<String> {
    (diagnostics.file == FileFormat::Jpeg).then(|| {
        "the photographs are JPEG: curved by the camera, compressed with loss and 8 bit; raw \
         photographs developed to linear TIFF give a better table"
            .to_owned()
    })
}

/// Files of the photographs, for programs.
pub(super) fn files(diagnostics: &Diagnostics) -> Value {
    json!({
        "format": diagnostics.file.to_string(),
        "bits": diagnostics.bits,
        "lossy": diagnostics.file == FileFormat::Jpeg,
    })
}

/// How the projector's light falls off over the picture, where cells that light each
/// other tell it; `null` elsewhere.
pub(super) fn flux(inverse: &InverseTransport) -> Value {
    Flux::find(inverse).map_or(Value::Null, |flux| {
        json!({
            "dimmest_of_brightest": flux.evenness(),
            "misfit": flux.misfit,
            "misfit_if_even": flux.misfit_if_even,
            "pairs": flux.pairs,
            "cells": flux.cells,
        })
    })
}

/// Every cell that the camera did not measure, for programs.
pub(super) fn unmeasured(measurements: &Measurements) -> Vec<Value> {
    let cols = measurements.grid.cols();
    let cell = |out: &LeftOut| {
        let (why, pixels) = match out.why {
            Why::TooFewPixels { pixels: 0 } => ("unseen", 0),
            Why::TooFewPixels { pixels } => ("too-few-pixels", pixels),
            Why::Saturated { pixels, .. } => ("saturated", pixels),
        };
        let (row, col) = (out.cell / cols, out.cell % cols);
        json!({ "row": row, "col": col, "why": why, "pixels": pixels })
    };
    measurements.diagnostics.left_out.iter().map(cell).collect()
}
