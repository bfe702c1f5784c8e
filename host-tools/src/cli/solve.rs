//! `iltm solve`

use super::args::Solve;
use super::failure::{Failure, Kind};
use super::output::{Output, make_folder, write_file};
use super::progress::progress;
use super::summary::{summary, text};
use super::tables::seal;
use crate::build_table::{BuiltTable, build_table_from};
use crate::capture::{self, CaptureOptions};
use crate::compile::reference_white::WhiteRequest;
use crate::compile::sign::read_key;
use crate::solve::SolveOptions;
use crate::solve_page::{self, Content};
use crate::video::sampled_frames;
use iltm_picture::{LightPicture, progress::Progress};
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Frames of each of the user's videos that are looked at.
const FRAMES: usize = 48;

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
        Some(light) => Some(WhiteRequest::Light(light)),
        None if frames.is_empty() => None,
        None => Some(WhiteRequest::Content {
            frames: &frames,
            share: arguments.clip_share,
        }),
    };
    let mut measurements = capture::read(&arguments.capture, &photographs, bars.as_ref())?;
    if let Some(name) = &arguments.name {
        measurements.settings.scene.name = Some(name.clone());
    }
    let built = build_table_from(
        measurements,
        &arguments.capture,
        &options,
        white,
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
    let mut text = text(&built);
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
            let mut failure = Failure::from(error);
            failure.message = format!("{}: {}", path.display(), failure.message);
            failure
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
    built: &BuiltTable,
    arguments: &Solve,
    content: &[Content],
    folder: &Path,
    bars: &dyn Progress,
) -> Result<PathBuf, Failure> {
    let report = solve_page::report(built, &arguments.capture, &arguments.output, content, bars);
    let report = report.map_err(|error| {
        Failure::new(
            Kind::Frames,
            error,
            "Check the content, or leave --report away: the table has been written.",
        )
    })?;
    make_folder(folder)?;
    for file in &report.files {
        write_file(&folder.join(&file.name).with_extension("png"), &file.png)?;
    }
    let page = folder.join("report.html");
    write_file(&page, report.page.as_bytes())?;
    Ok(page)
}
