//! `iltm tradeoff`

use super::args::Tradeoff as Arguments;
use super::failure::{Failure, Kind, cannot_read, cannot_write};
use super::output::{Output, read_file, write_file};
use super::progress::progress;
use super::tables::check;
use crate::tradeoff::{Tradeoff, TradeoffError};
use serde_json::json;
use std::fmt::Write;
use std::fs;
use std::io::ErrorKind;
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
        let file = read_file(input)?;
        let table = check(input, &file)?;
        let found = Tradeoff::of_table(&input.display().to_string(), &table, bars.as_ref());
        bars.end();
        found.map_err(failed)?
    };
    let place = |name: &str| arguments.output.join(name);
    let picture = found.svg();
    write_file(&place(PAGE), found.html().as_bytes())?;
    if let Some(picture) = &picture {
        write_file(&place(PICTURE), picture.as_bytes())?;
    }
    write_file(&place(LIST), &found.csv())?;
    let mut data = found.data();
    data["page"] = json!(place(PAGE).display().to_string());
    data["picture"] = json!(picture.map(|_| place(PICTURE).display().to_string()));
    data["list"] = json!(place(LIST).display().to_string());
    output.result(&data, &text(&found, &place(PAGE)));
    Ok(())
}

fn make_folder(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => Failure::new(
            Kind::Write,
            format!(
                "{}: cannot be made: a file is in its place",
                folder.display()
            ),
            "Move it away, or choose another folder with -o.",
        ),
        _ => cannot_write(folder, &error),
    })
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
