//! PNG files from strangers: opened with limits, decoded without alpha.

use super::CaptureError;
use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageDecoder, Limits};
use std::fs::File;
use std::io::{BufReader, ErrorKind};
use std::path::{Path, PathBuf};

/// Pixels a picture may have: the largest medium-format sensors.
pub(super) const MAX_PIXELS: u64 = 160_000_000;

/// Bytes the decoder may allocate beside the pixels themselves.
const DECODER_BYTES: u64 = 32 << 20;

/// A picture file and who named it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source<'a> {
    /// The file.
    pub(super) path: &'a Path,
    /// "pattern" or "photograph".
    pub(super) what: &'static str,
    /// Line of `capture.csv` that names it.
    pub(super) line: u64,
}

/// A picture whose header is read and whose pixels are not.
pub(super) struct Opened {
    path: PathBuf,
    decoder: PngDecoder<BufReader<File>>,
}

impl Opened {
    /// Opens a PNG and reads its header.
    ///
    /// # Errors
    /// [`CaptureError::MissingFile`], [`CaptureError::Io`],
    /// [`CaptureError::Png`] or [`CaptureError::TooLarge`].
    pub(super) fn open(source: Source<'_>) -> Result<Self, CaptureError> {
        let path = source.path.to_owned();
        let metadata = match std::fs::metadata(&path) {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == ErrorKind::NotFound => {
                return Err(CaptureError::MissingFile {
                    path,
                    what: source.what,
                    line: source.line,
                });
            }
            Err(source) => return Err(CaptureError::Io { path, source }),
        };
        // Opening a pipe would wait for a writer for ever.
        if !metadata.is_file() {
            let reason = "it is not a regular file".to_owned();
            return Err(CaptureError::Png { path, reason });
        }
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(source) => return Err(CaptureError::Io { path, source }),
        };
        let mut limits = Limits::no_limits();
        // 8 bytes: the widest pixel, 16-bit RGB with alpha.
        limits.max_alloc = Some(MAX_PIXELS * 8 + DECODER_BYTES);
        let decoder = match PngDecoder::with_limits(BufReader::new(file), limits) {
            Ok(decoder) => decoder,
            Err(error) => return Err(undecodable(path, &error)),
        };
        let (width, height) = decoder.dimensions();
        if u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(CaptureError::TooLarge {
                path,
                width,
                height,
                limit: MAX_PIXELS,
            });
        }
        Ok(Self { path, decoder })
    }

    /// Width and height in pixels, at least 1.
    pub(super) fn size(&self) -> (u32, u32) {
        self.decoder.dimensions()
    }

    /// Colour channels without alpha, 1 or 3.
    pub(super) fn channels(&self) -> usize {
        if self.decoder.color_type().has_color() {
            3
        } else {
            1
        }
    }

    /// Decodes the pixels.
    ///
    /// An alpha channel is dropped if it is opaque everywhere, as drawing
    /// programs write it; a see-through pixel has no value of its own, so it is
    /// refused.
    ///
    /// # Errors
    /// [`CaptureError::Png`] or [`CaptureError::Transparent`].
    pub(super) fn decode(self) -> Result<Samples, CaptureError> {
        let Self { path, decoder } = self;
        let decoded = match DynamicImage::from_decoder(decoder) {
            Ok(decoded) => decoded,
            Err(error) => return Err(undecodable(path, &error)),
        };
        let transparent = |width: u32, at: usize| CaptureError::Transparent {
            path: path.clone(),
            row: at as u32 / width,
            col: at as u32 % width,
        };
        let width = decoded.width();
        match decoded {
            DynamicImage::ImageLuma8(picture) => Ok(Samples::Eight(picture.into_raw())),
            DynamicImage::ImageRgb8(picture) => Ok(Samples::Eight(picture.into_raw())),
            DynamicImage::ImageLuma16(picture) => Ok(Samples::Sixteen(picture.into_raw())),
            DynamicImage::ImageRgb16(picture) => Ok(Samples::Sixteen(picture.into_raw())),
            DynamicImage::ImageLumaA8(picture) => opaque(&picture, 2).map(Samples::Eight),
            DynamicImage::ImageRgba8(picture) => opaque(&picture, 4).map(Samples::Eight),
            DynamicImage::ImageLumaA16(picture) => opaque(&picture, 2).map(Samples::Sixteen),
            DynamicImage::ImageRgba16(picture) => opaque(&picture, 4).map(Samples::Sixteen),
            other => {
                let reason = format!("its pixels are {:?}", other.color());
                return Err(CaptureError::Png { path, reason });
            }
        }
        .map_err(|at| transparent(width, at))
    }
}

/// Values of a picture, row by row, channels side by side.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Samples {
    /// 0 to 255.
    Eight(Vec<u8>),
    /// 0 to 65,535.
    Sixteen(Vec<u16>),
}

/// The samples without the last of every `step`, the alpha; an error is the
/// first pixel whose alpha is not full.
fn opaque<T: Copy + PartialEq + image::Primitive>(
    samples: &[T],
    step: usize,
) -> Result<Vec<T>, usize> {
    let pixels = samples.chunks_exact(step);
    if let Some(at) = pixels
        .clone()
        .position(|pixel| pixel.last() != Some(&T::DEFAULT_MAX_VALUE))
    {
        return Err(at);
    }
    Ok(pixels
        .flat_map(|pixel| &pixel[..step - 1])
        .copied()
        .collect())
}

fn undecodable(path: PathBuf, error: &image::ImageError) -> CaptureError {
    CaptureError::Png {
        path,
        reason: error.to_string(),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(crate) fn source(path: &Path) -> Source<'_> {
        Source {
            path,
            what: "photograph",
            line: 2,
        }
    }

    fn decode(bytes: &[u8]) -> Result<Samples, CaptureError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        std::fs::write(&path, bytes).unwrap();
        Opened::open(source(&path))?.decode()
    }

    fn png(picture: &DynamicImage) -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture
            .write_to(&mut bytes, image::ImageFormat::Png)
            .unwrap();
        bytes.into_inner()
    }

    #[test]
    fn an_opaque_alpha_channel_is_dropped_and_a_see_through_pixel_is_named() {
        let mut picture = image::RgbaImage::from_pixel(3, 2, image::Rgba([1, 2, 3, 255]));
        let samples = decode(&png(&picture.clone().into())).unwrap();
        assert_eq!(samples, Samples::Eight([1, 2, 3].repeat(6)));
        picture.put_pixel(2, 1, image::Rgba([1, 2, 3, 254]));
        let error = decode(&png(&picture.into())).unwrap_err();
        assert!(
            error.to_string().contains("row 1, column 2 is transparent"),
            "{error}"
        );
    }

    #[test]
    fn a_header_that_asks_for_a_terapixel_allocates_nothing() {
        let mut bytes = png(&image::GrayImage::new(2, 2).into());
        // Width and height of IHDR stand at bytes 16..24, its CRC at 29..33.
        bytes[16..24].copy_from_slice(&[0, 16, 0, 0, 0, 16, 0, 0]);
        let crc = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        let error = decode(&bytes).unwrap_err();
        assert!(
            matches!(
                error,
                CaptureError::TooLarge {
                    width: 1_048_576,
                    ..
                }
            ),
            "{error}"
        );
    }

    /// CRC-32 of the PNG specification, annex D, bit by bit.
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |c, _| {
                (c >> 1) ^ (0xedb8_8320 * (c & 1))
            })
        })
    }

    #[test]
    fn a_folder_and_a_missing_file_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let error = Opened::open(source(folder.path())).err().unwrap();
        assert!(error.to_string().contains("not a regular file"), "{error}");
        let error = Opened::open(source(&folder.path().join("no.png")))
            .err()
            .unwrap();
        assert!(
            error
                .to_string()
                .contains("missing photograph, named in line 2"),
            "{error}"
        );
    }

    #[test]
    fn every_truncation_of_a_picture_is_refused() {
        let bytes =
            png(&image::GrayImage::from_fn(9, 9, |x, y| image::Luma([(x * y) as u8])).into());
        // The last 12 bytes are the empty end chunk.
        for length in 0..bytes.len() - 12 {
            assert!(
                matches!(decode(&bytes[..length]), Err(CaptureError::Png { .. })),
                "{length}"
            );
        }
    }

    proptest! {
        #[test]
        fn a_damaged_picture_never_panics(at in 0_usize..200, with: u8) {
            let mut bytes = png(&image::GrayImage::new(9, 9).into());
            let length = bytes.len();
            bytes[at % length] = with;
            let _ = decode(&bytes);
        }
    }
}
