//! `iltm solve`

use super::args::Solve;
use super::failure::{Failure, Kind, cannot_write};
use super::output::{Output, pictures, write_file, write_files};
use super::progress::progress;
use super::summary::{self, remarks, summary};
use super::table_words;
use super::tables::{check, check_date, seal};
use crate::build_table::{BuiltTable, LearnedFrom, TableOptions, build_table_from};
use crate::capture::{self, CaptureOptions, Measurements};
use crate::compile::reference_white::WhiteRequest;
use crate::compile::sign::read_key;
use crate::solve::{Method, Processes, SolveOptions};
use crate::solve_page::{self, Content};
use crate::video::{Fit, PlacedFrames, VideoError, sampled_frames};
use iltm_picture::{LightPicture, Picture, progress::Progress, whole_file};
use iltm_runtime::{FrameSize, units::Light};
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Frames of each of the user's videos that are looked at.
const FRAMES: usize = 48;

pub(super) fn run(arguments: &Solve, processes: Processes, output: &Output) -> Result<(), Failure> {
    let start = Instant::now();
    check_date()?;
    if let (Some(method), Some(_)) = (arguments.method, arguments.lambda)
        && method != Method::Joint
    {
        return Err(Failure::new(
            Kind::Usage,
            format!("the method `{method}` has no weight"),
            "Leave --lambda or --method away.",
        ));
    }
    // A key that cannot be read is known before the work, not after it.
    let key = arguments.key.as_deref().map(read_key).transpose()?;
    // So is a place that cannot be written to.
    check_place(&arguments.output)?;
    let options = SolveOptions {
        method: arguments.method,
        lambda: arguments.lambda,
        processes,
        ..SolveOptions::default()
    };
    let bars = progress(output);
    let content = content(&arguments.content, bars.as_ref())?;
    let captures = &arguments.captures;
    let learned = learned_from(arguments, bars.as_ref())?;
    let content = placed(content, learned.measurements(), arguments.fit)?;
    let frames: Vec<LightPicture> = content.iter().flat_map(Content::light).collect();
    let white = match arguments.white {
        Some(light) => Some(WhiteRequest::Light(light)),
        None if frames.is_empty() => None,
        None => Some(WhiteRequest::Content {
            frames: &frames,
            share: arguments.clip_share,
        }),
    };
    let built = build_table_from(
        learned,
        &captures[0],
        &options,
        &TableOptions {
            white,
            gain_resolution: arguments.gain_resolution,
            keep_ambient: arguments.keep_ambient,
            match_black: arguments.match_black,
        },
        bars.as_ref(),
    );
    bars.end();
    let built = built?;
    let image = &built.compiled.image;
    let file = match &key {
        Some(key) => seal(image, key, &arguments.seal)?,
        None => image.clone(),
    };
    write_file(&arguments.output, &file)?;
    let page = match &arguments.report {
        Some(folder) => Some(report(&built, arguments, &content, folder, bars.as_ref())?),
        None => None,
    };
    bars.end();
    let seconds = start.elapsed().as_secs_f64();
    let mut data = summary(&built);
    data["table"] = json!(arguments.output.display().to_string());
    data["seconds"] = json!(seconds);
    data["signed"] = json!(key.is_some());
    data["report"] = json!(page.as_ref().map(|page| page.display().to_string()));
    let table = check(&arguments.output, image)?;
    for (name, value) in table_words::data(&table).as_object().into_iter().flatten() {
        data[name] = value.clone();
    }
    let mut text = table_words::lines(&arguments.output, &table);
    text += &remarks(&built);
    if arguments.match_black && table.black() == Light::ZERO {
        text += "note        black is not raised: the photographs of black are dark\n";
    }
    if processes.count() > 1 && built.report.method != Method::Links {
        let _ = writeln!(
            text,
            "note        ranks: `{}` works on one of {}; `--method links` on all",
            built.report.method,
            processes.count(),
        );
    }
    let _ = writeln!(
        text,
        "written     {}{} in {seconds:.2} s",
        arguments.output.display(),
        if key.is_some() { ", signed," } else { "" },
    );
    if arguments.detail.verbose {
        let _ = write!(text, "\n{}", summary::text(&built));
    }
    if let Some(page) = &page {
        let _ = writeln!(text, "report      {}", page.display());
    }
    output.result(&data, &text);
    Ok(())
}

/// The capture of one projector, or those of several.
fn learned_from(arguments: &Solve, bars: &dyn Progress) -> Result<LearnedFrom, Failure> {
    let photographs = CaptureOptions {
        bernoulli: arguments.photos,
        ignore: arguments.ignore.clone(),
        ..CaptureOptions::default()
    };
    let mut learned: LearnedFrom = match &arguments.captures[..] {
        [one] => capture::read(one, &photographs, bars)?.into(),
        several => capture::read_several(several, &photographs, bars)?.into(),
    };
    if let Some(name) = &arguments.name {
        learned.measurements_mut().settings.scene.name = Some(name.clone());
    }
    Ok(learned)
}

/// Whether a file can be put in a place, before the work for it is done.
pub(super) fn check_place(file: &Path) -> Result<(), Failure> {
    let checked = whole_file::check_place(file).map(drop);
    checked.map_err(|error| cannot_write(&error.path, &error.source))
}

/// Some frames of each of the user's files.
fn content(files: &[PathBuf], bars: &dyn Progress) -> Result<Vec<Content>, Failure> {
    bars.begin("looking at the content", 0);
    let read = |path: &PathBuf| {
        let frames = sampled_frames(path, FRAMES).map_err(|error| named(path, error))?;
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

/// The page's name in the folder that `--report` gives.
const PAGE: &str = "report.html";
/// The failure of a file of content, which names it.
fn named(path: &Path, error: VideoError) -> Failure {
    let names_it = matches!(error, VideoError::Open { .. });
    let mut failure = Failure::from(error);
    if !names_it {
        failure.message = format!("{}: {}", path.display(), failure.message);
    }
    failure
}

/// The part of the content that falls on the cells.
fn placed(
    content: Vec<Content>,
    measurements: &Measurements,
    fit: Option<Fit>,
) -> Result<Vec<Content>, Failure> {
    let projector = measurements.settings.projector.pixels();
    let one_a_cell = FrameSize::of_grid(measurements.grid);
    let on_cells = |frame: Picture| match projector {
        None if fit.is_some() => Err(VideoError::NothingToFit),
        Some(projector) if frame.size() != one_a_cell => {
            let placed = PlacedFrames::on(projector, frame.size(), fit)?;
            Ok(placed.on_cells(&frame).unwrap_or(frame))
        }
        _ => Ok(frame),
    };
    let of_file = |content: Content| {
        let frames = content.frames.into_iter().map(on_cells);
        Ok(Content {
            frames: frames
                .collect::<Result<_, _>>()
                .map_err(|error| named(Path::new(&content.name), error))?,
            name: content.name,
        })
    };
    content.into_iter().map(of_file).collect()
}

/// Writes the report; its page.
fn report(
    built: &BuiltTable,
    arguments: &Solve,
    content: &[Content],
    folder: &Path,
    bars: &dyn Progress,
) -> Result<PathBuf, Failure> {
    let report = solve_page::report(built, &arguments.captures, &arguments.output, content, bars);
    let report = report.map_err(|error| {
        Failure::new(
            Kind::Frames,
            error,
            "Check the content, or leave --report away: the table has been written.",
        )
    })?;
    let mut files = pictures(&report.files);
    files.push((PAGE.into(), report.page.as_bytes()));
    write_files(folder, &files)?;
    Ok(folder.join(PAGE))
}
