//! One picture that tells the story: wanted, photographed without compensation,
//! photographed with it, and both errors.

use super::{Example, Treatment};
use iltm_picture::{
    ColourScale, Picture,
    canvas::{BACKGROUND, Canvas, INK, QUIET, Type},
};
use iltm_runtime::FrameSize;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight};

/// Pixels between pictures and around them.
const GAP: usize = 12;

/// Pixels that a line of letters takes, room around it included.
const LINE: usize = 30;

const TITLE: Type = Type {
    height: RasterHeight::Size20,
    weight: FontWeight::Bold,
    colour: INK,
};

const TEXT: Type = Type {
    height: RasterHeight::Size16,
    weight: FontWeight::Regular,
    colour: QUIET,
};

/// Composes the summary; the colour bar of the error maps is `errors`.
///
/// `None` if the pictures are so large that their composition is not a frame.
#[must_use]
pub fn summary(example: &Example, errors: &ColourScale) -> Option<Picture> {
    let picture = example.wanted.picture.size();
    let (width, height) = (picture.width(), picture.height());
    let left = |column: usize| GAP + column * (width + GAP);
    let maps = GAP + LINE + height + GAP + LINE;
    let size = FrameSize::new(
        u16::try_from(left(3)).ok()?,
        u16::try_from(maps + height + GAP).ok()?,
    )?;
    let mut canvas = Canvas::new(size, BACKGROUND);
    canvas.write(left(0), GAP, "Wanted", TITLE);
    let predicted = "predicted photograph";
    canvas.place(left(0), GAP + LINE, &example.wanted.picture);
    for (column, treatment) in [(1, Treatment::None), (2, Treatment::Compensated)] {
        let Some(shown) = example
            .shown
            .iter()
            .find(|shown| shown.treatment == treatment)
        else {
            continue;
        };
        canvas.write(left(column), GAP, treatment.title(), TITLE);
        let end = (left(column) + width).saturating_sub(TEXT.width(predicted));
        canvas.write(end, GAP + 3, predicted, TEXT);
        canvas.place(left(column), GAP + LINE, &shown.photograph.for_display());
        let error = format!("Error {:.1} %", 100.0 * shown.comparison.error);
        canvas.write(left(column), maps - LINE + 4, &error, TITLE);
        let values = shown.comparison.map.iter().map(|error| f64::from(*error));
        canvas.place(left(column), maps, &errors.picture(picture, values));
    }
    legend(&mut canvas, (left(0), maps), (width, height), errors);
    Some(canvas.finish())
}

/// The colour bar and what it means, in the place of a picture.
fn legend(
    canvas: &mut Canvas,
    (x, y): (usize, usize),
    (width, height): (usize, usize),
    errors: &ColourScale,
) {
    const BAR: usize = 22;
    let title = "Error of the photograph,";
    let unit = "in units of reference white";
    let top = y + height / 2 - BAR;
    canvas.write(x, top - 2 * LINE + 6, title, TEXT);
    canvas.write(x, top - LINE + 2, unit, TEXT);
    let last = width.saturating_sub(1).max(1) as f64;
    for col in 0..width {
        for row in 0..BAR {
            canvas.set(x + col, top + row, errors.colour_at(col as f64 / last));
        }
    }
    for tick in errors.ticks() {
        let wide = TEXT.width(&tick.label);
        let centre = tick.place * width as f64 - wide as f64 / 2.0;
        let start = (centre.max(0.0) as usize).min(width.saturating_sub(wide));
        canvas.write(x + start, top + BAR + 4, &tick.label, TEXT);
    }
    let below = top + BAR + LINE + 12;
    canvas.write(x, below, "What is left is mostly darker than", TEXT);
    canvas.write(
        x,
        below + LINE - 6,
        "the light that arrives there anyway.",
        TEXT,
    );
}
