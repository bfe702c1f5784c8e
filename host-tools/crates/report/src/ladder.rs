//! The accuracy ladder of a table: what each tier leaves out, and what it costs.

use super::microseconds;
use iltm_compile::cost::{self, BUDGET};
use iltm_runtime::{
    FrameSize,
    image::{
        Table, TierInfo,
        layout::{ALIGNMENT, entry, tier},
    },
    pipeline::FrameError,
};

/// One tier as its table has it: nothing is measured.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Step {
    /// The tier.
    pub tier: u8,
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
    /// Bytes of a table that has this tier and, of the others, gain only.
    pub table_bytes: u64,
    /// Instructions of a frame of the grid's size on the reference board
    /// ([`cost`]).
    pub instructions: u64,
}

impl Step {
    /// Share of a frame's time that the instructions take, by
    /// [`BUDGET`]: one instruction a cycle.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.instructions as f64 / BUDGET as f64
    }
}

/// All tiers of a table, gain only first.
#[must_use]
pub fn steps(table: &Table<'_>) -> Vec<Step> {
    let own = table.inverse_error().to_num::<f64>();
    let size = FrameSize::of_grid(table.grid());
    let tiers = (0_u8..).zip(table.tiers());
    let step = |(tier, info): (u8, &TierInfo)| {
        let left_out: f64 = info.predicted_error.to_num();
        Step {
            tier,
            left_out,
            total: left_out.hypot(own),
            entries: info.entries,
            multiplications: info.multiplications,
            bytes: operator_bytes(table, tier),
            table_bytes: table_bytes(table, tier),
            instructions: cost::stages(table, tier, size).total(),
        }
    };
    tiers.map(step).collect()
}

/// One tier, and how long it took here.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rung {
    /// What the table says.
    pub step: Step,
    /// Microseconds that one core of this machine took for a frame of the grid's
    /// size.
    pub microseconds: f64,
}

/// All tiers of a table, gain only first. Takes some milliseconds to measure.
///
/// # Errors
/// Those of [`microseconds`].
pub fn ladder(table: &Table<'_>) -> Result<Vec<Rung>, FrameError> {
    let measured = microseconds(table)?;
    let rungs = steps(table).into_iter().zip(measured);
    let rung = |(step, microseconds)| Rung { step, microseconds };
    Ok(rungs.map(rung).collect())
}

fn operator_bytes(table: &Table<'_>, tier: u8) -> u64 {
    let segments = table
        .operator()
        .map_or(&[][..], |operator| operator.segments());
    let used = segments.iter().filter(|segment| segment.tier == tier);
    used.map(|segment| segment.bytes() as u64).sum()
}

fn table_bytes(table: &Table<'_>, kept: u8) -> u64 {
    let segments = table
        .operator()
        .map_or(&[][..], |operator| operator.segments());
    let others = segments.iter().filter(|segment| segment.tier != kept);
    let section = |bytes: usize| entry::SIZE + bytes.next_multiple_of(ALIGNMENT);
    let sections: usize = others.map(|segment| section(segment.bytes())).sum();
    let tiers = table.tiers().len() - if kept == 0 { 1 } else { 2 };
    (table.bytes() - sections - tiers * tier::SIZE) as u64
}
