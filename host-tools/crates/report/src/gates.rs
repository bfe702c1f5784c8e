//! Gates page: the verdict on a capture and the next step, the photograph of white, then what
//! each gate says with what its number was taken from, bad news first.

use iltm_capture::{Evidence, Examined, Gate, Verdict, WhitePhotograph};
use iltm_picture::{
    ColourScale, Palette, Response,
    canvas::{Canvas, QUIET},
    chart::{Chart, ChartAxis, PALETTE, Series},
    html::{capitalised, colour_bar, document, img},
    png,
};
use iltm_runtime::FrameSize;
use maud::{Markup, html};

const STYLE: &str = include_str!("gates.css");

/// Colour of the projection's border, and of clipped pixels, in the photograph of white.
const BORDER: [u8; 3] = [0x2a, 0x9d, 0xf4];
const CLIPPED: [u8; 3] = [0xe6, 0x19, 0x2b];

/// The page of a capture of this name.
#[must_use]
pub fn page(name: &str, examined: &Examined) -> String {
    let that = |verdict: Verdict| -> Vec<&Gate> {
        let that = examined.gates.iter().filter(|gate| gate.verdict == verdict);
        that.collect()
    };
    let [failed, warned, open, passed] = [
        Verdict::Fail,
        Verdict::Warn,
        Verdict::NotJudged,
        Verdict::Pass,
    ]
    .map(that);
    let body = html! {
        main {
            p.over { "iltm check" }
            h1 { (name) }
            (outcome(&failed, &warned, &open))
            @if let Some(white) = &examined.white { (photograph(white)) }
            @for gate in failed.iter().chain(&warned) { (card(gate, true)) }
            @if !open.is_empty() {
                h2.group { "Not judged" }
                @for gate in &open { (card(gate, false)) }
            }
            @if !passed.is_empty() {
                h2.group { "Passed" }
                @for gate in &passed { (card(gate, false)) }
            }
        }
    };
    document(&format!("Check of {name}"), STYLE, &body)
}

/// The verdict in large words, and what to do next.
fn outcome(failed: &[&Gate], warned: &[&Gate], open: &[&Gate]) -> Markup {
    let names = |gates: &[&Gate]| {
        let names: Vec<String> = gates.iter().map(|gate| gate.name.to_string()).collect();
        names.join(", ")
    };
    let (class, word) = match (failed, open) {
        ([], []) => ("pass", "Passed"),
        ([], _) => ("open", "Passed, as far as it was judged"),
        _ => ("fail", "Refused"),
    };
    html! {
        section class=(format!("outcome {class}")) {
            p.word { (word) }
            @match failed.first() {
                Some(first) => {
                    p.lead { (capitalised(&first.what)) "." }
                    p.next { b { "Next: " } (first.next_step) }
                    @if failed.len() > 1 {
                        p.quiet { "Also refused by: " (names(&failed[1..])) "." }
                    }
                }
                None => p.lead {
                    "These photographs can be used."
                    @if !warned.is_empty() { " There is a remark on: " (names(warned)) "." }
                },
            }
            @if !open.is_empty() {
                p.quiet { "Not judged, so that nothing is known of it: " (names(open)) "." }
            }
        }
    }
}

/// The photograph of white with the border of the projection and what is clipped.
fn photograph(white: &WhitePhotograph) -> Markup {
    let (width, height) = white.size;
    let side = |pixels: usize| u16::try_from(pixels).ok();
    let size = side(width).zip(side(height));
    let Some(size) = size.and_then(|(width, height)| FrameSize::new(width, height)) else {
        return html! {};
    };
    let mut canvas = Canvas::new(size, QUIET);
    // Lines must be seen where the picture is drawn smaller than it is.
    let thick = width.div_ceil(700);
    for y in 0..height {
        for x in 0..width {
            let at = y * width + x;
            let beside = [
                (x >= thick).then(|| at - thick),
                (x + thick < width).then_some(at + thick),
                (y >= thick).then(|| at - thick * width),
                (y + thick < height).then_some(at + thick * width),
            ];
            let inside = white.lit[at];
            let border = inside && beside.iter().any(|at| at.is_none_or(|at| !white.lit[at]));
            let code =
                (255.0 * Response::Srgb.value(f64::from(white.light[at]).clamp(0.0, 1.0))) as u8;
            let colour = match (white.clipped[at], border) {
                (true, _) => CLIPPED,
                (_, true) => BORDER,
                _ => [code; 3],
            };
            canvas.set(x, y, colour);
        }
    }
    let clipped = white.clipped.iter().filter(|clipped| **clipped).count();
    html! {
        figure.white {
            (img(&png::encode(&canvas.finish()), "the photograph of white"))
            figcaption {
                "White as the camera sees it. " span.border { "Blue" } ": border of the projection's cells that were found. "
                @if clipped > 0 {
                    span.clipped { "Red" } ": " (clipped) " clipped pixels, whose light is not known."
                } @else {
                    "No pixel is clipped."
                }
            }
        }
    }
}

/// A gate; closed unless it is to be read.
fn card(gate: &Gate, open: bool) -> Markup {
    let mark = match gate.verdict {
        Verdict::Pass => "passes",
        Verdict::NotJudged => "not judged",
        Verdict::Warn => "remark",
        Verdict::Fail => "fails",
    };
    html! {
        details class=(format!("gate {}", gate.verdict.name())) open[open] {
            summary.head {
                h3 { (gate.name) }
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
            from,
        } => {
            let points = values
                .iter()
                .map(|(index, value)| (f64::from(*index), *value));
            // What lies on the other side of a step has another colour.
            let (before, after): (Vec<_>, Vec<_>) =
                points.partition(|(index, _)| from.is_none_or(|from| *index < f64::from(from)));
            chart(
                "index of the photograph",
                what,
                [&before, &after],
                *limit,
                0.0,
            )
        }
        Evidence::Curve { x, y, points } => chart(x, y, [points, &[]], None, 1.5),
        Evidence::Cells {
            what,
            rows,
            cols,
            values,
            notable,
        } => map(what, (*rows, *cols), values, *notable),
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

/// Points over two axes before and after a step, with a line at the limit.
fn chart(x: &str, y: &str, parts: [&[(f64, f64)]; 2], limit: Option<f64>, line: f64) -> Markup {
    let points = || parts.into_iter().flatten();
    if points().next().is_none() {
        return html! {};
    }
    let series = |(points, (colour, name)): (&[(f64, f64)], (&'static str, &str))| Series {
        name: name.to_owned(),
        points: points.to_vec(),
        colour,
        line,
        dot: 2.4,
        ..Series::default()
    };
    let names = if parts[1].is_empty() {
        ["", ""]
    } else {
        ["before", "after it moved"]
    };
    let colours = [(PALETTE[0], names[0]), (PALETTE[1], names[1])];
    let chart = Chart {
        title: y,
        size: (560.0, 220.0),
        x: ChartAxis {
            range: Some(range(points().map(|p| p.0))),
            ..ChartAxis::linear(x)
        },
        y: ChartAxis {
            range: Some(range(points().map(|p| p.1).chain(limit))),
            ..ChartAxis::default()
        },
        limit: limit.map(|limit| (limit, "limit")),
        series: parts.into_iter().zip(colours).map(series).collect(),
        ..Chart::default()
    };
    html! {
        figure { (chart.render()) figcaption { (capitalised(y)) } }
    }
}

/// A number for each cell as a picture; cells without one stay grey.
/// Numbers below what is notable have the colours of small ones.
fn map(what: &str, (rows, cols): (usize, usize), values: &[f64], notable: f64) -> Markup {
    let side = |cells: usize| u16::try_from(cells).unwrap_or(u16::MAX);
    let size = FrameSize::new(side(cols), side(rows)).filter(|s| s.pixels() == values.len());
    let Some(size) = size else {
        return html! {};
    };
    let sizes = || values.iter().map(|value| value.abs());
    let high = sizes()
        .filter(|v| v.is_finite())
        .fold(notable.max(1e-6), f64::max);
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

    fn examined(gates: Vec<Gate>) -> Examined {
        Examined {
            gates,
            white: None,
            measurements: None,
        }
    }

    #[test]
    fn bad_news_comes_first_and_every_photograph_is_drawn() {
        let evidence = Evidence::Photographs {
            what: "brightness, %",
            values: (0..7).map(|k| (k, f64::from(k) - 3.0)).collect(),
            limit: Some(1.5),
            from: Some(4),
        };
        let good = Gate {
            name: GateName::Complete,
            ..gate(Verdict::Pass, Evidence::None)
        };
        let page = page("c", &examined(vec![good, gate(Verdict::Fail, evidence)]));
        let place = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}: {page}"));
        assert!(place("Refused") < place("Hold it still."));
        assert!(place("<h3>flicker") < place("<h3>complete"));
        assert_eq!(page.matches("<details").count(), 2);
        assert_eq!(page.matches(" open>").count(), 1);
        assert_eq!(page.matches("<circle").count(), 7 + 2);
        assert!(page.contains("class=\"limit\"") && page.contains("after it moved"));
    }

    #[test]
    fn what_was_not_judged_is_no_plain_pass() {
        let page = page(
            "c",
            &examined(vec![gate(Verdict::NotJudged, Evidence::None)]),
        );
        assert!(page.contains("Passed, as far as it was judged"), "{page}");
    }

    #[test]
    fn a_photograph_of_white_has_its_border_and_clipped_pixels() {
        let inside = |at: usize| (1..5).contains(&(at % 6)) && (1..4).contains(&(at / 6));
        let white = WhitePhotograph {
            size: (6, 5),
            light: vec![0.5; 30],
            clipped: (0..30).map(|at| at == 14).collect(),
            lit: (0..30).map(inside).collect(),
        };
        let page = photograph(&white).into_string();
        assert!(page.contains("1 clipped pixels") && page.contains("data:image/png"));
    }

    #[test]
    fn cells_without_a_number_do_not_disturb_the_picture() {
        let evidence = Evidence::Cells {
            what: "light",
            rows: 2,
            cols: 3,
            values: vec![1.0, 2.0, f64::NAN, -4.0, 0.0, 1.0],
            notable: 0.0,
        };
        let page = page("c", &examined(vec![gate(Verdict::Pass, evidence)]));
        assert!(page.contains("data:image/png;base64,"));
        assert!(page.contains(">4</span>"), "{page}");
    }
}
