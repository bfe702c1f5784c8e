//! Textures: albedo from a picture.

use iltm_picture::Response;
use image::{ImageReader, Limits};
use nalgebra::Vector2;
use std::path::Path;

/// Sides of a texture, pixels, at most.
const MOST_SIDE: u32 = 8192;
/// Bytes that reading one may take.
const MOST_BYTES: u64 = 256 << 20;

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
        let mut limits = Limits::default();
        limits.max_image_width = Some(MOST_SIDE);
        limits.max_image_height = Some(MOST_SIDE);
        limits.max_alloc = Some(MOST_BYTES);
        let refuse = |reason: String| format!("{}: {reason}", path.display());
        let mut reader = ImageReader::open(path).map_err(|e| refuse(e.to_string()))?;
        reader.limits(limits);
        let picture = reader.decode().map_err(|e| refuse(e.to_string()))?;
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        if width == 0 || height == 0 {
            return Err(refuse("it has no pixels".to_owned()));
        }
        let light = |value: f32| Response::Srgb.light(f64::from(value)) as f32;
        let pixels: Vec<[f32; 3]> = picture
            .to_rgb32f()
            .pixels()
            .map(|pixel| pixel.0.map(light))
            .collect();
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
