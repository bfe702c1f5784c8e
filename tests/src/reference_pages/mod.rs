//! Reference pages: the pages of the site that are made from the source, with every command
//! and its options, and every error and what to do about it. Besides, what tests of pages
//! ask of the repository.

mod errors;

use serde_json::Value;
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The pages with their paths.
///
/// # Errors
/// If the source cannot be read, or is not Rust.
pub fn pages() -> io::Result<Vec<(PathBuf, String)>> {
    let docs = root().join("docs");
    Ok(vec![
        (docs.join("commands.md"), commands()),
        (docs.join("errors.md"), errors()?),
    ])
}

/// The repository.
pub fn root() -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    tests.parent().unwrap_or(tests).to_owned()
}

/// All files below a folder of the repository whose names end with `.` and `extension`.
///
/// # Errors
/// If a folder cannot be read.
pub fn files_below(folder: &str, extension: &str) -> io::Result<Vec<PathBuf>> {
    let mut folders = vec![root().join(folder)];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|its| its == extension) {
                files.push(path);
            }
        }
    }
    Ok(files)
}

/// What cargo knows of the workspace.
pub fn metadata() -> &'static Value {
    static METADATA: OnceLock<Value> = OnceLock::new();
    METADATA.get_or_init(|| {
        let metadata = Command::new(env!("CARGO"))
            .args(["metadata", "--no-deps", "--format-version=1", "--locked"])
            .current_dir(root())
            .output()
            .expect("cargo is there");
        serde_json::from_slice(&metadata.stdout).expect("JSON")
    })
}

fn commands() -> String {
    let options = clap_markdown::MarkdownOptions::new()
        .title("Commands".to_owned())
        .show_footer(false);
    let body = clap_markdown::help_markdown_command_custom(&iltm::cli::command(), &options);
    // Trailing spaces are for no one.
    let lines: Vec<&str> = body.lines().map(str::trim_end).collect();
    lines.join("\n") + "\n"
}

fn errors() -> io::Result<String> {
    let mut text = String::from(
        "# Errors\n\nThis page is for anyone whose command or script failed: it lists every exit code \
         and every error. A command that fails prints what happened, where, and what to do next; \
         with `--json` it prints the same as one object on standard output. The exit code tells \
         the cause:\n\n\
         | code | name | cause |\n|---|---|---|\n",
    );
    for (code, name, meaning) in iltm::cli::exit_codes() {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "| {code} | `{name}` | {meaning} |");
    }
    text.push_str(
        "\nCode 134 (101 in a development build) means a mistake in iltm itself; please \
         report it with what was printed.\n\n\
         Words in braces stand for a path, a line or a number. Messages of the gates before a \
         solve have [their own page](gates.md).\n",
    );
    for house in ["host-tools/crates", "host-tools/src", "runtime/src"] {
        for error in errors::in_files(&files_below(house, "rs")?)? {
            let _ = write!(text, "\n## {}\n\n{}\n\n", error.name, error.about);
            for case in &error.cases {
                let _ = write!(text, "- **{}**: {}", case.name, case.about);
                if let Some(message) = &case.message {
                    let _ = write!(text, " \"`{message}`\"");
                }
                if let Some(next) = &case.next_step {
                    let _ = write!(text, "\n  *Next:* {next}");
                }
                text.push('\n');
            }
        }
    }
    Ok(text)
}
