//! Pictures of one value a cell, side by side with captions and one colour bar.

use iltm_picture::{
    ColourScale, LightPicture, Picture, SHADES, Samples,
    canvas::{BACKGROUND, Canvas, Colour, INK, QUIET, Type},
    png,
};
use iltm_runtime::{FrameSize, Grid};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight};
use std::collections::BTreeSet;

const TITLE: Type = Type {
    height: RasterHeight::Size16,
    weight: FontWeight::Bold,
    colour: INK,
};
const TEXT: Type = Type {
    height: RasterHeight::Size16,
    weight: FontWeight::Regular,
    colour: QUIET,
};
/// Pixels around tiles.
const GAP: usize = 14;
/// Pixels of a line of letters, room around it included.
const LINE: usize = 22;
/// Width that a picture is enlarged to, about.
const WIDTH: usize = 250;
/// Height of a colour bar.
const BAR: usize = 14;

/// One picture.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    pub(super) title: String,
    /// Second line; may be empty.
    pub(super) caption: String,
    pub(super) picture: Picture,
}

impl Tile {
    /// Light as a screen shows it, `bright` as white.
    pub(super) fn light(
        (title, caption): (&str, &str),
        grid: Grid,
        values: impl IntoIterator<Item = f64>,
        bright: f64,
    ) -> Self {
        let size = FrameSize::of_grid(grid);
        let plane: Vec<f32> = values.into_iter().map(|v| (v / bright) as f32).collect();
        let picture = LightPicture::new(size, vec![plane]).map(|light| light.for_display());
        Self {
            title: title.to_owned(),
            caption: caption.to_owned(),
            picture: enlarged(&picture.unwrap_or_else(|| blank(size))),
        }
    }

    /// Numbers as colours.
    pub(super) fn scaled(
        (title, caption): (&str, &str),
        size: FrameSize,
        values: impl IntoIterator<Item = f64>,
        scale: &ColourScale,
    ) -> Self {
        Self {
            title: title.to_owned(),
            caption: caption.to_owned(),
            picture: enlarged(&scale.picture(size, values)),
        }
    }
}

fn blank(size: FrameSize) -> Picture {
    Canvas::new(size, BACKGROUND).finish()
}

/// Each pixel as a square of several.
fn enlarged(picture: &Picture) -> Picture {
    let (width, height) = (picture.size().width(), picture.size().height());
    let zoom = (WIDTH / width.max(1)).clamp(1, 16);
    let size = FrameSize::new((width * zoom) as u16, (height * zoom) as u16);
    let Some(size) = size.filter(|_| zoom > 1) else {
        return picture.clone();
    };
    let mut canvas = Canvas::new(size, BACKGROUND);
    let mut small = Canvas::new(picture.size(), BACKGROUND);
    small.place(0, 0, picture);
    for y in 0..height * zoom {
        for x in 0..width * zoom {
            canvas.set(x, y, small.get(x / zoom, y / zoom));
        }
    }
    canvas.finish()
}

/// Rows of tiles, all as large as the largest; `None` if there are none or they make
/// more than a picture can hold.
pub(super) fn sheet(rows: &[Vec<Tile>], bar: Option<(&ColourScale, &str)>) -> Option<Picture> {
    let tiles = || rows.iter().flatten();
    let side = tiles()
        .map(|tile| tile.picture.size().width().max(TEXT.width(&tile.caption)))
        .max()?;
    let rise = tiles().map(|tile| tile.picture.size().height()).max()?;
    let titles = tiles().map(|tile| lines(&tile.title, side).len()).max()?;
    let across = rows.iter().map(Vec::len).max()?;
    let above = (titles + 1) * LINE;
    let step = rise + above + GAP;
    let end = GAP + rows.len() * step;
    let legend = if bar.is_some() {
        BAR + 2 * LINE + GAP
    } else {
        0
    };
    let size = FrameSize::new(
        u16::try_from(GAP + across * (side + GAP)).ok()?,
        u16::try_from(end + legend).ok()?,
    )?;
    let mut canvas = Canvas::new(size, BACKGROUND);
    for (row, tiles) in rows.iter().enumerate() {
        for (col, tile) in tiles.iter().enumerate() {
            let (x, y) = (GAP + col * (side + GAP), GAP + row * step);
            for (line, words) in lines(&tile.title, side).iter().enumerate() {
                canvas.write(x, y + line * LINE, words, TITLE);
            }
            canvas.write(x, y + titles * LINE - 2, &tile.caption, TEXT);
            canvas.place(x, y + above, &tile.picture);
        }
    }
    if let Some((scale, words)) = bar {
        legend_at(
            &mut canvas,
            (GAP, end),
            size.width() - 2 * GAP,
            scale,
            words,
        );
    }
    Some(canvas.finish())
}

/// A title in lines of at most `width` pixels, words kept whole.
fn lines(title: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in title.split(' ') {
        let last = lines.last_mut().filter(|last| {
            last.is_empty() || TITLE.width(last) + TITLE.width(" ") + TITLE.width(word) <= width
        });
        match last {
            Some(last) if last.is_empty() => last.push_str(word),
            Some(last) => {
                last.push(' ');
                last.push_str(word);
            }
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

fn legend_at(
    canvas: &mut Canvas,
    (x, y): (usize, usize),
    width: usize,
    scale: &ColourScale,
    words: &str,
) {
    canvas.write(x, y, words, TEXT);
    let top = y + LINE;
    // The same shades as the pictures', so that one palette holds both.
    let shades = SHADES as usize;
    for col in 0..width {
        let shade = col * shades / width.max(1);
        let colour = scale.colour_at(shade as f64 / (shades - 1) as f64);
        for row in 0..BAR {
            canvas.set(x + col, top + row, colour);
        }
    }
    for tick in scale.ticks() {
        let wide = TEXT.width(&tick.label);
        let centre = tick.place * width as f64 - wide as f64 / 2.0;
        let start = (centre.max(0.0) as usize).min(width.saturating_sub(wide));
        canvas.write(x + start, top + BAR + 3, &tick.label, TEXT);
    }
}

/// A picture as a PNG file: with a palette where that holds all its colours, which makes
/// it a fraction as large.
pub(super) fn encoded(picture: &Picture) -> Vec<u8> {
    with_palette(picture).unwrap_or_else(|| {
        let mut bytes = Vec::new();
        // Writing to memory does not fail.
        let _ = png::write(&mut bytes, picture);
        bytes
    })
}

/// `None` of a picture that is not 8-bit RGB, or has more colours than a palette.
fn with_palette(picture: &Picture) -> Option<Vec<u8>> {
    let (3, Samples::Eight(samples)) = (picture.channels(), picture.samples()) else {
        return None;
    };
    let (pixels, _) = samples.as_chunks::<3>();
    let colours: BTreeSet<&Colour> = pixels.iter().collect();
    if colours.len() > 256 {
        return None;
    }
    let palette: Vec<&Colour> = colours.into_iter().collect();
    let index = |pixel: &Colour| palette.binary_search(&pixel).ok().map(|at| at as u8);
    let indices: Vec<u8> = pixels.iter().map(index).collect::<Option<_>>()?;
    let mut bytes = Vec::new();
    let (width, height) = (picture.size().width(), picture.size().height());
    let mut encoder = ::png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(::png::ColorType::Indexed);
    encoder.set_depth(::png::BitDepth::Eight);
    encoder.set_compression(::png::Compression::High);
    // Indices are no light that neighbours predict.
    encoder.set_filter(::png::Filter::NoFilter);
    encoder.set_palette(palette.into_iter().flatten().copied().collect::<Vec<u8>>());
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(&indices).ok()?;
    writer.finish().ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_titles_break_between_words() {
        let width = TITLE.width("a long title");
        assert_eq!(
            lines("a long title indeed", width),
            ["a long title", "indeed"]
        );
        assert_eq!(lines("", width), [""]);
        assert_eq!(
            lines("incomprehensibilities", width),
            ["incomprehensibilities"]
        );
    }

    #[test]
    fn a_palette_changes_no_pixel() {
        let grid = Grid::new(6, 9).unwrap();
        let scale = ColourScale::linear(iltm_picture::Palette::Magma, 1.0);
        let values = || (0..54).map(|at| f64::from(at) / 53.0);
        let size = FrameSize::of_grid(grid);
        let tiles = vec![
            Tile::light(("one", "light"), grid, values(), 1.0),
            Tile::scaled(("two", "scale"), size, values(), &scale),
        ];
        let picture = sheet(&[tiles], Some((&scale, "values"))).unwrap();
        let bytes = with_palette(&picture).unwrap();
        assert_eq!(png::read(bytes.as_slice()).unwrap(), picture);
    }
}
