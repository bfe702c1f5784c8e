//! Names in printed commands: programs, packages, targets, features, profiles and options
//! exist.
//!
//! Looked up are commands that are too long to be run, those in the prose of the pages, and
//! every `cargo` command in comments and messages of the sources.

use super::follower::files;
use super::page::{Page, has_extension, is_assignment, pages};
use clap::ArgAction;
use iltm_tests::reference_pages::{metadata, root};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Why a name of a command does not exist.
type Unknown = String;

fn items(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

/// Packages that a command is about: those it names, or what cargo takes by itself.
fn packages(named: &[&str]) -> Result<Vec<&'static Value>, Unknown> {
    let all = || items(&metadata()["packages"]);
    let missing = |name: &&&str| !all().any(|package| package["name"] == **name);
    if let Some(name) = named.iter().find(missing) {
        return Err(format!("there is no package `{name}`"));
    }
    let default = &metadata()["workspace_default_members"];
    let chosen = all().filter(|package| {
        let by_name = named.iter().any(|name| package["name"] == **name);
        by_name || named.is_empty() && items(default).any(|id| *id == package["id"])
    });
    Ok(chosen.collect())
}

/// Looks names up that follow `cargo`; returns the words behind `--`, if they are for
/// `iltm`.
fn cargo<'w>(words: &[&'w str]) -> Result<Option<Vec<&'w str>>, Unknown> {
    let end = words.iter().position(|word| *word == "--");
    let (own, program) = words.split_at(end.unwrap_or(words.len()));
    // Of an option that takes a value: both.
    let mut options: Vec<(&str, &str)> = Vec::new();
    let mut filter = None;
    let mut rest = own.iter().skip(1);
    while let Some(word) = rest.next() {
        let option = match *word {
            "-p" | "--package" => "package",
            "--bin" | "--test" | "--bench" | "--features" | "--profile" | "--path" => &word[2..],
            _ if word.starts_with('-') => continue,
            // What follows is for people, or which tests are run.
            _ => {
                filter = Some(end_of_sentence(word));
                break;
            }
        };
        let value = rest.next().ok_or(format!("{word} needs a name"))?;
        options.push((option, end_of_sentence(value)));
    }
    let of = |name: &str| -> Vec<&str> {
        let named = options.iter().filter(|(option, _)| *option == name);
        named.map(|(_, value)| *value).collect()
    };
    let chosen = packages(&of("package"))?;
    for kind in ["bin", "test", "bench"] {
        let has = |package: &Value, name: &str| {
            let mut targets = items(&package["targets"]);
            targets.any(|target| target["name"] == name && target["kind"][0] == kind)
        };
        for name in of(kind) {
            if !chosen.iter().any(|package| has(package, name)) {
                return Err(format!("there is no {kind} `{name}`"));
            }
        }
    }
    let of_tests = own.contains(&"--lib") || own.contains(&"--test");
    if let Some(filter) = filter.filter(|_| of_tests) {
        let name = filter.trim_end_matches("::").rsplit("::").next();
        let name = name.unwrap_or(filter);
        if !chosen.iter().any(|package| has_tests(package, name)) {
            return Err(format!("there are no tests `{filter}`"));
        }
    }
    for feature in of("features").iter().flat_map(|names| names.split(',')) {
        let found = match feature.split_once('/') {
            Some((package, feature)) => packages(&[package])?[0]["features"].get(feature),
            None => chosen
                .iter()
                .find_map(|package| package["features"].get(feature)),
        };
        found.ok_or(format!("there is no feature `{feature}`"))?;
    }
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("the workspace");
    for profile in of("profile") {
        if !manifest.contains(&format!("[profile.{profile}]")) {
            return Err(format!("there is no profile `{profile}`"));
        }
    }
    for path in of("path") {
        if !root().join(path).join("Cargo.toml").exists() {
            return Err(format!("there is no package in `{path}`"));
        }
    }
    let is_ours = own.first() == Some(&"run") && of("bin").is_empty();
    Ok((is_ours && !program.is_empty()).then(|| program[1..].to_vec()))
}

/// A word without what ends a sentence.
fn end_of_sentence(word: &str) -> &str {
    word.trim_end_matches(['.', ',', ';', '"', ')'])
}

/// Whether a package has tests, or a module, that the name is part of.
fn has_tests(package: &Value, name: &str) -> bool {
    let manifest = package["manifest_path"].as_str().map(Path::new);
    let folder = manifest.and_then(Path::parent).expect("a package");
    let paths = files().into_iter().map(|path| root().join(path));
    let mut sources = paths.filter(|path| path.starts_with(folder));
    sources.any(|path| {
        let text = fs::read_to_string(path).unwrap_or_default();
        let mut lines = text.lines().map(str::trim_start);
        lines.any(|line| {
            let item = line.strip_prefix("pub ").unwrap_or(line);
            (item.starts_with("fn ") || item.starts_with("mod ")) && line.contains(name)
        })
    })
}

/// Looks up subcommands and options of `iltm`. Values are not looked at, and may be missing.
fn iltm(words: &[&str]) -> Result<(), Unknown> {
    let mut program = iltm::cli::command();
    program.build();
    let mut command = &program;
    let mut words = words.iter().copied();
    while let Some(word) = words.next() {
        let word = word.trim_end_matches([',', ';', ':']);
        let unknown = || format!("`{}` has no {word}", command.get_name());
        let (long, short) = match (word.strip_prefix("--"), word.strip_prefix('-')) {
            (Some(long), _) => (long.split('=').next(), None),
            (None, Some(short)) => (None, short.chars().next()),
            (None, None) => {
                if command.has_subcommands() && !word.starts_with(['[', '<']) {
                    command = command.find_subcommand(word).ok_or_else(unknown)?;
                }
                continue;
            }
        };
        if word == "--" {
            // What follows is for another program.
            let others = command.get_arguments().any(clap::Arg::is_last_set);
            return if others { Ok(()) } else { Err(unknown()) };
        }
        if (long, short) == (None, None) {
            // `-` is standard input or output.
            continue;
        }
        let mut options = command.get_arguments();
        let option = options.find(|option| {
            long.is_some() && option.get_long() == long
                || short.is_some() && option.get_short() == short
        });
        let action = option.ok_or_else(unknown)?.get_action();
        let takes_value = matches!(action, ArgAction::Set | ArgAction::Append);
        if takes_value && !word.contains('=') {
            words.next();
        }
    }
    Ok(())
}

/// Looks up what a line of commands names: `cargo`, `iltm`, and scripts of the repository.
pub(crate) fn look_up(line: &str) -> Result<(), Unknown> {
    // What is quoted is for others.
    let line: Vec<&str> = line.split('\'').step_by(2).collect();
    for command in line.join("QUOTED").split(['|', '>', ';', '&']) {
        let words = command.split_whitespace();
        let before = |word: &&str| {
            is_assignment(word) || ["time", "/usr/bin/time", "-v", "do", "bash"].contains(word)
        };
        let words: Vec<&str> = words.skip_while(before).collect();
        match words.split_first() {
            Some((&"cargo", words)) => {
                if let Some(words) = cargo(words)? {
                    iltm(&words)?;
                }
            }
            Some((&"iltm" | &"target/release/iltm", words)) => iltm(words)?,
            Some((script, _)) if has_extension(script, "sh") => {
                let found = files().iter().any(|path| path.ends_with(script));
                found.then_some(()).ok_or(format!("there is no {script}"))?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// What `iltm patterns` writes beside the slides, for whoever photographs.
const RULES: &str = "host-tools/crates/session/src/readme.md";

#[test]
fn every_command_in_a_sentence_of_a_page_names_what_exists() {
    let mut looked_up = 0;
    let others = [RULES, "CHANGELOG.md", "host-tools/samples/README.md"];
    for path in pages().iter().map(String::as_str).chain(others) {
        let page = Page::read(path);
        let lines = page.loose_commands().into_iter();
        let lines = lines.map(|(_, line)| line.trim().to_owned());
        for line in page.code_spans().into_iter().chain(lines) {
            look_up(&line).unwrap_or_else(|why| panic!("{path}: `{line}`: {why}"));
            looked_up += usize::from(line.starts_with("iltm ") || line.starts_with("cargo "));
        }
    }
    assert!(looked_up > 80, "{looked_up}");
}

/// Verbs of cargo that name packages and targets.
const VERBS: [&str; 6] = ["bench", "build", "doc", "install", "run", "test"];

#[test]
fn every_cargo_command_in_the_repository_names_what_exists() {
    let mut looked_up = 0;
    // Of the commands below there is nothing.
    let others = files()
        .into_iter()
        .filter(|path| path != Path::new(file!()));
    for path in others {
        let Ok(text) = fs::read_to_string(root().join(&path)) else {
            continue;
        };
        // A command may go on in the next line of a comment.
        let lines = text
            .lines()
            .map(|line| line.trim().trim_start_matches(['/', '!', '#', '|']));
        let text = lines.collect::<Vec<_>>().join(" ");
        for (at, _) in text.match_indices("cargo ") {
            let end = text[at..].find('`').map_or(text.len(), |end| at + end);
            let words: Vec<&str> = text[at..end].split_whitespace().skip(1).take(16).collect();
            if !words.first().is_some_and(|verb| VERBS.contains(verb)) {
                continue;
            }
            let stop = words
                .iter()
                .position(|word| word.contains(['"', '$', '{', '<', '>', '|', '\\']));
            let words = &words[..stop.unwrap_or(words.len())];
            if let Err(why) = cargo(words) {
                panic!("{}: cargo {}: {why}", path.display(), words.join(" "));
            }
            looked_up += 1;
        }
    }
    assert!(looked_up > 40, "{looked_up}");
}

#[test]
fn names_that_do_not_exist_are_noticed() {
    for line in [
        "cargo run -p iltm-test --bin reference",
        "cargo run -p iltm-tests --bin references",
        "cargo test -p iltm --test power_cuts -- --nocapture",
        "cargo test -p iltm-tests --test device power_cats -- --nocapture",
        "cargo bench -p iltm --bench solves",
        "cargo test -p iltm-scene --lib near_polygons_that_nobody_has",
        "cargo run --profile fuzzy -p iltm-tests --bin fuzz -- all",
        "cargo doc -p iltm --features iltm/fault-tool",
        "cargo install --path host-tool",
        "cargo run --release -- demos",
        "time iltm simulates host-tools/scenes/stage.toml",
        "cat film.y4m | iltm compensate --tiers 3 scene.iltm - -o -",
        "iltm compensate scene.iltm -- --profile=low-latency",
        "bash tests/runs.sh",
    ] {
        assert!(look_up(line).is_err(), "{line}");
    }
}
