//! Haar entries: a table's operator `K^`, read back from the image in floating point.

use iltm_runtime::haar::Function;
use iltm_runtime::image::Table;
use iltm_runtime::operator::{Channels, Operator, Row, Segment};
use iltm_runtime::units::CORRECTION_GUARD_BITS;

/// One entry of `K^` in the orthonormal Haar domain.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct HaarEntry {
    /// Index of the function that is corrected.
    pub row: usize,
    /// Index of the function that light has.
    pub col: usize,
    /// Correction for each unit of light.
    pub value: f64,
}

/// The entries of segments of a table by channel, scales of the channels included.
#[must_use]
pub fn haar_entries(table: &Table<'_>, segments: &[Segment<'_>]) -> Vec<Vec<HaarEntry>> {
    let functions: Vec<Function> = table.basis().functions().collect();
    let scales = table.operator().map(Operator::channel_scales);
    let of_channel = |channel: usize| {
        let scale = scales.map_or(1.0, |scales| scales[channel].to_num::<f64>());
        let own = segments.iter().filter(|segment| match segment.channels {
            Channels::All => true,
            Channels::One(one) => usize::from(one) == channel,
        });
        let rows = own.flat_map(Segment::rows);
        rows.flat_map(|row| of_row(&functions, row, scale))
            .collect()
    };
    (0..usize::from(table.channels())).map(of_channel).collect()
}

/// The entries of one segment, scales of the channels left out.
pub(crate) fn entries_of(functions: &[Function], segment: &Segment<'_>) -> Vec<HaarEntry> {
    let rows = segment.rows();
    let entries = rows.flat_map(|row| of_row(functions, row, 1.0));
    entries.collect()
}

/// The inverse of what [`quantise`](crate::quantise) does.
fn of_row(functions: &[Function], row: Row<'_>, scale: f64) -> Vec<HaarEntry> {
    let norm = |index: usize| (functions[index].squared_norm() as f64).sqrt();
    let index = usize::from(row.index);
    let entry = |(col, value): (usize, i16)| {
        let shift = functions[col].input_shift() + CORRECTION_GUARD_BITS;
        let unit = (-f64::from(shift + u32::from(row.shift))).exp2();
        HaarEntry {
            row: index,
            col,
            value: scale * f64::from(value) * unit * norm(index) * norm(col),
        }
    };
    row_values(row).into_iter().map(entry).collect()
}

/// Index and value of a row's entries that are not zero.
#[must_use]
pub fn row_values(row: Row<'_>) -> Vec<(usize, i16)> {
    row.fold(Vec::new(), |mut values, pair| {
        let both = (usize::from(pair.index)..).zip(pair.values);
        values.extend(both.filter(|(_, value)| *value != 0));
        values
    })
}
