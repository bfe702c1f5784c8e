//! JSON and CSV of the points.

use super::{Missing, Point, Tradeoff};
use iltm_compile::cost::{BUDGET, CLOCK, RATE};
use serde_json::{Value, json};

impl Tradeoff {
    /// Everything, for programs and for the page.
    #[must_use]
    pub fn data(&self) -> Value {
        let missing = |missing: &Missing| json!({ "what": missing.what, "why": missing.why });
        json!({
            "name": self.name,
            "scene": self.scene,
            "rows": self.grid.rows(),
            "cols": self.grid.cols(),
            "channels": self.channels,
            "advice": self.advice(),
            "budget": { "instructions": BUDGET, "clock": CLOCK, "rate": RATE },
            "points": self.points.iter().map(point).collect::<Vec<_>>(),
            "missing": self.missing.iter().map(missing).collect::<Vec<_>>(),
        })
    }

    /// All points, a line each.
    #[must_use]
    pub fn csv(&self) -> Vec<u8> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        // Writing to memory does not fail.
        let _ = writer.write_record(COLUMNS);
        for point in &self.points {
            let data = self::point(point);
            let _ = writer.write_record(COLUMNS.map(|column| field(&data[column])));
        }
        writer.into_inner().unwrap_or_default()
    }
}

const COLUMNS: [&str; 20] = [
    "sweep",
    "setting",
    "tier",
    "method",
    "photographs",
    "bits",
    "rows",
    "cols",
    "left_out",
    "inverse_error",
    "predicted_error",
    "true_error",
    "instructions",
    "share",
    "microseconds",
    "bytes",
    "hypothetical",
    "solve_seconds",
    "front",
    "current",
];

/// A point. What is not a number is `null`.
fn point(point: &Point) -> Value {
    json!({
        "sweep": point.sweep.name(),
        "setting": point.setting,
        "tier": point.tier,
        "method": point.method,
        "photographs": point.photographs,
        "bits": point.bits,
        "rows": point.grid.rows(),
        "cols": point.grid.cols(),
        "left_out": point.left_out,
        "inverse_error": (point.inverse > 0.0).then_some(point.inverse),
        "predicted_error": point.predicted,
        "true_error": point.truth,
        "instructions": point.instructions,
        "share": point.share(),
        "microseconds": point.microseconds,
        "bytes": point.bytes,
        "hypothetical": point.hypothetical,
        "solve_seconds": point.seconds,
        "front": point.front,
        "current": point.sweep == super::Sweep::Table,
    })
}

/// A value as a field; what there is not is empty.
fn field(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tradeoff::Sweep;
    use crate::tradeoff::advice::tests::point;
    use iltm_runtime::Grid;

    #[test]
    fn every_point_is_a_line_with_what_is_missing_left_empty() {
        let mut first = point(Sweep::Table, 1, 0.25, 0.5);
        first.setting = "one, \"two\"".to_owned();
        let tradeoff = Tradeoff {
            name: String::new(),
            scene: String::new(),
            grid: Grid::new(2, 2).unwrap(),
            channels: 1,
            points: vec![first, point(Sweep::Bits, 1, f64::NAN, 0.5)],
            missing: Vec::new(),
        };
        let text = String::from_utf8(tradeoff.csv()).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert_eq!(lines[0].split(',').count(), COLUMNS.len());
        assert!(
            lines[1].starts_with("table,\"one, \"\"two\"\"\",1,,,16,2,2,0.25,,0.25,,1800000,0.5,")
        );
        assert!(lines[2].starts_with("bits,,1,,,16,2,2,,,,,1800000,0.5,"));
    }
}
