//! Page of a verdict: one HTML file with everything inside.

use super::judge::{MOST_NOISE, MOST_VIEWPOINT};
use super::maps::{MARKED, drift_scale, error_scale, pixel_scale};
use super::outcome::{MOST_SHIFTED, colour};
use super::{Cause, Outcome, PixelVerdict, TableVerdict};
use iltm_capture::PictureShift;
use iltm_compile::Provenance;
use iltm_picture::PictureError;
use iltm_picture::html::{PictureFile, capitalised, colour_bar, document, img_named, percent};
use iltm_picture::numbers::percent as plain;
use iltm_runtime::image::Table;
use maud::{Markup, html};

/// Who verified what, and when: what photographs do not tell.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Handover {
    /// The table's file.
    pub table: String,
    /// When the verdict was given, for people.
    pub date: String,
    /// Board, number, firmware, table and mode of the device, one entry each; `None` if none
    /// was asked.
    pub device: Option<Vec<(String, String)>>,
}

/// The page of a verdict; `files` are the [`pictures`](super::pictures). Complete in itself.
#[must_use]
pub fn html(
    table: &Table<'_>,
    verdict: &TableVerdict,
    files: &[PictureFile],
    handover: &Handover,
) -> String {
    let answer = verdict.outcome.words();
    let body = html! { main {
        (opening(answer, verdict))
        (identity(table, verdict, handover))
        @if let Some(judged) = &verdict.pixels { (viewer(judged, files)) }
        (pictures(verdict, files))
        (worst(verdict, files))
        (unchecked(verdict, handover))
        (drift(verdict, files))
        (details(table, verdict))
        footer { "Written by iltm " (env!("CARGO_PKG_VERSION")) "." }
    } };
    document(answer, include_str!("page.css"), &body)
}

fn opening(answer: &str, verdict: &TableVerdict) -> Markup {
    let [mut before, mut after] = verdict.error;
    let mut limit = verdict.bound.limit;
    let mut of = "with the table, by the mean light of cells";
    let by_cells = verdict.outcome == Outcome::Failed && !verdict.fails_within_cells();
    let moved = verdict.moved();
    let pixels = verdict
        .pixels
        .as_ref()
        .filter(|_| !by_cells && moved.is_none());
    let judged = pixels.and_then(|pixels| Some((pixels, pixels.fixed?, pixels.bound?)));
    if let Some((pixels, fixed, bound)) = judged {
        [before, after, limit] = [pixels.error[0], fixed.error, bound.limit];
        of = "with the table, at the same pixels in every image";
    }
    let colour = match verdict.outcome {
        Outcome::Passed => "best",
        Outcome::Failed => "bad",
        Outcome::Inconclusive => "open",
    };
    html! { header {
        p .over { "iltm verify" }
        h1 .verdict.(colour) { (answer) }
        p .lead { (reason(verdict)) }
        @if let Some(cause) = verdict.cause { p { b { "Next: " } (cause.next_step()) } }
        div .numbers {
            div .number { b { (percent(before)) } span { @if verdict.wanted { "error without the table, expected" } @else { "error of the wall as it is" } } }
            @match moved {
                Some(moved) => {
                    div .number.(colour) { b { @if moved.pixels.is_finite() { (format!("{:.1} px", moved.pixels)) } @else { "far" } } span { "between pictures that overlap" } }
                    div .number { b { (format!("{MOST_SHIFTED:.0} px")) } span { "the most that passes" } }
                }
                None => {
                    div .number.(colour) { b { (percent(after)) } span { (of) } }
                    div .number { b { (percent(limit)) } span { "the most that passes" } }
                }
            }
        }
        p { (brightness_words(verdict)) }
    } }
}

/// How bright white is with the table.
#[must_use]
pub fn brightness_words(verdict: &TableVerdict) -> String {
    if verdict.outcome == Outcome::Inconclusive {
        return "Not judged by these photographs.".to_owned();
    }
    format!(
        "White is {:.0} % as bright as without the table.",
        100.0 * verdict.brightness
    )
}

/// What was verified, and a place to sign.
fn identity(table: &Table<'_>, verdict: &TableVerdict, handover: &Handover) -> Markup {
    let provenance = Provenance::read(table.provenance());
    let scene = if provenance.scene.is_empty() {
        "no name"
    } else {
        provenance.scene.as_str()
    };
    html! { section .identity {
        h2 { "What was verified" }
        table .facts { tbody {
            tr { td { "scene" } td { (scene) } }
            tr { td { "date" } td { (handover.date) } }
            tr { td { "table" } td { (handover.table) ", id " b { (format!("{:08x}", table.id())) } ", " (table.grid()) " cells, made " (provenance.date) } }
            @match &handover.device {
                Some(lines) => { @for (name, value) in lines { tr { td { (name) } td { (value) } } } },
                None => { tr { td { "device" } td { "not asked" } } },
            }
            tr { td { "tool" } td { "iltm " (env!("CARGO_PKG_VERSION")) } }
            tr { td { "outcome" } td { (verdict.outcome.words()) } }
            tr .sign { td { "name, signature" } td {} }
        } }
    } }
}

/// What this verification says nothing of.
fn unchecked(verdict: &TableVerdict, handover: &Handover) -> Markup {
    let (compared, known) = verdict.cells;
    html! { section {
        h2 { "What was not checked" }
        ul {
            @if verdict.wanted {
                li { "The wall without compensation: its errors are what the table expects, not photographs. So is the projector's own white." }
                li { "The camera's response: a chain that compensates leaves nothing to tell it by." }
            } @else { li { "The player and the device: the slides were compensated by this program. A chain that scales, shifts or does not compensate shows another picture than these photographs; `iltm verify --wanted` looks at it." } }
            @if handover.device.is_none() { li { "Which table is on a device: none was asked." } }
            li { "Tiers below the table's top one, which a device uses when time is short." }
            @if compared < known { li { (known - compared) " of the table's " (known) " cells, which the camera did not see clearly." } }
            @for pair in &verdict.unseen { li { (capitalised(&unseen_words(*pair))) "." } }
            @if verdict.pixels.is_none() { li { "Detail within a cell, and creases: a cell's mean light is compared." } }
            li { "Content other than the test images: darker or more saturated pictures may be cut." }
            li { "Other places to stand, glossy surfaces from there, and other light in the room than during these photographs." }
        }
    } }
}

/// How the verdict was reached.
fn details(table: &Table<'_>, verdict: &TableVerdict) -> Markup {
    html! { section .details {
        h2 { "How the verdict was reached" }
        p .quiet {
            "Photographs of " (verdict.images.len()) " test images, each projected as it is and compensated, compared "
            "with what was wanted in " (verdict.cells.0) " of " (verdict.cells.1) " cells: "
            span .formula { "\u{2016}s\u{b7}photograph \u{2212} wanted\u{2016} / \u{2016}wanted\u{2016}" }
            ", with the one factor s for all cells and colours that suits a photograph best."
        }
        table .facts { tbody {
            @for (name, value) in expectation(verdict) { tr { td { (name) } td { (value) } } }
            @for gate in &verdict.gates {
                tr { td { "gate " code { (gate.name.name()) } } td { (gate.verdict.name()) ": " (gate.what) } }
            }
        } }
        h3 { "The table" }
        pre { (table.provenance().trim_end()) }
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
            bound.noise.map_or_else(
                || "not known: one photograph of white".to_owned(),
                |noise| {
                    let counted = percent(bound.counted[0]);
                    format!(
                        "{}; {counted} counts, at most as much as in white",
                        percent(noise)
                    )
                },
            ),
        ),
        ("finding the cells again makes", percent(bound.viewpoint)),
        (
            "expected in all: squares add up",
            known(bound.expected, "nothing"),
        ),
    ];
    lines.push((
        "the most that passes",
        match (bound.given, bound.expected) {
            (true, _) => format!("{}, as asked for", percent(bound.limit)),
            (false, Some(_)) => format!(
                "{}: 1.5 times what is expected, where noise counts up to {MOST_NOISE} times the \
                 promise, and finding the cells again up to {MOST_VIEWPOINT} times",
                percent(bound.limit),
            ),
            (false, None) => format!("{}: half of the error before", percent(bound.limit)),
        },
    ));
    lines
}

/// What is said first of a table that makes it no better.
const fn harm([before, after]: [f64; 2]) -> &'static str {
    if after >= before {
        "With the table the error is no smaller than without. "
    } else {
        ""
    }
}

/// How good a table is that passed.
fn good(verdict: &TableVerdict) -> String {
    let [before, after] = verdict.error;
    let of = if verdict.wanted {
        "The chain that was photographed compensates"
    } else {
        "Slides that this program compensated; player and device were not verified"
    };
    let viewer = verdict.pixels.as_ref().map_or_else(String::new, |pixels| {
        let seen = plain(pixels.error[1]);
        let fixed = fixed_words(pixels).map_or_else(String::new, |fixed| format!(", {fixed}"));
        format!(" A viewer sees {seen} of the light off, images finer than the cells{fixed}.")
    });
    format!(
        "By the mean light of cells the error is {}, {:.1} times smaller than without the \
         table.{viewer} {of}.",
        plain(after),
        before / after.max(1e-9)
    )
}

/// The part of what a viewer sees that is held against a limit, in words; `None` if none is.
#[must_use]
pub fn fixed_words(pixels: &PixelVerdict) -> Option<String> {
    let (fixed, bound) = (pixels.fixed?, pixels.bound?);
    Some(format!(
        "{} at the same pixels in every image, of which at most {} passes",
        plain(fixed.error),
        plain(bound.limit)
    ))
}

/// How far right and down a picture lies, in words.
#[must_use]
pub fn shift_words([right, down]: [f64; 2]) -> String {
    format!(
        "{:.1} pixels of the projector to the {} and {:.1} {}",
        right.abs(),
        if right < 0.0 { "left" } else { "right" },
        down.abs(),
        if down < 0.0 { "up" } else { "down" }
    )
}

/// How pictures that overlap lie against each other, in words.
#[must_use]
pub fn overlap_words(shift: &PictureShift) -> String {
    let [first, second] = shift.projectors.map(|number| number + 1);
    if shift.pixels.is_infinite() {
        return format!(
            "the pictures of projectors {first} and {second} overlap at other pixels than when the table \
             was made"
        );
    }
    format!(
        "the pictures of projectors {first} and {second} lie {:.1} pixels from where they lay against \
         each other when the table was made",
        shift.pixels
    )
}

/// What is not known of pictures whose overlap the photographs do not show, in words.
#[must_use]
pub fn unseen_words(pair: [usize; 2]) -> String {
    let [first, second] = pair.map(|number| number + 1);
    format!(
        "whether the pictures of projectors {first} and {second} lie where they lay against each other: \
         the photographs show too few places that both light"
    )
}

/// The same of those that lie too far.
#[must_use]
pub fn moved_words(shift: &PictureShift) -> String {
    if shift.pixels.is_infinite() {
        return overlap_words(shift);
    }
    format!(
        "{}; at most {MOST_SHIFTED:.0} pixel passes",
        overlap_words(shift)
    )
}

/// What is wrong within the cells.
fn within_cells(verdict: &TableVerdict) -> String {
    let pixels = verdict.pixels.as_ref();
    let fixed = pixels.and_then(fixed_words).unwrap_or_default();
    let shift = pixels.and_then(|pixels| pixels.fixed?.shift);
    if let Some(moved) = verdict.moved() {
        return format!("{}.", capitalised(&moved_words(moved)));
    }
    let what = match (verdict.cause, shift, verdict.outcome) {
        (Some(Cause::Nudged), Some(shift), _) => format!(
            "The picture lies {} of where it lay when the table was made, and the wall's own detail is \
             compensated beside it",
            shift_words(shift)
        ),
        (_, _, Outcome::Failed) => {
            "Something within the cells is not as it was when the table was made".to_owned()
        }
        _ => "Something within the cells is not as it was when the table was made, or the table errs \
              more there than it predicts"
            .to_owned(),
    };
    format!("{what}: {fixed}.")
}

/// Why it passed or not, a sentence or two.
#[must_use]
pub fn reason(verdict: &TableVerdict) -> String {
    // Plain letters: terminals have it too.
    let percent = plain;
    let [_, after] = verdict.error;
    let harm = harm(verdict.error);
    let bound = &verdict.bound;
    let level = verdict.drift.white.iter().flat_map(|white| &white.level);
    let level: Vec<f64> = level.copied().collect();
    let shape = verdict
        .drift
        .white
        .as_ref()
        .map_or(0.0, |white| white.shape);
    let apart = |what: &str| {
        format!(
            "{what} {}, and the table promises {}.",
            percent(bound.added),
            percent(bound.promise)
        )
    };
    let why = match verdict.cause {
        None => return good(verdict),
        Some(Cause::Noise) => apart("Photographs of the same picture differ among themselves by"),
        Some(Cause::Nudged | Cause::Texture) => within_cells(verdict),
        Some(Cause::Exchanged) => {
            let [first, second] = verdict
                .exchanged
                .unwrap_or_default()
                .map(|number| number + 1);
            format!("Projectors {first} and {second} show each other's pictures.")
        }
        Some(Cause::Viewpoint) => apart(
            "From where the camera stands, white differs from what the table expects from cell to \
             cell by",
        ),
        Some(Cause::Response) => format!(
            "The photographs would fit if their light were raised to the power {:.2}, with an error of \
             {}: the camera's response is not the declared one, or the projector's is not the one \
             that the table was made for.",
            verdict.curve.power,
            percent(verdict.curve.left)
        ),
        Some(Cause::Scene) => format!(
            "White now differs from what the table expects by {} from cell to cell: the projector, \
             its picture mode, the scene or something in it has moved or changed since the table \
             was made, or it is a table of another scene.",
            percent(shape)
        ),
        Some(Cause::Colour) => format!(
            "The colours of white differ from those that the table expects by {}: the camera's \
             white balance, the projector's colour mode or its lamp has changed.",
            percent(colour(&level))
        ),
        Some(Cause::ProjectorResponse) => {
            "White is as the table expects it, so the scene is the same: the projector's response \
             (picture mode, gamma) may have changed, or the table was learned from too few or too \
             noisy photographs."
                .to_owned()
        }
        Some(Cause::Chain) => verdict
            .chain
            .map_or_else(String::new, |chain| chain.to_string()),
        Some(Cause::Unknown) => {
            "The table does not tell how bright white should be, so that nothing says whether the \
             scene has changed since it was made."
                .to_owned()
        }
        Some(cause) => {
            let refusal = verdict.gates.iter().find(|gate| gate.fails());
            let what = refusal.map_or("", |gate| gate.what.as_str());
            let what = capitalised(what);
            if cause == Cause::DynamicProjector {
                format!("{what}.")
            } else {
                format!(
                    "{what}. The error that they show, {}, is theirs as much as the table's, which \
                     promises {}.",
                    percent(after),
                    percent(bound.promise)
                )
            }
        }
    };
    if verdict.outcome == Outcome::Failed {
        let unnamed = verdict.wanted && verdict.cause != Some(Cause::Chain);
        let chain = if unnamed {
            " A picture that is shifted by less than a cell, or scaled, looks like this too: first \
             see that player, device and projector show it pixel for pixel."
        } else {
            ""
        };
        format!("{harm}{why}{chain}")
    } else {
        why
    }
}

fn pictures(verdict: &TableVerdict, files: &[PictureFile]) -> Markup {
    html! { section {
        h2 { "The wall in the photographs, cell by cell" }
        p { "All at the same brightness. On the left the wanted light, drawn where the camera sees each cell." }
        @for image in &verdict.images {
            div .example {
                h3 { (image.title) }
                div .three {
                    figure { (img_named(files, &format!("{}-wanted", image.image), "Wanted")) figcaption { "Wanted" } }
                    @if !verdict.wanted { figure {
                        (img_named(files, &format!("{}-before", image.image), "Photograph of the wall without compensation"))
                        figcaption .error { "As it is: error " b { (percent(image.error[0])) } }
                    } }
                    figure {
                        (img_named(files, &format!("{}-after", image.image), "Photograph of the wall with compensation"))
                        figcaption .error { "Compensated: error " b { (percent(image.error[1])) } }
                    }
                }
            }
        }
    } }
}

/// What a viewer sees of images of the projector's own pixels.
fn viewer(judged: &PixelVerdict, files: &[PictureFile]) -> Markup {
    let [before, after] = judged.error;
    let figures = |half: usize| {
        let images: Vec<PictureError> = judged.images.iter().map(|pair| pair[half]).collect();
        PictureError::mean(&images).map(|mean| mean.words())
    };
    html! { section {
        h2 { "What a viewer sees" }
        p {
            "Natural images of the projector's own pixels, compared at " (judged.errors.len())
            " pixels of the camera: " b { (percent(after)) } " of the light is off, "
            (percent(before)) " as the wall is. The camera's noise, "
            (percent(judged.noise)) " in one photograph, is taken out."
            @if let Some(fixed) = fixed_words(judged) {
                " " (capitalised(&fixed)) ": a wrong gain or a changed wall spoils every image alike, "
                "and what is wrong in one image alone is noise, focus or the file format."
            }
        }
        div .three {
            figure { (img_named(files, "fine-wanted", "Wanted")) figcaption { "Wanted" } }
            figure { (img_named(files, "fine-before", "Photograph of the wall without compensation")) figcaption { "As it is" } }
            figure { (img_named(files, "fine-after", "Photograph of the wall with compensation")) figcaption { "Compensated" } }
        }
        p .quiet { "All three at the same exposure. Single pixels that are not compared show the mean of those beside them." }
        div .half {
            figure .cells { (img_named(files, "pixel-errors", "Error of every pixel of the camera")) (colour_bar(&pixel_scale(judged), false)) figcaption { "Error of every pixel over " (judged.images.len()) " images, compensated, relative to reference white, noise included" } }
            div {
                @if let Some(words) = figures(0) { p { "As it is: " (words) "." } }
                @if let Some(words) = figures(1) { p { "Compensated: " (words) "." } }
                p .quiet { "These figures include the noise of the photographs. " code { "iltm refine" } " feeds the photographs back into the table." }
            }
        }
    } }
}

fn worst(verdict: &TableVerdict, files: &[PictureFile]) -> Markup {
    html! { section {
        h2 { "Where it is worst" }
        p { "Error of every cell over all test images, relative to reference white. Rows and columns count from 1 at the top left of the projected picture. Grey cells could not be compared." }
        div .half {
            figure { (img_named(files, "worst-seen", "Photograph of the wall with the worst cells outlined")) figcaption { "The worst cells on the wall" } }
            figure .cells { (img_named(files, "worst-cells", "Error of each cell with compensation")) (colour_bar(&error_scale(verdict, 1), false)) figcaption { "The same cells in the projected picture, compensated" } }
        }
        div .half {
            div .scroll { table {
                thead { tr { th { "mark" } th { "row" } th { "column" } th { "error, of white" } } }
                tbody { @for (at, cell) in verdict.worst.iter().enumerate() {
                    tr {
                        td { @if at < MARKED { (at + 1) } }
                        td { (cell.row + 1) } td { (cell.col + 1) } td { (percent(cell.error)) }
                    }
                } }
            } }
            figure .cells { (img_named(files, "worst-cells-before", "Error of each cell without compensation")) (colour_bar(&error_scale(verdict, 0), false)) figcaption { "As it is; the colours have another scale" } }
        }
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
        figure .cells {
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

#[cfg(test)]
mod tests {
    use super::harm;

    #[test]
    fn only_a_table_that_makes_it_no_better_is_said_to_do_harm() {
        assert_eq!(harm([0.2, 0.1]), "");
        assert!(harm([0.2, 0.2]).contains("no smaller"));
        assert!(harm([0.1, 0.2]).contains("no smaller"));
    }
}
