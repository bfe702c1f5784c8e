//! Summary of a table that was built, and of its photographs: for people and for programs.

use super::words::lines;
use crate::build_table::BuiltTable;
use crate::capture::{
    CameraFit, Devices, Diagnostics, FileFormat, Gate, LeftOut, MapError, Measurements, Role,
    Verdict, Why,
};
use crate::solve::{Compensation, Flux, InverseTransport, Method, WhyLeftOut};
use serde_json::{Value, json};
use std::fmt::Write;

/// Places that are named before the rest is only counted.
const MOST_PLACES: usize = 6;

/// A table that was built, for programs.
pub(super) fn summary(built: &BuiltTable) -> Value {
    let report = &built.report;
    let grid = built.inverse.grid;
    json!({
        "rows": grid.rows(),
        "cols": grid.cols(),
        "channels": built.inverse.channels.len(),
        "live_cells": report.live_cells,
        "left_out": left_out(built),
        "unmeasured_cells": unmeasured(&built.measurements),
        "files": files(&built.measurements.diagnostics),
        "devices": devices(&built.measurements.devices),
        "ambient_share": ambient_share(&built.measurements),
        "flux": flux(&built.inverse),
        "method": report.method.to_string(),
        "photographs": {
            "white": report.photographs.white,
            "gray_code": report.photographs.gray_code,
            "bernoulli": report.photographs.bernoulli,
            "images": report.photographs.images,
        },
        "ignored_gates": ignored(built),
        "lambda": report.lambda,
        "iterations": report.iterations,
        "condition": report.condition,
        "recovery": report.recovery,
        "compensation": report.compensation.to_string(),
        "predicted_error": {
            "uncompensated": built.predicted.uncompensated,
            "gain_only": built.predicted.gain_only,
            // `null` where the inverse found would let light grow without end.
            "compensated": built.predicted.compensated,
            "by_cells": built.predicted.by_cells,
            "figures": built.predicted.figures.map(|figures| json!({
                "worst_places": figures.worst_places,
                "psnr": figures.psnr,
                "ssim": figures.ssim,
                "delta_e": figures.delta_e,
            })),
        },
        "reference_white": built.compiled.white,
        "white": built.white,
        "bytes": built.compiled.image.len(),
        "tiers": tiers(built),
    })
}

/// Names of the gates that fail and were ignored.
fn ignored(built: &BuiltTable) -> Vec<&'static str> {
    let gates = &built.measurements.diagnostics.gates;
    let failed = gates.iter().filter(|gate| gate.fails());
    failed.map(|gate| gate.name.name()).collect()
}

fn tiers(built: &BuiltTable) -> Vec<Value> {
    let ladder = &built.compiled.ladder;
    let tiers = ladder.tiers.iter().map(|tier| (tier.entries, tier.error));
    std::iter::once((0, ladder.gain_only))
        .chain(tiers)
        .map(|(entries, error)| json!({ "entries": entries, "error": error }))
        .collect()
}

/// Cells that the table leaves dark, a line for each reason.
fn left_out(built: &BuiltTable) -> Vec<String> {
    let cols = built.inverse.grid.cols();
    let mut by_reason: Vec<(&str, Vec<usize>)> = Vec::new();
    for out in &built.report.left_out {
        let why = match out.why {
            WhyLeftOut::Unlit => "lit by nothing, though light of others is seen there",
            WhyLeftOut::Black => "black: they give back no light",
            WhyLeftOut::Unseen => unseen(built, out.cell),
            WhyLeftOut::NoProjector => continue,
        };
        match by_reason.iter_mut().find(|(known, _)| *known == why) {
            Some((_, cells)) => cells.push(out.cell),
            None => by_reason.push((why, vec![out.cell])),
        }
    }
    let line = |(why, cells): (&str, Vec<usize>)| {
        let (count, verb) = (
            cells.len(),
            if cells.len() == 1 {
                "cell is"
            } else {
                "cells are"
            },
        );
        let places = places(&cells, cols);
        format!("{count} {verb} left out, {why}: {places}")
    };
    by_reason.into_iter().map(line).collect()
}

/// Why the camera could not measure a cell.
fn unseen(built: &BuiltTable, cell: usize) -> &'static str {
    let diagnostics = &built.measurements.diagnostics;
    let found = diagnostics.left_out.iter().find(|out| out.cell == cell);
    match found.map(|out| out.why) {
        Some(Why::Saturated { .. }) => "saturated in the flood photograph",
        Some(Why::TooFewPixels { pixels: 0 }) => {
            "seen by no camera pixel (what they throw on others is accounted for)"
        }
        _ => "seen alone by too few camera pixels (what they throw on others is accounted for)",
    }
}

/// Cells as rows and columns: whole rows together, the others by runs.
fn places(cells: &[usize], cols: usize) -> String {
    let mut whole: Vec<usize> = Vec::new();
    let mut runs: Vec<String> = Vec::new();
    for of_row in cells.chunk_by(|a, b| a / cols == b / cols) {
        let row = of_row[0] / cols;
        if of_row.len() == cols {
            whole.push(row);
            continue;
        }
        for run in of_row.chunk_by(|a, b| a + 1 == *b) {
            let columns = range("column", run[0] % cols, run[run.len() - 1] % cols);
            runs.push(format!("row {row} {columns}"));
        }
    }
    let rows = whole.chunk_by(|a, b| a + 1 == *b);
    let mut named: Vec<String> = rows
        .map(|run| range("row", run[0], run[run.len() - 1]))
        .collect();
    named.append(&mut runs);
    let more = named.len().saturating_sub(MOST_PLACES);
    named.truncate(MOST_PLACES);
    let mut text = named.join(", ");
    if more > 0 {
        let _ = write!(text, " and {more} more places");
    }
    text
}

fn range(what: &str, first: usize, last: usize) -> String {
    if first == last {
        format!("{what} {first}")
    } else {
        format!("{what}s {first}-{last}")
    }
}

/// What people have to know of a table that was built beside how good it is: cells that it
/// leaves dark, gates that were ignored, a weight at the edge of what was searched, and why
/// it cancels no bounces.
pub(super) fn remarks(built: &BuiltTable) -> String {
    let mut text = String::new();
    for line in left_out(built) {
        let _ = writeln!(text, "left out    {line}");
    }
    for gate in &built.measurements.diagnostics.gates {
        match gate.verdict {
            Verdict::Fail => {
                let _ = writeln!(text, "ignored     {gate}");
            }
            Verdict::Warn => {
                let _ = writeln!(text, "note        {gate}");
            }
            Verdict::Pass | Verdict::NotJudged => {}
        }
    }
    if let Some(why) = no_operator(built) {
        let _ = writeln!(text, "note        {why}");
    }
    if let Some(Err(fault)) = &built.measurements.map {
        let _ = writeln!(text, "note        {}", map_fault(fault));
    }
    if let Some(missing) = built.measurements.devices.uncalibrated() {
        let _ = writeln!(text, "note        {missing}");
    }
    text
}

/// Why fine stripes serve nothing, and what to do about it.
pub(super) fn map_fault(fault: &MapError) -> String {
    format!(
        "{fault}; gains follow the cells alone. {}",
        fault.next_step()
    )
}

/// Details of a table that was built, for people who ask.
pub(super) fn text(built: &BuiltTable) -> String {
    let report = &built.report;
    let mut text = String::new();
    let photographs = report.photographs;
    let views = (built.measurements.roles.iter()).zip(&built.measurements.repeats);
    let white: u32 = views
        .filter(|(role, _)| **role == Role::White)
        .map(|(_, repeats)| repeats)
        .sum();
    let _ = writeln!(
        text,
        "photographs {} white, {} Gray code, {}",
        white,
        photographs.gray_code,
        photographs.content()
    );
    // The default one needs no mention.
    if report.method != Method::Joint {
        let _ = writeln!(text, "method      {}", report.method);
    }
    let _ = writeln!(
        text,
        "cells       {} of {} ({})",
        report.live_cells, report.cells, built.inverse.grid
    );
    let _ = writeln!(
        text,
        "scene       condition {:.2}\n\
         white       {:.4} of the camera's full scale: {}",
        report.condition,
        built.white.light,
        built.white.reason()
    );
    let known = device_lines(&built.measurements);
    if !known.is_empty() {
        text += &lines("devices     ", &known);
    }
    if let Some(recovery) = &report.recovery {
        text += &lines("recovery    ", &recovery.lines());
    }
    let prediction = report.prediction;
    let _ = writeln!(
        text,
        "held out    by cells {:.4} off with the operator, {:.4} with the best gains alone, {:.4} with\n\
         \x20           nothing, in {} photographs that the solve had not seen",
        prediction.compensated,
        prediction.gain_only,
        prediction.uncompensated,
        prediction.photographs,
    );
    text
}

/// Why a table has gains and no operator, or not even those; `None` of one with an operator.
fn no_operator(built: &BuiltTable) -> Option<String> {
    let report = &built.report;
    match report.compensation {
        Compensation::Operator => return None,
        Compensation::GainOnly => {}
        Compensation::Nothing => {
            return Some(format!(
                "the table changes nothing: the wall errs by {:.4} as it is, and gains, rounded to \
                 the projector's codes, by {:.4}",
                built.predicted.uncompensated, built.predicted.gain_only
            ));
        }
    }
    let (clipped, prediction) = (report.clipped, report.prediction);
    let cancelled = 100.0 * prediction.cancelled();
    let why = if cancelled < 0.2 {
        format!("it would cancel {cancelled:.2} % of the light")
    } else if clipped.compensated < clipped.gain_only {
        format!(
            "it is not proven better: {:.1} standard errors, and 2 are asked for",
            prediction.confidence
        )
    } else {
        format!(
            "clipped images err by {:.4} with it and {:.4} without",
            clipped.compensated, clipped.gain_only
        )
    };
    Some(format!("the table has gains and no operator: {why}"))
}

/// The gates for programs.
pub(super) fn gates(gates: &[Gate]) -> Vec<Value> {
    let gate = |gate: &Gate| {
        json!({
            "name": gate.name.name(),
            "verdict": gate.verdict.name(),
            "number": gate.number,
            "limit": gate.limit,
            "unit": gate.unit,
            "what": gate.what,
            "next_step": gate.next_step,
        })
    };
    gates.iter().map(gate).collect()
}

/// Projector and camera, for programs.
fn devices(devices: &Devices) -> Value {
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
fn device_lines(measurements: &Measurements) -> Vec<String> {
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
fn ambient_share(measurements: &Measurements) -> f64 {
    let (mut dark, mut lit) = (0.0, 0.0);
    for (index, channel) in measurements.channels.iter().enumerate() {
        let flood = measurements.white(index);
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
fn files(diagnostics: &Diagnostics) -> Value {
    json!({
        "format": diagnostics.file.to_string(),
        "bits": diagnostics.bits,
        "lossy": diagnostics.file == FileFormat::Jpeg,
    })
}

/// How the projector's light falls off over the picture, where cells that light each
/// other tell it; `null` elsewhere.
fn flux(inverse: &InverseTransport) -> Value {
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
fn unmeasured(measurements: &Measurements) -> Vec<Value> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_named_by_whole_rows_and_runs() {
        let two_rows: Vec<usize> = (0..12).collect();
        assert_eq!(places(&two_rows, 6), "rows 0-1");
        assert_eq!(
            places(&[7, 8, 10, 18, 19, 20, 21, 22, 23], 6),
            "row 3, row 1 columns 1-2, row 1 column 4"
        );
        let scattered: Vec<usize> = (0..10).map(|k| 12 * k).collect();
        assert!(places(&scattered, 6).ends_with("and 4 more places"));
    }
}
