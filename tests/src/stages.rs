//! Pipeline stages: what they take, in instructions a sample and bytes of firmware.
//!
//! Counted on the reference board as in [`instructions`](crate::instructions), for
//! tables that list more stages one after the other.
//! `docs/stages.csv` and `docs/firmware-sizes.csv` hold the results, and tests compare
//! them.

use crate::firmware::{elf, elf_of, flash_bytes};
use crate::grid;
use crate::instructions::{bench, cases};
use crate::made_up::{MadeUp, pairs};
use crate::neighbours::OF_SEVERAL;
use iltm::compile::image::StoredRow;
use iltm::device::emulator::Board;
use iltm_runtime::features::Stage;
use iltm_runtime::image::Table;
use iltm_runtime::operator::{Row, Segment};
use iltm_runtime::{FrameSize, Grid};
use std::fmt::Write as _;

/// Those of a projector alone.
pub const ALONE: [Stage; 5] = [
    Stage::Operator,
    Stage::Ambient,
    Stage::Response,
    Stage::Colour,
    Stage::FullResolution,
];

/// Entries of each row of a made-up operator, in pairs.
const ENTRIES: usize = 8;

/// A table that lists these stages, and no others, for frames of the grid's size.
/// [`Stage::FullResolution`] is no section of it but gains finer than the cells, which
/// it has not.
pub fn table(grid: Grid, stages: &[Stage]) -> MadeUp {
    let channels = 1 + 2 * usize::from(stages.contains(&Stage::Colour));
    let mut table = MadeUp::nearly_plain(grid, channels, stages.contains(&Stage::Ambient));
    table.response = stages.contains(&Stage::Response);
    if stages.contains(&Stage::Operator) {
        table.tiers = vec![rows(grid)];
    }
    if stages.contains(&Stage::Neighbours) {
        let side = |cells: usize| cells.div_ceil(4) as u16;
        let others = crate::grid(side(grid.rows()), 2 * side(grid.cols()));
        table = table.with_neighbours(others, [1, 1], 0x9E16);
    }
    table
}

/// Rows of pairs at random places.
fn rows(grid: Grid) -> Vec<StoredRow> {
    let mut random = fastrand::Rng::with_seed(0x57A6);
    let cells = grid.cells() as u16;
    let row = |index| StoredRow {
        index,
        shift: 8,
        entries: pairs(&mut random, cells, ENTRIES / 2),
    };
    (0..cells).map(row).collect()
}

/// A table of the list: as [`table`], with an operator that has its entries where that of the painted
/// panels at 64 x 64 cells has them, as it is solved from photographs. Their values are small, so that
/// hardly any sample is clipped, which would take instructions too.
pub fn listed(stages: &[Stage]) -> MadeUp {
    let mut table = table(grid(64, 64), stages);
    if !table.tiers.is_empty() {
        let cases = cases();
        let solved = cases.iter().find(|case| case.name == "64x64 colour");
        let solved = Table::check(&solved.expect("it is listed").image).expect("a table");
        let operator = solved.operator().expect("panels light each other");
        table.tiers = vec![operator.segments().iter().flat_map(stored).collect()];
    }
    table
}

/// The rows of a segment as a table stores them, with values of 1 and -1.
pub(crate) fn stored(segment: &Segment<'_>) -> Vec<StoredRow> {
    let entries = |row: &Row<'_>| {
        row.fold(Vec::new(), |mut entries, pair| {
            let both = [
                (pair.index, pair.values[0]),
                (pair.index + 1, pair.values[1]),
            ];
            let signs = both.map(|(at, value)| (at, value.signum()));
            entries.extend(signs.into_iter().filter(|(_, sign)| *sign != 0));
            entries
        })
    };
    let rows = segment.rows().map(|row| StoredRow {
        index: row.index,
        shift: row.shift,
        entries: entries(&row),
    });
    rows.collect()
}

/// What a frame takes, instructions a sample.
#[derive(Clone, PartialEq, Debug)]
pub struct Cost {
    /// The stages that the table lists.
    pub stages: &'static str,
    /// Of a frame of one pixel a cell.
    pub cells: f64,
    /// Of a frame of sixteen pixels a cell.
    pub pixels: f64,
}

/// The tables of the list.
const TABLES: [(&str, &[Stage]); 7] = [
    ("gain", &[]),
    ("gain + ambient", &[Stage::Ambient]),
    ("gain + response", &[Stage::Response]),
    ("gain + operator", &[Stage::Operator]),
    (
        "gain + operator + ambient",
        &[Stage::Operator, Stage::Ambient],
    ),
    (
        "gain + operator + ambient + response",
        &[Stage::Operator, Stage::Ambient, Stage::Response],
    ),
    (
        "gain + operator + ambient + response + colour",
        &[
            Stage::Operator,
            Stage::Ambient,
            Stage::Response,
            Stage::Colour,
        ],
    ),
];

/// Instructions of a frame at the top tier.
pub fn instructions(table: &MadeUp, size: FrameSize, firmware_stages: &str) -> u64 {
    let bench_elf = elf_of(Board::An500, firmware_stages, "bench");
    let lines = bench(&bench_elf, &table.image(), size, None);
    let [.., frame, _] = lines.last().expect("tier 0 at least");
    *frame
}

/// Counts the tables of the list.
pub fn costs() -> Vec<Cost> {
    let larger = FrameSize::new(256, 256).expect("not empty");
    let cost = |&(name, stages): &(&'static str, &[Stage])| {
        let table = listed(stages);
        let of = |size: FrameSize| {
            let samples = size.pixels() * table.channels;
            let all = crate::firmware::ALL_STAGES;
            instructions(&table, size, all) as f64 / samples as f64
        };
        Cost {
            stages: name,
            cells: of(FrameSize::of_grid(table.grid)),
            pixels: of(larger),
        }
    };
    TABLES.iter().map(cost).collect()
}

/// The list as `docs/stages.csv` holds it.
pub fn csv(costs: &[Cost]) -> String {
    let mut text =
        String::from("stages,instructions a sample,a sample of a frame with 16 pixels a cell\n");
    for cost in costs {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "{},{:.2},{:.2}", cost.stages, cost.cells, cost.pixels);
    }
    text
}

/// The features of a firmware with some of the stages, as its build takes them.
pub fn features(stages: &[Stage]) -> String {
    let names: Vec<_> = stages.iter().map(|stage| stage.feature()).collect();
    names.join(",")
}

/// Bytes of flash of a product with these features, none of which is lean.
pub fn flash(features: &str) -> u64 {
    flash_bytes(&if features == self::features(&ALONE) {
        elf(Board::An500, "firmware")
    } else if features == self::features(&Stage::ALL) {
        elf_of(Board::An500, OF_SEVERAL, "firmware")
    } else {
        elf_of(Board::An500, features, "firmware")
    })
}

/// The line of `docs/firmware-sizes.csv` for a product with some of the stages.
pub fn size_line(stages: &[Stage]) -> String {
    let features = features(stages);
    let bytes = flash(&features);
    let name = match features.as_str() {
        "" => "none".to_owned(),
        some => some.replace(',', " + "),
    };
    format!("{name},{bytes}")
}

/// All choices of the stages of a projector alone, none first, and then all that there are.
pub fn choices() -> Vec<Vec<Stage>> {
    let choice = |bits: usize| {
        let chosen = |place: &usize| bits >> place & 1 == 1;
        (0..ALONE.len())
            .filter(chosen)
            .map(|place| ALONE[place])
            .collect()
    };
    let alone = (0..1 << ALONE.len()).map(choice);
    alone.chain([Stage::ALL.to_vec()]).collect()
}
