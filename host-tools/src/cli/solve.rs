//! `iltm solve`

use super::args::Solve;
use super::devices::{ambient_share, device_lines, devices, files, flux, unmeasured};
use super::failure::{Failure, Kind};
use super::key::seal;
use super::output::{Output, cannot_write, write_file};
use super::progress::progress;
use crate::capture::{CaptureOptions, Verdict, Why};
use crate::compile::sign::read_key;
use crate::compile::wish::WhiteWish;
use crate::learn::{Learned, learn};
use crate::solve::{Compensation, Method, SolveOptions, WhyLeftOut};
use crate::solve_page::{self, Content};
use crate::video::sampled_frames;
use iltm_picture::{LightPicture, progress::Progress};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Frames of each of the user's videos that are looked at.
const FRAMES: usize = 48;

/// Places that are named before the rest is only counted.
const MOST_PLACES: usize = 6;

pub(super) fn run(arguments: &Solve, output: &Output) -> Result<(), Failure> {
    let start = Instant::now();
    // A key that cannot be read is known before the work, not after it.
    let key = arguments.key.as_deref().map(read_key).transpose()?;
    let photographs = CaptureOptions {
        bernoulli: arguments.photos,
        ignore: arguments.ignore.clone(),
        ..CaptureOptions::default()
    };
    let options = SolveOptions {
        method: arguments.method,
        lambda: arguments.lambda,
        ..SolveOptions::default()
    };
    let bars = progress(output);
    let content = content(&arguments.content, bars.as_ref())?;
    let frames: Vec<LightPicture> = content.iter().flat_map(Content::light).collect();
    let white = match arguments.white {
        Some(light) => Some(WhiteWish::Light(light)),
        None if frames.is_empty() => None,
        None => Some(WhiteWish::Content {
            frames: &frames,
            share: arguments.clip_share,
        }),
    };
    let learned = learn(
        &arguments.capture,
        &photographs,
        &options,
        white,
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
    let page = match &arguments.report {
        Some(folder) => Some(report(
            &learned,
            arguments,
            &content,
            folder,
            bars.as_ref(),
        )?),
        None => None,
    };
    bars.end();
    let seconds = start.elapsed().as_secs_f64();
    let mut data = summary(&learned);
    data["table"] = json!(arguments.output.display().to_string());
    data["seconds"] = json!(seconds);
    data["signed"] = json!(key.is_some());
    data["report"] = json!(page.as_ref().map(|page| page.display().to_string()));
    let mut text = text(&learned);
    let _ = writeln!(
        text,
        "table       {}: {} bytes, {}in {seconds:.2} s",
        arguments.output.display(),
        file.len(),
        if key.is_some() { "signed, " } else { "" },
    );
    if let Some(page) = &page {
        let _ = writeln!(text, "report      {}", page.display());
    }
    output.result(&data, &text);
    Ok(())
}

/// Some frames of each of the user's files.
fn content(files: &[PathBuf], bars: &dyn Progress) -> Result<Vec<Content>, Failure> {
    bars.begin("looking at the content", 0);
    let read = |path: &PathBuf| {
        let frames = sampled_frames(path, FRAMES).map_err(|error| {
            let failure = super::compensate::failed(&error);
            Failure::new(
                failure.kind,
                format!("{}: {}", path.display(), failure.message),
                failure.next_step,
            )
        })?;
        let name = path.file_name().unwrap_or(path.as_os_str());
        Ok(Content {
            name: name.to_string_lossy().into_owned(),
            frames,
        })
    };
    let content = files.iter().map(read).collect();
    bars.end();
    content
}

/// Writes the report; its page.
fn report(
    learned: &Learned,
    arguments: &Solve,
    content: &[Content],
    folder: &Path,
    bars: &dyn Progress,
) -> Result<PathBuf, Failure> {
    let report = solve_page::report(
        learned,
        &arguments.capture,
        &arguments.output,
        content,
        bars,
    );
    let report = report.map_err(|error| {
        Failure::new(
            Kind::Frames,
            error,
            "Check the content, or leave --report away: the table has been written.",
        )
    })?;
    std::fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))?;
    for file in &report.files {
        write_file(&folder.join(&file.name).with_extension("png"), &file.png)?;
    }
    let page = folder.join("report.html");
    write_file(&page, report.page.as_bytes())?;
    Ok(page)
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
        "left_out": left_out(learned),
        "unmeasured_cells": unmeasured(&learned.measurements),
        "files": files(&learned.measurements.diagnostics),
        "devices": devices(&learned.measurements.devices),
        "ambient_share": ambient_share(&learned.measurements),
        "flux": flux(&learned.inverse),
        "method": report.method.name(),
        "photographs": {
            "white": report.photographs.white,
            "gray_code": report.photographs.gray_code,
            "bernoulli": report.photographs.bernoulli,
        },
        "ignored_gates": ignored(learned),
        "lambda": report.lambda,
        "iterations": report.iterations,
        "condition": report.condition,
        "recovery": report.recovery,
        "compensation": report.compensation.name(),
        "predicted_error": {
            "uncompensated": report.prediction.uncompensated,
            "gain_only": report.prediction.gain_only,
            // `null` where the inverse found would let light grow without end.
            "compensated": report.prediction.compensated,
        },
        "reference_white": learned.compiled.white.light,
        "white": learned.white,
        "bytes": learned.compiled.image.len(),
        "tiers": tiers(learned),
    })
}

/// Names of the gates that fail and were ignored.
fn ignored(learned: &Learned) -> Vec<&'static str> {
    let gates = &learned.measurements.diagnostics.gates;
    let failed = gates.iter().filter(|gate| gate.fails());
    failed.map(|gate| gate.name.name()).collect()
}

fn tiers(learned: &Learned) -> Vec<Value> {
    let ladder = &learned.compiled.ladder;
    let tiers = ladder.tiers.iter().map(|tier| (tier.entries, tier.error));
    std::iter::once((0, ladder.gain_only))
        .chain(tiers)
        .map(|(entries, error)| json!({ "entries": entries, "error": error }))
        .collect()
}

/// Cells that the table leaves dark, a line for each reason.
fn left_out(learned: &Learned) -> Vec<String> {
    let cols = learned.inverse.grid.cols();
    let mut by_reason: Vec<(&str, Vec<usize>)> = Vec::new();
    for out in &learned.report.left_out {
        let why = match out.why {
            WhyLeftOut::Unlit => "lit by nothing, though light of others is seen there",
            WhyLeftOut::Black => "black: they give back no light",
            WhyLeftOut::Unseen => unseen(learned, out.cell),
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
fn unseen(learned: &Learned, cell: usize) -> &'static str {
    let diagnostics = &learned.measurements.diagnostics;
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
    // The default one needs no mention.
    if report.method != Method::Joint {
        let _ = writeln!(text, "method      {}", report.method.name());
    }
    let _ = writeln!(
        text,
        "cells       {} of {} ({})",
        report.live_cells, report.cells, learned.inverse.grid
    );
    for line in left_out(learned) {
        let _ = writeln!(text, "            {line}");
    }
    for gate in &learned.measurements.diagnostics.gates {
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
    let _ = writeln!(
        text,
        "scene       condition {:.2}\n\
         white       {:.4} of the camera's full scale: {}",
        report.condition,
        learned.white.light,
        learned.white.reason()
    );
    let known = device_lines(&learned.measurements);
    if !known.is_empty() {
        text += &lines("devices     ", &known);
    }
    if let Some(recovery) = &report.recovery {
        text += &lines("recovery    ", &recovery.lines());
    }
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
        let clipped = report.clipped;
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
        let _ = writeln!(
            text,
            "            the table has gains and no operator: {why}"
        );
    }
    text
}

/// Lines under a heading, the following ones indented as far.
pub(super) fn lines(heading: &str, lines: &[String]) -> String {
    let indent = " ".repeat(heading.len());
    let mut text = String::new();
    for (at, line) in lines.iter().enumerate() {
        let start = if at == 0 { heading } else { &indent };
        let _ = writeln!(text, "{start}{line}");
    }
    text
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
