//! Points of one table: its tiers, and the same with fewer bits.

use super::bits::{BITS, Rounded};
use super::float_table::FloatTable;
use super::judge::{ReferenceTransport, of_change};
use super::{Point, Sweep, TradeoffError};
use crate::{TierCost, microseconds, tier_costs};
use iltm_compile::cost::Shape;
use iltm_picture::progress::Progress;
use iltm_runtime::{FrameSize, image::Table};
use iltm_solve::SolveReport;

/// What the points of one table have in common.
pub(super) struct Common {
    pub(super) sweep: Sweep,
    pub(super) setting: String,
    pub(super) method: Option<String>,
    pub(super) photographs: Option<u64>,
    pub(super) seconds: Option<f64>,
}

impl Common {
    pub(super) fn solved(sweep: Sweep, setting: String, report: &SolveReport) -> Self {
        let counts = report.photographs;
        let seconds = report.seconds;
        Self {
            sweep,
            setting,
            method: Some(report.method.to_string()),
            photographs: Some(counts.all() as u64),
            seconds: Some(seconds.prepare + seconds.choose + seconds.solve + seconds.finish),
        }
    }

    pub(super) fn again(&self, sweep: Sweep, setting: String) -> Self {
        Self {
            sweep,
            setting,
            method: self.method.clone(),
            ..*self
        }
    }

    /// The point of one of a table's tiers, without a true error.
    pub(super) fn point(&self, table: &Table<'_>, cost: TierCost, microseconds: f64) -> Point {
        Point {
            sweep: self.sweep,
            setting: self.setting.clone(),
            tier: cost.tier,
            method: self.method.clone(),
            photographs: self.photographs,
            bits: 16,
            grid: table.grid(),
            left_out: cost.left_out,
            inverse: table.inverse_error().to_num(),
            predicted: cost.total,
            truth: None,
            instructions: cost.instructions,
            microseconds: Some(microseconds),
            bytes: cost.table_bytes,
            seconds: self.seconds,
            hypothetical: false,
            front: false,
        }
    }
}

/// A point for each tier of a table.
pub(super) fn of_tiers(
    common: &Common,
    table: &Table<'_>,
    truth: Option<&ReferenceTransport>,
) -> Result<Vec<Point>, TradeoffError> {
    let numbers = FloatTable::new(table);
    let timed = microseconds(table).map_err(TradeoffError::Timing)?;
    let white = table.reference_white().to_num::<f64>();
    let point = |(cost, microseconds): (TierCost, f64)| Point {
        truth: truth.map(|truth| {
            let entries = numbers.entries(&numbers.segments(cost.tier));
            truth.error(&numbers, &entries, white)
        }),
        ..common.point(table, cost, microseconds)
    };
    Ok(tier_costs(table)
        .into_iter()
        .zip(timed)
        .map(point)
        .collect())
}

/// Points of a table's tiers with coefficients of fewer bits; `points` are those of the
/// table.
pub(super) fn of_bits(
    table: &Table<'_>,
    points: &[Point],
    truth: Option<&ReferenceTransport>,
    progress: &dyn Progress,
) -> Result<Vec<Point>, TradeoffError> {
    let numbers = FloatTable::new(table);
    let white = table.reference_white().to_num::<f64>();
    let scene = numbers.entries(&numbers.segments(table.top_tier()));
    let shape = Shape::of(table, FrameSize::of_grid(table.grid()));
    let cells = table.grid().cells();
    let with_operator: Vec<&Point> = points.iter().filter(|point| point.tier > 0).collect();
    let mut rounded_points = Vec::new();
    progress.begin("rounding coefficients", BITS.len() as u64);
    for bits in BITS {
        for point in &with_operator {
            let segments = numbers.segments(point.tier);
            let rounded = segments
                .iter()
                .map(|segment| Rounded::new(segment, cells, bits));
            let rounded: Vec<Rounded> = rounded.collect();
            let stored = rounded
                .iter()
                .map(Rounded::segment)
                .collect::<Result<Vec<_>, _>>();
            let stored = stored.map_err(TradeoffError::Operator)?;
            let packed = rounded
                .iter()
                .map(Rounded::packed_bytes)
                .sum::<Result<u64, _>>();
            let packed = packed.map_err(TradeoffError::Operator)?;
            let own: usize = segments
                .iter()
                .map(iltm_runtime::operator::Segment::bytes)
                .sum();
            let entries = numbers.entries(&stored);
            let change = of_change(&numbers, &scene, &numbers.entries(&segments), &entries);
            rounded_points.push(Point {
                sweep: Sweep::Bits,
                setting: format!("{bits} bits"),
                bits,
                left_out: point.left_out.hypot(change),
                predicted: point.predicted.hypot(change),
                truth: truth.map(|truth| truth.error(&numbers, &entries, white)),
                instructions: shape.stages(&stored).total(),
                microseconds: None,
                bytes: point.bytes - own as u64 + packed,
                hypothetical: true,
                ..(*point).clone()
            });
        }
        progress.advance(1);
    }
    progress.end();
    Ok(rounded_points)
}
