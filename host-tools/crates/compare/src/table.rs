//! Benchmark tables: rows as CSV, Markdown and text.

use super::benchmark::{BenchmarkRow, MethodResult};
use iltm_picture::numbers::grouped;
use std::fmt::Write;

/// Rows as comma-separated values with a heading; a method that gives no answer has
/// its reason in the last column.
#[must_use]
pub fn csv(groups: &[(&str, &[BenchmarkRow])]) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut put = |fields: [String; 12]| {
        // Writing to memory does not fail.
        let _ = writer.write_record(fields);
    };
    put([
        "group",
        "method",
        "photographs",
        "seconds",
        "bytes",
        "multiplications_a_frame",
        "inverse_error",
        "second_bounce_error",
        "compensation_error",
        "source",
        "year",
        "remark",
    ]
    .map(str::to_owned));
    for (group, rows) in groups {
        for row in *rows {
            let number = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
            let done = row.result.as_ref().ok();
            let whole = |of: fn(&MethodResult) -> Option<usize>| {
                done.and_then(of)
                    .map_or_else(String::new, |v| v.to_string())
            };
            put([
                (*group).to_owned(),
                row.method.name.clone(),
                whole(|done| Some(done.photographs)),
                number(done.map(|done| done.seconds)),
                whole(|done| done.memory),
                number(done.and_then(|done| done.multiplications)),
                number(done.and_then(|done| done.errors.inverse)),
                number(done.and_then(|done| done.errors.second_bounce)),
                number(done.map(|done| done.errors.compensation)),
                format!("{}: {}", row.method.source.authors, row.method.source.title),
                row.method.source.year.to_string(),
                match &row.result {
                    Ok(done) => done.remark.clone(),
                    Err(why) => why.to_string(),
                },
            ]);
        }
    }
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Names of the columns that every table shows.
pub(super) const COLUMNS: [&str; 8] = [
    "method",
    "photographs",
    "time",
    "memory",
    "multiplications a frame",
    "error of the inverse",
    "second bounce",
    "compensation",
];

/// A row's cells in the order of [`COLUMNS`].
pub(super) fn cells(row: &BenchmarkRow) -> [String; 8] {
    let Ok(done) = &row.result else {
        let mut cells = [const { String::new() }; 8];
        cells[0].clone_from(&row.method.name);
        return cells;
    };
    let photographs = match done.photographs {
        0 => String::new(),
        count => count.to_string(),
    };
    [
        row.method.name.clone(),
        photographs,
        seconds(done.seconds),
        done.memory.map_or_else(String::new, bytes),
        done.multiplications
            .map_or_else(String::new, |count| grouped(count.round() as u64)),
        done.errors.inverse.map_or_else(String::new, error),
        done.errors.second_bounce.map_or_else(String::new, error),
        error(done.errors.compensation),
    ]
}

/// Rows as a Markdown table.
#[must_use]
pub fn markdown(rows: &[BenchmarkRow]) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "| {} |", COLUMNS.join(" | "));
    let _ = writeln!(text, "|---{}", "|---:".repeat(COLUMNS.len() - 1) + "|");
    for row in rows {
        match &row.result {
            Ok(_) => {
                let _ = writeln!(text, "| {} |", cells(row).join(" | "));
            }
            Err(why) => {
                let _ = writeln!(
                    text,
                    "| {} | | | | | | | no answer: {why} |",
                    row.method.name
                );
            }
        }
    }
    text
}

/// Rows for a terminal.
#[must_use]
pub fn text(rows: &[BenchmarkRow]) -> String {
    let mut text = String::new();
    let heads = [
        "",
        "photos",
        "time",
        "memory",
        "mults/frame",
        "inverse",
        "2nd bounce",
        "comp.",
    ];
    let longest = rows.iter().map(|row| row.method.name.chars().count()).max();
    let longest = longest.unwrap_or(0);
    let mut line = |cells: &[String]| {
        let _ = write!(text, "{:longest$}", cells[0]);
        for (cell, width) in cells[1..].iter().zip([8, 9, 9, 13, 10, 12, 10]) {
            let _ = write!(text, "{cell:>width$}");
        }
        text.push('\n');
    };
    line(&heads.map(str::to_owned));
    for row in rows {
        match &row.result {
            Ok(_) => line(&cells(row)),
            Err(why) => line(&[row.method.name.clone(), format!("   no answer: {why}")]),
        }
    }
    text
}

/// An error with three digits that mean something.
pub(super) fn error(value: f64) -> String {
    match value {
        v if !v.is_finite() || v >= 1e4 => "diverges".to_owned(),
        v if v >= 10.0 => format!("{v:.0}"),
        v if v >= 0.9995 => format!("{v:.1}"),
        v if v >= 0.1 => format!("{v:.3}").trim_start_matches('0').to_owned(),
        v if v >= 0.000_05 => format!("{v:.4}").trim_start_matches('0').to_owned(),
        _ => "0".to_owned(),
    }
}

fn seconds(seconds: f64) -> String {
    match seconds {
        s if s >= 10.0 => format!("{s:.0} s"),
        s if s >= 0.1 => format!("{s:.2} s"),
        s if s >= 1e-3 => format!("{:.0} ms", 1e3 * s),
        _ => "<1 ms".to_owned(),
    }
}

fn bytes(bytes: usize) -> String {
    match bytes as f64 / 1e6 {
        mega if mega >= 10.0 => format!("{mega:.0} MB"),
        mega => format!("{mega:.1} MB"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_the_digits_that_mean_something() {
        let shown = [
            0.0,
            0.000_12,
            0.0123,
            0.25,
            0.9999,
            1.25,
            120.0,
            f64::INFINITY,
        ]
        .map(error);
        assert_eq!(
            shown,
            [
                "0", ".0001", ".0123", ".250", "1.0", "1.2", "120", "diverges"
            ]
        );
    }
}
