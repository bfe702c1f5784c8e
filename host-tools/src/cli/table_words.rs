//! A table in six lines: how good it is, how bright, what it is, and what to do next.

use crate::compile::{Provenance, cost::CLOCK};
use crate::report::tier_costs;
use crate::solve::Compensation;
use iltm_picture::numbers::{grouped, percent};
use iltm_runtime::image::Table;
use iltm_runtime::units::Light;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// A word for a predicted error, by what a viewer sees of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Grade {
    /// The eye does not tell it from the wanted picture.
    Good,
    /// It is seen beside the wanted picture, and not without it.
    Fair,
    /// It is seen.
    Poor,
}

/// An eye just sees a contrast of about one per cent where light is even; in pictures it takes more.
const GOOD: f64 = 0.015;

/// What is seen without anything to compare with.
const FAIR: f64 = 0.04;

impl Grade {
    fn of(error: f64) -> Self {
        // Written so that what is not a number is poor.
        if error <= GOOD {
            Self::Good
        } else if error <= FAIR {
            Self::Fair
        } else {
            Self::Poor
        }
    }

    const fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Fair => "fair",
            Self::Poor => "poor",
        }
    }
}

/// Error of the table's top tier and of gains alone, which are its tier 0, each with the
/// error of the inverse itself; `None` where nothing was predicted.
fn errors(table: &Table<'_>) -> Option<(f64, f64)> {
    if table.inverse_error().to_num::<f64>() <= 0.0 {
        return None;
    }
    let tiers = tier_costs(table);
    Some((tiers.last()?.total, tiers.first()?.total))
}

/// What programs learn of it beside the figures.
pub(super) fn data(table: &Table<'_>) -> Value {
    let grade = errors(table).map(|(error, _)| Grade::of(error).word());
    json!({
        "grade": grade,
        "brightness": Provenance::read(table.provenance()).brightness,
        "black": table.black().to_num::<f64>(),
        "projector": table.projector().map(|projector| json!({
            "width": projector.size().width(),
            "height": projector.size().height(),
            "border": projector.border(),
        })),
    })
}

/// The lines; `path` is the table's file.
pub(super) fn lines(path: &Path, table: &Table<'_>) -> String {
    let provenance = Provenance::read(table.provenance());
    let mut text = String::new();
    let _ = match errors(table) {
        None => writeln!(
            text,
            "error       not predicted: too few photographs to hold any out"
        ),
        Some((error, gains)) => {
            let before = provenance
                .predicted_error
                .map_or_else(String::new, |predicted| {
                    format!("; {} without a table", percent(predicted.uncompensated))
                });
            let alone = if table.operator().is_some() {
                format!(", {} with gains alone", percent(gains))
            } else if provenance.compensation == Compensation::Nothing.to_string() {
                ": even enough, pictures are left as they are".to_owned()
            } else {
                ": gains alone, no bounces are cancelled".to_owned()
            };
            let _ = writeln!(
                text,
                "{:<12}predicted to be {} off the wanted light{before}{alone}",
                Grade::of(error).word(),
                percent(error),
            );
            let figures = provenance.predicted_error.and_then(|error| error.figures);
            figures.map_or(Ok(()), |figures| {
                writeln!(text, "{:<12}{}", "pixels", figures.words())
            })
        }
    };
    if let Some(refined) = provenance.refined.last() {
        let _ = writeln!(
            text,
            "refined     {}: from {} of what a viewer sees to {}, by photographs of the wall",
            refined.date.get(..10).unwrap_or_default(),
            percent(refined.before),
            percent(refined.after),
        );
    }
    if let Some(brightness) = provenance.brightness {
        let _ = writeln!(text, "brightness  {}", brightness.words());
    }
    if table.black() > Light::ZERO {
        let _ = writeln!(
            text,
            "black       raised to {} of white everywhere, as it is where black is brightest",
            percent(table.black().to_num()),
        );
    }
    let _ = writeln!(text, "{}", sizes(table));
    if let Some(neighbours) = table.neighbours() {
        let [before, after] = neighbours.around();
        let plural = if before == 1 { "" } else { "s" };
        let _ = writeln!(
            text,
            "neighbours  {} cells of {before} projector{plural} on the left and {after} on the right: {} bytes \
             of their light a frame",
            neighbours.grid(),
            grouped(neighbours.bytes() as u64),
        );
    }
    if let Some(top) = tier_costs(table).last() {
        let _ = writeln!(
            text,
            "time        {:.2} ms a frame of one pixel a cell on the reference device",
            1e3 * top.instructions as f64 / CLOCK as f64
        );
    }
    // Of a device or a pipe, the table is wherever its reader has put it.
    if path.is_file() && !path.starts_with("/dev") {
        let file = crate::solve_page::quoted(path);
        let next = if table.neighbours().is_some() {
            format!("flash it to the device of its projector: iltm flash {file}")
        } else if provenance.overlapping {
            format!(
                "prove it on the wall: iltm verify {file} -o VERIFY --captures LEFT RIGHT, its captures"
            )
        } else {
            format!("prove it on the wall: iltm verify {file} -o VERIFY")
        };
        let _ = writeln!(text, "next        {next}");
    }
    text
}

/// The line of what the table is for, and how long it is.
fn sizes(table: &Table<'_>) -> String {
    let colour = if table.channels() == 1 {
        "grey"
    } else {
        "colour"
    };
    let projector = table.projector().map_or_else(String::new, |projector| {
        let (width, height) = (projector.size().width(), projector.size().height());
        let border = match projector.border() {
            0 => String::new(),
            border => format!(" with a border of {border}"),
        };
        format!(" on {width} x {height} pixels{border}")
    });
    format!(
        "table       {}, {:08x}: {} cells{projector}, {colour}, {} bytes",
        table.label(),
        table.id(),
        table.grid(),
        table.bytes()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_is_poor_and_limits_belong_to_the_better_word() {
        let cases = [
            (0.004, "good"),
            (GOOD, "good"),
            (0.02, "fair"),
            (FAIR, "fair"),
            (0.2, "poor"),
            (f64::NAN, "poor"),
            (f64::INFINITY, "poor"),
        ];
        for (error, word) in cases {
            assert_eq!(Grade::of(error).word(), word, "{error}");
        }
    }
}
