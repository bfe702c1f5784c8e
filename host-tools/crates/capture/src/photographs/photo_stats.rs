//! Photograph statistics: how bright a file is, before anything is known of what it shows.

use crate::format::error::CaptureError;
use crate::format::picture_file::{Opened, Samples, Source};
use std::cmp::Ordering;
use std::path::Path;

/// Share of the samples below [`PhotoStats::bright`].
const BRIGHT: f64 = 0.995;

/// A photograph that is whole: every pixel was decoded.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PhotoStats {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Colour channels, 1 or 3.
    pub channels: usize,
    /// Mean of all values, of the file's full scale.
    pub mean: f64,
    /// Value that all but half a percent of them stay below, of the file's full
    /// scale: how bright the bright parts are, stray highlights left out.
    pub bright: f64,
}

impl PhotoStats {
    /// Decodes a photograph.
    ///
    /// # Errors
    /// What reading a photograph of a capture gives: missing, not a picture, cut
    /// short, too large, transparent.
    pub fn read(path: &Path) -> Result<Self, CaptureError> {
        let opened = Opened::open(Source {
            path,
            what: "photograph",
            line: 0,
        })?;
        let (size, channels) = (opened.size(), opened.channels());
        let (mean, bright) = match opened.decode()? {
            Samples::Eight(values) => levels(values, 255.0),
            Samples::Sixteen(values) => levels(values, 65_535.0),
            Samples::Float(mut values) => {
                for value in &mut values {
                    *value = value.max(0.0);
                }
                levels(values, 1.0)
            }
        };
        Ok(Self {
            size,
            channels,
            mean,
            bright,
        })
    }
}

/// Mean and bright value of numbers, none of which is NaN.
fn levels<T: Copy + PartialOrd + Into<f64>>(mut values: Vec<T>, full: f64) -> (f64, f64) {
    let count = values.len();
    if count == 0 {
        return (0.0, 0.0);
    }
    let sum: f64 = values.iter().map(|value| (*value).into()).sum();
    let at = ((count as f64 * BRIGHT) as usize).min(count - 1);
    let order = |a: &T, b: &T| a.partial_cmp(b).unwrap_or(Ordering::Equal);
    let bright = *values.select_nth_unstable_by(at, order).1;
    (sum / count as f64 / full, bright.into() / full)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, Luma};

    #[test]
    fn mean_and_bright_parts_are_shares_of_full_scale() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        // A tenth at 204 = 80 %, one highlight.
        let value = |x, y| match (x, y) {
            (0, 0) => 255,
            (0..5, _) => 204,
            _ => 0,
        };
        let picture = GrayImage::from_fn(50, 20, |x, y| Luma([value(x, y)]));
        picture.save(&path).unwrap();
        let stats = PhotoStats::read(&path).unwrap();
        assert_eq!((stats.size, stats.channels), ((50, 20), 1));
        assert!((stats.bright - 0.8).abs() < 1e-9);
        let mean = (99.0 * 204.0 + 255.0) / 255.0 / 1000.0;
        assert!((stats.mean - mean).abs() < 1e-9);
    }
}
