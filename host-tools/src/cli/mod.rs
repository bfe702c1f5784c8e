//! The command line. Thin: arguments in, library calls, words and codes out.
//!
//! Results go to standard output: words for people, or with `--json` one object or lines of
//! objects, the last of which says so. Progress, remarks and errors go to standard error. Where
//! frames go to standard output, all else goes to standard error.

mod active;
mod args;
mod bounces;
mod capture;
mod check;
mod compare;
mod compensate;
mod connect;
mod demo;
#[cfg(unix)]
mod emulate;
mod export;
mod failure;
mod fit;
mod flash;
mod inspect;
mod interrupt;
mod join;
mod key;
mod man;
mod monitor;
mod mpv;
mod name_parser;
mod output;
mod patterns;
mod play;
mod ports;
mod progress;
mod ranks;
mod refine;
mod simulate;
mod simulate_chain;
mod solve;
mod split;
mod status;
mod summary;
mod support_bundle;
mod table_words;
mod tables;
mod tradeoff;
mod trial;
mod verify;
mod words;

use crate::compare::Meter;
use crate::solve::Processes;
use args::{Arguments, Command};
use clap::{CommandFactory, Parser};
use failure::{Failure, Kind};
use output::Output;
use ranks::Ranks;
use std::env;
use std::process::ExitCode;

/// The command line as clap knows it: names, options, words.
#[must_use]
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Exit codes: number, name, and what each means.
#[must_use]
pub fn exit_codes() -> Vec<(u8, &'static str, &'static str)> {
    failure::Kind::codes()
}

/// Runs the command that the process was started with; `meter` reads the program's
/// allocator, if that counts.
#[must_use]
pub fn run(meter: Option<Meter>) -> ExitCode {
    match Ranks::join() {
        Ok(ranks) => ranks.run(|processes| run_alone(meter, processes)),
        Err(failure) => Output::new(asks_for_json()).failure(&failure),
    }
}

/// The same for the one process that reads and writes.
fn run_alone(meter: Option<Meter>, processes: Processes) -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refused(&error),
    };
    let output = Output::new(arguments.json);
    interrupt::begin(&output);
    let result = match &arguments.command {
        Command::Demo(demo) => demo::run(demo, &output),
        Command::Simulate(simulate) => simulate::run(simulate, &output),
        Command::Check(check) => check::run(check, &output),
        Command::Patterns(patterns) => patterns::run(patterns, &output),
        Command::Capture(capture) => capture::run(capture, &output),
        Command::Join(join) => join::run(join, &output),
        Command::Solve(solve) => solve::run(solve, processes, &output),
        Command::Inspect(inspect) => inspect::run(inspect, &output),
        Command::Compare(compare) => compare::run(compare, meter, &output),
        Command::Compensate(compensate) => compensate::run(compensate, &output),
        Command::Play(play) => play::run(play, &output),
        Command::Export(export) => export::run(export, &output),
        Command::Bounces(bounces) => bounces::run(bounces, &output),
        Command::Tradeoff(tradeoff) => tradeoff::run(tradeoff, &output),
        Command::Verify(verify) => verify::run(verify, &output),
        Command::Refine(refine) => refine::run(refine, &output),
        Command::Split(split) => split::run(split, &output),
        Command::Sign(sign) => key::sign(sign, &output),
        Command::Ports(ports) => ports::run(ports, &output),
        Command::Flash(flash) => flash::run(flash, &output),
        Command::Confirm(line) => trial::confirm(line, &output),
        Command::Rollback(line) => trial::rollback(line, &output),
        Command::Key(key) => key::run(key, &output),
        Command::Man(man) => man::run(man, &output),
        Command::Completions(completions) => {
            man::completions(completions, &output);
            Ok(())
        }
        Command::SupportBundle(bundle) => support_bundle::run(bundle, &output),
        Command::Status(status) => status::run(status, &output),
        Command::Monitor(monitor) => monitor::run(monitor, &output),
        #[cfg(unix)]
        Command::Emulate(emulate) => emulate::run(emulate, &output),
    };
    interrupt::wait_if_ending();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => output.failure(&failure),
    }
}

/// Whether the command line asks for objects, as far as it can be told without understanding it.
fn asks_for_json() -> bool {
    let mut before_files = env::args_os().take_while(|word| word != "--");
    before_files.any(|word| word == "--json")
}

/// Says that the command line cannot be understood, or prints the help that it asks for.
fn refused(error: &clap::Error) -> ExitCode {
    if error.use_stderr() && asks_for_json() {
        let said = error.to_string();
        // What is wrong ends where the usage begins.
        let wrong = said.lines().take_while(|line| !line.trim().is_empty());
        let wrong: Vec<&str> = wrong.map(str::trim).collect();
        let message = wrong.join(" ");
        let message = message.trim_start_matches("error: ");
        let next_step = "Run the command with --help.";
        return Output::new(true).failure(&Failure::new(Kind::Usage, message, next_step));
    }
    // Help that cannot be written is of no use to anybody.
    let _ = error.print();
    if error.use_stderr() {
        ExitCode::from(Kind::Usage.code())
    } else {
        ExitCode::SUCCESS
    }
}
