//! HTML page of the trade-off: one file that a browser shows without network.

use super::advice::fraction;
use super::picture::{colour, title};
use super::{Point, Sweep, Tradeoff};
use iltm_compile::cost::{CLOCK, RATE};
use iltm_picture::html::{capitalised, document, grouped, percent};
use maud::{Markup, PreEscaped, html};

impl Tradeoff {
    /// The page as HTML, complete in itself.
    #[must_use]
    pub fn html(&self) -> String {
        // No string within can end the script.
        let data = self.data().to_string().replace('<', "\\u003c");
        let what = self.heading();
        let body = html! {
            main {
                header {
                    p .over { "iltm tradeoff" }
                    h1 { (what) }
                    p .lead .advice { (capitalised(&self.advice())) "." }
                }
                (self.chart())
                (self.tiers())
                (self.terms())
                @if !self.missing.is_empty() { (self.what_is_missing()) }
                footer {
                    "Written by iltm " (env!("CARGO_PKG_VERSION")) " from " code { (self.name) } "."
                }
            }
            script type="application/json" id="data" { (PreEscaped(data)) }
            script { (PreEscaped(include_str!("page.js"))) }
        };
        let title = format!("What accuracy costs: {what}");
        document(&title, include_str!("page.css"), &body)
    }

    fn chart(&self) -> Markup {
        let there = |sweep: &Sweep| self.points.iter().any(|point| point.sweep == *sweep);
        let sweeps = Sweep::ALL.into_iter().filter(there);
        let timed = self.points.iter().any(|point| point.seconds.is_some());
        html! {
            section .plot {
                form .controls {
                    label { "Cost " select #x {
                        option value="instructions" { "instructions a frame" }
                        option value="microseconds" { "microseconds a frame, this machine" }
                        option value="bytes" { "bytes of the table" }
                        @if timed {
                            option value="solve_seconds" { "seconds of the solve" }
                            option value="photographs" { "photographs" }
                        }
                    } }
                    label { "Error " select #y {
                        option value="predicted_error" { "predicted, held-out photographs" }
                        @if self.has_truth() { option value="true_error" { "true, by the reference" } }
                    } }
                    fieldset {
                        legend { "Shown" }
                        @for sweep in sweeps {
                            label .toggle {
                                input type="checkbox" name="sweep" value=(sweep.name()) checked;
                                span .swatch style=(format!("--own:{}", colour(sweep))) {}
                                (title(sweep))
                            }
                        }
                    }
                }
                div .figure {
                    svg #chart .chart viewBox="0 0 940 520" role="group" tabindex="0" aria-label="Error against cost. Arrow keys go from point to point." {}
                    div #point .card role="status" aria-live="polite" { "Point at a dot, or use the arrow keys." }
                }
                noscript { @if let Some(svg) = self.svg() { (PreEscaped(svg)) } }
                p .quiet {
                    "Each dot is a way to compensate; lines join the tiers of one table. The wide band is the Pareto "
                    "front of what is shown: nothing else errs as little for as much. Large dots are the "
                    "table\u{2019}s own tiers, the points between which a device\u{2019}s governor moves. Dots of fewer "
                    "bits are hollow: no device has such a format, so they are on no front."
                }
            }
        }
    }

    fn tiers(&self) -> Markup {
        let own = || {
            self.points
                .iter()
                .filter(|point| point.sweep == Sweep::Table)
        };
        let truth = self.has_truth();
        let micros = |point: &Point| point.microseconds.map(|time| format!("{time:.1}"));
        html! {
            section {
                h2 { "The tiers of the table" }
                div .scroll { table {
                    thead { tr {
                        th { "tier" } th { "predicted error" } @if truth { th { "true error" } }
                        th { "left out" } th { "instructions" } th { "of a frame" } th { "\u{b5}s here" } th { "bytes" }
                    } }
                    tbody { @for point in own() { tr {
                        td { (point.tier) }
                        td { (percent(point.predicted)) @if point.predicted < 0.1 { " (" (fraction(point.predicted)) ")" } }
                        @if truth { td { @if let Some(error) = point.truth { (percent(error)) } } }
                        td { (percent(point.left_out)) } td { (grouped(point.instructions)) } td { (percent(point.share())) }
                        td { (micros(point).unwrap_or_default()) } td { (grouped(point.bytes)) }
                    } } }
                } }
                p .quiet {
                    "The same numbers that " code { "iltm inspect" } " prints of the table."
                }
            }
        }
    }

    fn terms(&self) -> Markup {
        html! {
            section {
                h2 { "What the numbers are" }
                ul .terms {
                    li { b { "Predicted error" } ": the root of the sum of squares of the inverse\u{2019}s own error, by "
                        "photographs that its solve had not seen, and of what a tier leaves out, on natural images; of gains alone (tier 0) at the brightness that "
                        "suits it best, for without the operator all is brighter." }
                    @if self.has_truth() {
                        li { b { "True error" } ": natural images from a fifth of reference white up, compensated and "
                            "clipped, through the transport in the capture\u{2019}s reference: "
                            span .formula { "mean \u{2016}T p \u{2212} d\u{2016} / \u{2016}d\u{2016}" }
                            ". The reference has noise of its own, and no brightness is free, so that gains alone come out worse." }
                    }
                    li { b { "Instructions" } ": of a frame of one pixel a cell (" (self.grid) ", "
                        @if self.channels == 1 { "grey" } @else { "colour" }
                        ") on the reference board, by a model that is within 2 % of the counts but for samples that are cut off, at 7 each. A share of a "
                        (RATE) " Hz frame takes a part of " (CLOCK / 1_000_000)
                        " MHz that does one instruction a cycle: a Cortex-M7 can do two, and waits for memory." }
                    li { b { "Microseconds" } ": the same frame, just now, on one core of the machine that wrote this page." }
                    li { b { "Bytes" } ": of a table with one tier beside gain only. Of fewer bits than 16, what a format "
                        "would take that no device has." }
                    li { b { "Seconds" } ": of the solve, its choice of the weight and its own checks included; reading "
                        "photographs and compiling the table are not." }
                    li { b { "Coarser operator" } ": the operator averaged down and interpolated up again, each cell\u{2019}s "
                        "gain kept, judged on the whole grid. It pays in frames that are larger than the grid." }
                }
            }
        }
    }

    fn what_is_missing(&self) -> Markup {
        html! {
            section {
                h2 { "What is not here" }
                ul .terms { @for missing in &self.missing { li { b { (missing.what) } ": " (missing.why) "." } } }
            }
        }
    }
}
