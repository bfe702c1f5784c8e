//! `iltm solve`

use super::args::Solve;
use super::failure::Failure;
use super::key::seal;
use super::output::{Output, write_file};
use super::progress::progress;
use crate::capture::{CaptureOptions, Why};
use crate::compile::sign::read_key;
use crate::learn::{Learned, learn};
use crate::solve::{Compensation, SolveOptions};
use serde_json::{Value, json};
use std::fmt::Write;
use std::time::Instant;

/// Cells that are named one by one before the rest is only counted.
const MOST_LINES: usize = 8;

pub(super) fn run(arguments: &Solve, output: &Output) -> Result<(), Failure> {
    let start = Instant::now();
    // A key that cannot be read is known before the work, not after it.
    let key = arguments.key.as_deref().map(read_key).transpose()?;
    let photographs = CaptureOptions {
        bernoulli: arguments.photos,
        ..CaptureOptions::default()
    };
    let options = SolveOptions {
        method: arguments.method,
        lambda: arguments.lambda,
        ..SolveOptions::default()
    };
    let bars = progress(output);
    let learned = learn(
        &arguments.capture,
        &photographs,
        &options,
        arguments.white,
        bars.as_ref(),
    );
    bars.end();
    let learned = learned?;
    let image = &learned.compiled.image;
    let file = match &key {
        Some(key) => seal(image, key, &arguments.seal)?,
        None => image.clone(),
    };
    write_file(&arguments.output, &file)?;
    let seconds = start.elapsed().as_secs_f64();
    let mut data = summary(&learned);
    data["table"] = json!(arguments.output.display().to_string());
    data["seconds"] = json!(seconds);
    data["signed"] = json!(key.is_some());
    let mut text = text(&learned);
    let _ = writeln!(
        text,
        "table       {}: {} bytes, {}in {seconds:.2} s",
        arguments.output.display(),
        file.len(),
        if key.is_some() { "signed, " } else { "" },
    );
    output.result(&data, &text);
    Ok(())
}

/// What was learned, for programs.
pub(super) fn summary(learned: &Learned) -> Value {
    let report = &learned.report;
    let grid = learned.inverse.grid;
    json!({
        "rows": grid.rows(),
        "cols": grid.cols(),
        "channels": learned.inverse.channels.len(),
        "live_cells": report.live_cells,
        "method": report.method.name(),
        "photographs": {
            "white": report.photographs.white,
            "gray_code": report.photographs.gray_code,
            "bernoulli": report.photographs.bernoulli,
        },
        "lambda": report.lambda,
        "iterations": report.iterations,
        "condition": report.condition,
        "compensation": report.compensation.name(),
        "predicted_error": {
            "uncompensated": report.prediction.uncompensated,
            "gain_only": report.prediction.gain_only,
            // `null` where the inverse found would let light grow without end.
            "compensated": report.prediction.compensated,
        },
        "reference_white": learned.compiled.white.light,
        "bytes": learned.compiled.image.len(),
        "tiers": tiers(learned),
    })
}

fn tiers(learned: &Learned) -> Vec<Value> {
    let ladder = &learned.compiled.ladder;
    let tiers = ladder.tiers.iter().map(|tier| (tier.entries, tier.error));
    std::iter::once((0, ladder.gain_only))
        .chain(tiers)
        .map(|(entries, error)| json!({ "entries": entries, "error": error }))
        .collect()
}

/// What the capture could not be used for, a line each.
fn left_out(learned: &Learned) -> Vec<String> {
    let diagnostics = &learned.measurements.diagnostics;
    let cols = learned.inverse.grid.cols();
    let mut lines: Vec<String> = Vec::new();
    for left_out in diagnostics.left_out.iter().take(MOST_LINES) {
        let (row, col) = (left_out.cell / cols, left_out.cell % cols);
        let why = match left_out.why {
            Why::TooFewPixels { pixels } => format!("only {pixels} camera pixels see it alone"),
            Why::Saturated { saturated, pixels } => {
                format!("{saturated} of its {pixels} pixels are saturated")
            }
        };
        lines.push(format!("row {row}, column {col} left out: {why}"));
    }
    let more = diagnostics.left_out.len().saturating_sub(MOST_LINES);
    if more > 0 {
        lines.push(format!("and {more} more cells left out"));
    }
    lines
}

/// What was learned, for people.
pub(super) fn text(learned: &Learned) -> String {
    let report = &learned.report;
    let mut text = String::new();
    let photographs = report.photographs;
    let _ = writeln!(
        text,
        "photographs {} white, {} Gray code, {} Bernoulli",
        photographs.white, photographs.gray_code, photographs.bernoulli
    );
    let _ = writeln!(
        text,
        "cells       {} of {} ({})",
        report.live_cells, report.cells, learned.inverse.grid
    );
    for line in left_out(learned) {
        let _ = writeln!(text, "            {line}");
    }
    let _ = writeln!(
        text,
        "scene       condition {:.2}, reference white {:.4} of the camera's full scale",
        report.condition, learned.compiled.white.light
    );
    let prediction = report.prediction;
    let _ = writeln!(
        text,
        "error       {:.4} with an operator; {:.4} with gain alone, {:.4} with nothing\n\
         \x20           (predicted from {} photographs that the solve had not seen)",
        prediction.compensated,
        prediction.gain_only,
        prediction.uncompensated,
        prediction.photographs,
    );
    if report.compensation == Compensation::GainOnly {
        text.push_str(
            "            the operator does not prove to be better: the table has gains alone\n",
        );
    }
    text
}
