//! The site's pages: those made from the source are up to date, links lead somewhere, every
//! page is in the table of contents, and the table format says what the reader does.

use iltm::capture::{CalibrationRole, Role, SETTINGS_FILE, Settings};
use iltm_runtime::image::layout::{SectionKind, header, meta, tier};
use iltm_runtime::image::seal::field;
use iltm_tests::reference_pages::{pages, root};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn markdown(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            markdown(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
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
    let mut pages = vec![root().join("README.md")];
    markdown(&root().join("docs"), &mut pages);
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
    let mut pages = Vec::new();
    markdown(&docs, &mut pages);
    for page in pages {
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
    assert_eq!(rows(&page, "Sections").len(), 9);
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
            meta::INVERSE_ERROR
        ]
    );
    assert_eq!(
        of("Tiers"),
        [tier::PREDICTED_ERROR, tier::ENTRIES, tier::MULTIPLICATIONS]
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
    assert_eq!((roles.len(), calibration.len()), (7, 5));
    for name in roles {
        assert!(Role::from_name(&name).is_some(), "{name}");
    }
    for name in calibration {
        assert!(CalibrationRole::from_name(&name).is_some(), "{name}");
    }
}
