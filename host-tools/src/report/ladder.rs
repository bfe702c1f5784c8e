//! The accuracy ladder of a table: what each tier leaves out, and what it costs.

use super::microseconds;
use iltm_runtime::image::{Table, TierInfo};
use iltm_runtime::pipeline::FrameError;

/// One tier.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rung {
    /// Predicted error of what the tier leaves out, relative to the wanted light.
    pub left_out: f64,
    /// The same together with the inverse's own error: root of the sum of squares.
    pub total: f64,
    /// Operator entries read a frame.
    pub entries: u32,
    /// Multiplications by them a frame, all channels.
    pub multiplications: u32,
    /// Bytes of the operator that a frame reads.
    pub bytes: u64,
    /// Microseconds that one core of this machine took for a frame of the grid's
    /// size.
    pub microseconds: f64,
}

/// All tiers of a table, gain only first. Takes some milliseconds to measure.
///
/// # Errors
/// Those of [`microseconds`].
pub fn ladder(table: &Table<'_>) -> Result<Vec<Rung>, FrameError> {
    let own = table.inverse_error().to_num::<f64>();
    let measured = microseconds(table)?;
    let tiers = (0_u8..).zip(table.tiers()).zip(measured);
    let rung = |((tier, info), microseconds): ((u8, &TierInfo), f64)| {
        let left_out: f64 = info.predicted_error.to_num();
        Rung {
            left_out,
            total: left_out.hypot(own),
            entries: info.entries,
            multiplications: info.multiplications,
            bytes: operator_bytes(table, tier),
            microseconds,
        }
    };
    Ok(tiers.map(rung).collect())
}

fn operator_bytes(table: &Table<'_>, tier: u8) -> u64 {
    let segments = table
        .operator()
        .map_or(&[][..], |operator| operator.segments());
    let used = segments.iter().filter(|segment| segment.tier == tier);
    used.map(|segment| segment.bytes() as u64).sum()
}
