//! Schemas of what `--json` prints: every object that a test sees is held against the schema of
//! its command in `docs/json/`.

use super::user::User;
use jsonschema::{Retrieve, Uri, Validator};
use serde_json::Value;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs/json")
}

/// The schema of a command line as it is typed behind `iltm`.
fn of(line: &str) -> (String, Validator) {
    let words: Vec<&str> = line.split(' ').filter(|word| *word != "--json").collect();
    let command = match words.as_slice() {
        ["key", inner, ..] => format!("key-{inner}"),
        [command, ..] => (*command).to_owned(),
        [] => unreachable!("a command line has a command"),
    };
    // A mistake in the command line may be in the command's name.
    let named = folder().join(format!("{command}.json"));
    let file = if named.is_file() {
        named
    } else {
        folder().join("usage.json")
    };
    (command, read(&file))
}

fn read(file: &Path) -> Validator {
    let text = fs::read_to_string(file);
    let text = text.unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let schema: Value = serde_json::from_str(&text).expect("JSON");
    let options = jsonschema::options().with_base_uri("iltm:/usage.json");
    let validator = options.with_retriever(Beside).build(&schema);
    validator.expect("a schema")
}

/// Schemas that others refer to lie in the same folder.
struct Beside;

impl Retrieve for Beside {
    fn retrieve(&self, uri: &Uri<String>) -> Result<Value, Box<dyn Error + Send + Sync>> {
        let name = uri.path().as_str().trim_start_matches('/').to_owned();
        Ok(serde_json::from_str(&fs::read_to_string(
            folder().join(name),
        )?)?)
    }
}

/// Holds what a command has printed against its schema: an object a line, the last of which
/// says so.
#[track_caller]
pub(crate) fn check(line: &str, printed: &str) {
    let (command, schema) = of(line);
    let objects: Vec<Value> = printed
        .lines()
        .map(|line| serde_json::from_str(line).expect("an object a line"))
        .collect();
    for object in &objects {
        let wrong: Vec<String> = schema
            .iter_errors(object)
            .map(|error| format!("{}: {error}", error.instance_path()))
            .collect();
        assert!(wrong.is_empty(), "{command}: {object}: {wrong:#?}");
    }
    let (last, before) = objects.split_last().expect("at least one object");
    assert_eq!(last["last"], true, "{command}: {last}");
    assert!(
        before.iter().all(|object| object["last"].is_null()),
        "{command}"
    );
}

#[test]
fn long_work_tells_programs_how_far_it_is_on_standard_error() {
    let schema = read(&folder().join("progress.json"));
    let said = User::new().run("check SAMPLE --json").said;
    let lines: Vec<Value> = said
        .lines()
        .filter(|line| line.starts_with("{\"progress\""))
        .map(|line| serde_json::from_str(line).expect("an object a line"))
        .collect();
    assert!(lines.len() > 1, "{said}");
    for line in &lines {
        assert!(schema.is_valid(line), "{line}");
    }
    assert!(!User::new().run("check SAMPLE").said.contains("progress"));
}

#[test]
fn every_command_has_a_schema_that_says_what_each_field_is() {
    let commands = iltm::cli::command();
    let mut names = ["usage", "error", "progress"].map(str::to_owned).to_vec();
    for command in commands.get_subcommands() {
        let name = command.get_name();
        let inner: Vec<_> = command.get_subcommands().collect();
        names.extend(inner.iter().map(|it| format!("{name}-{}", it.get_name())));
        if inner.is_empty() {
            names.push(name.to_owned());
        }
    }
    for name in &names {
        let text = fs::read_to_string(folder().join(format!("{name}.json")));
        let text = text.unwrap_or_else(|error| panic!("docs/json/{name}.json: {error}"));
        let schema: Value = serde_json::from_str(&text).expect("JSON");
        jsonschema::meta::validate(&schema).expect("a schema");
        described(name, &schema);
    }
    let files = fs::read_dir(folder()).expect("a folder");
    assert_eq!(
        files.count(),
        names.len(),
        "schemas of commands that are not there"
    );
}

/// Every field of every object has a description, and nothing else may stand there.
fn described(place: &str, schema: &Value) {
    if let Some(fields) = schema["properties"].as_object() {
        assert_eq!(schema["additionalProperties"], false, "{place}");
        for (name, field) in fields {
            let place = format!("{place}.{name}");
            assert!(field["description"].is_string(), "{place} says nothing");
            described(&place, field);
        }
    }
    for part in ["items", "additionalProperties"] {
        if let Some(inner) = schema.get(part) {
            described(place, inner);
        }
    }
    for part in ["anyOf", "oneOf"] {
        for one in schema[part].as_array().into_iter().flatten() {
            described(place, one);
        }
    }
}
