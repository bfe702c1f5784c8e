//! Stills: pictures of any size and kind as pictures to show, cut to another aspect and scaled.

use super::error::CaptureError;
use super::picture_file::{EXPORT, Opened, Samples, Source};
use iltm_picture::Picture;
use iltm_runtime::FrameSize;
use image::{DynamicImage, ImageBuffer, imageops::FilterType};
use std::path::Path;

/// Reads a picture of any kind that photographs may have, as one of `size` with 8 bits: its middle,
/// as large as the aspect allows.
///
/// # Errors
/// [`CaptureError::Picture`] of what is no picture, or of floating point numbers, which are light
/// and no codes for a projector.
pub fn read_still(path: &Path, size: FrameSize) -> Result<Picture, CaptureError> {
    let refuse = |reason: &str| CaptureError::Picture {
        path: path.to_owned(),
        reason: reason.to_owned(),
        next_step: EXPORT,
    };
    let opened = Opened::open(Source {
        path,
        what: "picture",
        line: 0,
    })?;
    let ((width, height), channels) = (opened.size(), opened.channels());
    let grey = channels == 1;
    let picture = match opened.decode()? {
        Samples::Eight(codes) if grey => {
            ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageLuma8)
        }
        Samples::Eight(codes) => {
            ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageRgb8)
        }
        Samples::Sixteen(codes) if grey => {
            ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageLuma16)
        }
        Samples::Sixteen(codes) => {
            ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageRgb16)
        }
        Samples::Float(_) => return Err(refuse("it holds floating point numbers and no codes")),
    };
    let picture = picture.ok_or_else(|| refuse("it has fewer samples than pixels"))?;
    let (width, height) = (size.width() as u32, size.height() as u32);
    let fitted = picture.resize_to_fill(width, height, FilterType::CatmullRom);
    let codes = if grey {
        fitted.into_luma8().into_raw()
    } else {
        fitted.into_rgb8().into_raw()
    };
    Picture::new(size, iltm_picture::Samples::Eight(codes))
        .ok_or_else(|| refuse("it has fewer samples than pixels"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, RgbImage};

    #[test]
    fn the_middle_of_a_still_is_shown_as_large_as_the_aspect_allows() {
        let folder = tempfile::tempdir().unwrap();
        let size = FrameSize::new(8, 4).unwrap();
        // A bright middle between dark ends that another aspect cuts off.
        for (across, down, vertical) in [(40, 60, true), (120, 20, false)] {
            let middle = |x: u32, y: u32| {
                let (at, all) = if vertical { (y, down) } else { (x, across) };
                (all / 10..9 * all / 10).contains(&at)
            };
            let path = folder.path().join("still.png");
            let grey = |x, y| image::Luma([if middle(x, y) { 200 } else { 0 }]);
            GrayImage::from_fn(across, down, grey).save(&path).unwrap();
            let still = read_still(&path, size).unwrap();
            assert_eq!((still.size(), still.channels()), (size, 1));
            let iltm_picture::Samples::Eight(codes) = still.samples() else {
                panic!("{still:?}");
            };
            assert!(codes.iter().all(|code| *code == 200), "{codes:?}");
        }
        let path = folder.path().join("still.jpg");
        let colour = RgbImage::from_pixel(9, 9, image::Rgb([200, 100, 50]));
        colour.save(&path).unwrap();
        assert_eq!(read_still(&path, size).unwrap().channels(), 3);
        std::fs::write(&path, b"no picture").unwrap();
        let error = read_still(&path, size).unwrap_err();
        assert!(error.to_string().contains("it is not a PNG"), "{error}");
    }
}
