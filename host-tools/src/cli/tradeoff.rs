//! `iltm tradeoff`

use super::args::Tradeoff as Arguments;
use super::failure::{Failure, Kind, cannot_read};
use super::output::{Output, make_folder, write_files};
use super::progress::progress;
use super::tables::{check, read_table};
use crate::tradeoff::{Tradeoff, TradeoffError};
use serde_json::json;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// The files, by what they hold.
const PAGE: &str = "tradeoff.html";
const PICTURE: &str = "tradeoff.svg";
const LIST: &str = "tradeoff.csv";

pub(super) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let input = &arguments.input;
    let about = fs::metadata(input).map_err(|error| cannot_read(input, &error))?;
    // Whether there is room is known before the work, not after it.
    make_folder(&arguments.output)?;
    let bars = progress(output);
    let found = if about.is_dir() {
        let found = Tradeoff::of_capture(input, bars.as_ref());
        bars.end();
        found.map_err(failed)?
    } else {
        let file = read_table(input)?;
        let table = check(input, &file)?;
        let found = Tradeoff::of_table(&input.display().to_string(), &table, bars.as_ref());
        bars.end();
        found.map_err(failed)?
    };
    let place = |name: &str| arguments.output.join(name);
    let picture = found.svg();
    let mut files = vec![(PAGE, found.html().into_bytes()), (LIST, found.csv())];
    files.extend(
        picture
            .as_ref()
            .map(|svg| (PICTURE, svg.clone().into_bytes())),
    );
    write_files(&arguments.output, &files)?;
    let mut data = found.data();
    data["page"] = json!(place(PAGE).display().to_string());
    data["picture"] = json!(picture.map(|_| place(PICTURE).display().to_string()));
    data["list"] = json!(place(LIST).display().to_string());
    output.result(&data, &text(&found, &place(PAGE)));
    Ok(())
}

fn failed(error: TradeoffError) -> Failure {
    match error {
        TradeoffError::Build(error) => error.into(),
        TradeoffError::Reference(error) => Failure::new(Kind::Capture, &error, error.next_step()),
        TradeoffError::Compile(error) => Failure::new(Kind::Solve, &error, error.next_step()),
        TradeoffError::Table(_) | TradeoffError::Operator(_) | TradeoffError::Timing(_) => {
            Failure::new(
                Kind::Table,
                error,
                "Please report this with the capture or the table: it should never get here.",
            )
        }
    }
}

fn text(found: &Tradeoff, page: &Path) -> String {
    let mut text = String::new();
    let front = found.points.iter().filter(|point| point.front).count();
    let _ = writeln!(
        text,
        "points      {}, {front} of them on the front of error against instructions",
        found.points.len()
    );
    for (index, missing) in found.missing.iter().enumerate() {
        let name = if index == 0 { "not there" } else { "" };
        let _ = writeln!(text, "{name:<11} {}: {}", missing.what, missing.why);
    }
    let _ = writeln!(text, "advice      {}", found.advice());
    let _ = writeln!(text, "\nOpen {} in a browser.", page.display());
    text
}
