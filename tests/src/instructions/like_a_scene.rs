//! Made-up operators for grids whose real scenes take minutes to compile.
//!
//! The operator's rows are copies of those of a real table, as to how many pairs and
//! entries they have; where they lie and what their values are is made up. What a
//! frame takes depends on nothing else.

use crate::made_up::MadeUp;
use fixed::types::U1F15;
use iltm::compile::image::StoredRow;
use iltm_runtime::Grid;
use iltm_runtime::image::Table;

/// A table with ambient light, response and an operator of one tier, about `entries`
/// entries a row, with rows like those of the top tier of `shape`.
pub(super) fn table(grid: Grid, channels: usize, entries: f64, shape: &Table<'_>) -> Vec<u8> {
    let mut table = MadeUp::nearly_plain(grid, channels, true);
    table.scales[..channels].fill(U1F15::from_num(0.9));
    table.response = true;
    table.tiers = vec![rows(grid, entries, shape)];
    table.image()
}

fn rows(grid: Grid, entries: f64, shape: &Table<'_>) -> Vec<StoredRow> {
    let mut random = fastrand::Rng::with_seed(0x1E4F);
    let operator = shape.operator().expect("the shape has one");
    // Pairs and entries of every row, empty ones too.
    let mut lengths: Vec<(usize, usize)> = Vec::new();
    for segment in operator
        .segments()
        .iter()
        .filter(|s| s.tier == shape.top_tier())
    {
        let length = |row: iltm_runtime::operator::Row<'_>| (row.pairs().into(), row.entries());
        lengths.extend(segment.rows().map(length));
    }
    let total: usize = lengths.iter().map(|(_, entries)| entries).sum();
    lengths.resize(shape.grid().cells(), (0, 0));
    let share = entries * lengths.len() as f64 / total as f64;
    let cells = grid.cells();
    let mut rows = Vec::new();
    for index in 0..cells {
        let (pairs, of_row) = lengths[random.usize(..lengths.len())];
        // More than once where the shape has fewer entries than asked for.
        let times = share.floor() as usize + usize::from(random.f64() < share.fract());
        let (pairs, of_row) = (pairs * times, of_row * times);
        if pairs == 0 {
            continue;
        }
        // Pairs at even places, so that none runs into the next.
        let mut places = std::collections::BTreeSet::new();
        while places.len() < pairs.min(cells / 2 - 1) {
            places.insert(2 * random.u16(..(cells / 2 - 1) as u16));
        }
        let mut both = of_row.saturating_sub(pairs);
        let mut stored = Vec::new();
        for place in places {
            stored.push((place, random.i16(1..20)));
            if both > 0 {
                stored.push((place + 1, -random.i16(1..20)));
                both -= 1;
            }
        }
        rows.push(StoredRow {
            index: index as u16,
            shift: 8,
            entries: stored,
        });
    }
    rows
}
