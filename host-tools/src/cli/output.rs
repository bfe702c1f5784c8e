//! Output of a command: words for people, JSON for programs, files whole or not at all.

use super::active::Active;
use super::failure::{Failure, Kind, cannot_write};
use iltm_picture::{html::PictureFile, unfinished, whole_file, whole_folder};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Version of the objects that `--json` prints: it rises when a field goes or changes its
/// meaning.
const JSON_VERSION: u8 = 1;

/// Standard output and standard error as a command sees them.
#[derive(Clone, Debug)]
pub(super) struct Output {
    json: bool,
    /// Whether somebody watches standard error.
    pub(super) terminal: bool,
    /// Whether frames go to standard output, and all words to standard error.
    frames: Arc<AtomicBool>,
}

impl Output {
    pub(super) fn new(json: bool) -> Self {
        Self {
            json,
            terminal: io::stderr().is_terminal(),
            frames: Arc::default(),
        }
    }

    pub(super) const fn is_json(&self) -> bool {
        self.json
    }

    /// From now on standard output carries frames; results go to standard error.
    pub(super) fn give_frames(&self) {
        self.frames.store(true, Ordering::SeqCst);
    }

    /// Where results go. A reader that went away is no failure of the command.
    fn write(&self, text: &str) {
        if self.frames.load(Ordering::SeqCst) {
            let _ = io::stderr().write_all(text.as_bytes());
        } else {
            let mut out = io::stdout().lock();
            let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        }
    }

    /// The result of a command: JSON for programs or text for people.
    pub(super) fn result(&self, data: &Value, text: &str) {
        self.dressed_result(data, &printable(text));
    }

    /// The same of text that may hold colours: nothing in it is made [`printable`].
    pub(super) fn dressed_result(&self, data: &Value, text: &str) {
        if self.json {
            self.write(&last(data.clone()));
        } else {
            self.write(text);
        }
    }

    /// The result of a command on one of several things: the last ends what programs read.
    pub(super) fn part_of_result(&self, is_last: bool, data: &Value, text: &str) {
        if is_last {
            self.result(data, text);
        } else {
            self.event(data);
            self.findings(text);
        }
    }

    /// The result of a command that fails by what it has found, for people; programs get it with
    /// the failure.
    pub(super) fn findings(&self, text: &str) {
        self.dressed_findings(&printable(text));
    }

    /// The same of text that may hold colours.
    pub(super) fn dressed_findings(&self, text: &str) {
        if !self.json {
            self.write(text);
        }
    }

    /// What people read while a command goes on; programs get it as events.
    pub(super) fn people(&self, text: &str) {
        if !self.json {
            let _ = write!(io::stderr(), "{}", printable(text));
        }
    }

    /// A remark for people, where there are some.
    pub(super) fn remark(&self, text: &str) {
        if self.terminal && !self.json {
            let _ = writeln!(io::stderr(), "{}", printable(text));
        }
    }

    /// An event of long work, for programs: an object a line.
    pub(super) fn event(&self, data: &Value) {
        if self.json {
            self.write(&format!("{data}\n"));
        }
    }

    pub(super) fn failure(&self, failure: &Failure) -> ExitCode {
        unfinished::remove_empty_folders();
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
            self.write(&last(data));
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

/// The text without what a terminal obeys, and without what hides or reorders other letters: names
/// in a stranger's files and from a device's line may hold both.
pub(super) fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        if is_obeyed(c) {
            safe.extend(c.escape_unicode());
        } else {
            safe.push(c);
        }
    }
    Cow::Owned(safe)
}

fn is_obeyed(c: char) -> bool {
    match c {
        '\n' | '\t' => false,
        // Marks of direction, joiners, blanks without width, separators of lines, tags.
        '\u{ad}'
        | '\u{61c}'
        | '\u{180e}'
        | '\u{200b}'..='\u{200f}'
        | '\u{2028}'..='\u{202e}'
        | '\u{2060}'..='\u{206f}'
        | '\u{feff}'
        | '\u{fff9}'..='\u{fffb}'
        | '\u{e0000}'..='\u{e007f}' => true,
        _ => c.is_control(),
    }
}

/// The names and contents of pictures as files.
pub(super) fn pictures(pictures: &[PictureFile]) -> Vec<(PathBuf, &[u8])> {
    let file = |it: &PictureFile| Path::new(&it.name).with_extension("png");
    pictures.iter().map(|it| (file(it), &*it.png)).collect()
}

/// The last object of a command as a line.
fn last(mut data: Value) -> String {
    data["json"] = json!(JSON_VERSION);
    data["last"] = json!(true);
    format!("{data}\n")
}

/// Writes a file whole or not at all: beside its place, then renamed.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    whole_file::write(path, bytes).map_err(|error| cannot_write(&error.path, &error.source))
}

/// Makes a folder and those that it lies in.
pub(super) fn make_folder(folder: &Path) -> Result<(), Failure> {
    unfinished::make_folder(folder).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => Failure::new(
            Kind::Write,
            format!(
                "{}: cannot be made: a file is in its place",
                folder.display()
            ),
            "Move it away, or choose another folder.",
        ),
        _ => cannot_write(folder, &error),
    })
}

/// Writes files into a folder, all of them or none; the folder is made if it is not there.
pub(super) fn write_files(
    folder: &Path,
    files: &[(impl AsRef<Path>, impl AsRef<[u8]>)],
) -> Result<(), Failure> {
    whole_folder::put(folder, files).map_err(|error| cannot_write(&error.path, &error.source))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_is_sent_no_commands_of_strangers() {
        assert_eq!(
            printable("a\u{1b}]0;X\u{7}\nb\u{9b}"),
            "a\\u{1b}]0;X\\u{7}\nb\\u{9b}"
        );
        // An override of the direction would show this name as scene.iltm.
        assert_eq!(printable("s\u{202e}mtli.enec"), "s\\u{202e}mtli.enec");
        assert_eq!(printable("Größe 5 µm, 東"), "Größe 5 µm, 東");
    }
}
