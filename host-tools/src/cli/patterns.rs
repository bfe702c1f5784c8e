//! `iltm patterns`

use super::args::{NamedSize, Patterns};
use super::failure::{Failure, Kind, cannot_write};
use super::output::Output;
use super::progress::progress;
use crate::capture::MIN_BERNOULLI;
use crate::session::{self, Layout, Made, OrderOptions, PatternsError};
use iltm_runtime::Grid;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

pub(super) fn run(arguments: &Patterns, output: &Output) -> Result<(), Failure> {
    let folders = folders(arguments)?;
    // A folder that is in the way is known before the work, not after it.
    folders
        .iter()
        .try_for_each(|folder| iltm_picture::check_free(folder))?;
    let layouts = layouts(arguments)?;
    let stills = |layout: &Layout| match &arguments.images {
        Some(folder) => session::stills(folder, layout.inner()),
        None => Ok(Vec::new()),
    };
    let images: Vec<_> = layouts.iter().map(stills).collect::<Result<_, _>>()?;
    let given = usize::from(arguments.photos) + images[0].len();
    if given < MIN_BERNOULLI {
        return Err(PatternsError::TooFew { given }.into());
    }
    if arguments
        .projector
        .iter()
        .any(|projector| projector.name.is_some())
    {
        let folder = &arguments.output;
        fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))?;
    }
    let bars = progress(output);
    for (at, ((layout, out), images)) in layouts.iter().zip(&folders).zip(images).enumerate() {
        let options = OrderOptions {
            bernoulli: arguments.photos.into(),
            images,
            seed: arguments.seed,
            ramp: if arguments.no_calibration {
                0
            } else {
                arguments.ramp
            },
            probe: !arguments.no_calibration,
            stripes: !arguments.no_dense,
            repeat_every: arguments.repeat_every.into(),
        };
        let slides = session::order(layout, &options);
        let made = session::write(&slides, layout, &arguments.camera, out, bars.as_ref())?;
        let (data, text) = told(arguments, layout, &folders[..=at], made);
        output.part_of_result(at + 1 == folders.len(), &data, &text);
    }
    Ok(())
}

/// The capture folder of each projector.
fn folders(arguments: &Patterns) -> Result<Vec<PathBuf>, Failure> {
    let refuse = |message: String, next_step| Err(Failure::new(Kind::Usage, message, next_step));
    let projectors = &arguments.projector;
    let named: Vec<&String> = projectors
        .iter()
        .filter_map(|projector| projector.name.as_ref())
        .collect();
    if projectors.len() > 1 && named.len() < projectors.len() {
        return refuse(
            "several projectors, and not each has a name".to_owned(),
            "Name each: --projector left=1920x1080 --projector right=1920x1080.",
        );
    }
    let twice = (named.iter().enumerate()).find(|(at, name)| named[..*at].contains(name));
    if let Some((_, name)) = twice {
        return refuse(
            format!("two projectors are named {name}"),
            "Give each a name of its own.",
        );
    }
    let folder = |projector: &NamedSize| match &projector.name {
        Some(name) => arguments.output.join(name),
        None => arguments.output.clone(),
    };
    Ok(projectors.iter().map(folder).collect())
}

/// The cells of each projector: those of the first, and of the others as many as have the same
/// pixels.
fn layouts(arguments: &Patterns) -> Result<Vec<Layout>, Failure> {
    let mut layouts: Vec<Layout> = Vec::new();
    for NamedSize { name, size } in &arguments.projector {
        let (size, border) = (*size, arguments.border);
        let layout = match (layouts.first(), arguments.camera_size) {
            (Some(first), _) => {
                let grid = first.grid_of(size).ok_or_else(|| {
                    let projectors = arguments.projector.iter().map(|projector| projector.size);
                    let [rows, cols] = first.nearest_common(&projectors.collect::<Vec<_>>());
                    Failure::new(
                        Kind::Usage,
                        format!(
                            "cells of {} cannot have as many pixels as those of the first projector",
                            name.as_deref().unwrap_or_default()
                        ),
                        format!(
                            "Leave the border away, and choose cells that divide the frames of all \
                             projectors: --rows {rows} --cols {cols}."
                        ),
                    )
                })?;
                Layout::new(grid, size, border)?
            }
            (None, Some(camera)) => Layout::proposed(size, border, camera)?,
            (None, None) => {
                // The parser asks for both.
                let (rows, cols) = (arguments.rows, arguments.cols);
                let grid = Grid::new(rows.unwrap_or_default(), cols.unwrap_or_default());
                Layout::new(grid.map_err(PatternsError::from)?, size, border)?
            }
        };
        layouts.push(layout);
    }
    Ok(layouts)
}

/// What is said of the last of these folders.
fn told(arguments: &Patterns, layout: &Layout, folders: &[PathBuf], made: Made) -> (Value, String) {
    let grid = layout.grid();
    let out = &folders[folders.len() - 1];
    let data = json!({
        "capture": out.display().to_string(),
        "rows": grid.rows(),
        "cols": grid.cols(),
        "projector": [layout.projector().width(), layout.projector().height()],
        "border": layout.border(),
        "slides": made.slides,
        "calibration": made.calibration,
        "stripes": made.stripes,
        "images": made.images,
        "seed": arguments.seed,
    });
    let mut text = format!(
        "cells       {} rows, {} columns, of about {} x {} pixels of the projector\n\
         capture     {}: {} slides of {}, {} of them to measure projector and camera, {} fine stripes\n",
        grid.rows(),
        grid.cols(),
        layout.inner().width() / grid.cols(),
        layout.inner().height() / grid.rows(),
        out.display(),
        made.slides,
        layout.projector(),
        made.calibration,
        made.stripes,
    );
    if folders.len() == arguments.projector.len() {
        let names = folders.iter().map(|folder| folder.display().to_string());
        let displays = if folders.len() > 1 { "N1,N2" } else { "N" };
        let _ = writeln!(
            text,
            "next        read {}, then `iltm capture {} --display {displays} --camera CMD`",
            out.join("README.md").display(),
            names.collect::<Vec<_>>().join(" "),
        );
    }
    (data, text)
}
