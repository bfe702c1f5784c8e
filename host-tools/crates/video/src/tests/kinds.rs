//! Kinds of frames and of tables, and which go together.

use super::*;
use ::png::{BitDepth, ColorType};
use iltm_picture::{png, png::PngError, progress::Silent};
use std::io::Cursor;

#[test]
fn a_grey_frame_is_refused_by_a_table_of_three_channels() {
    let table = MadeUp::new(grid(2, 2), 3);
    let picture = random_picture(size(4, 4), 1, false, 1);
    let error = compensated(&table, CompensateOptions::default(), &picture).unwrap_err();
    assert!(matches!(error, VideoError::GreyFrame));
    assert!(error.next_step().contains("colour"));
}

#[test]
fn a_table_of_one_channel_treats_each_colour_like_grey() {
    let table = MadeUp::of_all_kinds(grid(4, 6), 1, 4, 3);
    for (width, height) in [(6, 4), (31, 17)] {
        let frame = size(width, height);
        let colour = random_picture(frame, 3, false, 5);
        let Samples::Eight(samples) = colour.samples() else {
            panic!("a picture of bytes");
        };
        let plane = |samples: &[u8], channel| -> Vec<u8> {
            samples.iter().copied().skip(channel).step_by(3).collect()
        };
        let (result, summary) = compensated(&table, CompensateOptions::default(), &colour).unwrap();
        let Samples::Eight(result) = result.samples() else {
            panic!("a picture of bytes");
        };
        let mut clipped = 0;
        for channel in 0..3 {
            let grey = Picture::new(frame, Samples::Eight(plane(samples, channel))).unwrap();
            let (grey, of_grey) = compensated(&table, CompensateOptions::default(), &grey).unwrap();
            assert_eq!(grey.samples(), &Samples::Eight(plane(result, channel)));
            clipped += of_grey.clipped;
        }
        assert_eq!(summary.clipped, clipped);
    }
}

#[test]
fn a_frame_smaller_than_the_grid_is_refused_with_both_sizes() {
    let table = MadeUp::new(grid(4, 6), 3);
    for (width, height) in [(5, 4), (6, 3), (5, 40), (60, 3)] {
        let picture = random_picture(size(width, height), 3, false, 1);
        let error = compensated(&table, CompensateOptions::default(), &picture).unwrap_err();
        assert!(matches!(error, VideoError::SmallerThanGrid { .. }));
        assert!(error.to_string().contains("6 x 4"));
        assert!(error.to_string().contains(&format!("{width} x {height}")));
    }
}

#[test]
fn a_tier_that_the_table_has_not_is_refused() {
    let table = MadeUp::of_all_kinds(grid(4, 6), 3, 4, 3);
    let settings = CompensateOptions {
        tier: Some(3),
        ..CompensateOptions::default()
    };
    let picture = random_picture(size(6, 4), 3, false, 1);
    let error = compensated(&table, settings, &picture).unwrap_err();
    assert!(matches!(error, VideoError::NoSuchTier { tier: 3, top: 2 }));
}

#[test]
fn samples_beyond_black_and_white_are_counted() {
    // Gain 2 sends everything above half scale beyond white.
    let mut table = MadeUp::new(grid(2, 2), 1);
    table.gains.fill(2 << table.gain_fraction);
    let ramp = (0..=255_u8).collect();
    let picture = Picture::new(size(16, 16), Samples::Eight(ramp)).unwrap();
    let (_, summary) = compensated(&table, settings(Encoding::Linear), &picture).unwrap();
    assert_eq!((summary.clipped, summary.samples), (128, 256));
}

/// A PNG file of the given colour type and samples.
fn png_file(colour: ColorType, depth: BitDepth, samples: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut file, 4, 2);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    if colour == ColorType::Indexed {
        encoder.set_palette(vec![0, 0, 0, 255, 0, 0, 0, 255, 0, 9, 9, 9]);
    }
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(samples).unwrap();
    writer.finish().unwrap();
    file
}

#[test]
fn pictures_keep_their_size_depth_and_colour() {
    for (channels, wide) in [(1, false), (1, true), (3, false), (3, true)] {
        let picture = random_picture(size(9, 5), channels, wide, 4);
        let mut file = Vec::new();
        png::write(&mut file, &picture).unwrap();
        assert_eq!(png::read(Cursor::new(&file)).unwrap(), picture);
        let image = MadeUp::new(grid(2, 3), 1).image();
        let table = Table::check(&image).unwrap();
        let compensator = Compensator::new(&table, CompensateOptions::default()).unwrap();
        let mut output = Vec::new();
        let summary = compensator.stream(&file[..], &mut output, &Silent).unwrap();
        assert_eq!((summary.frames, summary.samples), (1, 45 * channels as u64));
        let result = png::read(Cursor::new(&output)).unwrap();
        let of = |picture: &Picture| {
            let wide = matches!(picture.samples(), Samples::Sixteen(_));
            (picture.size(), picture.channels(), wide)
        };
        assert_eq!(of(&result), of(&picture));
    }
}

#[test]
fn palettes_and_few_bits_become_eight_bits() {
    let indexed = png_file(ColorType::Indexed, BitDepth::Two, &[0b00_01_10_11; 2]);
    let picture = png::read(&indexed[..]).unwrap();
    let row = [0, 0, 0, 255, 0, 0, 0, 255, 0, 9, 9, 9];
    assert_eq!(picture.samples(), &Samples::Eight([row, row].concat()));
    let grey = png_file(ColorType::Grayscale, BitDepth::One, &[0b0101_0000; 2]);
    let picture = png::read(&grey[..]).unwrap();
    assert_eq!(
        picture.samples(),
        &Samples::Eight([0, 255, 0, 255].repeat(2))
    );
}

#[test]
fn transparent_pictures_are_refused_and_opaque_ones_are_their_colours() {
    for (colour, channels) in [(ColorType::Rgba, 4), (ColorType::GrayscaleAlpha, 2)] {
        for (depth, bytes) in [(BitDepth::Eight, 1), (BitDepth::Sixteen, 2)] {
            let sample = |at: usize| {
                let alpha = at / bytes % channels == channels - 1;
                if alpha { 255 } else { at as u8 }
            };
            let samples: Vec<u8> = (0..8 * channels * bytes).map(sample).collect();
            let whole = png::read(&png_file(colour, depth, &samples)[..]).unwrap();
            assert_eq!(whole.channels(), channels - 1);
            let plain = match colour {
                ColorType::Rgba => ColorType::Rgb,
                _ => ColorType::Grayscale,
            };
            let colours = samples.chunks_exact(bytes).enumerate();
            let colours = colours.filter(|(at, _)| at % channels != channels - 1);
            let colours: Vec<u8> = colours.flat_map(|(_, sample)| sample.to_vec()).collect();
            assert_eq!(
                whole,
                png::read(&png_file(plain, depth, &colours)[..]).unwrap()
            );
        }
        let mut samples = vec![255; 8 * channels];
        *samples.last_mut().unwrap() = 254;
        let file = png_file(colour, BitDepth::Eight, &samples);
        let error = png::read(&file[..]).unwrap_err();
        assert!(matches!(error, PngError::Alpha));
        assert!(error.next_step().contains("-alpha off"));
    }
}

#[test]
fn a_picture_that_says_it_is_huge_is_refused_before_it_is_read() {
    let mut file = png_file(ColorType::Grayscale, BitDepth::Eight, &[0; 8]);
    for (width, height) in [(65_536_u32, 1_u32), (60_000, 60_000), (1, u32::MAX >> 1)] {
        file[16..20].copy_from_slice(&width.to_be_bytes());
        file[20..24].copy_from_slice(&height.to_be_bytes());
        // The checksum of the header: CRC-32 of its kind and content.
        let crc = iltm_runtime::image::crc32(&[&file[12..29]]);
        file[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(matches!(
            png::read(&file[..]),
            Err(PngError::TooLarge { .. })
        ));
    }
}

#[test]
fn damaged_pictures_give_an_error_and_never_a_panic() {
    let whole = png_file(ColorType::Rgb, BitDepth::Eight, &[77; 24]);
    for end in 0..whole.len() - 12 {
        assert!(png::read(&whole[..end]).is_err());
    }
    for place in 0..whole.len() {
        for bit in 0..8 {
            let mut damaged = whole.clone();
            damaged[place] ^= 1 << bit;
            let _ = png::read(&damaged[..]);
        }
    }
}

#[test]
fn an_input_of_another_kind_is_named() {
    let image = MadeUp::new(grid(2, 2), 3).image();
    let table = Table::check(&image).unwrap();
    let compensator = Compensator::new(&table, CompensateOptions::default()).unwrap();
    for input in ["", "x", "RIFF....AVI LIST", "\u{89}PN"] {
        let error = compensator
            .stream(input.as_bytes(), Vec::new(), &Silent)
            .unwrap_err();
        assert!(matches!(error, VideoError::UnknownFormat), "{input}");
    }
}
