//! Canvas: RGB pixels to compose pictures and a few words on.

use crate::{Picture, Samples};
use iltm_runtime::FrameSize;
pub use noto_sans_mono_bitmap::{FontWeight, RasterHeight};
use noto_sans_mono_bitmap::{get_raster, get_raster_width};

/// An sRGB colour.
pub type Colour = [u8; 3];

/// Background of composed pictures.
pub const BACKGROUND: Colour = [18, 20, 24];
/// Letters that are to be read first.
pub const INK: Colour = [232, 234, 238];
/// Letters that are to be read next.
pub const QUIET: Colour = [160, 166, 176];

/// How letters look.
#[derive(Clone, Copy, Debug)]
pub struct Type {
    /// Height of a line, pixels.
    pub height: RasterHeight,
    /// Regular or bold.
    pub weight: FontWeight,
    /// Colour where a letter covers a pixel.
    pub colour: Colour,
}

impl Type {
    /// Width of a text in pixels: all letters are equally wide.
    #[must_use]
    pub fn width(self, text: &str) -> usize {
        text.chars().count() * get_raster_width(self.weight, self.height)
    }
}

/// RGB pixels that can be drawn on. What would lie outside is left out.
#[derive(Clone, Debug)]
pub struct Canvas {
    size: FrameSize,
    samples: Vec<u8>,
}

impl Canvas {
    /// An empty canvas.
    #[must_use]
    pub fn new(size: FrameSize, background: Colour) -> Self {
        Self {
            size,
            samples: background.repeat(size.pixels()),
        }
    }

    /// What was drawn.
    #[must_use]
    pub fn finish(self) -> Picture {
        Picture::of_colours(self.size, self.samples)
    }

    fn pixel(&mut self, x: usize, y: usize) -> Option<&mut Colour> {
        if x >= self.size.width() || y >= self.size.height() {
            return None;
        }
        let (pixels, _) = self.samples.as_chunks_mut::<3>();
        pixels.get_mut(y * self.size.width() + x)
    }

    /// The colour at a place; black outside.
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> Colour {
        let (pixels, _) = self.samples.as_chunks::<3>();
        let inside = x < self.size.width() && y < self.size.height();
        let pixel = inside.then(|| pixels.get(y * self.size.width() + x));
        pixel.flatten().copied().unwrap_or_default()
    }

    /// Colours a pixel.
    pub fn set(&mut self, x: usize, y: usize, colour: Colour) {
        if let Some(pixel) = self.pixel(x, y) {
            *pixel = colour;
        }
    }

    /// Copies an 8-bit picture, grey or RGB, with its top left corner at `x`, `y`.
    pub fn place(&mut self, x: usize, y: usize, picture: &Picture) {
        let Samples::Eight(samples) = picture.samples() else {
            return;
        };
        let width = picture.size().width();
        for (at, pixel) in samples.chunks_exact(picture.channels()).enumerate() {
            let colour = match *pixel {
                [red, green, blue] => [red, green, blue],
                [grey, ..] => [grey; 3],
                [] => continue,
            };
            self.set(x + at % width, y + at / width, colour);
        }
    }

    /// Writes a line of basic Latin with its top left corner at `x`, `y`.
    pub fn write(&mut self, x: usize, y: usize, text: &str, letters: Type) {
        let advance = get_raster_width(letters.weight, letters.height);
        for (index, letter) in text.chars().enumerate() {
            let Some(raster) = get_raster(letter, letters.weight, letters.height) else {
                continue;
            };
            for (row, line) in raster.rows().enumerate() {
                for (col, cover) in line.iter().enumerate() {
                    if let Some(pixel) = self.pixel(x + index * advance + col, y + row) {
                        blend(pixel, letters.colour, *cover);
                    }
                }
            }
        }
    }
}

fn blend(pixel: &mut Colour, colour: Colour, cover: u8) {
    // Sixteen shades look like all of them, and leave room in a picture's palette.
    let cover = cover / 17 * 17;
    for (below, above) in pixel.iter_mut().zip(colour) {
        let mix = u32::from(*below) * u32::from(255 - cover) + u32::from(above) * u32::from(cover);
        *below = ((mix + 127) / 255) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LETTERS: Type = Type {
        height: RasterHeight::Size20,
        weight: FontWeight::Regular,
        colour: [255; 3],
    };

    #[test]
    fn words_leave_ink_and_stay_within_their_width() {
        let size = FrameSize::new(60, 30).unwrap();
        let mut canvas = Canvas::new(size, [0; 3]);
        canvas.write(3, 4, "ink", LETTERS);
        let (left, right) = (3, 3 + LETTERS.width("ink"));
        let lit = |at: usize| canvas.samples[3 * at] > 0;
        let columns: Vec<usize> = (0..size.pixels())
            .filter(|at| lit(*at))
            .map(|at| at % 60)
            .collect();
        assert!(columns.len() > 40);
        assert!(columns.iter().all(|x| (left..right).contains(x)));
    }

    #[test]
    fn what_lies_outside_is_left_out() {
        let mut canvas = Canvas::new(FrameSize::new(4, 4).unwrap(), [9; 3]);
        canvas.write(2, 2, "outside", LETTERS);
        let red = Canvas::new(FrameSize::new(3, 3).unwrap(), [255, 0, 0]).finish();
        canvas.place(3, 3, &red);
        let Samples::Eight(samples) = canvas.finish().samples().clone() else {
            panic!("8 bits");
        };
        assert_eq!(samples.len(), 48);
        assert_eq!(samples[45..], [255, 0, 0]);
    }
}
