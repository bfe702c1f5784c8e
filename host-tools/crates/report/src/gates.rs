//! Gates page: what the gates say of a capture, a card for each, what explains others
//! first, with what its number was taken from.

use iltm_capture::{Evidence, Gate, Verdict};
use iltm_picture::{
    ColourScale, Palette,
    canvas::{Canvas, QUIET},
    chart::{Chart, ChartAxis, PALETTE, Series},
    html::{capitalised, colour_bar, document, img},
    png,
};
use iltm_runtime::FrameSize;
use maud::{Markup, html};

const STYLE: &str = include_str!("gates.css");

/// The page; `name` is the capture's.
#[must_use]
pub fn page(name: &str, gates: &[Gate]) -> String {
    let failed = gates.iter().filter(|gate| gate.fails()).count();
    let warned = gates.iter().filter(|g| g.verdict == Verdict::Warn).count();
    let lead = match (failed, warned) {
        (0, 0) => "These photographs can be used.".to_owned(),
        (0, 1) => "These photographs can be used; one gate has a remark.".to_owned(),
        (0, warned) => format!("These photographs can be used; {warned} gates have a remark."),
        (1, _) => "These photographs cannot be used as they are: one gate fails.".to_owned(),
        (failed, _) => {
            format!("These photographs cannot be used as they are: {failed} gates fail.")
        }
    };
    let body = html! {
        main {
            p.over { "iltm check" }
            h1 { (name) }
            p.lead { (lead) }
            p.quiet {
                "Begin with the first gate that fails: what follows from it is judged once it passes."
            }
            @for gate in gates { (card(gate)) }
        }
    };
    document(&format!("Check of {name}"), STYLE, &body)
}

fn card(gate: &Gate) -> Markup {
    let mark = match gate.verdict {
        Verdict::Pass => "passes",
        Verdict::NotJudged => "not judged",
        Verdict::Warn => "remark",
        Verdict::Fail => "fails",
    };
    html! {
        section class=(format!("gate {}", gate.verdict.name())) {
            div.head {
                h2 { (gate.name) }
                span.mark { (mark) }
                @if gate.verdict != Verdict::NotJudged {
                    span.number { (gate.number_and_limit()) }
                }
            }
            p { (capitalised(&gate.what)) "." }
            @if !gate.next_step.is_empty() {
                p.next { b { "Next: " } (gate.next_step) }
            }
            (picture(&gate.evidence))
        }
    }
}

fn picture(evidence: &Evidence) -> Markup {
    match evidence {
        Evidence::None => html! {},
        Evidence::Photographs {
            what,
            values,
            limit,
        } => {
            let points: Vec<(f64, f64)> = (values.iter())
                .map(|(index, value)| (f64::from(*index), *value))
                .collect();
            chart("index of the photograph", what, &points, *limit, false)
        }
        Evidence::Curve { x, y, points } => chart(x, y, points, None, true),
        Evidence::Cells {
            what,
            rows,
            cols,
            values,
        } => map(what, *rows, *cols, values),
    }
}

/// Smallest range of all numbers, with 0 in it; never empty.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for value in values.filter(|value| value.is_finite()) {
        (low, high) = (low.min(value), high.max(value));
    }
    if high - low < 1e-9 {
        high = low + 1.0;
    }
    (low, high)
}

/// Points over two axes, with a line at the limit.
fn chart(x: &str, y: &str, points: &[(f64, f64)], limit: Option<f64>, joined: bool) -> Markup {
    if points.is_empty() {
        return html! {};
    }
    let chart = Chart {
        title: y,
        size: (560.0, 220.0),
        x: ChartAxis {
            range: Some(range(points.iter().map(|p| p.0))),
            ..ChartAxis::linear(x)
        },
        y: ChartAxis {
            range: Some(range(points.iter().map(|p| p.1).chain(limit))),
            ..ChartAxis::default()
        },
        limit: limit.map(|limit| (limit, "limit")),
        series: vec![Series {
            points: points.to_vec(),
            colour: PALETTE[0],
            line: if joined { 1.5 } else { 0.0 },
            dot: 2.4,
            ..Series::default()
        }],
        ..Chart::default()
    };
    html! {
        figure { (chart.render()) figcaption { (capitalised(y)) } }
    }
}

/// A number for each cell as a picture; cells without one stay grey.
fn map(what: &str, rows: usize, cols: usize, values: &[f64]) -> Markup {
    let side = |cells: usize| u16::try_from(cells).unwrap_or(u16::MAX);
    let size = FrameSize::new(side(cols), side(rows)).filter(|s| s.pixels() == values.len());
    let Some(size) = size else {
        return html! {};
    };
    let sizes = || values.iter().map(|value| value.abs());
    let high = sizes()
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max)
        .max(1e-6);
    let scale = ColourScale::linear(Palette::Viridis, high);
    let mut canvas = Canvas::new(size, QUIET);
    for (at, value) in sizes().enumerate().filter(|(_, value)| value.is_finite()) {
        canvas.set(at % cols, at / cols, scale.colour(value));
    }
    html! {
        figure.map {
            (img(&png::encode(&canvas.finish()), what))
            (colour_bar(&scale, false))
            figcaption { (capitalised(what)) ", a square for each cell" }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_capture::GateName;

    fn gate(verdict: Verdict, evidence: Evidence) -> Gate {
        Gate {
            name: GateName::Flicker,
            verdict,
            number: 2.0,
            limit: 1.5,
            unit: "%",
            what: "brightness jumps".to_owned(),
            next_step: "Hold it still.",
            evidence,
        }
    }

    #[test]
    fn a_page_says_how_many_gates_fail_and_draws_every_photograph() {
        let evidence = Evidence::Photographs {
            what: "brightness, %",
            values: (0..7).map(|k| (k, f64::from(k) - 3.0)).collect(),
            limit: Some(1.5),
        };
        let page = page("c", &[gate(Verdict::Fail, evidence)]);
        assert!(page.contains("one gate fails"));
        assert_eq!(page.matches("<circle").count(), 7);
        assert!(page.contains("class=\"limit\"") && page.contains("Hold it still."));
    }

    #[test]
    fn cells_without_a_number_do_not_disturb_the_picture() {
        let evidence = Evidence::Cells {
            what: "light",
            rows: 2,
            cols: 3,
            values: vec![1.0, 2.0, f64::NAN, -4.0, 0.0, 1.0],
        };
        let page = page("c", &[gate(Verdict::Pass, evidence)]);
        assert!(page.contains("data:image/png;base64,"));
        assert!(page.contains(">4</span>"), "{page}");
    }
}
