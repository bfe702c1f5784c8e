//! Picture files of every format, whole, damaged and misnamed.

use crate::format::picture_file::*;
use crate::{CaptureError, FileFormat};
use image::{DynamicImage, ImageFormat};
use std::io::Cursor;
use std::path::Path;

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

fn encode(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn png(picture: &DynamicImage) -> Vec<u8> {
    encode(picture, ImageFormat::Png)
}

/// Format, channels, bits and samples of a file with a misleading name.
fn read(bytes: &[u8]) -> (FileFormat, usize, u8, Samples) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.png");
    std::fs::write(&path, bytes).unwrap();
    let opened = Opened::open(source(&path)).unwrap();
    let (format, channels, bits) = (opened.format(), opened.channels(), opened.bits());
    (format, channels, bits, opened.decode().unwrap())
}

fn deep() -> Vec<u16> {
    (0..18).map(|k| k * 3_000).collect()
}

#[test]
fn eight_and_sixteen_bits_come_back_from_every_lossless_format() {
    let wide = image::ImageBuffer::from_raw(3, 2, deep()).unwrap();
    let wide = DynamicImage::ImageRgb16(wide);
    let grey = image::GrayImage::from_raw(3, 2, vec![0, 1, 2, 3, 200, 255]).unwrap();
    let grey = DynamicImage::ImageLuma8(grey);
    for (format, file) in [
        (ImageFormat::Png, FileFormat::Png),
        (ImageFormat::Tiff, FileFormat::Tiff),
        (ImageFormat::Pnm, FileFormat::Netpbm),
    ] {
        if format != ImageFormat::Pnm {
            let found = read(&encode(&wide, format));
            assert_eq!(found, (file, 3, 16, Samples::Sixteen(deep())));
        }
        let found = read(&encode(&grey, format));
        let values = vec![0, 1, 2, 3, 200, 255];
        assert_eq!(found, (file, 1, 8, Samples::Eight(values)));
    }
}

#[test]
fn twelve_bits_of_a_raw_converter_are_read_high_byte_first_and_fill_the_scale() {
    // Netpbm's own specification: two bytes a sample, the most significant first.
    let mut bytes = b"P5\n# dcraw -4\n3 1\n4095\n".to_vec();
    bytes.extend([0x00, 0x00, 0x08, 0x00, 0x0f, 0xff]);
    let (format, channels, bits, samples) = read(&bytes);
    assert_eq!((format, channels, bits), (FileFormat::Netpbm, 1, 16));
    // 2048 / 4095 * 65535.
    assert_eq!(samples, Samples::Sixteen(vec![0, 32_776, 65_535]));
}

#[test]
fn floating_point_comes_back_from_tiff_and_openexr_with_what_is_below_0_and_above_1() {
    let values = [-0.25_f32, 0.0, 0.5, 1.0, 2.5, 0.125];
    let picture = image::ImageBuffer::from_raw(2, 1, values.to_vec()).unwrap();
    let picture = DynamicImage::ImageRgb32F(picture);
    for (format, file) in [
        (ImageFormat::Tiff, FileFormat::Tiff),
        (ImageFormat::OpenExr, FileFormat::OpenExr),
    ] {
        let found = read(&encode(&picture, format));
        assert_eq!(found, (file, 3, 32, Samples::Float(values.to_vec())));
    }
    let mut grey = Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut grey).unwrap();
    let kind = encoder.new_image::<tiff::encoder::colortype::Gray32Float>(3, 2);
    kind.unwrap().write_data(&values).unwrap();
    let found = read(grey.get_ref());
    assert_eq!(
        found,
        (FileFormat::Tiff, 1, 32, Samples::Float(values.to_vec()))
    );
}

#[test]
fn a_value_that_is_no_number_is_named() {
    let values = vec![0.5, 0.5, 0.5, 0.5, f32::NAN, 0.5];
    let picture = image::ImageBuffer::from_raw(2, 1, values).unwrap();
    let bytes = encode(&DynamicImage::ImageRgb32F(picture), ImageFormat::OpenExr);
    let error = decode(&bytes).unwrap_err().to_string();
    assert!(error.contains("row 0, column 1 is not a finite"), "{error}");
}

#[test]
fn a_jpeg_is_read_and_one_that_was_cut_off_is_refused() {
    let picture = image::GrayImage::from_fn(64, 48, |x, y| image::Luma([(2 * x + y) as u8]));
    let bytes = encode(&picture.clone().into(), ImageFormat::Jpeg);
    let (format, channels, bits, samples) = read(&bytes);
    assert_eq!((format, channels, bits), (FileFormat::Jpeg, 1, 8));
    let Samples::Eight(values) = samples else {
        panic!("8 bit")
    };
    let far = values.iter().zip(picture.as_raw());
    assert!(far.map(|(a, b)| a.abs_diff(*b)).max() <= Some(12));
    for length in 0..bytes.len() - 1 {
        let error = decode(&bytes[..length]).expect_err(&length.to_string());
        assert!(matches!(error, CaptureError::Picture { .. }), "{error}");
    }
}

#[test]
fn a_file_of_another_kind_is_refused_with_the_kinds_that_are_read() {
    for bytes in [&b"GIF89a"[..], b"", b"P5", b"II", b"not a PNG"] {
        let error = decode(bytes).unwrap_err().to_string();
        assert!(error.contains(FileFormat::NAMES), "{error}");
    }
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
fn the_memory_of_a_picture_counts_the_copies_that_its_decoder_makes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photograph");
    let memory = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Opened::open(source(&path)).unwrap().memory()
    };
    let picture = DynamicImage::new_rgb16(3, 2);
    assert_eq!(memory(&png(&picture)), 36);
    assert_eq!(memory(&encode(&picture, ImageFormat::Tiff)), 72);
    assert_eq!(memory(b"P6 12600 12600 65535\n"), 12_600 * 12_600 * 6);
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
    let bytes = png(&image::GrayImage::from_fn(9, 9, |x, y| image::Luma([(x * y) as u8])).into());
    // The last 12 bytes are the empty end chunk.
    for length in 0..bytes.len() - 12 {
        assert!(
            matches!(decode(&bytes[..length]), Err(CaptureError::Picture { .. })),
            "{length}"
        );
    }
}
