//! `iltm patterns`

use super::args::Patterns;
use super::failure::Failure;
use super::output::Output;
use super::progress::progress;
use crate::capture::MIN_BERNOULLI;
use crate::session::{self, Layout, OrderOptions, PatternsError};
use iltm_runtime::Grid;
use serde_json::json;

pub(super) fn run(arguments: &Patterns, output: &Output) -> Result<(), Failure> {
    let out = &arguments.output;
    // A folder that is in the way is known before the work, not after it.
    iltm_picture::check_free(out)?;
    let (projector, border) = (arguments.projector, arguments.border);
    let layout = if let Some(camera) = arguments.camera_size {
        Layout::proposed(projector, border, camera)?
    } else {
        // The parser asks for both.
        let (rows, cols) = (arguments.rows, arguments.cols);
        let grid = Grid::new(rows.unwrap_or_default(), cols.unwrap_or_default());
        Layout::new(grid.map_err(PatternsError::from)?, projector, border)?
    };
    let grid = layout.grid();
    let images = match &arguments.images {
        Some(folder) => session::stills(folder, layout.inner())?,
        None => Vec::new(),
    };
    let given = usize::from(arguments.photos) + images.len();
    if given < MIN_BERNOULLI {
        return Err(PatternsError::TooFew { given }.into());
    }
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
    let slides = session::order(&layout, &options);
    let bars = progress(output);
    let made = session::write(&slides, &layout, &arguments.camera, out, bars.as_ref())?;
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
    let text = format!(
        "cells       {} rows, {} columns, of about {} x {} pixels of the projector\n\
         capture     {}: {} slides of {}, {} of them to measure projector and camera, {} fine stripes\n\
         next        read {}, then `iltm capture {} --display N --camera CMD`\n",
        grid.rows(),
        grid.cols(),
        layout.inner().width() / grid.cols(),
        layout.inner().height() / grid.rows(),
        out.display(),
        made.slides,
        layout.projector(),
        made.calibration,
        made.stripes,
        out.join("README.md").display(),
        out.display(),
    );
    output.result(&data, &text);
    Ok(())
}
