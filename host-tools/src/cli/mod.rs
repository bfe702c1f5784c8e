//! The command line. Thin: arguments in, library calls, words and codes out.
//!
//! People read standard error; standard output carries data: a video stream, or
//! with `--json` one JSON object and nothing else.

mod args;
mod compensate;
mod demo;
mod failure;
mod inspect;
mod output;
mod progress;
mod solve;

use args::{Arguments, Command};
use clap::Parser;
use output::Output;
use std::process::ExitCode;

/// Runs the command that the process was started with.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = Arguments::parse();
    let output = Output::new(arguments.json);
    let result = match &arguments.command {
        Command::Demo(demo) => demo::run(demo, &output),
        Command::Solve(solve) => solve::run(solve, &output),
        Command::Inspect(inspect) => inspect::run(inspect, &output),
        Command::Compensate(compensate) => compensate::run(compensate, &output),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => output.failure(&failure),
    }
}
