//! Quantisation: coefficients of fewer bits.
//!
//! The device's format has 16 bits a value and a power of two a row. Here the values of
//! a row are rounded to fewer, so that the largest just fits; what rounds to zero is no
//! entry any more. Such a table runs on the device in its 16 bits, so its error and its
//! instructions are real; the bytes are those of a format that there is not.

use iltm_compile::haar_entries::row_values;
use iltm_compile::image::{StoredRow, segment_bytes};
use iltm_runtime::operator::{Channels, OperatorError, Segment};

/// Bits that are tried; 16 are what a table has.
pub(super) const BITS: std::ops::Range<u32> = 4..16;

/// Bits of a row's index and shift, and of the index of a pair.
const ROW_BITS: usize = 32;
const INDEX_BITS: usize = 16;

/// A segment of a tier, its values rounded.
pub(super) struct Rounded {
    tier: u8,
    channels: Channels,
    bytes: Vec<u8>,
    bits: u32,
}

impl Rounded {
    pub(super) fn new(segment: &Segment<'_>, cells: usize, bits: u32) -> Self {
        let round = |row: iltm_runtime::operator::Row<'_>| {
            let values = row_values(row);
            let step = step(values.iter().map(|(_, value)| *value), bits);
            let entries = values
                .into_iter()
                .map(|(col, value)| (col as u16, rounded(value, step)));
            StoredRow {
                index: row.index,
                shift: row.shift,
                entries: entries.filter(|(_, value)| *value != 0).collect(),
            }
        };
        let mut rows: Vec<StoredRow> = segment.rows().map(round).collect();
        rows.retain(|row| !row.entries.is_empty());
        rows.sort_by_key(|row| row.index);
        Self {
            tier: segment.tier,
            channels: segment.channels,
            bytes: segment_bytes(cells, &rows),
            bits,
        }
    }

    /// As the device has it.
    pub(super) fn segment(&self) -> Result<Segment<'_>, OperatorError> {
        Segment::new(0, self.tier, self.channels, &self.bytes)
    }

    /// Bytes that it would take if values had so many bits.
    pub(super) fn packed_bytes(&self) -> Result<u64, OperatorError> {
        let pair = INDEX_BITS + 2 * self.bits as usize;
        let rows = self.segment()?;
        let bits = rows
            .rows()
            .map(|row| ROW_BITS + usize::from(row.pairs()) * pair);
        Ok(bits.sum::<usize>().div_ceil(8) as u64)
    }
}

/// The least power of two in steps of which all values fit so many bits.
fn step(values: impl Iterator<Item = i16>, bits: u32) -> u32 {
    let largest = values.map(i16::unsigned_abs).max().unwrap_or(0);
    let most = (1_i32 << (bits - 1)) - 1;
    let fits =
        |step: &u32| i32::from(rounded(largest.min(i16::MAX as u16) as i16, *step)) >> step <= most;
    (0..16).find(fits).unwrap_or(15)
}

/// To the nearest multiple of `2^step`, halves away from zero.
fn rounded(value: i16, step: u32) -> i16 {
    let unit = f64::from(step).exp2();
    let multiple = (f64::from(value) / unit).round() * unit;
    multiple.clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(entries: &[(u16, i16)]) -> Vec<u8> {
        let row = StoredRow {
            index: 3,
            shift: 9,
            entries: entries.to_vec(),
        };
        segment_bytes(64, &[row])
    }

    fn entries(segment: Segment<'_>) -> Vec<(usize, i16)> {
        segment.rows().flat_map(row_values).collect()
    }

    #[test]
    fn values_are_multiples_of_what_the_largest_leaves_and_small_ones_vanish() {
        let bytes = segment(&[(2, 1_000), (3, -130), (8, 60), (20, 200)]);
        let given = Segment::new(0, 1, Channels::All, &bytes).unwrap();
        // 4 bits go to 7: steps of 256, since 1,000 / 128 is 8. So 1,000 becomes 4 steps,
        // 130 and 200 become one, 60 none.
        let rounded = Rounded::new(&given, 64, 4);
        let expected = [(2, 1_024), (3, -256), (20, 256)];
        assert_eq!(entries(rounded.segment().unwrap()), expected);
        // A row with its two pairs: 32 bits, and twice 16 + 8.
        assert_eq!(rounded.packed_bytes().unwrap(), (32 + 48_u64).div_ceil(8));
    }

    #[test]
    fn as_many_bits_as_there_are_change_nothing() {
        let given = [(2, 32_767), (3, -32_767), (8, 1), (20, -1)];
        let bytes = segment(&given);
        let segment = Segment::new(0, 1, Channels::All, &bytes).unwrap();
        let rounded = Rounded::new(&segment, 64, 16);
        assert_eq!(entries(rounded.segment().unwrap()), entries(segment));
    }

    #[test]
    fn an_error_is_at_most_half_a_step_of_the_largest_value() {
        let mut random = fastrand::Rng::with_seed(6);
        for bits in BITS {
            let values: Vec<(u16, i16)> = (0..20)
                .map(|at| (3 * at, random.i16(-3_000..3_000)))
                .collect();
            let bytes = segment(&values);
            let given = Segment::new(0, 1, Channels::All, &bytes).unwrap();
            let largest = values.iter().map(|(_, value)| value.unsigned_abs()).max();
            // The largest takes more than half of what the bits can count, or the step
            // would be half as large.
            let unit = f64::from(largest.unwrap()) / f64::from((1 << (bits - 2)) - 1);
            let rounded = Rounded::new(&given, 64, bits);
            let kept = entries(rounded.segment().unwrap());
            for (col, value) in values {
                let found = kept.iter().find(|(at, _)| *at == usize::from(col));
                let found = found.map_or(0, |(_, value)| *value);
                let error = (f64::from(found) - f64::from(value)).abs();
                assert!(
                    error <= 0.5 * unit.max(1.0) + 0.5,
                    "{bits} bits: {value} became {found}"
                );
            }
        }
    }
}
