//! Picture formats: a small photograph in every format that is read.

use image::{DynamicImage, ImageBuffer, ImageFormat};
use std::fmt::Write;
use std::io::Cursor;

/// A picture of 8 x 6 pixels: grey and colour, 8 and 16 bit and floating point, as
/// far as each format has them; the first ones are patterns too.
pub fn pictures() -> Vec<Vec<u8>> {
    let lit = ImageBuffer::from_fn(8, 6, |_, _| image::Luma([255_u8]));
    let eight = ImageBuffer::from_fn(8, 6, |x, y| image::Luma([(30 * x + 7 * y) as u8]));
    let colour = ImageBuffer::from_fn(8, 6, |x, y| {
        image::Rgb([(30 * x) as u8, 99, (40 * y) as u8])
    });
    let wide = ImageBuffer::from_fn(8, 6, |x, y| image::Luma([(8_000 * x + 900 * y) as u16]));
    let float = ImageBuffer::from_fn(8, 6, |x, y| {
        image::Rgb([x as f32 / 8.0, 0.5, y as f32 / 6.0])
    });
    let alpha = ImageBuffer::from_fn(8, 6, |x, _| image::Rgba([x as f32 / 8.0, 0.5, 0.2, 1.0]));
    let of = [
        (DynamicImage::ImageLuma8(lit), &[ImageFormat::Png][..]),
        (
            DynamicImage::ImageLuma8(eight),
            &[
                ImageFormat::Png,
                ImageFormat::Tiff,
                ImageFormat::Jpeg,
                ImageFormat::Pnm,
            ],
        ),
        (
            DynamicImage::ImageRgb8(colour),
            &[
                ImageFormat::Png,
                ImageFormat::Tiff,
                ImageFormat::Jpeg,
                ImageFormat::Pnm,
            ],
        ),
        (
            DynamicImage::ImageLuma16(wide),
            &[ImageFormat::Png, ImageFormat::Tiff],
        ),
        (
            DynamicImage::ImageRgb32F(float),
            &[ImageFormat::Tiff, ImageFormat::OpenExr],
        ),
        (DynamicImage::ImageRgba32F(alpha), &[ImageFormat::OpenExr]),
    ];
    let encoded = of.iter().flat_map(|(picture, formats)| {
        formats.iter().filter_map(|format| {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, *format).ok()?;
            Some(bytes.into_inner())
        })
    });
    let mut all: Vec<Vec<u8>> = encoded.collect();
    all.extend([twelve_bits(), ascii(), grey_float()]);
    all
}

/// A PGM with 12 bits in two bytes.
fn twelve_bits() -> Vec<u8> {
    let mut bytes = b"P5 8 6 4095\n".to_vec();
    bytes.extend((0..48_u16).flat_map(|value| (85 * value).to_be_bytes()));
    bytes
}

/// A PPM in figures.
fn ascii() -> Vec<u8> {
    let mut text = "P3\n# figures\n8 6\n255\n".to_owned();
    for value in 0..144 {
        // Writing into a string cannot fail.
        let _ = write!(text, "{value} ");
    }
    text.into_bytes()
}

/// A floating point grey TIFF (TIFF 6.0, sections 2 and 19), one strip.
fn grey_float() -> Vec<u8> {
    const SHORT: u16 = 3;
    const LONG: u16 = 4;
    let entries: [(u16, u16, u32); 10] = [
        (256, SHORT, 8),
        (257, SHORT, 6),
        (258, SHORT, 32),
        (259, SHORT, 1),
        (262, SHORT, 1),
        (273, LONG, 8),
        (277, SHORT, 1),
        (278, SHORT, 6),
        (279, LONG, 192),
        (339, SHORT, 3),
    ];
    let mut bytes = vec![b'I', b'I', 42, 0];
    bytes.extend(200_u32.to_le_bytes());
    bytes.extend((0..48_u8).flat_map(|value| (f32::from(value) / 48.0).to_le_bytes()));
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, value) in entries {
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend(0_u32.to_le_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm::capture::FileFormat;

    #[test]
    fn every_format_that_is_read_has_a_picture() {
        let formats: Vec<_> = pictures()
            .iter()
            .filter_map(|bytes| FileFormat::of(bytes))
            .collect();
        assert_eq!(formats.len(), pictures().len());
        for format in [
            FileFormat::Png,
            FileFormat::Tiff,
            FileFormat::Jpeg,
            FileFormat::OpenExr,
            FileFormat::Netpbm,
        ] {
            assert!(formats.contains(&format), "{format}");
        }
    }
}
