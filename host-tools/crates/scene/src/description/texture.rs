//! Textures: albedo from a picture.

use iltm_picture::{Response, Samples, png};
use nalgebra::Vector2;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// A picture of albedo, decoded from sRGB: each pixel is a rectangle of one colour.
#[derive(Clone, Debug)]
pub struct Texture {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

impl Texture {
    /// Reads a PNG.
    ///
    /// # Errors
    /// A sentence that says why it is no texture.
    pub fn read(path: &Path) -> Result<Self, String> {
        let metadata = std::fs::metadata(path).map_err(|e| format!("{}: {e}", path.display()))?;
        // Opening a pipe would wait for a writer for ever.
        if !metadata.is_file() {
            return Err(format!("{} is not a regular file", path.display()));
        }
        let refuse = |reason: String| format!("{}: {reason}", path.display());
        let file = File::open(path).map_err(|e| refuse(e.to_string()))?;
        let picture = png::read(BufReader::new(file)).map_err(|e| refuse(e.to_string()))?;
        let light = |part: f32| Response::Srgb.light(f64::from(part)) as f32;
        let light: Vec<f32> = match picture.samples() {
            Samples::Eight(codes) => {
                let part = |code: &u8| light(f32::from(*code) / 255.0);
                codes.iter().map(part).collect()
            }
            Samples::Sixteen(codes) => {
                let part = |code: &u16| light(f32::from(*code) / 65_535.0);
                codes.iter().map(part).collect()
            }
        };
        let pixels = light.chunks_exact(picture.channels());
        let colour = |pixel: &[f32]| [0, 1, 2].map(|channel| pixel[channel % pixel.len()]);
        let pixels = pixels.map(colour).collect();
        let (width, height) = (picture.size().width(), picture.size().height());
        Ok(Self::new(width, height, pixels))
    }

    /// A texture of these pixels, row by row from the top; there are `width *
    /// height` of them and at least one.
    pub(crate) fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>) -> Self {
        Self {
            width,
            height,
            pixels,
        }
    }

    /// Albedo at a place from the left and from the top, 0 to 1; beyond that, that
    /// of the border.
    #[must_use]
    pub fn at(&self, place: Vector2<f64>) -> [f64; 3] {
        let index = |x: f64, count: usize| ((x * count as f64).max(0.0) as usize).min(count - 1);
        let (col, row) = (index(place.x, self.width), index(place.y, self.height));
        self.pixels[row * self.width + col].map(f64::from)
    }

    /// Largest difference between the channels of a pixel.
    #[must_use]
    pub fn widest_spread(&self) -> f64 {
        let spread = |p: &[f32; 3]| {
            p.iter().fold(0.0, |a: f32, b| a.max(*b))
                - p.iter().fold(f32::INFINITY, |a, b| a.min(*b))
        };
        f64::from(self.pixels.iter().map(spread).fold(0.0, f32::max))
    }

    /// The largest albedo of each channel.
    #[must_use]
    pub fn largest(&self) -> [f64; 3] {
        let largest = |channel: usize| {
            self.pixels
                .iter()
                .map(move |p| p[channel])
                .fold(0.0, f32::max)
        };
        [0, 1, 2].map(|channel| f64::from(largest(channel)))
    }
}
