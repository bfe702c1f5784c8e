//! Tables for grids whose real scenes take minutes to compile.
//!
//! The operator's rows are copies of those of a real table, as to how many pairs and
//! entries they have; where they lie and what their values are is made up. What a
//! frame takes depends on nothing else.

use fixed::types::U1F15;
use iltm::capture::Response;
use iltm::compile::image::{ImageWriter, StoredRow, segment_bytes};
use iltm::compile::response;
use iltm_runtime::Grid;
use iltm_runtime::haar::Basis;
use iltm_runtime::image::Table;
use iltm_runtime::image::layout::{SectionKind, meta, tier};
use iltm_runtime::operator::{Channels, Operator, Segment};
use std::ops::Range;

/// Fraction bits of the gains.
const GAIN_FRACTION: u8 = 13;

/// A table with ambient light, response and an operator of one tier, about `entries`
/// entries a row, with rows like those of the top tier of `shape`.
pub(super) fn table(grid: Grid, channels: usize, entries: f64, shape: &Table<'_>) -> Vec<u8> {
    let cells = grid.cells();
    let segment = segment_bytes(cells, &rows(grid, entries, shape));
    let mut scales = [U1F15::ZERO; 3];
    scales[..channels].fill(U1F15::from_num(0.9));
    let made = Segment::new(0, 1, Channels::All, &segment).expect("whole words");
    let segments = std::iter::once(made).collect();
    let operator = Operator::new(&Basis::new(grid), segments, scales).expect("small values");

    let mut head = vec![0; meta::SIZE];
    put(&mut head, meta::ROWS, &(grid.rows() as u16).to_le_bytes());
    put(&mut head, meta::COLS, &(grid.cols() as u16).to_le_bytes());
    head[meta::CHANNELS] = channels as u8;
    head[meta::GAIN_FRACTION] = GAIN_FRACTION;
    put(
        &mut head,
        meta::REFERENCE_WHITE,
        &(1_u32 << 23).to_le_bytes(),
    );
    let bounds = operator.bounds();
    put(
        &mut head,
        meta::ACCUMULATOR_BOUND,
        &bounds.accumulator.to_le_bytes(),
    );
    put(
        &mut head,
        meta::CORRECTION_BOUND,
        &bounds.correction.to_le_bytes(),
    );
    put(
        &mut head,
        meta::CHANNEL_SCALES,
        &halfwords(scales.map(U1F15::to_bits)),
    );
    let tiers = (0..=1).flat_map(|number| {
        let mut entry = vec![0; tier::SIZE];
        let (entries, multiplications) = operator.cost(number, channels as u8);
        put(&mut entry, tier::ENTRIES, &entries.to_le_bytes());
        put(
            &mut entry,
            tier::MULTIPLICATIONS,
            &multiplications.to_le_bytes(),
        );
        entry
    });
    let knots = response::knots(Response::Srgb).expect("not linear");
    let mut image = ImageWriter::default();
    image.section(SectionKind::Meta, 0, head);
    image.section(SectionKind::Tiers, 0, tiers.collect());
    // Just under one, so that natural frames are not clipped more than usual.
    let gain = vec![7_800; cells * channels];
    image.section(SectionKind::Gain, 0, halfwords(gain));
    image.section(
        SectionKind::Ambient,
        0,
        halfwords(vec![330; cells * channels]),
    );
    image.section(SectionKind::Codes, 0, response::codes(&knots));
    image.section(SectionKind::Response, 0, halfwords(knots));
    image.section(SectionKind::Operator, 1, segment.clone());
    image.finish()
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

fn put(bytes: &mut [u8], field: Range<usize>, value: &[u8]) {
    bytes[field].copy_from_slice(value);
}

fn halfwords(values: impl IntoIterator<Item = u16>) -> Vec<u8> {
    values.into_iter().flat_map(u16::to_le_bytes).collect()
}
