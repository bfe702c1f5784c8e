//! The architecture page: its drawing and its table say what the manifests say.

use iltm_tests::reference_pages::root;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::process::Command;

type Uses = BTreeMap<String, BTreeSet<String>>;

/// The product's crates by their short names, and which of them each uses.
fn manifests() -> Uses {
    let metadata = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version=1", "--locked"])
        .current_dir(root())
        .output()
        .unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&metadata.stdout).unwrap();
    let short = |name: &serde_json::Value| {
        let name = name.as_str().unwrap();
        let own = name == "iltm" || name.starts_with("iltm-");
        own.then(|| name.trim_start_matches("iltm-").to_owned())
    };
    let packages = metadata["packages"].as_array().unwrap().iter();
    let uses = packages.filter_map(|package| {
        let dependencies = package["dependencies"].as_array().unwrap().iter();
        let normal = dependencies.filter(|dependency| dependency["kind"].is_null());
        let uses = normal.filter_map(|dependency| short(&dependency["name"]));
        Some((short(&package["name"])?, uses.collect()))
    });
    uses.filter(|(name, _)| name != "tests").collect()
}

fn page() -> String {
    fs::read_to_string(root().join("docs/architecture.md")).unwrap()
}

#[test]
fn every_crate_of_the_drawing_uses_only_crates_on_lines_below_it() {
    let page = page();
    let drawing = page.split("```text\n").nth(1).unwrap();
    let drawing = drawing.split("```").next().unwrap();
    let mut line_of = BTreeMap::new();
    for (line, text) in drawing.lines().enumerate() {
        for name in text.split_whitespace() {
            let before = line_of.insert(name.to_owned(), line);
            assert_eq!(before, None, "{name} stands in the drawing twice");
        }
    }
    let uses = manifests();
    assert!(uses.keys().eq(line_of.keys()), "{uses:?} {line_of:?}");
    for (name, used) in &uses {
        for below in used {
            assert!(line_of[below] > line_of[name], "{name} uses {below}");
        }
    }
}

#[test]
fn the_table_of_crates_names_what_each_manifest_names() {
    let page = page();
    let rows = page.lines().filter(|line| line.starts_with("| ["));
    // The later tables have other columns.
    let rows = rows.filter_map(|line| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let name = cells[0].strip_prefix('[')?.split(']').next()?;
        let [_, _, uses] = cells[..] else { return None };
        let uses = uses.split(", ").filter(|name| !name.is_empty());
        Some((name.to_owned(), uses.map(str::to_owned).collect()))
    });
    assert_eq!(rows.collect::<Uses>(), manifests());
}
