//! Contact sheet: pictures side by side with titles, captions and one colour bar.

use crate::canvas::{BACKGROUND, Canvas, FontWeight, INK, QUIET, RasterHeight, Type};
use crate::{ColourScale, LightPicture, Picture, SHADES};
use iltm_runtime::FrameSize;

const HEADING: Type = Type {
    height: RasterHeight::Size20,
    weight: FontWeight::Bold,
    colour: INK,
};
const TITLE: Type = Type {
    height: RasterHeight::Size16,
    ..HEADING
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
/// Width that small pictures are enlarged to, about.
const WIDTH: usize = 250;
/// Height of a colour bar.
const BAR: usize = 14;

/// A picture and the words above it.
#[derive(Clone, Debug, Default)]
pub struct Tile {
    /// The first line, broken where it is wider than the picture.
    pub title: String,
    /// The lines below.
    pub captions: Vec<String>,
    /// The picture; a tile may be empty.
    pub picture: Option<Picture>,
}

impl Tile {
    /// A tile; small pictures are enlarged.
    #[must_use]
    pub fn new((title, caption): (&str, &str), picture: &Picture) -> Self {
        Self {
            title: title.to_owned(),
            captions: vec![caption.to_owned()],
            picture: Some(picture.enlarged((WIDTH / picture.size().width()).clamp(1, 16))),
        }
    }

    /// Light as a screen shows it, `bright` as white.
    ///
    /// # Panics
    /// If there is not a value for each pixel.
    #[must_use]
    pub fn light(
        words: (&str, &str),
        size: FrameSize,
        values: impl IntoIterator<Item = f64>,
        bright: f64,
    ) -> Self {
        let values: Vec<f64> = values.into_iter().collect();
        let light = LightPicture::from_fn(size, 1, |_, pixel| (values[pixel] / bright) as f32);
        Self::new(words, &light.for_display())
    }

    /// Numbers as colours.
    ///
    /// # Panics
    /// If there is not a value for each pixel.
    #[must_use]
    pub fn scaled(
        words: (&str, &str),
        size: FrameSize,
        values: impl IntoIterator<Item = f64>,
        scale: &ColourScale,
    ) -> Self {
        Self::new(words, &scale.picture(size, values))
    }
}

/// Rows of tiles, all as wide as the widest.
#[derive(Clone, Debug, Default)]
pub struct ContactSheet<'a> {
    /// Above everything; may be empty.
    pub heading: String,
    /// The tiles, row by row.
    pub rows: Vec<Vec<Tile>>,
    /// Colours that tiles have, and what they stand for.
    pub bar: Option<(&'a ColourScale, &'a str)>,
    /// Lines below everything.
    pub notes: Vec<String>,
}

impl ContactSheet<'_> {
    /// The picture; `None` if there are no tiles or they make more than a frame can hold.
    #[must_use]
    pub fn compose(&self) -> Option<Picture> {
        let side = self.rows.iter().flatten().map(Tile::width).max()?;
        let across = self.rows.iter().map(Vec::len).max()?;
        let words = self.notes.iter().map(|note| TEXT.width(note));
        let words = words.chain([HEADING.width(&self.heading)]).max()?;
        let inner = (across * (side + GAP) - GAP).max(words);
        let head = if self.heading.is_empty() {
            0
        } else {
            LINE + GAP
        };
        let rows = self.rows.iter().map(|row| Lines::of(row, side));
        let rows: Vec<Lines> = rows.collect();
        let bar = self.bar.map_or(0, |_| BAR + 2 * LINE + GAP);
        let tiles: usize = rows.iter().map(Lines::height).sum();
        let height = GAP + head + tiles + bar + self.notes.len() * LINE;
        let size = FrameSize::new(
            u16::try_from(inner + 2 * GAP).ok()?,
            u16::try_from(height).ok()?,
        )?;
        let mut canvas = Canvas::new(size, BACKGROUND);
        canvas.write(GAP, GAP, &self.heading, HEADING);
        let mut y = GAP + head;
        for (tiles, lines) in self.rows.iter().zip(rows) {
            for (col, tile) in tiles.iter().enumerate() {
                tile.draw(&mut canvas, (GAP + col * (side + GAP), y), side, &lines);
            }
            y += lines.height();
        }
        if let Some((scale, words)) = self.bar {
            colour_bar(&mut canvas, (GAP, y), inner, scale, words);
        }
        for (line, note) in self.notes.iter().enumerate() {
            canvas.write(GAP, y + bar + line * LINE, note, TEXT);
        }
        Some(canvas.finish())
    }
}

/// What a row of tiles has room for.
struct Lines {
    titles: usize,
    captions: usize,
    picture: usize,
}

impl Lines {
    fn of(tiles: &[Tile], width: usize) -> Self {
        let most = |of: &dyn Fn(&Tile) -> usize| tiles.iter().map(of).max().unwrap_or(0);
        Self {
            titles: most(&|tile| broken(&tile.title, width).len()),
            captions: most(&|tile| tile.captions.len()),
            picture: most(&|tile| tile.picture.as_ref().map_or(0, |p| p.size().height())),
        }
    }

    const fn above(&self) -> usize {
        (self.titles + self.captions) * LINE
    }

    const fn height(&self) -> usize {
        self.above() + self.picture + GAP
    }
}

impl Tile {
    /// Pixels that the picture and the lines below the title need.
    fn width(&self) -> usize {
        let words = self.captions.iter().map(|caption| TEXT.width(caption));
        let picture = self.picture.iter().map(|picture| picture.size().width());
        words.chain(picture).max().unwrap_or(0)
    }

    fn draw(&self, canvas: &mut Canvas, (x, y): (usize, usize), width: usize, lines: &Lines) {
        for (line, words) in broken(&self.title, width).iter().enumerate() {
            canvas.write(x, y + line * LINE, words, TITLE);
        }
        for (line, caption) in (lines.titles..).zip(&self.captions) {
            canvas.write(x, y + line * LINE - 2 * lines.titles.min(1), caption, TEXT);
        }
        if let Some(picture) = &self.picture {
            canvas.place(x, y + lines.above(), picture);
        }
    }
}

/// A title in lines of at most `width` pixels, words kept whole.
fn broken(title: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in title.split_whitespace() {
        match lines.last_mut() {
            Some(last) if TITLE.width(last) + TITLE.width(" ") + TITLE.width(word) <= width => {
                last.push(' ');
                last.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn colour_bar(
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Palette, png};

    #[test]
    fn long_titles_break_between_words() {
        let width = TITLE.width("a long title");
        let lines = ["a long title", "indeed"];
        assert_eq!(broken("a long title indeed", width), lines);
        assert!(broken("", width).is_empty());
        let word = "incomprehensibilities";
        assert_eq!(broken(word, width), [word]);
    }

    #[test]
    fn a_palette_changes_no_pixel_of_a_sheet() {
        let scale = ColourScale::linear(Palette::Magma, 1.0);
        let values = || (0..54).map(|at| f64::from(at) / 53.0);
        let size = FrameSize::new(9, 6).unwrap();
        let tiles = vec![
            Tile::light(("one", "light"), size, values(), 1.0),
            Tile::scaled(("two", "scale"), size, values(), &scale),
        ];
        let sheet = ContactSheet {
            heading: "heading".to_owned(),
            rows: vec![tiles],
            bar: Some((&scale, "values")),
            notes: vec!["a note".to_owned()],
        };
        let picture = sheet.compose().unwrap();
        let bytes = png::encode_small(&picture);
        assert_eq!(png::read(bytes.as_slice()).unwrap(), picture);
        assert!(bytes.len() < png::encode(&picture).len());
    }

    #[test]
    fn a_sheet_without_tiles_is_no_picture() {
        assert_eq!(ContactSheet::default().compose(), None);
    }
}
