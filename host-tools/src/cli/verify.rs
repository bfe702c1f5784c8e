//! `iltm verify`

use super::args::{SerialLine, Verify};
use super::connect::connect;
use super::failure::{Failure, Kind};
use super::output::{self, Output, write_files};
use super::progress::progress;
use super::summary::gates;
use super::tables::{check_whole, read_table};
use super::words::{number, table_in_use};
use crate::capture::{CameraPlaces, camera_places};
use crate::compile::Provenance;
use crate::session::Layout;
use crate::verify::{
    Cause, Handover, ImageVerdict, Outcome, Readings, Recognised, Slides, TableVerdict,
    brightness_words, fixed_words, html, judge, moved_words, overlap_words, pictures, reason,
    recognise, shift_words, unseen_words, write,
};
use iltm_picture::{numbers::percent, progress::Progress};
use iltm_runtime::{FrameSize, image::Table};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

pub(super) fn run(arguments: &Verify, output: &Output) -> Result<(), Failure> {
    let image = read_table(&arguments.table)?;
    let table = check_whole(&arguments.table, &image)?;
    let bars = progress(output);
    let result = match (&arguments.output, &arguments.capture) {
        (Some(out), _) => prepare(arguments, &table, out, bars.as_ref(), output),
        (None, Some(folder)) => verdict(arguments, &table, folder, bars.as_ref(), output),
        // clap asks for one of the two.
        (None, None) => Ok(()),
    };
    bars.end();
    result
}

/// Writes the pictures to project.
fn prepare(
    arguments: &Verify,
    table: &Table<'_>,
    out: &Path,
    bars: &dyn Progress,
    output: &Output,
) -> Result<(), Failure> {
    let provenance = Provenance::read(table.provenance());
    let places = places(arguments, table, provenance.overlapping, bars)?;
    let settings = provenance.capture.unwrap_or_default();
    let own = settings.projector.size;
    let projector = (places.as_ref().map(|places| places.frame))
        .or(arguments.projector)
        .or_else(|| own.and_then(|[width, height]| FrameSize::new(width, height)))
        .or_else(|| FrameSize::new(1920, 1080));
    let Some(projector) = projector else {
        unreachable!("sides above zero");
    };
    let border = arguments.border.unwrap_or(settings.projector.border);
    let layout = Layout::new(table.grid(), projector, border)?;
    let kind = match &places {
        Some(places) => Slides::Several(places),
        None if arguments.wanted => Slides::Wanted,
        None => Slides::Both {
            fine: !arguments.no_dense,
        },
    };
    let written = write(table, &layout, (&settings, kind), out, bars)?;
    bars.end();
    let data = json!({
        "folder": out.display().to_string(),
        "wanted": arguments.wanted,
        "pictures": written.pictures,
        "film": written.film,
        "stripes": written.stripes,
        "fine_images": written.fine.len(),
        "images": written.images.iter().map(|image| json!({
            "title": image.title,
            "clipped": image.clipped,
        })).collect::<Vec<_>>(),
        "projector": size(layout.projector()),
        "border": layout.border(),
    });
    let how = if arguments.wanted {
        "as it should look, for whatever compensates"
    } else {
        "each as it is and compensated"
    };
    // Those of overlapping projectors are all finer than the cells.
    let tested = if places.is_some() {
        &written.fine
    } else {
        &written.images
    };
    let fine = match written.fine.len() {
        0 => String::new(),
        _ if places.is_some() => format!(
            "{} stripes of the projectors' own pixels are among them. ",
            written.stripes
        ),
        count => format!(
            "{count} images and {} stripes of the projector's own pixels are among them: the error \
             is seen pixel by pixel, and `iltm refine` can use it.\n",
            written.stripes
        ),
    };
    let film = match (arguments.wanted, written.film) {
        (false, _) => "",
        (true, 0) => "The projection has too few pixels for a film with cards.\n",
        (true, _) => "film/ has them for a player, each after a card with its number.\n",
    };
    let text = format!(
        "{}: {} pictures to project and photograph ({} test images, {how};\n\
         white, black and patterns that find the cells). {fine}{film}README.md in it says how. Then:\n\
         iltm verify {} {}\n",
        out.display(),
        written.pictures,
        tested.len(),
        arguments.table.display(),
        out.display(),
    );
    output.result(&data, &text);
    Ok(())
}

/// Where the camera of the captures sees the pixels of projectors that overlap.
fn places(
    arguments: &Verify,
    table: &Table<'_>,
    overlapping: bool,
    bars: &dyn Progress,
) -> Result<Option<CameraPlaces>, Failure> {
    let refuse = |what: &str, next_step: &str| {
        let message = format!("{}: {what}", arguments.table.display());
        Err(Failure::new(Kind::Usage, message, next_step))
    };
    if arguments.captures.is_empty() && !overlapping {
        return Ok(None);
    }
    if !overlapping {
        return refuse(
            "its projectors do not overlap, and its pictures need no captures",
            "Leave --captures away.",
        );
    }
    if arguments.captures.is_empty() {
        return refuse(
            "its projectors overlap, and test images must show the same where two light one place",
            "Name the captures that it was solved from, in their order: --captures LEFT RIGHT. They \
             say which places these are.",
        );
    }
    if arguments.wanted || arguments.no_dense || arguments.border.is_some_and(|border| border > 0) {
        return refuse(
            "where projectors overlap, slides are for the projectors alone, with fine stripes and no \
             border",
            "Leave --wanted, --no-dense and --border away.",
        );
    }
    let places = camera_places(&arguments.captures, bars)?;
    if places.grid != table.grid() {
        let what = format!(
            "it is for {} cells, and these captures have {} side by side",
            table.grid(),
            places.grid
        );
        return refuse(
            &what,
            "Name the captures that it was solved from, in their order.",
        );
    }
    if arguments
        .projector
        .is_some_and(|projector| projector != places.frame)
    {
        let what = format!(
            "the captures' projectors have {} x {} pixels side by side",
            places.frame.width(),
            places.frame.height()
        );
        return refuse(&what, "Leave --projector away.");
    }
    Ok(Some(places))
}

fn size(size: FrameSize) -> Value {
    json!({ "width": size.width(), "height": size.height() })
}

/// Judges the photographs of a folder.
fn verdict(
    arguments: &Verify,
    table: &Table<'_>,
    folder: &Path,
    bars: &dyn Progress,
    output: &Output,
) -> Result<(), Failure> {
    let photographs = arguments.photographs.as_deref();
    let recognised = photographs.map(|from| recognise(folder, from, table, bars));
    let recognised = recognised.transpose()?;
    let readings = Readings::read(folder, table, bars)?;
    let verdict = judge(folder, table, &readings, arguments.bound)?;
    let out = arguments
        .report
        .clone()
        .unwrap_or_else(|| folder.join("verdict"));
    let device = arguments.port.as_ref().map(|_| device(arguments, output));
    let handover = Handover {
        table: arguments.table.display().to_string(),
        date: chrono::Local::now().format("%Y-%m-%d %H:%M").to_string(),
        device: device.transpose()?,
    };
    let page = report(table, &readings, &verdict, &handover, &out)?;
    bars.end();
    let mut data = data(arguments, folder, &verdict, &page);
    data["recognised"] = recognised.map_or(Value::Null, |found| {
        json!({
            "photographs": found.photographs,
            "cards": found.cards,
            "slides": found.slides,
        })
    });
    let recognised = recognised.map(|found: Recognised| {
        format!(
            "recognised  {} slides, by {} cards in {} photographs\n",
            found.slides, found.cards, found.photographs
        )
    });
    let blind = match &readings.revisited.pixels {
        Some(Err(error)) => format!("viewer      not judged: {error}. {}\n", error.next_step()),
        Some(Ok(_)) if verdict.pixels.is_none() => {
            "viewer      not judged by these photographs\n".to_owned()
        }
        Some(Ok(_)) | None => String::new(),
    };
    let text = recognised.unwrap_or_default() + &blind + &text(&verdict, &page);
    if verdict.outcome == Outcome::Passed {
        output.result(&data, &text);
        return Ok(());
    }
    output.findings(&text);
    let (kind, says) = if verdict.outcome == Outcome::Inconclusive {
        let says = "these photographs cannot tell whether it keeps its promise";
        (Kind::Inconclusive, says.to_owned())
    } else {
        let at_pixels = verdict.pixels.as_ref();
        let at_pixels = at_pixels.filter(|_| verdict.fails_within_cells());
        let by_cells = || {
            let (error, limit) = (percent(verdict.error[1]), percent(verdict.bound.limit));
            format!("error {error}, at most {limit} passes")
        };
        let exchanged = verdict
            .exchanged
            .map(|_| reason(&verdict).trim_end_matches('.').to_owned());
        let moved = exchanged.or_else(|| verdict.moved().map(moved_words));
        let what = moved.or_else(|| at_pixels.and_then(fixed_words));
        let what = what.unwrap_or_else(by_cells);
        let says = format!("it does not keep its promise: {what}");
        (Kind::Verdict, says)
    };
    let message = format!("{}: {says}", arguments.table.display());
    let todo = verdict.cause.map_or("", Cause::next_step);
    let mut next_step = format!("{todo} The page is {}.", page.display());
    if output.is_json() {
        // People have just read it.
        next_step = format!("{} {next_step}", reason(&verdict));
    }
    Err(Failure::new(kind, message, next_step).with_result(data))
}

/// What the device at the port says of itself.
fn device(arguments: &Verify, output: &Output) -> Result<Vec<(String, String)>, Failure> {
    let line = SerialLine {
        port: arguments.port.clone(),
        baud: None,
    };
    let mut connection = connect(&line, output)?;
    let status = connection.client.status();
    let status = status.map_err(|error| connection.failed(&error))?;
    let slots = connection.client.slots().ok();
    let device = connection.client.device();
    let who = format!(
        "{}, {}, firmware {}, at {}",
        status.board,
        number(device.device),
        status.firmware,
        connection.port
    );
    Ok(vec![
        ("device".to_owned(), who),
        (
            "its table".to_owned(),
            table_in_use(&status, slots.as_ref()),
        ),
        ("its mode".to_owned(), status.mode.to_string()),
    ])
}

/// The page's name in its folder.
const PAGE: &str = "verdict.html";

/// Writes the page and its pictures; the page.
fn report(
    table: &Table<'_>,
    readings: &Readings,
    verdict: &TableVerdict,
    handover: &Handover,
    out: &Path,
) -> Result<PathBuf, Failure> {
    let drawn = pictures(table, readings, verdict);
    let page = html(table, verdict, &drawn, handover);
    let mut files = output::pictures(&drawn);
    files.push((PAGE.into(), page.as_bytes()));
    write_files(out, &files)?;
    Ok(out.join(PAGE))
}

fn data(arguments: &Verify, folder: &Path, verdict: &TableVerdict, page: &Path) -> Value {
    let bound = &verdict.bound;
    let white = verdict.drift.white.as_ref();
    let of_image = |image: &ImageVerdict| {
        json!({
            "image": image.image,
            "title": image.title,
            "before": image.error[0],
            "after": image.error[1],
            "modelled_before": image.modelled.map(|modelled| modelled[0]),
            "modelled_after": image.modelled.map(|modelled| modelled[1]),
            "after_at_table_white": image.at_table_white,
            "white": image.white,
            "clipped": image.clipped,
        })
    };
    let worst = verdict
        .worst
        .iter()
        .map(|cell| json!({ "row": cell.row + 1, "col": cell.col + 1, "error": cell.error }));
    json!({
        "table": arguments.table.display().to_string(),
        "capture": folder.display().to_string(),
        "outcome": verdict.outcome.name(),
        "cause": verdict.cause.map(Cause::name),
        "gates": gates(&verdict.gates),
        "mean_error": { "before": verdict.error[0], "after": verdict.error[1] },
        "bound": {
            "limit": bound.limit,
            "given": bound.given,
            "expected": bound.expected,
            "promise": bound.promise,
            "added": bound.added,
            "doubt": bound.doubt,
            "predicted": bound.predicted,
            "range": bound.range,
            "noise": bound.noise,
            "viewpoint": bound.viewpoint,
        },
        "images": verdict.images.iter().map(of_image).collect::<Vec<_>>(),
        "viewer": verdict.pixels.as_ref().map(|pixels| json!({
            "before": pixels.error[0],
            "after": pixels.error[1],
            "noise": pixels.noise,
            "fixed": pixels.fixed.map(|fixed| fixed.error),
            "shift": pixels.fixed.and_then(|fixed| fixed.shift),
            "promise": pixels.bound.map(|bound| bound.promise),
            "limit": pixels.bound.map(|bound| bound.limit),
            "pixels": pixels.errors.len(),
            "images": pixels.images.iter().map(|[before, after]| json!({
                "before": before,
                "after": after,
            })).collect::<Vec<_>>(),
        })),
        "wanted": verdict.wanted,
        "curve": { "power": verdict.curve.power, "left": verdict.curve.left },
        "brightness": (verdict.outcome != Outcome::Inconclusive).then_some(verdict.brightness),
        "drift": {
            "level": white.map(|white| &white.level),
            "shape": white.map(|white| white.shape),
            "session": verdict.drift.session,
        },
        "exchanged": verdict.exchanged.map(|pair| pair.map(|number| number + 1)),
        "overlaps_unseen": verdict.unseen.iter().map(|pair| pair.map(|number| number + 1)).collect::<Vec<_>>(),
        "overlaps": verdict.shifts.iter().map(|shift| json!({
            "projectors": shift.projectors.map(|number| number + 1),
            "moved": shift.pixels,
            "right": shift.shift[0],
            "down": shift.shift[1],
        })).collect::<Vec<_>>(),
        "worst_cells": worst.collect::<Vec<_>>(),
        "cells": { "compared": verdict.cells.0, "known": verdict.cells.1 },
        "page": page.display().to_string(),
        "map": page.with_file_name("worst-cells.png").display().to_string(),
    })
}

/// How pictures that overlap lie, as far as the photographs tell.
fn overlap(verdict: &TableVerdict) -> String {
    let mut text = String::new();
    if let Some(farthest) = verdict.farthest() {
        let others = match verdict.shifts.len() - 1 {
            0 => "",
            1 => "; those of the other pair no farther",
            _ => "; those of the other pairs no farther",
        };
        let _ = writeln!(text, "overlap     {}{others}", overlap_words(farthest));
    }
    for pair in &verdict.unseen {
        let _ = writeln!(text, "overlap     not known {}", unseen_words(*pair));
    }
    text
}

fn text(verdict: &TableVerdict, page: &Path) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "test image            before    after");
    for image in &verdict.images {
        let title = &image.title;
        let [before, after] = image.error;
        let _ = writeln!(text, "{title:20}  {before:.4}    {after:.4}");
    }
    let [before, after] = verdict.error;
    let _ = writeln!(text, "{:20}  {before:.4}    {after:.4}", "mean");
    let bound = &verdict.bound;
    let known =
        |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), |v| format!("{v:.4}"));
    let counted = |value: Option<f64>, counted: f64| match value {
        Some(value) if value - counted > 5e-5 => {
            format!("{value:.4}, of which at most {counted:.4} counts")
        }
        value => known(value),
    };
    let why = match (bound.given, bound.expected) {
        (true, _) => "as asked for".to_owned(),
        (false, None) => "half of the error before: the table predicts none".to_owned(),
        (false, Some(expected)) => format!(
            "1.5 times the {expected:.4} expected: table {}, range and codes {}, noise {}, viewpoint \
             {}; it is their squares that add up",
            known(bound.predicted),
            known(bound.range),
            counted(bound.noise, bound.counted[0]),
            counted(Some(bound.viewpoint), bound.counted[1])
        ),
    };
    let _ = writeln!(text, "bound       {:.4} ({why})", bound.limit);
    let _ = writeln!(
        text,
        "cells       {} of {} compared",
        verdict.cells.0, verdict.cells.1
    );
    if let Some(pixels) = &verdict.pixels {
        let [before, after] = pixels.error;
        let _ = writeln!(
            text,
            "viewer      sees {} of the light off, {} as the wall is: images finer than the cells, at {} pixels of the camera",
            percent(after),
            percent(before),
            pixels.errors.len()
        );
        let fixed = fixed_words(pixels).unwrap_or_else(|| {
            "not held against a limit: the table predicts no error at pixels".to_owned()
        });
        let _ = writeln!(text, "fixed       {fixed}");
        if let Some(shift) = pixels.fixed.and_then(|fixed| fixed.shift) {
            let _ = writeln!(
                text,
                "nudge       the picture lies {} of where it lay when the table was made",
                shift_words(shift)
            );
        }
    }
    text += &overlap(verdict);
    match &verdict.drift.white {
        None => {
            text += "drift       not known: the table does not tell what light comes of an input\n";
        }
        Some(white) => {
            let percent = |level: &f64| format!("{:.1} %", 100.0 * level);
            let levels: Vec<String> = white.level.iter().map(percent).collect();
            let _ = writeln!(
                text,
                "drift       white is {} of what the table expects, {:.2} % off that from cell to cell",
                levels.join(", "),
                100.0 * white.shape
            );
        }
    }
    if let Some(worst) = verdict.worst.first() {
        let _ = writeln!(
            text,
            "worst cell  row {}, column {}, from 1 at the top left: {:.2} % of white",
            worst.row + 1,
            worst.col + 1,
            100.0 * worst.error
        );
    }
    let _ = writeln!(text, "brightness  {}", brightness_words(verdict));
    let _ = writeln!(text, "page        {}", page.display());
    let answer = match verdict.outcome {
        Outcome::Passed => "PASSED",
        Outcome::Failed => "FAILED",
        Outcome::Inconclusive => "CANNOT TELL",
    };
    let _ = writeln!(text, "verdict     {answer}: {}", reason(verdict));
    text
}
