//! Two more pictures of a capture: what accuracy costs in time, and its light bounce by bounce.

use super::File;
use super::results::PaperError;
use iltm_picture::{png::encode_small, progress::Progress};
use iltm_report::{
    bounces::{self, BouncesOptions},
    tradeoff::Tradeoff,
};
use std::path::Path;

/// The files, and what they say in a line.
#[derive(Debug)]
pub(super) struct Sample {
    pub(super) files: Vec<File>,
    /// The one line of advice.
    pub(super) advice: String,
    /// Share of the light that is direct, and what the second bounce has of it.
    pub(super) shares: (f64, f64),
}

/// Both pictures of the capture in `folder`.
pub(super) fn pictures(folder: &Path, progress: &dyn Progress) -> Result<Sample, PaperError> {
    let failed = |error: &dyn std::error::Error| PaperError::Sample {
        why: error.to_string(),
    };
    let found = Tradeoff::of_capture(folder, progress).map_err(|error| failed(&error))?;
    let light = bounces::bounces(folder, &BouncesOptions::default(), progress)
        .map_err(|error| failed(&error))?;
    let sheet = bounces::sheet(&light).ok_or(PaperError::Picture {
        what: "the bounces",
    })?;
    let picture = found.svg().ok_or(PaperError::Picture {
        what: "the trade-off",
    })?;
    let file = |name: &str, bytes| File {
        name: name.to_owned(),
        bytes,
    };
    let share = |layer: usize| {
        let layer = light.separated.layers.get(layer);
        layer.map_or(0.0, |layer| layer.light_share)
    };
    Ok(Sample {
        files: vec![
            file("tradeoff.svg", picture.into_bytes()),
            file("tradeoff.csv", found.csv()),
            file("tradeoff.html", found.html().into_bytes()),
            file("bounces.png", encode_small(&sheet)),
        ],
        advice: found.advice(),
        shares: (share(0), share(1)),
    })
}
