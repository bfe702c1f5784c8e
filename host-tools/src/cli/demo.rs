//! `iltm demo`

use super::args::Demo;
use super::failure::Failure;
use super::output::Output;
use super::progress::progress;
use super::summary;
use super::table_words;
use super::tables::{check, check_date};
use crate::demo::{self, DemoOutcome};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

pub(super) fn run(arguments: &Demo, output: &Output) -> Result<(), Failure> {
    let start = Instant::now();
    check_date()?;
    let bars = progress(output);
    let outcome = demo::run(&arguments.out, bars.as_ref());
    bars.end();
    let outcome = outcome?;
    let seconds = start.elapsed().as_secs_f64();
    let table = check(&outcome.paths.table, &outcome.built.compiled.image)?;
    let mut data = data(&outcome, seconds);
    for (name, value) in table_words::data(&table).as_object().into_iter().flatten() {
        data[name] = value.clone();
    }
    let mut text = table_words::lines(&outcome.paths.table, &table);
    text += &summary::remarks(&outcome.built);
    if arguments.detail.verbose {
        let _ = write!(text, "\n{}", summary::text(&outcome.built));
    }
    text += &done(&outcome, seconds);
    output.result(&data, &text);
    Ok(())
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn data(outcome: &DemoOutcome, seconds: f64) -> Value {
    let paths = &outcome.paths;
    let images = outcome
        .images
        .iter()
        .map(|(name, [uncompensated, gain_only, compensated])| {
            json!({
                "name": name,
                "uncompensated": uncompensated,
                "gain_only": gain_only,
                "compensated": compensated,
            })
        });
    let steps = outcome
        .seconds
        .iter()
        .map(|(step, seconds)| json!({ "step": step, "seconds": seconds }));
    let mut data = summary::summary(&outcome.built);
    data["capture"] = json!(shown(&paths.capture));
    data["table"] = json!(shown(&paths.table));
    data["video"] = json!(shown(&paths.video));
    data["compensated"] = json!(shown(&paths.compensated));
    data["report"] = json!(shown(&paths.report));
    data["pictures"] = json!(shown(&paths.pictures));
    data["report_bytes"] = json!(outcome.report_bytes);
    data["frames"] = json!(outcome.video.frames);
    data["clipped"] = json!(outcome.video.clipped as f64 / outcome.video.samples.max(1) as f64);
    data["images"] = images.collect();
    data["steps"] = steps.collect();
    data["seconds"] = json!(seconds);
    data
}

fn done(outcome: &DemoOutcome, seconds: f64) -> String {
    let paths = &outcome.paths;
    let mut text = String::new();
    let listed = [
        ("photographs", &paths.capture),
        ("table", &paths.table),
        ("video", &paths.video),
        ("compensated", &paths.compensated),
        ("pictures", &paths.pictures),
    ];
    let _ = writeln!(text, "\nAll done in {seconds:.1} s:");
    for (what, path) in listed {
        let _ = writeln!(text, "  {what:<12} {}", path.display());
    }
    let _ = writeln!(text, "\nOpen {} in a browser.", paths.report.display());
    text
}
