//! `iltm man` and `iltm completions`: what the command line knows about itself.

use super::args::{Arguments, Completions, Man};
use super::failure::{Failure, cannot_write};
use super::output::{Output, write_files};
use clap::CommandFactory;
use serde_json::json;
use std::io::{self, Write};

/// Writes a manual page for `iltm` and one for each command, in section 1.
pub(super) fn run(arguments: &Man, output: &Output) -> Result<(), Failure> {
    let folder = &arguments.output;
    let mut pages = Vec::new();
    let mut command = super::command();
    // Options that all commands have stand on the page of each.
    command.build();
    collect(command, "", &mut pages).map_err(|error| cannot_write(folder, &error))?;
    write_files(folder, &pages)?;
    let names: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    let data = json!({ "folder": folder.display().to_string(), "pages": names });
    let text = format!("{}: {} manual pages\n", folder.display(), names.len());
    output.result(&data, &text);
    Ok(())
}

/// The page of a command and those of its own commands.
fn collect(
    command: clap::Command,
    parent: &str,
    pages: &mut Vec<(String, Vec<u8>)>,
) -> io::Result<()> {
    let name = match parent {
        "" => command.get_name().to_owned(),
        parent => format!("{parent}-{}", command.get_name()),
    };
    for inner in command.get_subcommands() {
        if inner.get_name() != "help" {
            collect(inner.clone(), &name, pages)?;
        }
    }
    // The name with a hyphen is what `man` looks for.
    let mut command = command.name(name.clone()).disable_help_subcommand(true);
    if !parent.is_empty() {
        command = command.after_help("Exit codes: see iltm(1).");
    }
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page)?;
    pages.push((format!("{name}.1"), page));
    Ok(())
}

/// Prints the completions of a shell on standard output.
pub(super) fn completions(arguments: &Completions, output: &Output) {
    let mut script = Vec::new();
    let mut command = Arguments::command();
    clap_complete::generate(arguments.shell, &mut command, "iltm", &mut script);
    if output.is_json() {
        let script = String::from_utf8_lossy(&script).into_owned();
        let shell = arguments.shell.to_string();
        output.result(&json!({ "shell": shell, "script": script }), "");
    } else {
        // A reader that went away has all it wanted.
        let _ = io::stdout().write_all(&script);
    }
}
