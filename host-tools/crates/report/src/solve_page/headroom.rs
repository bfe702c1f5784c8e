//! Headroom: how bright white is, why, and what of the content is cut at that.

use super::Content;
use iltm_compile::{build_table::BuiltTable, clip_thresholds::ClipThresholds};
use iltm_picture::{
    LightPicture, Picture,
    canvas::Canvas,
    html::{PictureFile, img, percent, picture_file},
};
use iltm_runtime::image::Table;
use iltm_video::{CompensateOptions, Compensator};
use maud::{Markup, html};
use std::ops::Range;

/// What is painted where white is cut, and where black is.
const BRIGHT: [u8; 3] = [255, 40, 120];
const DARK: [u8; 3] = [40, 140, 255];

/// Content shown on the page.
const SHOWN: usize = 4;

/// The section about reference white.
pub(super) fn section(
    learned: &BuiltTable,
    table: &Table<'_>,
    content: &[Content],
    files: &mut Vec<PictureFile>,
) -> Markup {
    let white = &learned.white;
    let previews = previews(learned, table, content, files);
    html! { section {
        h2 { "How bright white is" }
        p {
            "White (255) in a picture means a light of " b { (format!("{:.4}", white.light)) }
            " of the camera's full scale on the wall: " (white.reason()) "."
        }
        @if content.is_empty() {
            p {
                "With even white nothing is cut. A picture that is dark elsewhere lends less light to its bright "
                "places, which then need more than the projector has: with content of your own ("
                code .formula { "--content VIDEO.y4m" } ") white is chosen for that, and this page shows where it is cut."
            }
        }
        @for preview in &previews {
            div .example {
                h3 { (preview.name) }
                p .quiet {
                    (preview.frames) @if preview.frames == 1 { " frame: " } @else { " frames: " }
                    (percent(preview.cut.0)) " of the samples cut at the projector's white, "
                    (percent(preview.cut.1)) " at its black"
                    @if let Some((bright, dark)) = cut_in_full(table, &preview.content.frames) {
                        "; at the content's own resolution " (percent(bright)) " and " (percent(dark))
                    }
                    "."
                }
                div .half {
                    figure {
                        (img(&preview.still.png, "A frame with what is cut painted over"))
                        figcaption { "A frame; red: brighter than the projector can, blue: darker than the light from elsewhere." }
                    }
                    figure {
                        (img(&preview.map.png, "Share of frames that are cut"))
                        figcaption { "All frames: the redder or bluer, the more of them are cut there." }
                    }
                }
            }
        }
    } }
}

/// A picture or a video with what is cut of it.
struct Preview<'c> {
    name: &'c str,
    content: &'c Content,
    frames: usize,
    cut: (f64, f64),
    still: PictureFile,
    map: PictureFile,
}

fn previews<'c>(
    learned: &BuiltTable,
    table: &Table<'_>,
    content: &'c [Content],
    files: &mut Vec<PictureFile>,
) -> Vec<Preview<'c>> {
    let mut previews = Vec::new();
    for (index, content) in content.iter().take(SHOWN).enumerate() {
        let light = content.light();
        let black = table.black().to_num::<f64>() * learned.white.light;
        let (inverse, fine) = (&learned.inverse, learned.fine.as_ref());
        let found = ClipThresholds::of(inverse, fine, &light, black);
        let Ok(Some(thresholds)) = found else {
            continue;
        };
        let middle = light.len() / 2;
        let Some(frame) = light.get(middle) else {
            continue;
        };
        let white = learned.white.light;
        let still = painted(&thresholds, white, middle..middle + 1, frame);
        let dark = frame.scaled(0.25);
        let map = painted(&thresholds, white, 0..light.len(), &dark);
        let preview = Preview {
            name: &content.name,
            content,
            frames: light.len(),
            cut: thresholds.cut(white),
            still: picture_file(&format!("headroom-{}-frame", index + 1), &still),
            map: picture_file(&format!("headroom-{}-map", index + 1), &map),
        };
        files.extend([preview.still.clone(), preview.map.clone()]);
        previews.push(preview);
    }
    previews
}

/// Shares of the samples that the runtime itself cuts at white and at black; `None` if it
/// cannot show them.
fn cut_in_full(table: &Table<'_>, frames: &[Picture]) -> Option<(f64, f64)> {
    let compensator = Compensator::new(table, CompensateOptions::default()).ok()?;
    let (mut clipped, mut white, mut samples) = (0, 0, 0);
    for frame in frames {
        let summary = compensator.picture(&mut frame.clone()).ok()?;
        clipped += summary.clipped;
        white += summary.clipped_white;
        samples += summary.samples;
    }
    let share = |count: u64| count as f64 / samples as f64;
    (samples > 0).then(|| (share(white), share(clipped - white)))
}

/// A frame with the shares painted over it.
fn painted(
    thresholds: &ClipThresholds,
    white: f64,
    frames: Range<usize>,
    under: &LightPicture,
) -> Picture {
    let [bright, dark] = thresholds.maps(white, frames);
    let size = thresholds.size();
    let mut shown = Canvas::new(under.size(), [0; 3]);
    shown.place(0, 0, &under.for_display());
    let (width, height) = (under.size().width(), under.size().height());
    Picture::from_fn(under.size(), |x, y| {
        let place = y * size.height() / height * size.width() + x * size.width() / width;
        let own = shown.get(x, y);
        let (share, over) = if bright[place] > 0.0 {
            (bright[place], BRIGHT)
        } else {
            (dark[place], DARK)
        };
        // A single frame of many can still be seen.
        let cover = if share > 0.0 {
            0.25 + 0.75 * share.min(1.0)
        } else {
            0.0
        };
        std::array::from_fn::<u8, 3, _>(|colour| {
            let (below, above) = (f64::from(own[colour]), f64::from(over[colour]));
            (below + cover * (above - below)).round() as u8
        })
    })
}
