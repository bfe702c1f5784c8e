//! `iltm compensate`

mod live;

use super::args::Compensate;
use super::failure::{Failure, Kind};
use super::inspect::check;
use super::output::{Output, cannot_read, read_file};
use super::progress::progress;
use crate::video::y4m::Y4mError;
use crate::video::{Compensator, Settings, Summary, VideoError};
use iltm_picture::{WholeFile, png::PngError};
use iltm_runtime::pipeline::Encoding;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::time::Instant;

pub(super) fn run(arguments: &Compensate, output: &Output) -> Result<(), Failure> {
    let piped = is_pipe(&arguments.output);
    if piped && output.is_json() {
        return Err(Failure::new(
            Kind::Usage,
            "standard output cannot carry both the frames and JSON",
            "Give a file with --output, or leave --json away.",
        ));
    }
    if arguments.watch || arguments.budget.is_some() {
        return live::run(arguments, piped, output);
    }
    let image = read_file(&arguments.table)?;
    let table = check(&arguments.table, &image)?;
    let settings = settings(arguments);
    let compensator = Compensator::new(&table, settings).map_err(|error| failed(&error))?;
    let input = opened(&arguments.input)?;
    let bars = progress(output);
    let start = Instant::now();
    let summary = if piped {
        let summary = compensator.stream(input, io::stdout(), bars.as_ref());
        summary.map_err(|error| failed(&error))?
    } else {
        let mut whole =
            WholeFile::create(&arguments.output).map_err(|e| of_kind(Kind::Write, &e.into()))?;
        let summary = compensator.stream(input, whole.file(), bars.as_ref());
        let summary = summary.map_err(|error| failed(&error))?;
        whole
            .finish()
            .map_err(|e| of_kind(Kind::Write, &e.into()))?;
        summary
    };
    report(&summary, start.elapsed().as_secs_f64(), output);
    Ok(())
}

fn settings(arguments: &Compensate) -> Settings {
    Settings {
        tier: arguments.tier,
        encoding: if arguments.linear {
            Encoding::Linear
        } else {
            Encoding::Display
        },
        ..Settings::default()
    }
}

/// The input, from its beginning.
fn opened(input: &Path) -> Result<Box<dyn Read + Send>, Failure> {
    if is_pipe(input) {
        return Ok(Box::new(io::stdin()));
    }
    let file = File::open(input).map_err(|error| cannot_read(input, &error))?;
    Ok(Box::new(file))
}

/// `-` stands for standard input or output.
fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-"
}

fn report(summary: &Summary, seconds: f64, output: &Output) {
    let (data, text) = said(summary, seconds);
    output.result(&data, &text);
}

/// What was done, for programs and for people.
fn said(summary: &Summary, seconds: f64) -> (Value, String) {
    let share = 100.0 * summary.clipped as f64 / summary.samples.max(1) as f64;
    let data = json!({
        "width": summary.size.width(),
        "height": summary.size.height(),
        "frames": summary.frames,
        "samples": summary.samples,
        "clipped": summary.clipped,
        "seconds": seconds,
    });
    let frames = match summary.frames {
        1 => "1 frame".to_owned(),
        frames => format!("{frames} frames"),
    };
    let text = format!(
        "{frames} of {} in {seconds:.2} s, {share:.2} % of the samples clipped\n",
        summary.size
    );
    (data, text)
}

/// What a failure while frames flow is counted as.
pub(super) fn failed(error: &VideoError) -> Failure {
    let kind = match error {
        VideoError::NoSuchTier { .. } | VideoError::Threads { .. } | VideoError::Still => {
            Kind::Usage
        }
        VideoError::Table(_) => Kind::Table,
        VideoError::Read { .. } => Kind::Read,
        VideoError::File { .. } => Kind::Write,
        VideoError::Y4m(Y4mError::Write { .. }) | VideoError::Png(PngError::Write { .. }) => {
            Kind::Write
        }
        VideoError::Y4m(Y4mError::Read { .. }) | VideoError::Png(PngError::Read { .. }) => {
            Kind::Read
        }
        _ => Kind::Frames,
    };
    of_kind(kind, error)
}

fn of_kind(kind: Kind, error: &VideoError) -> Failure {
    Failure::new(kind, error, error.next_step())
}
