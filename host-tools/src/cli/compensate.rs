//! `iltm compensate`

use super::args::Compensate;
use super::failure::{Failure, Kind, cannot_read};
use super::output::Output;
use super::progress::progress;
use super::tables::{check_whole, read_table, watch_table};
use super::words::advice_for_white;
use crate::compile::Provenance;
use crate::video::live::{Live, LiveEvent, LiveSummary, words};
use crate::video::pipe;
use crate::video::watch::FileWatch;
use crate::video::y4m::Y4mError;
use crate::video::{CompensateOptions, Compensator, FrameTotals, Input, VideoError};
use iltm_picture::{WholeFile, foreign_file};
use iltm_runtime::pipeline::Encoding;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;
use std::time::Instant;

pub(super) fn run(arguments: &Compensate, output: &Output) -> Result<(), Failure> {
    if is_pipe(&arguments.output) && output.is_json() {
        return Err(Failure::new(
            Kind::Usage,
            "standard output cannot carry both the frames and JSON",
            "Give a file with --output, or leave --json away.",
        ));
    }
    let path = &arguments.table;
    let (image, watch) = if arguments.watch {
        let (image, watch) = watch_table(path)?;
        (image, Some(watch))
    } else {
        (read_table(path)?, None)
    };
    let table = check_whole(path, &image)?;
    let settings = settings(arguments);
    let compensator = Compensator::new(&table, settings)?;
    let input = opened(&arguments.input)?;
    fits_name(&input, &arguments.output)?;
    let bars = progress(output);
    let start = Instant::now();
    let (summary, live) = written(&arguments.output, output, |out| {
        if watch.is_none() && arguments.budget.is_none() {
            let summary = compensator.input(input, out, bars.as_ref())?;
            return Ok((summary, None));
        }
        let live = Live {
            budget: arguments.budget,
            newer: &mut || watch.as_ref().and_then(FileWatch::newer),
            said: &mut |event| say(event, arguments, output),
        };
        let summary = compensator.live(live, input, out, bars.as_ref())?;
        Ok((summary.frames, Some(summary)))
    })?;
    let brightness = Provenance::read(table.provenance()).brightness;
    let (mut data, totals) = totals(&summary, start.elapsed().as_secs_f64());
    data["brightness"] = json!(brightness);
    let gpu = compensator.gpu(summary.size);
    data["gpu"] = json!(gpu);
    let mut text = brightness.map_or_else(String::new, |brightness| brightness.words() + "\n");
    text += &totals;
    if let Some(gpu) = gpu {
        let _ = writeln!(text, "frames   made by {gpu}");
    }
    if let Some(live) = live {
        add_live(&live, arguments, &mut data, &mut text);
    }
    if is_pipe(&arguments.output) {
        output.people(&text);
    } else {
        output.result(&data, &text);
    }
    Ok(())
}

fn settings(arguments: &Compensate) -> CompensateOptions {
    CompensateOptions {
        tier: arguments.tier,
        encoding: if arguments.linear {
            Encoding::Linear
        } else {
            Encoding::Display
        },
        fit: arguments.fit,
        gpu: arguments.gpu,
        ..CompensateOptions::default()
    }
}

/// The input, from its beginning.
fn opened(path: &Path) -> Result<Input<Box<dyn Read + Send>>, Failure> {
    let input: Box<dyn Read + Send> = if is_pipe(path) {
        let stdin = io::stdin();
        pipe::widen(&stdin);
        Box::new(stdin)
    } else {
        Box::new(foreign_file::open(path).map_err(|error| cannot_read(path, &error))?)
    };
    Ok(Input::of(input)?)
}

/// The output is of the input's kind: a name that says otherwise would mislead whoever opens
/// it.
fn fits_name<R>(input: &Input<R>, output: &Path) -> Result<(), Failure> {
    let ending = output.extension().unwrap_or_default();
    let says = |kind: &str| ending.eq_ignore_ascii_case(kind);
    let (given, other) = if input.is_png() {
        ("a PNG picture", "y4m")
    } else {
        ("a Y4M stream", "png")
    };
    if !says(other) {
        return Ok(());
    }
    Err(Failure::new(
        Kind::Usage,
        format!(
            "{}: the input is {given}, and the output becomes one",
            output.display()
        ),
        "Give --output the ending of the input, or convert with ffmpeg before or after.",
    ))
}

/// What `write` writes, on standard output, or in a file that is there whole or not at all.
fn written<T>(
    path: &Path,
    output: &Output,
    write: impl FnOnce(&mut (dyn Write + Send)) -> Result<T, VideoError>,
) -> Result<T, Failure> {
    if is_pipe(path) {
        output.give_frames();
        let stdout = standard_output().map_err(|source| Y4mError::Write { frame: 0, source });
        let mut stdout = stdout.map_err(VideoError::from)?;
        return Ok(write(&mut stdout)?);
    }
    let mut whole = WholeFile::create(path).map_err(VideoError::from)?;
    let done = write(whole.file())?;
    whole.finish().map_err(VideoError::from)?;
    Ok(done)
}

/// Standard output, which the library would search for line ends, sample by sample.
fn standard_output() -> io::Result<File> {
    let stdout = io::stdout();
    #[cfg(windows)]
    let handle = std::os::windows::io::AsHandle::as_handle(&stdout);
    #[cfg(not(windows))]
    let handle = std::os::fd::AsFd::as_fd(&stdout);
    let stdout = File::from(handle.try_clone_to_owned()?);
    pipe::widen(&stdout);
    Ok(stdout)
}

/// `-` stands for standard input or output.
fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// What was done, for programs and for people.
fn totals(summary: &FrameTotals, seconds: f64) -> (Value, String) {
    let share = |count: u64| 100.0 * count as f64 / summary.samples.max(1) as f64;
    let white = share(summary.clipped_white);
    let black = share(summary.clipped - summary.clipped_white);
    let data = json!({
        "width": summary.size.width(),
        "height": summary.size.height(),
        "frames": summary.frames,
        "samples": summary.samples,
        "clipped": summary.clipped,
        "clipped_white": summary.clipped_white,
        "cut_short": summary.cut_short,
        "seconds": seconds,
    });
    let frames = match summary.frames {
        1 => "1 frame".to_owned(),
        frames => format!("{frames} frames"),
    };
    let mut text = format!(
        "{frames} of {} in {seconds:.2} s\n\
         cut off  {white:.2} % of the samples are too bright for the projector's white, \
         {black:.2} % darker than its black\n",
        summary.size
    );
    if let Some(advice) = advice_for_white(white) {
        let _ = writeln!(text, "         {advice}");
    }
    if summary.cut_short {
        text += "         the program that takes the frames ended before the last one: the rest is lost\n";
    }
    (data, text)
}

/// Tells at once what happened between two frames.
fn say(event: &LiveEvent, arguments: &Compensate, output: &Output) {
    let table = arguments.table.display();
    let (data, text) = match event {
        LiveEvent::Tier { frame, change } => (
            json!({
                "event": "tier",
                "frame": frame,
                "from": change.from,
                "to": change.to,
                "reason": words(change.reason),
            }),
            None,
        ),
        LiveEvent::Table { frame, id } => (
            json!({ "event": "table", "frame": frame, "id": format!("{id:08x}") }),
            Some(format!(
                "{table}: the new table {id:08x} is used from frame {frame} on\n"
            )),
        ),
        LiveEvent::Refused { frame, why } => (
            json!({ "event": "refused", "frame": frame, "reason": why.to_string() }),
            Some(format!(
                "{table}: changed, but {why}; the table before stays in use\n"
            )),
        ),
    };
    output.event(&data);
    if let Some(text) = text {
        output.people(&text);
    }
}

/// Adds what happened with `--watch` and `--budget`.
fn add_live(summary: &LiveSummary, arguments: &Compensate, data: &mut Value, text: &mut String) {
    data["event"] = json!("end");
    data["tiers"] = tiers(summary);
    data["slowest_ms"] = json!(1e3 * summary.slowest.as_secs_f64());
    data["tables"] = json!(summary.tables);
    data["refused"] = json!(summary.refused);
    if let Some(budget) = arguments.budget {
        let budget = 1e3 * budget.as_secs_f64();
        data["budget_ms"] = json!(budget);
        data["overruns"] = json!(summary.overruns);
        let used = summary
            .tiers
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0);
        let used: Vec<String> = used
            .map(|(tier, count)| format!("{count} at tier {tier}"))
            .collect();
        let _ = writeln!(
            text,
            "budget {budget} ms: frames {}; {} took longer, {:.1} ms the longest",
            used.join(", "),
            summary.overruns,
            1e3 * summary.slowest.as_secs_f64()
        );
    }
    if summary.tables + summary.refused > 0 {
        let _ = writeln!(
            text,
            "new tables: {} taken, {} refused",
            summary.tables, summary.refused
        );
    }
}

fn tiers(summary: &LiveSummary) -> Value {
    let tiers = summary.tiers.iter().enumerate();
    tiers
        .map(|(tier, frames)| json!({ "tier": tier, "frames": frames }))
        .collect()
}
