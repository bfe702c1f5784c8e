//! `iltm check`

use super::args::Check;
use super::failure::{Failure, Kind};
use super::output::Output;
use super::progress::progress;
use crate::capture::{self, CaptureOptions, Examined, Gate, Verdict};
use crate::learn::LearnError;
use serde_json::{Value, json};
use std::fmt::Write;

pub(super) fn run(arguments: &Check, output: &Output) -> Result<(), Failure> {
    let options = CaptureOptions {
        bernoulli: arguments.photos,
        // A few stripes are enough to say whether a rig is in order.
        min_bernoulli: 0,
        ..CaptureOptions::default()
    };
    let bars = progress(output);
    let examined = capture::examine(&arguments.capture, &options, bars.as_ref());
    bars.end();
    let examined = examined.map_err(LearnError::Capture)?;
    let failed = failed(&examined.gates);
    let data = json!({
        "capture": arguments.capture.display().to_string(),
        "pass": failed.is_empty(),
        "gates": gates(&examined.gates),
        "cells": cells(&examined),
    });
    let text = text(&examined.gates);
    if failed.is_empty() {
        output.result(&data, &text);
        return Ok(());
    }
    output.people(&text);
    let mut failure = refusal(&arguments.capture.display().to_string(), &failed);
    failure.data = Some(Box::new(data));
    Err(failure)
}

/// The gates that fail.
fn failed(gates: &[Gate]) -> Vec<&Gate> {
    gates.iter().filter(|gate| gate.fails()).collect()
}

/// What scripts get for a capture that does not pass.
fn refusal(capture: &str, failed: &[&Gate]) -> Failure {
    let names: Vec<&str> = failed.iter().map(|gate| gate.name.name()).collect();
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

/// The gates for programs.
pub(super) fn gates(gates: &[Gate]) -> Vec<Value> {
    let gate = |gate: &Gate| {
        json!({
            "name": gate.name.name(),
            "verdict": gate.verdict.name(),
            "number": gate.number,
            "limit": gate.limit,
            "unit": gate.unit,
            "what": gate.what,
            "next_step": gate.next_step,
        })
    };
    gates.iter().map(gate).collect()
}

/// The gates for people, one or two lines each.
fn text(gates: &[Gate]) -> String {
    let mut text = String::new();
    for gate in gates {
        let mark = match gate.verdict {
            Verdict::Pass => "ok  ",
            Verdict::NotJudged => "-   ",
            Verdict::Warn => "warn",
            Verdict::Fail => "FAIL",
        };
        let number = number(gate);
        let _ = writeln!(text, "{mark} {:<13} {number:<24} {}", gate.name, gate.what);
        if !gate.next_step.is_empty() {
            let _ = writeln!(text, "{:44}-> {}", "", gate.next_step);
        }
    }
    text
}

/// A gate's number against its limit.
fn number(gate: &Gate) -> String {
    if gate.verdict == Verdict::NotJudged {
        return "not judged".to_owned();
    }
    let digits = if gate.number.fract() == 0.0 && gate.limit.fract() == 0.0 {
        0
    } else {
        2
    };
    let unit = if gate.unit == "photographs" {
        ""
    } else {
        gate.unit
    };
    let space = if unit == "%" || unit.is_empty() {
        ""
    } else {
        " "
    };
    format!(
        "{:.digits$}{space}{unit} (limit {:.digits$})",
        gate.number, gate.limit
    )
}
