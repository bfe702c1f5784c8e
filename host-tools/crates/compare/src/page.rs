//! HTML page of a contest: pictures first, numbers beside them.

use super::benchmark::{BenchmarkRow, MethodResult};
use super::benchmark_scene::BenchmarkScene;
use super::table::{COLUMNS, cells};
use iltm_picture::{
    ColourScale, ContactSheet, Palette, Tile,
    html::{document, img},
    png,
};
use iltm_runtime::FrameSize;
use maud::{Markup, html};

/// Tiles in a row of pictures.
const ACROSS: usize = 4;

/// Error of a wanted image, relative to white, at the end of the colour scale, and the
/// powers of ten below it.
const WORST: (f64, i32) = (0.3, 3);

/// What is said where projectors overlap.
pub const OVERLAP: &str = "Pictures of its projectors overlap, so methods for one projector are left out; the wanted images \
     lie on the camera\u{2019}s picture";

/// Two groups of rows and the light they were made with.
#[derive(Debug)]
pub struct BenchmarkPage<'c> {
    /// What was compared on, for the heading.
    pub name: &'c str,
    /// The light.
    pub light: &'c BenchmarkScene,
    /// Ways to photograph.
    pub photographed: &'c [BenchmarkRow],
    /// Ways to invert, given the transport itself.
    pub inverted: &'c [BenchmarkRow],
}

impl BenchmarkPage<'_> {
    /// The page as HTML, complete in itself.
    #[must_use]
    pub fn html(&self) -> String {
        let truth = &self.light.truth;
        let body = html! {
            main {
                header {
                    p .over { "iltm compare" }
                    h1 { (self.name) }
                    p .lead {
                        (truth.grid.rows()) " \u{d7} " (truth.grid.cols()) " cells, " (truth.live_cells())
                        " of them lit and seen. The transport is " (self.light.known)
                        "; every method gets the same light, with this camera\u{2019}s noise, and is judged by the same images."
                        @if self.light.colour { " Of the three channels it is the green one." }
                        @if truth.overlap { " " (OVERLAP) "." }
                    }
                    p { "All of them know cells only, so errors are those of the mean light of a cell. What a viewer sees at pixels is more; " code { "iltm solve" } " predicts it, and " code { "iltm verify" } " measures it." }
                }
                @if !self.photographed.is_empty() {
                    (self.group("Ways to photograph", "Each takes as many photographs as it wants; the transport that some of them find is inverted exactly.", self.photographed))
                }
                (self.group("Ways to invert, or to do without an inverse", "Each is given the transport itself.", self.inverted))
                (self.sources())
            }
        };
        document(&format!("Methods compared: {}", self.name), "", &body)
    }

    fn group(&self, title: &str, words: &str, rows: &[BenchmarkRow]) -> Markup {
        html! {
            section {
                h2 { (title) }
                p { (words) " Errors are relative: of the inverse (Frobenius), of the second bounce\u{2019}s picture under white, and of what compensated images look like, clipping included." }
                @if let Some(picture) = self.pictures(rows) {
                    figure {
                        (img(&picture, &format!("{title}: where a compensated image errs")))
                        figcaption { "One natural image on the wall, and where it errs by each method." }
                    }
                }
                div .scroll { table {
                    tr { @for head in COLUMNS { th { (head) } } }
                    @for row in rows {
                        tr {
                            @match &row.result {
                                Ok(_) => @for (at, cell) in cells(row).into_iter().enumerate() {
                                    td .(if at == 0 { "" } else { "formula" }) { (cell) }
                                },
                                Err(why) => { td { (row.method.name) } td colspan="7" { "no answer: " (why) } },
                            }
                        }
                    }
                } }
            }
        }
    }

    fn sources(&self) -> Markup {
        let rows = self.photographed.iter().chain(self.inverted);
        html! {
            section {
                h2 { "What they are, and where they come from" }
                dl .facts {
                    @for row in rows {
                        dt { strong { (row.method.name) } }
                        dd {
                            (row.method.how) " " em { (row.method.source) "." }
                            @if let Ok(MethodResult { remark, .. }) = &row.result { @if !remark.is_empty() { " Here: " (remark) "." } }
                        }
                    }
                }
            }
        }
    }

    /// Where one image errs, by method, as a PNG file.
    fn pictures(&self, rows: &[BenchmarkRow]) -> Option<Vec<u8>> {
        let truth = &self.light.truth;
        let scale = ColourScale::logarithmic(Palette::Magma, WORST.0, WORST.1);
        let size = FrameSize::of_grid(truth.grid);
        let wanted = truth.images.column(0).into_owned();
        let wanted_tile = Tile::light(("wanted", ""), size, wanted.iter().copied(), truth.white);
        let mut tiles = vec![wanted_tile];
        for row in rows {
            let Ok(done) = &row.result else { continue };
            let shown = &truth.transport * done.answer.shown(&wanted);
            let off = (shown - &wanted) / truth.white;
            let caption = format!(
                "compensation {}",
                super::table::error(done.errors.compensation)
            );
            let values = off.iter().map(|value| value.abs());
            tiles.push(Tile::scaled(
                (&row.method.name, &caption),
                size,
                values,
                &scale,
            ));
        }
        let sheet = ContactSheet {
            rows: tiles.chunks(ACROSS).map(<[Tile]>::to_vec).collect(),
            bar: Some((&scale, "error, relative to reference white")),
            ..ContactSheet::default()
        };
        Some(png::encode_small(&sheet.compose()?))
    }
}
