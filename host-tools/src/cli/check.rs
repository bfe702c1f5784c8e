//! `iltm check`

use super::args::Check;
use super::failure::{Failure, Kind};
use super::output::{Output, printable, write_file, write_files};
use super::progress::progress;
use super::summary::{gates, map_fault};
use crate::capture::{
    self, CaptureOptions, CrossingLight, Examined, ExaminedSeveral, Gate, MapSource, ProjectorMap,
    Verdict,
};
use crate::report;
use console::{Term, style};
use iltm_picture::{numbers::percent, progress::Progress};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;
use textwrap::Options;

/// The page's name in the folder that `-o` gives.
const PAGE_FILE: &str = "check.html";

pub(super) fn run(arguments: &Check, output: &Output) -> Result<(), Failure> {
    let options = CaptureOptions {
        bernoulli: arguments.photos,
        // A few stripes are enough to say whether a rig is in order.
        min_bernoulli: 0,
        coarsen: true,
        ..CaptureOptions::default()
    };
    let bars = progress(output);
    let [capture] = &arguments.captures[..] else {
        let several = several(arguments, &options, bars.as_ref(), output);
        bars.end();
        return several;
    };
    let examined = capture::examine(capture, &options, bars.as_ref());
    bars.end();
    let examined = examined?;
    let failed = failed(&examined.gates);
    let page = arguments.output.as_deref().map(|folder| {
        let html = report::gates::page(&name(capture), &examined);
        write_files(folder, &[(PAGE_FILE, html)])?;
        Ok::<_, Failure>(folder.join(PAGE_FILE))
    });
    let page = page.transpose()?;
    let map = map(arguments, capture, &examined)?;
    let (mut data, mut text, remarks) = found(capture, &examined);
    data["map"] = json!(map.as_ref().map(|map| json!({
        "source": map.source.name(),
        "projector": [map.projector.size().width(), map.projector.size().height()],
        "camera": [map.camera.0, map.camera.1],
        "binning": map.binning,
        "known": map.known(),
        "uncertainty": map.usual_uncertainty(),
    })));
    data["page"] = json!(page.as_ref().map(|page| page.display().to_string()));
    if let (Some(map), Some((path, _))) = (&map, &arguments.map) {
        let _ = writeln!(text, "{}: {}", path.display(), words(map));
    }
    if let Some(page) = &page {
        let _ = writeln!(text, "{}: what each gate saw", page.display());
    }
    if failed.is_empty() {
        text += &passed(&remarks, &not_judged(&examined.gates));
        output.dressed_result(&data, &dressed(&text));
        return Ok(());
    }
    output.dressed_findings(&dressed(&text));
    let failure = refusal(&capture.display().to_string(), &failed);
    Err(failure.with_result(data))
}

/// Checks captures of several projectors, and that they belong together.
fn several(
    arguments: &Check,
    options: &CaptureOptions,
    bars: &dyn Progress,
    output: &Output,
) -> Result<(), Failure> {
    if arguments.output.is_some() || arguments.map.is_some() {
        return Err(Failure::new(
            Kind::Usage,
            "--output and --map are of the capture of one projector".to_owned(),
            "Leave them away, or check the captures one by one.",
        ));
    }
    let ExaminedSeveral {
        each,
        between,
        light,
    } = capture::examine_several(&arguments.captures, options, bars)?;
    bars.end();
    let (mut captures, mut lines, mut remarks) = (Vec::new(), String::new(), Vec::new());
    for (capture, examined) in arguments.captures.iter().zip(&each) {
        let (data, own, noted) = found(capture, examined);
        captures.push(data);
        let _ = write!(lines, "{}\n{own}\n", capture.display());
        remarks.extend(noted);
    }
    let names: Vec<String> = (arguments.captures.iter())
        .map(|capture| capture.display().to_string())
        .collect();
    let together = names.join(" and ");
    if between.is_empty() {
        let _ = writeln!(
            lines,
            "{together}: not compared, since one was not measured\n"
        );
    } else {
        let _ = write!(lines, "{together}\n{}", text(&between));
        for crossing in &light {
            let _ = writeln!(lines, "{}", crossing_words(crossing, &names));
        }
        lines.push('\n');
    }
    remarks.extend(warned(&between));
    let all: Vec<Gate> = each
        .iter()
        .flat_map(|examined| &examined.gates)
        .chain(&between)
        .cloned()
        .collect();
    let (failed, open) = (failed(&all), not_judged(&all));
    let data = json!({
        "captures": captures,
        "between": gates(&between),
        "light": light.iter().map(|crossing| json!({
            "from": crossing.from + 1,
            "to": crossing.to + 1,
            "bounced": crossing.bounced,
            "overlap": crossing.overlap,
        })).collect::<Vec<_>>(),
        "pass": failed.is_empty(),
    });
    let once = |mut names: Vec<&'static str>| {
        let mut seen = HashSet::new();
        names.retain(|name| seen.insert(*name));
        names
    };
    if failed.is_empty() {
        lines += &passed(&once(remarks), &once(open));
        output.dressed_result(&data, &dressed(&lines));
        return Ok(());
    }
    output.dressed_findings(&dressed(&lines));
    Err(refusal(&together, &failed).with_result(data))
}

/// Who lights whom, a line of the names of captures.
fn crossing_words(crossing: &CrossingLight, names: &[String]) -> String {
    let (from, to) = (&names[crossing.from], &names[crossing.to]);
    let bounced = percent(crossing.bounced);
    let overlap = if crossing.overlap > 0.0 {
        format!(
            ", and {:.0} % of {to}'s picture, as the camera sees it, is lit by both",
            100.0 * crossing.overlap
        )
    } else {
        String::new()
    };
    format!("     light         {from}'s white adds {bounced} to what {to} lights alone{overlap}")
}

/// What was found in a capture: for programs, for people, and names of what can be lived with.
fn found(capture: &Path, examined: &Examined) -> (Value, String, Vec<&'static str>) {
    let failed = failed(&examined.gates);
    let fault = match examined.measurements.as_ref().map(|m| &m.map) {
        Some(Some(Err(fault))) => Some(map_fault(fault)),
        _ => None,
    };
    let data = json!({
        "capture": capture.display().to_string(),
        "pass": failed.is_empty(),
        "not_judged": not_judged(&examined.gates),
        "gates": gates(&examined.gates),
        "cells": cells(examined),
        "map_fault": fault,
    });
    let mut text = text(&examined.gates);
    let mut remarks = warned(&examined.gates);
    // What refuses the photographs explains the stripes too.
    if let (Some(fault), []) = (&fault, &failed[..]) {
        let _ = writeln!(text, "warn stripes       {fault}");
        remarks.push("stripes");
    }
    let measured = examined.measurements.as_ref();
    if let Some(missing) = measured.and_then(|m| m.devices.uncalibrated()) {
        let _ = writeln!(text, "warn calibration   {missing}");
        remarks.push("calibration");
    }
    (data, text, remarks)
}

/// Writes the projector map where one is asked for.
fn map(
    arguments: &Check,
    capture: &Path,
    examined: &Examined,
) -> Result<Option<ProjectorMap>, Failure> {
    let Some((path, format)) = &arguments.map else {
        return Ok(None);
    };
    let capture = capture.display();
    // Without cells, the gates say why.
    let Some(measurements) = &examined.measurements else {
        return Ok(None);
    };
    let map = match &measurements.map {
        Some(Ok(map)) => map.clone(),
        Some(Err(error)) => {
            let message = format!("{capture}: {error}");
            return Err(Failure::new(Kind::Photographs, message, error.next_step()));
        }
        None => ProjectorMap::of_cells(measurements),
    };
    let bytes = map.file(*format).map_err(|error| {
        let message = format!("{}: {error}", path.display());
        Failure::new(Kind::Write, message, "Write it as .npy.")
    })?;
    write_file(path, &bytes)?;
    Ok(Some(map))
}

/// What a map is, for people.
fn words(map: &ProjectorMap) -> String {
    let projector = map.projector.size();
    let from = match map.source {
        MapSource::Waves => "from fine stripes".to_owned(),
        MapSource::Code => "from the Gray code".to_owned(),
        MapSource::Images => "from the photographs of images".to_owned(),
        MapSource::Cells => "from the cells alone, since there are no finer stripes".to_owned(),
    };
    format!(
        "{} of {} camera pixels see a place of {projector}, known to {:.2} pixels, {from}",
        map.known(),
        map.position.len(),
        map.usual_uncertainty().unwrap_or(f32::NAN),
    )
}

/// The capture's name for people.
fn name(capture: &Path) -> String {
    let known = capture
        .canonicalize()
        .unwrap_or_else(|_| capture.to_owned());
    let name = known.file_name().unwrap_or(known.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The gates that fail.
fn failed(gates: &[Gate]) -> Vec<&Gate> {
    gates.iter().filter(|gate| gate.fails()).collect()
}

/// Names of the gates that were not judged.
fn not_judged(gates: &[Gate]) -> Vec<&'static str> {
    let open = gates
        .iter()
        .filter(|gate| gate.verdict == Verdict::NotJudged);
    open.map(|gate| gate.name.name()).collect()
}

/// Names of the gates that found something that can be lived with.
fn warned(gates: &[Gate]) -> Vec<&'static str> {
    let warn = |gate: &&Gate| gate.verdict == Verdict::Warn;
    gates.iter().filter(warn).map(|g| g.name.name()).collect()
}

/// The last line of a check that no gate fails.
fn passed(remarks: &[&str], open: &[&str]) -> String {
    let mut line = "passed".to_owned();
    if !open.is_empty() {
        let _ = write!(
            line,
            ", as far as it was judged: nothing is known of {}",
            open.join(", ")
        );
    }
    if remarks.is_empty() {
        if open.is_empty() {
            line += ": these photographs can be used";
        }
    } else {
        let _ = write!(line, "; see the remarks on {} above", remarks.join(", "));
    }
    line + "\n"
}

/// What scripts get for a capture that does not pass.
fn refusal(capture: &str, failed: &[&Gate]) -> Failure {
    let mut names: Vec<&str> = failed.iter().map(|gate| gate.name.name()).collect();
    names.dedup();
    let message = format!(
        "{capture}: the photographs do not pass {}",
        names.join(", ")
    );
    let next_step = failed.first().map_or("", |gate| gate.next_step);
    Failure::new(Kind::Photographs, message, next_step)
}

fn cells(examined: &Examined) -> Value {
    examined.measurements.as_ref().map_or(Value::Null, |m| {
        json!({
            "rows": m.grid.rows(),
            "cols": m.grid.cols(),
            "live": m.live.iter().filter(|live| **live).count(),
        })
    })
}

/// The gates for people, one or two lines each.
pub(super) fn text(gates: &[Gate]) -> String {
    let mut text = String::new();
    for gate in gates {
        let mark = match gate.verdict {
            Verdict::Pass => "ok  ",
            Verdict::NotJudged => "-   ",
            Verdict::Warn => "warn",
            Verdict::Fail => "FAIL",
        };
        let number = match gate.verdict {
            Verdict::NotJudged => "not judged".to_owned(),
            _ => gate.number_and_limit(),
        };
        let _ = writeln!(text, "{mark} {:<13} {number:<24} {}", gate.name, gate.what);
        if !gate.next_step.is_empty() {
            let _ = writeln!(text, "{}-> {}", " ".repeat(INDENT), gate.next_step);
        }
    }
    text
}

/// Column of what a gate has found: behind its mark and its name.
const INDENT: usize = 19;

/// The text as it is printed: in a terminal in its width, with colours where it has some.
pub(super) fn dressed(text: &str) -> String {
    let text = printable(text);
    let terminal = Term::stdout();
    if terminal.is_term() {
        wrapped(&text, terminal.size().1.into(), console::colors_enabled())
    } else {
        text.into_owned()
    }
}

/// Lines of a width, and marks in the colour of their verdict.
fn wrapped(text: &str, width: usize, colours: bool) -> String {
    let indent = " ".repeat(INDENT);
    let mut dressed = String::new();
    for line in text.lines() {
        let (mark, _) = line.split_at_checked(5).unwrap_or_default();
        let coloured = match mark {
            "ok   " => Some(style(mark).green()),
            "warn " => Some(style(mark).yellow()),
            "FAIL " => Some(style(mark).red().bold()),
            _ => None,
        };
        let hangs = coloured.is_some() || mark == "-    " || line.starts_with(' ');
        let indent = if hangs { &indent } else { "" };
        let filled = textwrap::fill(line, Options::new(width).subsequent_indent(indent));
        let _ = match coloured.zip(filled.strip_prefix(mark)) {
            Some((mark, rest)) => writeln!(dressed, "{}{rest}", mark.force_styling(colours)),
            None => writeln!(dressed, "{filled}"),
        };
    }
    dressed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_gets_lines_of_its_width_and_marks_in_colours() {
        let text = "FAIL order         2 (limit 0)              two photographs are exchanged\n\
                    \x20                  -> Put them back in the order of the list.\n\
                    passed as far as it was judged and no farther than that\n";
        let plain = "FAIL order         2 (limit 0)\n\
                     \x20                  two photographs are\n\
                     \x20                  exchanged\n\
                     \x20                  -> Put them back in\n\
                     \x20                  the order of the\n\
                     \x20                  list.\n\
                     passed as far as it was judged and no\n\
                     farther than that\n";
        assert_eq!(wrapped(text, 40, false), plain);
        let red = plain.replacen("FAIL ", "\x1b[31m\x1b[1mFAIL \x1b[0m", 1);
        assert_eq!(wrapped(text, 40, true), red);
    }
}
