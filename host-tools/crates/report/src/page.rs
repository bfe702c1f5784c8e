//! HTML page of a report: one file with everything inside.

use super::facts::facts;
use super::{Example, Report, TimedTier, TreatedImage, Treatment};
use iltm_compile::Brightness;
use iltm_picture::{
    chart::{Chart, ChartAxis, Series},
    html::{capitalised, colour_bar, document, grouped, img_named, number, percent},
};
use iltm_solve::Compensation;
use maud::{Markup, html};

/// What the page says that photographs cannot.
#[derive(Clone, Debug)]
pub struct Words {
    /// The heading.
    pub title: String,
    /// The scene in a sentence or two.
    pub scene: String,
    /// How to get the same again.
    pub commands: Vec<Command>,
    /// Wall-clock seconds by what they were spent on, beside the solve's own.
    pub seconds: Vec<(String, f64)>,
    /// The section about several projectors, after what was photographed.
    pub projectors: Option<Markup>,
    /// Sections of this report alone, before how it was solved.
    pub sections: Vec<Markup>,
}

/// A line for a terminal.
#[derive(Clone, Debug)]
pub struct Command {
    /// What it does.
    pub what: String,
    /// The line.
    pub line: String,
}

impl Command {
    /// A line and what it does.
    #[must_use]
    pub fn new(what: &str, line: String) -> Self {
        Self {
            what: what.to_owned(),
            line,
        }
    }
}

impl Report<'_> {
    /// The page as HTML, complete in itself: pictures are inside, nothing is
    /// fetched, nothing runs.
    #[must_use]
    pub fn html(&self, words: &Words) -> String {
        let body = html! {
            main {
                (self.opening(words))
                (self.scene())
                @if let Some(projectors) = &words.projectors { (projectors) }
                @if self.examples.is_empty() {
                    (without_pictures())
                } @else {
                    (self.pictures_section())
                    (self.bounces())
                }
                (self.operator())
                (self.accuracy())
                @for section in &words.sections { (section) }
                (self.solve(words))
                (self.repeat(words))
            }
        };
        document(&words.title, "", &body)
    }

    fn opening(&self, words: &Words) -> Markup {
        let predicted = self.learned.predicted;
        let counts = self.learned.report.photographs;
        let chosen = self.learned.report.compensation;
        let mark = |way| if way == chosen { "best" } else { "" };
        html! {
            header {
                p .over { "iltm report" }
                h1 { (words.title) }
                p .lead { (words.scene) }
                div .numbers {
                    (headline(predicted.uncompensated, "projected as it is", mark(Compensation::Nothing)))
                    (headline(self.gains_alone(), "each pixel's brightness and colour corrected", mark(Compensation::GainOnly)))
                    (headline(predicted.compensated, "interreflections cancelled as well", mark(Compensation::Operator)))
                }
                @if let Some(figures) = predicted.figures {
                    p { "As the table projects: " (figures.words()) "." }
                }
                p .quiet {
                    "Error of natural images on the wall relative to the wanted ones, pixel by pixel, ambient light "
                    "included, as the photographs predict it (" (counts.held_out) " of them were kept out of the solve "
                    "for this, and chose its one weight): "
                    span .formula { "\u{2016}s\u{b7}photograph \u{2212} wanted\u{2016} / \u{2016}wanted\u{2016}" }
                    ", with the one factor s for all pixels and colours that suits the photograph best, so that a "
                    "dim projection alone is no error."
                    @if self.learned.is_overlapping() {
                        " Where projectors overlap, corrected images are predicted as if one of them showed all of the light."
                    }
                }
                @if let Some(brightness) = self.brightness() {
                    p { (capitalised(&brightness.words())) "." }
                }
            }
        }
    }

    /// Error of gains alone: of the table's tier 0, which is what is said of it elsewhere, but for a
    /// table that changes nothing.
    fn gains_alone(&self) -> f64 {
        if self.learned.report.compensation == Compensation::Nothing {
            return self.learned.predicted.gain_only;
        }
        let first = self.ladder.first();
        first.map_or(f64::NAN, |tier| tier.cost.total)
    }

    fn brightness(&self) -> Option<Brightness> {
        Brightness::of(&self.learned.measurements, self.learned.white.light)
    }

    fn scene(&self) -> Markup {
        let grid = self.learned.inverse.grid;
        let counts = self.learned.report.photographs;
        let several = self.learned.projectors.is_some();
        html! {
            section .split {
                figure {
                    (self.image("flood", "The scene under white light"))
                    figcaption {
                        @if several {
                            "The flood photographs of all projectors, added up: all of the projection white, seen by the camera. "
                        } @else {
                            "The flood photograph: the whole projection white, seen by the camera. "
                        }
                        "Black is subtracted."
                    }
                }
                div {
                    h2 { "What was photographed" }
                    p {
                        @if several { "The projectors are, side by side, " } @else { "The projector is " }
                        "taken as " (grid.rows()) " \u{d7} " (grid.cols()) " lights. Every light reaches not only its own patch of the scene: what falls there is "
                        "scattered onto the patches opposite, and their light shows where it was not asked for. "
                        "Contrast drops, and colours bleed."
                    }
                    p {
                        (self.learned.measurements.diagnostics.photographs) " photographs, under white and black, "
                        (counts.gray_code) " under stripes (Gray code), "
                        @if counts.bernoulli > 0 { (counts.bernoulli) " under random patterns, " }
                        @if counts.images > 0 { (counts.images) " under images, " }
                        "are what the scene's inverse light transport was learned from: what to project so that, "
                        "after all bounces, the wall shows the wanted image."
                    }
                }
            }
        }
    }

    fn pictures_section(&self) -> Markup {
        html! {
            section {
                h2 { "What it does to images" }
                p {
                    "Projector inputs are computed by the code that runs on the device, bit for bit. The photographs "
                    "are predicted from them at full resolution with the learned transport, so they show clipping, "
                    "8-bit codes and what the table leaves out. Each is scaled by the one factor that fits the wanted "
                    "image best, so how bright it is cannot be seen here; the error is what remains, relative to the wanted image."
                }
                p {
                    "Light can be added but not taken back: where an image is darker than what arrives from elsewhere "
                    "anyway, the input is clipped at black, and an error remains that no projector could avoid."
                }
                p .quiet {
                    "What they cannot show is how far the learned transport itself is off: the photographs "
                    "put that at " (percent(self.learned.predicted_error())) ". It comes on top of the errors below (as the root of the sum "
                    "of squares)."
                }
                @for example in &self.examples { (self.example(example)) }
            }
        }
    }

    fn example(&self, example: &Example) -> Markup {
        let name = example.wanted.name;
        html! {
            div .example {
                h3 { (example.wanted.title) }
                p .quiet { (example.wanted.remark) }
                div .four {
                    div .head { "Wanted" }
                    @for shown in &example.shown { div .head { (shown.treatment.title()) } }

                    figure {
                        (self.image(&format!("{name}-wanted"), "Wanted image"))
                        figcaption { "Wanted image" }
                    }
                    @for shown in &example.shown {
                        figure {
                            (self.image(&format!("{name}-{}-photograph", shown.treatment.name()), "Predicted photograph"))
                            figcaption .error { "Error " b { (percent(shown.comparison.error)) } (phone(shown)) }
                        }
                    }

                    div .row {
                        strong { "Error of the photograph" }
                        "in units of reference white, root mean square over the colours"
                        (colour_bar(&self.errors, true))
                    }
                    @for shown in &example.shown {
                        figure {
                            (self.image(&format!("{name}-{}-error", shown.treatment.name()), "Error map"))
                            figcaption { (phone(shown)) }
                        }
                    }

                    div .row {
                        strong { "Projector input" }
                        "what is sent to the projector for it"
                    }
                    @for shown in &example.shown {
                        figure {
                            (self.image(&format!("{name}-{}-input", shown.treatment.name()), "Projector input"))
                            figcaption { (clipping(shown)) (phone(shown)) }
                        }
                    }
                }
            }
        }
    }

    fn bounces(&self) -> Markup {
        html! {
            section {
                h2 { "The light that is taken away" }
                p {
                    "For every frame the table computes how much light will reach each place by way of others, and "
                    "projects that much less there. These are those amounts for the wanted images, brightened as "
                    "noted under each."
                }
                div .three {
                    @for example in &self.examples {
                        figure {
                            (self.image(&format!("{}-bounced", example.wanted.name), "Light that arrives by way of other places"))
                            figcaption { (example.wanted.title) ", " (number(example.brightening())) " times as bright" }
                        }
                    }
                }
            }
        }
    }

    fn operator(&self) -> Markup {
        let map = &self.coefficients;
        let all = map.coefficients as u64;
        let entries =
            |rung: Option<&TimedTier>| u64::from(rung.map_or(0, |rung| rung.cost.entries));
        let (first, last) = (entries(self.ladder.get(1)), entries(self.ladder.last()));
        html! {
            section .half {
                div {
                    h2 { "The operator" }
                    p {
                        "The bounced light is a linear function of the image: a matrix with " (grouped(all))
                        " entries, nearly all of them small. In the Haar basis, which codes sums and differences of "
                        "ever larger blocks of cells, few of them matter, since geometry varies slowly: the table "
                        "keeps " (grouped(last)) " entries, those by which single colours differ included, and the "
                        "first " (grouped(first)) " do most of the work."
                    }
                    p .quiet {
                        "Rows: what is taken away. Columns: what is wanted. Coarse functions come first, at the top "
                        "left; the numbers along the axes are the sides of the functions' blocks in cells."
                    }
                    (colour_bar(&map.scale, false))
                    p .quiet { "Magnitude relative to the largest coefficient" }
                }
                (self.coefficient_figure())
            }
        }
    }

    fn coefficient_figure(&self) -> Markup {
        let map = &self.coefficients;
        // The coarsest levels have too few coefficients for a label each.
        let labelled: Vec<_> = map
            .levels
            .iter()
            .rev()
            .scan(1.0, |end, level| {
                let room = *end - level.start;
                *end = level.start;
                Some((level, room))
            })
            .filter(|(_, room)| *room > 0.035)
            .collect();
        html! {
            figure {
                div .map {
                    div .side {
                        @for (level, _) in &labelled { span style=(format!("top:{:.2}%", 100.0 * level.start)) { (level.side) } }
                    }
                    (self.image("coefficients", "Magnitudes of the operator's Haar coefficients, coarse to fine from the top left"))
                    div .below {
                        @for (level, _) in &labelled { span style=(format!("left:{:.2}%", 100.0 * level.start)) { (level.side) } }
                    }
                }
                figcaption { "Magnitude of the operator\u{2019}s Haar coefficients, in the red, green and blue channels\u{2019} common part." }
            }
        }
    }

    /// A picture inside of the page, by the name of its file.
    fn image(&self, name: &str, alt: &str) -> Markup {
        img_named(&self.files, name, alt)
    }

    fn accuracy(&self) -> Markup {
        let own = self.learned.predicted_error();
        let tiers = self.ladder.iter();
        let series = Series {
            points: tiers
                .map(|rung| (rung.microseconds, rung.cost.left_out))
                .collect(),
            labels: (0..self.ladder.len())
                .map(|tier| format!("tier {tier}"))
                .collect(),
            line: 1.8,
            ..Series::default()
        };
        let chart = Chart {
            title: "What each tier leaves out against the time it takes",
            x: ChartAxis::linear("microseconds a frame, one core of this machine"),
            y: ChartAxis::logarithmic("left out (relative error)"),
            limit: Some((own, "error of the inverse itself")),
            series: vec![series],
            ..Chart::default()
        };
        html! {
            section {
                h2 { "What accuracy costs" }
                p {
                    "A table is a ladder. Tier 0 only corrects each cell's gain; every further tier adds the "
                    "coefficients that matter most of those left. The device runs the highest tier that its time "
                    "allows and says which."
                }
                div .half {
                    div .scroll { table {
                        thead { tr {
                            th { "tier" } th { "left out" } th { "error in all" } th { "entries" } th { "multipli\u{ad}cations" } th { "bytes" } th { "\u{b5}s" }
                        } }
                        tbody { @for (tier, rung) in self.ladder.iter().enumerate() { tr {
                            td { (tier) } td { (percent(rung.cost.left_out)) } td { (percent(rung.cost.total)) }
                            td { (grouped(rung.cost.entries.into())) } td { (grouped(rung.cost.multiplications.into())) }
                            td { (grouped(rung.cost.bytes)) } td { (format!("{:.0}", rung.microseconds)) }
                        } } }
                    } }
                    (chart.render())
                }
                p .quiet {
                    "\u{201c}Left out\u{201d} is the mean error over natural images against the same table with all entries, "
                    "at unchanged brightness; \u{201c}error in all\u{201d} adds the inverse's own as the root of the sum of squares. "
                    "Entries, multiplications and bytes are those of the operator, for one frame of one pixel a cell. "
                    "Microseconds were measured just now on one core of the machine that wrote this page, which is not "
                    "the device."
                }
            }
        }
    }

    fn solve(&self, words: &Words) -> Markup {
        let report = &self.learned.report;
        let path = report.lambda_path.iter();
        let is_best =
            |trial: &iltm_solve::LambdaTrial| trial.lambda.total_cmp(&report.lambda).is_eq();
        let series = Series {
            points: path
                .clone()
                .map(|trial| (trial.lambda, 100.0 * trial.misfit))
                .collect(),
            marked: path.clone().position(is_best),
            line: 1.8,
            ..Series::default()
        };
        let chart = Chart {
            title: "Misfit of held-out photographs by the weight of sparsity",
            x: ChartAxis::logarithmic("weight of sparsity \u{3bb}"),
            y: ChartAxis::linear("misfit of held-out photographs, %"),
            series: vec![series],
            ..Chart::default()
        };
        html! {
            section {
                h2 { "How it was solved" }
                div .half {
                    table .facts { tbody {
                        @for (name, value) in facts(self.learned, &words.seconds) { tr { td { (name) } td { (value) } } }
                    } }
                    @if report.lambda_path.len() > 1 {
                        figure {
                            (chart.render())
                            figcaption {
                                "How sparse the operator should be is chosen by photographs that the solve has not "
                                "seen: too little weight fits noise, too much leaves out geometry."
                            }
                        }
                    }
                }
            }
        }
    }

    fn repeat(&self, words: &Words) -> Markup {
        let table = iltm_runtime::image::Table::check(&self.learned.compiled.image);
        html! {
            section {
                h2 { "Again, and on" }
                @for command in &words.commands {
                    p { (command.what) }
                    pre { (command.line) }
                }
                @if let Ok(table) = &table {
                    h3 { "What the table says of its origin" }
                    pre { (table.provenance().trim_end()) }
                }
            }
            footer {
                "Written by iltm " (env!("CARGO_PKG_VERSION"))
                ". Method after Chu, Ng, Pahwa, Quek and Huang, Compressive Inverse Light Transport, BMVC 2011. "
                "Colours of the maps: magma and viridis."
            }
        }
    }
}

/// What stands for pictures of projectors that overlap.
fn without_pictures() -> Markup {
    html! {
        section {
            h2 { "What it does to images" }
            p {
                "This page predicts images only where each place of a frame has a place of its own on the wall. Where "
                "projectors overlap, two places of the wide frame are one, so no images and no bounced light are drawn "
                "here. The errors above are predicted for these projectors all the same, and a verification shows "
                "images on them."
            }
        }
    }
}

fn headline(error: f64, what: &str, class: &str) -> Markup {
    html! { div .number .(class) { b { (percent(error)) } span { (what) } } }
}

/// The treatment's name, for screens too narrow for four columns.
fn phone(shown: &TreatedImage) -> Markup {
    html! { span .phone { (shown.treatment.title()) } }
}

fn clipping(shown: &TreatedImage) -> String {
    if shown.treatment == Treatment::None {
        return "The wanted image".to_owned();
    }
    let [black, white] = shown.clipped.map(percent);
    format!("{white} of the samples too bright for white, {black} darker than black")
}
