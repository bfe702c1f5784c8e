//! Frames in their place: borders, aspects, fits.

use super::*;
use crate::{Fit, PlacedFrames, y4m};
use iltm_picture::progress::Silent;
use iltm_runtime::placement::ProjectorPixels;
use iltm_tests::made_up::MadeUp;

/// A table of 3 x 5 cells on 40 x 25 pixels with a border of 4.
fn bordered(channels: usize) -> MadeUp {
    let mut table = MadeUp::of_all_kinds(grid(3, 5), channels, 3, 7);
    table.projector = ProjectorPixels::new(size(40, 25), 4);
    table
}

fn framed(
    table: &MadeUp,
    fit: Option<Fit>,
    picture: &Picture,
) -> Result<(Picture, FrameTotals), VideoError> {
    let image = table.image();
    let table = Table::check(&image).expect("a sample table is whole");
    let settings = CompensateOptions {
        fit,
        ..settings(Encoding::Display)
    };
    Compensator::new(&table, settings)?.frame(picture.clone())
}

/// A pixel's samples.
fn pixel(picture: &Picture, x: usize, y: usize) -> Vec<u16> {
    let channels = picture.channels();
    let at = (y * picture.size().width() + x) * channels;
    match picture.samples() {
        Samples::Eight(all) => all[at..at + channels]
            .iter()
            .map(|s| u16::from(*s))
            .collect(),
        Samples::Sixteen(all) => all[at..at + channels].to_vec(),
    }
}

/// The pixels of a rectangle, read one by one.
fn cut(picture: &Picture, left: usize, top: usize, to: FrameSize) -> Picture {
    let mut samples = Vec::new();
    for y in 0..to.height() {
        for x in 0..to.width() {
            samples.extend(pixel(picture, left + x, top + y));
        }
    }
    let samples = match picture.samples() {
        Samples::Eight(_) => Samples::Eight(samples.iter().map(|s| *s as u8).collect()),
        Samples::Sixteen(_) => Samples::Sixteen(samples),
    };
    Picture::new(to, samples).expect("a rectangle of it")
}

#[test]
fn inside_the_border_a_frame_is_what_its_cells_alone_would_be_and_black_outside() {
    for (channels, wide) in [(1, false), (3, false), (3, true)] {
        let table = bordered(channels);
        let frame = random_picture(size(40, 25), channels, wide, 3);
        let (made, totals) = framed(&table, None, &frame).unwrap();
        assert_eq!(made.size(), size(40, 25));
        let cells = cut(&frame, 4, 4, size(32, 17));
        let (alone, of_alone) = compensated(&table, settings(Encoding::Display), &cells).unwrap();
        assert_eq!(cut(&made, 4, 4, size(32, 17)), alone);
        assert_eq!(totals.clipped, of_alone.clipped);
        assert_eq!(totals.clipped_white, of_alone.clipped_white);
        for (x, y) in [(0, 0), (3, 12), (36, 4), (20, 3), (20, 21), (39, 24)] {
            assert!(
                pixel(&made, x, y).iter().all(|sample| *sample == 0),
                "{x} {y}"
            );
        }
    }
}

#[test]
fn a_frame_of_the_size_inside_the_border_is_put_there() {
    let table = bordered(3);
    let cells = random_picture(size(32, 17), 3, false, 3);
    let (made, totals) = framed(&table, None, &cells).unwrap();
    assert_eq!((made.size(), totals.size), (size(40, 25), size(40, 25)));
    let (alone, _) = compensated(&table, settings(Encoding::Display), &cells).unwrap();
    assert_eq!(cut(&made, 4, 4, size(32, 17)), alone);
}

#[test]
fn a_frame_at_another_scale_has_its_border_scaled() {
    let table = bordered(1);
    let frame = random_picture(size(80, 50), 1, false, 3);
    let (made, _) = framed(&table, None, &frame).unwrap();
    let cells = cut(&frame, 8, 8, size(64, 34));
    let (alone, _) = compensated(&table, settings(Encoding::Display), &cells).unwrap();
    assert_eq!(cut(&made, 8, 8, size(64, 34)), alone);
}

#[test]
fn a_frame_of_one_pixel_a_cell_stays_that() {
    let table = bordered(1);
    let cells = random_picture(size(5, 3), 1, false, 3);
    let (made, _) = framed(&table, None, &cells).unwrap();
    let (alone, _) = compensated(&table, settings(Encoding::Display), &cells).unwrap();
    assert_eq!(made, alone);
}

#[test]
fn another_aspect_is_refused_with_both_sizes_unless_it_is_said_how() {
    let table = bordered(1);
    for (width, height) in [(64, 36), (25, 40), (40, 40), (17, 13)] {
        let frame = random_picture(size(width, height), 1, false, 3);
        let error = framed(&table, None, &frame).unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, VideoError::Aspect { .. }), "{text}");
        assert!(text.contains(&format!("{width} x {height}")), "{text}");
        assert!(
            text.contains("40 x 25") && text.contains("border of 4"),
            "{text}"
        );
        assert!(error.next_step().contains("letterbox"));
    }
    let no_projector = MadeUp::new(grid(3, 5), 1);
    let frame = random_picture(size(40, 25), 1, false, 3);
    let error = framed(&no_projector, Some(Fit::Crop), &frame).unwrap_err();
    assert!(matches!(error, VideoError::NothingToFit), "{error}");
}

#[test]
fn fits_pad_cut_or_keep_a_frame_and_resample_no_pixel() {
    let table = bordered(1);
    // (frame, fit, what comes out, where its first pixel goes): 64 x 40 and 58 x 36 have
    // the projector's aspect.
    let cases = [
        ((64, 36), Fit::Letterbox, (64, 40), (0, 2)),
        ((64, 36), Fit::Crop, (58, 36), (-3, 0)),
        ((64, 36), Fit::Stretch, (64, 36), (0, 0)),
        ((40, 40), Fit::Letterbox, (64, 40), (12, 0)),
        ((40, 40), Fit::Crop, (40, 25), (0, -7)),
    ];
    for ((width, height), fit, (to_width, to_height), (left, top)) in cases {
        let frame = random_picture(size(width, height), 1, false, 3);
        let (made, _) = framed(&table, Some(fit), &frame).unwrap();
        let shown = size(to_width, to_height);
        assert_eq!(made.size(), shown, "{fit:?}");
        let placed = Picture::from_fn(shown, |x, y| {
            let (x, y) = (x as i32 - left, y as i32 - top);
            let inside = (0..i32::from(width)).contains(&x) && (0..i32::from(height)).contains(&y);
            let sample = if inside {
                pixel(&frame, x as usize, y as usize)[0]
            } else {
                0
            };
            [sample as u8]
        });
        let expected = match fit {
            Fit::Stretch => {
                // 4 of 40 columns and of 25 rows, of a frame of 64 x 36.
                let inside = cut(&placed, 6, 6, size(52, 24));
                let (alone, _) = compensated(&table, settings(Encoding::Display), &inside).unwrap();
                assert_eq!(cut(&made, 6, 6, size(52, 24)), alone);
                continue;
            }
            Fit::Letterbox | Fit::Crop => framed(&table, None, &placed).unwrap().0,
        };
        assert_eq!(made, expected, "{fit:?} {width} x {height}");
    }
}

#[test]
fn a_stream_of_another_aspect_gets_a_header_of_its_new_size_and_black_bars() {
    for colour in [
        "mono", "420jpeg", "422", "444", "mono10", "420p10", "422p10", "444p12",
    ] {
        let mut table = bordered(1);
        table.projector = ProjectorPixels::new(size(40, 25), 0);
        let image = table.image();
        let table = Table::check(&image).unwrap();
        let settings = CompensateOptions {
            fit: Some(Fit::Letterbox),
            ..settings(Encoding::Display)
        };
        let header = y4m::Header::parse(
            format!("YUV4MPEG2 W64 H36 F25:1 Ip C{colour} XCOLORRANGE=FULL").as_bytes(),
        )
        .unwrap();
        let mut input = [header.line(), b"\n"].concat();
        for frame in [31, 77] {
            input.extend(b"FRAME\n");
            let above = header.bits() - 8;
            let samples = (0..header.frame_bytes() / header.sample_bytes())
                .map(|at| u16::from((at * 7 + frame) as u8) << above);
            input.extend(
                samples.flat_map(|code| code.to_le_bytes().into_iter().take(header.sample_bytes())),
            );
        }
        let mut output = Vec::new();
        let compensator = Compensator::new(&table, settings).unwrap();
        let totals = compensator.y4m(&input[..], &mut output, &Silent).unwrap();
        assert_eq!((totals.frames, totals.size), (2, size(64, 40)));
        let mut reader = y4m::Reader::new(&output[..]).unwrap();
        assert_eq!(reader.header().size(), size(64, 40));
        let (shown, mut frame) = (reader.header().clone(), y4m::YuvFrame::default());
        let mut given = y4m::Reader::new(&input[..]).unwrap();
        let mut wanted = y4m::YuvFrame::default();
        while reader.read_frame(&mut frame).unwrap() {
            assert!(given.read_frame(&mut wanted).unwrap());
            let made = frame.to_picture(&shown).unwrap();
            // By the way of pictures: pad the frame's colours, then compensate.
            let picture = wanted.to_picture(&header).unwrap();
            let placed = PlacedFrames::new(&table, size(64, 36), Some(Fit::Letterbox)).unwrap();
            let padded = placed.picture(picture).unwrap();
            let (expected, _) = compensator.frame(padded).unwrap();
            let again = y4m::YuvFrame::from_picture(&shown, &expected).unwrap();
            let expected = again.to_picture(&shown).unwrap();
            assert_eq!(made, expected, "{colour}");
        }
    }
}

#[test]
fn what_is_clipped_is_told_apart_by_its_end() {
    // Gain 2 on the left, and more ambient light than anything wanted on the right.
    let mut table = MadeUp::new(grid(1, 2), 1);
    table.gains.fill(2 << table.gain_fraction);
    table.ambient = Some(vec![0, 1 << 15]);
    table.tiers = Vec::new();
    for frame in [size(2, 1), size(8, 4)] {
        let white = Picture::from_fn(frame, |_, _| [255]);
        let (_, totals) = compensated(&table, settings(Encoding::Linear), &white).unwrap();
        // What is left of light that is all ambient is none, which is black and not below.
        assert!(totals.clipped_white > 0 && totals.clipped_white <= totals.clipped);
        assert_eq!(totals.clipped, totals.clipped_white, "{frame}");
        let black = Picture::from_fn(frame, |_, _| [0]);
        let (_, totals) = compensated(&table, settings(Encoding::Linear), &black).unwrap();
        assert_eq!(totals.clipped_white, 0, "{frame}");
    }
}

#[test]
fn bounces_onto_black_are_clipped_at_black() {
    let table = MadeUp::of_all_kinds(grid(4, 6), 1, 4, 3);
    for frame in [size(6, 4), size(48, 32)] {
        let half = Picture::from_fn(frame, |x, _| [if 2 * x < frame.width() { 255 } else { 0 }]);
        let (made, totals) = compensated(&table, settings(Encoding::Linear), &half).unwrap();
        let Samples::Eight(codes) = made.samples() else {
            panic!("a picture of bytes");
        };
        let ends = |code: u8| {
            codes
                .iter()
                .map(|sample| u64::from(*sample == code))
                .sum::<u64>()
        };
        let black = totals.clipped - totals.clipped_white;
        assert!(black > 0 && black <= ends(0), "{black} of {}", ends(0));
        assert!(totals.clipped_white <= ends(255));
    }
}

#[test]
fn bars_count_neither_as_clipped_nor_as_samples() {
    let mut table = MadeUp::of_all_kinds(grid(4, 6), 1, 4, 3);
    table.projector = ProjectorPixels::new(size(48, 32), 4);
    // Bars above and below, and beside; how many of their pixels are on the cells.
    for ((width, height), counted) in [((48, 20), 40 * 20), ((20, 32), 20 * 24)] {
        let frame = Picture::from_fn(size(width, height), |_, _| [255]);
        let (made, totals) = framed(&table, Some(Fit::Letterbox), &frame).unwrap();
        assert_eq!((totals.size, totals.samples), (size(48, 32), counted));
        let start = |all: usize, part: u16| (all - usize::from(part)) / 2;
        let (left, top) = (start(48, width).max(4), start(32, height).max(4));
        let shown = size(width.min(40), height.min(24));
        let Samples::Eight(codes) = cut(&made, left, top, shown).samples().clone() else {
            panic!("a picture of bytes");
        };
        assert!(codes.iter().all(|code| *code > 0), "clipped in the picture");
        assert_eq!(totals.clipped, totals.clipped_white);
        // As a part of the picture, bars are clipped at black.
        let placed = PlacedFrames::on(table.projector.unwrap(), frame.size(), Some(Fit::Letterbox));
        let padded = placed.unwrap().picture(frame).unwrap();
        let (same, totals) = framed(&table, None, &padded).unwrap();
        assert_eq!(same, made);
        assert!(totals.clipped > totals.clipped_white);
    }
}
