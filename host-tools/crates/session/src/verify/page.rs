//! Page of a verdict: one HTML file with everything inside.

use super::maps::{drift_scale, error_scale};
use super::{ImageVerdict, TableVerdict, TestImage};
use iltm_picture::html::{PictureFile, colour_bar, document, img_named, percent};
use iltm_runtime::image::Table;
use maud::{Markup, html};

/// The page of a verdict. `images` are those that the table makes, in the order of their
/// numbers; `files` the [`pictures`](super::pictures). Complete in itself.
#[must_use]
pub fn html(
    table: &Table<'_>,
    verdict: &TableVerdict,
    images: &[TestImage],
    files: &[PictureFile],
) -> String {
    let answer = if verdict.passed {
        "The table keeps its promise"
    } else {
        "The table does not keep its promise"
    };
    let body = html! { main {
        (opening(answer, verdict))
        (pictures(verdict, images, files))
        (worst(verdict, files))
        (drift(verdict, files))
        (origin(table))
        footer { "Written by iltm " (env!("CARGO_PKG_VERSION")) "." }
    } };
    document(answer, include_str!("page.css"), &body)
}

fn opening(answer: &str, verdict: &TableVerdict) -> Markup {
    let [before, after] = verdict.error;
    let bound = &verdict.bound;
    html! { header {
        p .over { "iltm verify" }
        h1 { (answer) }
        div .numbers {
            div .number { b { (percent(before)) } span { "error of the wall as it is" } }
            div .number .(if verdict.passed { "best" } else { "bad" }) { b { (percent(after)) } span { "with the table" } }
            div .number { b { (percent(bound.limit)) } span { "the most that passes" } }
        }
        p { (reason(verdict)) }
        p .quiet {
            "Photographs of " (verdict.images.len()) " test images, each projected as it is and compensated, compared "
            "with what was wanted in " (verdict.cells.0) " of " (verdict.cells.1) " cells: "
            span .formula { "\u{2016}s\u{b7}photograph \u{2212} wanted\u{2016} / \u{2016}wanted\u{2016}" }
            ", with the one factor s for all cells and colours that suits a photograph best."
        }
        table .facts { tbody {
            @for (name, value) in expectation(verdict) { tr { td { (name) } td { (value) } } }
        } }
    } }
}

/// Where the table's bounces do not fade, [`Expected::photograph`](super::Expected::photograph).
const UNTOLD: &str = "not known: the table does not tell what light comes of an input";

/// What the bound is made of, name and value.
fn expectation(verdict: &TableVerdict) -> Vec<(&'static str, String)> {
    let bound = &verdict.bound;
    let known =
        |value: Option<f64>, otherwise: &str| value.map_or_else(|| otherwise.to_owned(), percent);
    let mut lines = vec![
        (
            "the table predicts of itself",
            known(bound.predicted, "nothing"),
        ),
        (
            "cut samples and 8-bit codes leave",
            known(bound.range, UNTOLD),
        ),
        (
            "noise of these photographs makes",
            known(bound.noise, "not known: one photograph of white"),
        ),
        ("finding the cells again makes", percent(bound.viewpoint)),
        ("expected in all", known(bound.expected, "nothing")),
    ];
    lines.push((
        "the most that passes",
        match (bound.given, bound.expected) {
            (true, _) => format!("{}, as asked for", percent(bound.limit)),
            (false, Some(_)) => format!("{}: 1.5 times what is expected", percent(bound.limit)),
            (false, None) => format!("{}: half of the error before", percent(bound.limit)),
        },
    ));
    lines
}

/// Why it passed or failed, a sentence or two.
#[must_use]
pub fn reason(verdict: &TableVerdict) -> String {
    let [before, after] = verdict.error;
    let drift = &verdict.drift;
    if verdict.passed {
        return format!(
            "The error is {:.1} times smaller than without the table.",
            before / after.max(1e-9)
        );
    }
    let Some(white) = &drift.white else {
        return "The table does not tell how bright white should be, so that nothing says whether the \
                scene has changed since it was made."
            .to_owned();
    };
    let levels = &white.level;
    let colour = levels.iter().fold(0.0_f64, |a, b| a.max(*b))
        / levels
            .iter()
            .fold(f64::INFINITY, |a, b| a.min(*b))
            .max(1e-12)
        - 1.0;
    let changed = if white.shape > 2.0 * verdict.bound.limit.max(0.01) {
        format!(
            "White now differs from what the table expects by {} from cell to cell: the projector, \
             its picture mode, the scene or something in it has moved or changed since the table \
             was made, or it is a table of another scene.",
            percent(white.shape)
        )
    } else if colour > 0.03 {
        format!(
            "The colours of white differ from those that the table expects by {}: the camera's \
             white balance, the projector's colour mode or its lamp has changed.",
            percent(colour)
        )
    } else {
        "White is as the table expects it, so the scene is the same: the projector's response \
         (picture mode, gamma) may have changed, or the table was learned from too few or too \
         noisy photographs."
            .to_owned()
    };
    let harm = if after >= before {
        "With the table the error is larger than without. "
    } else {
        ""
    };
    format!("{harm}{changed}")
}

fn pictures(verdict: &TableVerdict, images: &[TestImage], files: &[PictureFile]) -> Markup {
    let title = |image: &ImageVerdict| {
        images
            .get(usize::from(image.image))
            .map(|test| test.title.as_str())
    };
    html! { section {
        h2 { "On the wall" }
        p { "The cells' mean light in the photographs, each at the brightness that suits it best." }
        @for image in &verdict.images {
            div .example {
                h3 { (title(image).unwrap_or("Test image")) }
                div .three {
                    figure { (img_named(files, &format!("{}-wanted", image.image), "Wanted")) figcaption { "Wanted" } }
                    figure {
                        (img_named(files, &format!("{}-before", image.image), "Photograph without compensation"))
                        figcaption .error { "As it is: error " b { (percent(image.error[0])) } }
                    }
                    figure {
                        (img_named(files, &format!("{}-after", image.image), "Photograph with compensation"))
                        figcaption .error { "Compensated: error " b { (percent(image.error[1])) } }
                    }
                }
            }
        }
    } }
}

fn worst(verdict: &TableVerdict, files: &[PictureFile]) -> Markup {
    html! { section {
        h2 { "Where it is worst" }
        p { "Error of every cell over all test images, relative to reference white. Grey cells could not be compared." }
        div .half {
            figure { (img_named(files, "worst-cells-before", "Error of each cell without compensation")) (colour_bar(&error_scale(verdict, 0), false)) figcaption { "As it is" } }
            figure { (img_named(files, "worst-cells", "Error of each cell with compensation")) (colour_bar(&error_scale(verdict, 1), false)) figcaption { "Compensated; the colours have another scale" } }
        }
        div .scroll { table {
            thead { tr { th { "row" } th { "column" } th { "error, of white" } } }
            tbody { @for cell in &verdict.worst { tr { td { (cell.row) } td { (cell.col) } td { (percent(cell.error)) } } } }
        } }
    } }
}

fn drift(verdict: &TableVerdict, files: &[PictureFile]) -> Markup {
    let session = percent(verdict.drift.session);
    let Some(white) = &verdict.drift.white else {
        return html! { section {
            h2 { "What has changed since the table was made" }
            p { "This is " (UNTOLD) "." }
            p .quiet { "During this session white changed by " (session) "." }
        } };
    };
    let levels: Vec<String> = white.level.iter().map(|level| percent(*level)).collect();
    html! { section .split {
        figure {
            (img_named(files, "drift", "Change of white since the table was made"))
            (colour_bar(&drift_scale(verdict), false))
        }
        div {
            h2 { "What has changed since the table was made" }
            p {
                "White now is " (levels.join(", ")) " of what the table expects"
                @if white.level.len() == 3 { " (red, green, blue)" }
                ". Where camera and exposure are the same, that is how the lamp has aged; otherwise it says nothing."
            }
            p {
                "From cell to cell white differs by " b { (percent(white.shape)) }
                " from that: the map shows where. A bump that moved the projector, new furniture or a change of focus shows as a pattern."
            }
            p .quiet { "During this session white changed by " (session) "." }
        }
    } }
}

fn origin(table: &Table<'_>) -> Markup {
    html! { section {
        h2 { "The table" }
        pre { (table.provenance().trim_end()) }
    } }
}
