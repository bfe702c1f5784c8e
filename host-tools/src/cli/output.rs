//! Output of a command: words for people, JSON for programs, files whole or not at all.

use super::active::Active;
use super::failure::{Failure, cannot_read, cannot_write};
use iltm_picture::whole_file;
use serde_json::{Value, json};
use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;

/// Standard output and standard error as a command sees them.
#[derive(Debug)]
pub(super) struct Output {
    json: bool,
    /// Whether somebody watches standard error.
    pub(super) terminal: bool,
}

impl Output {
    pub(super) fn new(json: bool) -> Self {
        let terminal = io::stderr().is_terminal();
        Self { json, terminal }
    }

    pub(super) const fn is_json(&self) -> bool {
        self.json
    }

    /// The result of a command: JSON for programs or text for people. A reader
    /// that went away is no failure of the command.
    pub(super) fn result(&self, data: &Value, text: &str) {
        if self.json {
            let _ = writeln!(io::stdout(), "{data}");
        } else {
            let _ = write!(io::stderr(), "{text}");
        }
    }

    /// What people read while a command goes on, or before its failure; programs get it as
    /// events, or with the failure.
    pub(super) fn people(&self, text: &str) {
        if !self.json {
            let _ = write!(io::stderr(), "{text}");
        }
    }

    /// A remark for people, where there are some.
    pub(super) fn remark(&self, text: &str) {
        if self.terminal && !self.json {
            let _ = writeln!(io::stderr(), "{text}");
        }
    }

    /// An event of long work, for programs: an object a line.
    pub(super) fn event(&self, data: &Value) {
        if self.json {
            let mut out = io::stdout();
            let _ = writeln!(out, "{data}");
            let _ = out.flush();
        }
    }

    pub(super) fn failure(&self, failure: &Failure) -> ExitCode {
        if self.json {
            let mut data = failure
                .data
                .as_deref()
                .cloned()
                .unwrap_or_else(|| json!({}));
            data["error"] = json!({
                "kind": failure.kind.name(),
                "exit": failure.kind.code(),
                "message": failure.message,
                "next_step": failure.next_step,
                "active": failure.active.as_deref().map(Active::data),
            });
            let _ = writeln!(io::stdout(), "{data}");
        }
        let mut text = String::new();
        let width = console::Term::stderr().size().1.into();
        let graphical = miette::GraphicalReportHandler::new().with_width(width);
        if !self.terminal || graphical.render_report(&mut text, failure).is_err() {
            let active = failure.active.as_ref();
            let active = active.map(|active| format!("now: {active}\n"));
            text = format!(
                "error: {}\n{}next: {}\n",
                failure.message,
                active.unwrap_or_default(),
                failure.next_step
            );
        }
        let _ = write!(io::stderr(), "{text}");
        ExitCode::from(failure.kind.code())
    }
}

/// Writes a file whole or not at all: beside its place, then renamed.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    whole_file::write(path, bytes).map_err(|error| cannot_write(&error.path, &error.source))
}

pub(super) fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    fs::read(path).map_err(|error| cannot_read(path, &error))
}

/// Makes a folder and those that it lies in.
pub(super) fn make_folder(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))
}
