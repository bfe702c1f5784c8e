//! `iltm compensate --watch` and `--budget`

use super::super::args::Compensate;
use super::super::failure::{Failure, Kind};
use super::super::inspect::check;
use super::super::output::{Output, cannot_read};
use super::super::progress::progress;
use super::{failed, of_kind, opened, said, settings};
use crate::video::VideoError;
use crate::video::live::{Event, Live, LiveSummary, words};
use crate::video::watch::FileWatch;
use iltm_picture::{WholeFile, progress::Progress};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::{self, Read, Write};
use std::time::Instant;

/// Compensates a stream with a table that may change and within a budget.
pub(super) fn run(arguments: &Compensate, piped: bool, output: &Output) -> Result<(), Failure> {
    let path = &arguments.table;
    let (image, watch) = FileWatch::read(path).map_err(|error| cannot_read(path, &error))?;
    let watch = arguments.watch.then_some(watch);
    // Words about a table that is none at all are those of every command.
    check(path, &image)?;
    let bars = progress(output);
    let start = Instant::now();
    let result = if piped {
        stream(
            arguments,
            &image,
            watch.as_ref(),
            io::stdout(),
            bars.as_ref(),
            output,
        )
    } else {
        let mut whole =
            WholeFile::create(&arguments.output).map_err(|e| of_kind(Kind::Write, &e.into()))?;
        let file = whole.file();
        let summary = stream(
            arguments,
            &image,
            watch.as_ref(),
            file,
            bars.as_ref(),
            output,
        );
        if summary.is_ok() {
            whole
                .finish()
                .map_err(|e| of_kind(Kind::Write, &e.into()))?;
        }
        summary
    };
    bars.end();
    report(&result?, arguments, start.elapsed().as_secs_f64(), output);
    Ok(())
}

fn stream<W: Write + Send>(
    arguments: &Compensate,
    image: &[u8],
    watch: Option<&FileWatch>,
    out: W,
    bars: &dyn Progress,
    output: &Output,
) -> Result<LiveSummary, Failure> {
    let mut input = opened(&arguments.input)?;
    let read = |source| failed(&VideoError::Read { source });
    let first = crate::video::compensate::first_bytes(&mut input).map_err(read)?;
    if first.starts_with(&iltm_picture::png::SIGNATURE) {
        return Err(failed(&VideoError::Still));
    }
    let live = Live {
        settings: settings(arguments),
        budget: arguments.budget,
        newer: &mut || watch.and_then(FileWatch::newer),
        said: &mut |event| say(event, arguments, output),
    };
    let summary = live.y4m(image, first.chain(input), out, bars);
    summary.map_err(|error| failed(&error))
}

/// Tells at once what happened between two frames.
fn say(event: &Event, arguments: &Compensate, output: &Output) {
    let table = arguments.table.display();
    let (data, text) = match event {
        Event::Tier { frame, change } => (
            json!({
                "event": "tier",
                "frame": frame,
                "from": change.from,
                "to": change.to,
                "reason": words(change.reason),
            }),
            None,
        ),
        Event::Table { frame, id } => (
            json!({ "event": "table", "frame": frame, "id": format!("{id:08x}") }),
            Some(format!(
                "{table}: the new table {id:08x} is used from frame {frame} on\n"
            )),
        ),
        Event::Refused { frame, why } => (
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

fn report(summary: &LiveSummary, arguments: &Compensate, seconds: f64, output: &Output) {
    let (mut data, mut text) = said(&summary.frames, seconds);
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
    output.result(&data, &text);
}

fn tiers(summary: &LiveSummary) -> Value {
    let tiers = summary.tiers.iter().enumerate();
    tiers
        .map(|(tier, frames)| json!({ "tier": tier, "frames": frames }))
        .collect()
}
