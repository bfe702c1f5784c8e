//! Pages of the site: those made from the source are up to date, links lead somewhere,
//! every page is in the table of contents, the table format says what the reader does, and
//! the architecture what the manifests say.

use iltm::capture::{CalibrationRole, Role, SETTINGS_FILE, Settings};
use iltm_runtime::image::layout::{SectionKind, header, label, meta, projector, tier};
use iltm_runtime::image::seal::field;
use iltm_tests::reference_pages::{files_below, metadata, pages, root};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::ops::Range;
use std::path::Path;

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn pages_made_from_the_source_are_up_to_date() {
    for (path, text) in pages().unwrap() {
        assert!(
            read(&path) == text,
            "{}: run `cargo run -p iltm-tests --bin reference`",
            path.display()
        );
    }
}

/// Targets of links and pictures, without places inside a page.
fn links(text: &str) -> Vec<String> {
    let after = text.split("](").skip(1);
    let target = |rest: &str| rest.split([')', '#']).next().map(str::to_owned);
    after.filter_map(target).collect()
}

#[test]
fn every_link_inside_the_repository_leads_somewhere() {
    let mut pages = files_below("docs", "md").unwrap();
    pages.push(root().join("README.md"));
    let mut followed = 0;
    for page in &pages {
        let text = read(page);
        for link in links(&text) {
            if link.is_empty() || link.contains("://") || link.contains(' ') {
                continue;
            }
            let target = page.parent().unwrap().join(&link);
            assert!(target.exists(), "{}: {link}", page.display());
            followed += 1;
        }
    }
    assert!(followed > 50, "{followed}");
}

#[test]
fn every_page_is_in_the_table_of_contents() {
    let docs = root().join("docs");
    let contents = links(&read(&docs.join("SUMMARY.md")));
    for page in files_below("docs", "md").unwrap() {
        let name = page
            .strip_prefix(&docs)
            .unwrap()
            .to_string_lossy()
            .into_owned();
        assert!(name == "SUMMARY.md" || contents.contains(&name), "{name}");
    }
}

/// Rows of the table under a heading: the cells of each, trimmed.
fn rows<'t>(page: &'t str, heading: &str) -> Vec<Vec<&'t str>> {
    let section = page
        .split("\n## ")
        .find(|section| section.starts_with(heading));
    let section = section.unwrap_or_else(|| panic!("no {heading}"));
    let lines = section.lines().filter(|line| line.starts_with("| "));
    lines
        .skip(1)
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect()
}

/// The ranges that the first column of a table names: `0 to 3`, or `4`, or several.
fn ranges(rows: &[Vec<&str>]) -> Vec<Range<usize>> {
    let range = |text: &str| {
        let mut ends = text
            .split(" to ")
            .map(|end| end.trim().parse::<usize>().unwrap());
        let first = ends.next().unwrap();
        first..ends.next().unwrap_or(first) + 1
    };
    let all = rows.iter().flat_map(|row| row[0].split(','));
    all.map(range).collect()
}

#[test]
fn the_table_format_is_the_one_of_the_reader() {
    let page = read(&root().join("docs/table-format.md"));
    for row in rows(&page, "Sections") {
        let kind = SectionKind::from_number(row[0].parse().unwrap());
        assert_eq!(kind.map(SectionKind::name), Some(row[1]));
    }
    let kinds = (0..=u16::MAX).filter_map(SectionKind::from_number);
    assert_eq!(rows(&page, "Sections").len(), kinds.count());
    let of = |heading| ranges(&rows(&page, heading));
    assert_eq!(
        of("Header"),
        [
            header::MAGIC,
            header::VERSION,
            header::SECTIONS,
            header::LENGTH,
            header::CRC
        ]
    );
    let one = |at: usize| at..at + 1;
    let in_label =
        |range: Range<usize>| meta::LABEL.start + range.start..meta::LABEL.start + range.end;
    assert_eq!(
        of("Meta"),
        [
            meta::ROWS,
            meta::COLS,
            one(meta::CHANNELS),
            one(meta::GAIN_FRACTION),
            meta::RESERVED,
            meta::REFERENCE_WHITE,
            meta::ACCUMULATOR_BOUND,
            meta::CORRECTION_BOUND,
            meta::CHANNEL_SCALES,
            meta::RESERVED_END,
            meta::INVERSE_ERROR,
            in_label(label::NAME),
            in_label(label::DATE)
        ]
    );
    assert_eq!(
        of("Tiers"),
        [tier::PREDICTED_ERROR, tier::ENTRIES, tier::MULTIPLICATIONS]
    );
    assert_eq!(
        of("Projector"),
        [
            projector::WIDTH,
            projector::HEIGHT,
            projector::BORDER,
            projector::RESERVED
        ]
    );
    assert_eq!(
        of("Seal"),
        [
            field::MAGIC,
            field::SEAL_VERSION,
            field::RESERVED,
            field::VERSION,
            field::OLDEST,
            field::DEVICE,
            field::KEY,
            field::SIGNATURE
        ]
    );
}

#[test]
fn roles_and_settings_on_the_page_of_captures_are_those_that_are_read() {
    let page = read(&root().join("docs/captures.md"));
    let settings = page.split("```toml").nth(1).unwrap();
    let settings = settings.split("```").next().unwrap();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(SETTINGS_FILE), settings).unwrap();
    let settings = Settings::read(folder.path()).unwrap();
    assert_eq!(settings.scene.name.as_deref(), Some("north corner"));
    // The names in the first column, with numbers for their letters.
    let names = |heading: &str| -> Vec<String> {
        let rows = rows(&page, heading);
        let cells = rows.into_iter().flat_map(|row| row[0].split(", "));
        cells
            .map(|name| {
                name.trim_matches('`')
                    .replace("-B", "-3")
                    .replace("LLL", "128")
            })
            .collect()
    };
    let (roles, calibration) = (names("capture.csv"), names("calibration.csv"));
    assert_eq!((roles.len(), calibration.len()), (8, 5));
    for name in roles {
        assert!(Role::from_name(&name).is_some(), "{name}");
    }
    for name in calibration {
        assert!(CalibrationRole::from_name(&name).is_some(), "{name}");
    }
}

type Uses = BTreeMap<String, BTreeSet<String>>;

/// The product's crates by their short names, and which of them each uses.
fn manifests() -> Uses {
    let short = |name: &serde_json::Value| {
        let name = name.as_str().unwrap();
        let own = name == "iltm" || name.starts_with("iltm-");
        own.then(|| name.trim_start_matches("iltm-").to_owned())
    };
    let packages = metadata()["packages"].as_array().unwrap().iter();
    let uses = packages.filter_map(|package| {
        let dependencies = package["dependencies"].as_array().unwrap().iter();
        let normal = dependencies.filter(|dependency| dependency["kind"].is_null());
        let uses = normal.filter_map(|dependency| short(&dependency["name"]));
        Some((short(&package["name"])?, uses.collect()))
    });
    uses.filter(|(name, _)| name != "tests").collect()
}

#[test]
fn every_crate_of_the_drawing_uses_only_crates_on_lines_below_it() {
    let page = read(&root().join("docs/architecture.md"));
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
    let page = read(&root().join("docs/architecture.md"));
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
