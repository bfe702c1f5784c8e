//! Video from end to end.

use super::*;
use crate::test_scene::TestScene;
use crate::y4m::{Header, Reader, Y4mError, YuvFrame};
use iltm_picture::progress::Progress;
use proptest::prelude::*;
use std::io::{Read, Write};
use std::sync::atomic::{AtomicU64, Ordering};

/// A stream of frames of random bytes between two codes.
fn stream(line: &str, frames: usize, codes: std::ops::RangeInclusive<u8>) -> Vec<u8> {
    let header = Header::parse(line.as_bytes()).expect("a header");
    let mut random = fastrand::Rng::with_seed(11);
    let mut stream = format!("{line}\n").into_bytes();
    for _ in 0..frames {
        stream.extend(b"FRAME Xkept\n");
        stream.extend((0..header.frame_bytes()).map(|_| random.u8(codes.clone())));
    }
    stream
}

/// The stream through a table.
fn video(
    table: &MadeUp,
    settings: CompensateOptions,
    input: &[u8],
) -> Result<(Vec<u8>, FrameTotals), VideoError> {
    let image = table.image();
    let table = Table::check(&image).expect("a sample table is whole");
    let mut output = Vec::new();
    let summary =
        Compensator::new(&table, settings)?.y4m(input, &mut output, &Counter::default())?;
    Ok((output, summary))
}

/// Counts frames.
#[derive(Default)]
struct Counter(AtomicU64);

impl Progress for Counter {
    fn begin(&self, _what: &str, _total: u64) {}
    fn advance(&self, parts: u64) {
        self.0.fetch_add(parts, Ordering::Relaxed);
    }
    fn end(&self) {}
}

#[test]
fn headers_and_frame_parameters_are_kept_byte_for_byte() {
    let table = MadeUp::new(grid(2, 2), 1);
    for line in [
        "YUV4MPEG2 W6 H4 F30000:1001 Ip A128:117 C420mpeg2 XYSCSS=420MPEG2 XCOLORRANGE=FULL",
        "YUV4MPEG2 H5 W7",
        "YUV4MPEG2 W5 H3 C444 Xa  Xb",
        "YUV4MPEG2 W5 H3 Cmono",
        "YUV4MPEG2 W5 H3 C422",
        "YUV4MPEG2 W5 H3 C420p10 XYSCSS=420P10",
        "YUV4MPEG2 W5 H3 C422p10",
        "YUV4MPEG2 W5 H3 C444p12",
        "YUV4MPEG2 W5 H3 Cmono10",
    ] {
        let input = stream(line, 3, 0..=255);
        let (output, summary) = video(&table, CompensateOptions::default(), &input).unwrap();
        assert_eq!(output.len(), input.len(), "{line}");
        assert!(
            output.starts_with(format!("{line}\nFRAME Xkept\n").as_bytes()),
            "{line}"
        );
        assert_eq!(summary.frames, 3);
    }
}

#[test]
fn mono_video_that_is_not_changed_comes_back_exactly() {
    let table = MadeUp::new(grid(2, 2), 1);
    for (line, codes) in [
        ("YUV4MPEG2 W7 H5 Cmono", 0..=255),
        ("YUV4MPEG2 W2 H2 Cmono", 0..=255),
        ("YUV4MPEG2 W7 H5 Cmono XCOLORRANGE=LIMITED", 16..=235),
    ] {
        let input = stream(line, 2, codes);
        let (output, _) = video(&table, settings(Encoding::Linear), &input).unwrap();
        assert_eq!(output, input, "{line}");
    }
    for (bits, codes) in [(10, 0..=1023_u16), (12, 0..=4095)] {
        let mut input = format!("YUV4MPEG2 W64 H64 Cmono{bits}\nFRAME\n").into_bytes();
        input.extend(codes.cycle().take(64 * 64).flat_map(u16::to_le_bytes));
        let (output, _) = video(&table, settings(Encoding::Linear), &input).unwrap();
        assert_eq!(output, input, "{bits} bits");
    }
}

/// Frames of the test scene.
fn scene_stream(line: &str, frames: usize) -> Vec<u8> {
    let header = Header::parse(line.as_bytes()).expect("a header");
    let scene = TestScene::new(header.size(), 25.0);
    let mut stream = format!("{line}\n").into_bytes();
    for number in 0..frames {
        stream.extend(b"FRAME\n");
        let mut picture = scene.frame(number as u64);
        if let (Samples::Eight(samples), true) = (picture.samples(), header.bits() > 8) {
            let wide = samples.iter().map(|code| u16::from(*code) * 257).collect();
            picture = Picture::new(header.size(), Samples::Sixteen(wide)).expect("as many");
        }
        let frame = YuvFrame::from_picture(&header, &picture);
        stream.extend(frame.expect("a frame of the stream's size").samples);
    }
    stream
}

/// The samples of the last frame of a stream.
fn codes(header: &Header, stream: &[u8]) -> Vec<u16> {
    let bytes = &stream[stream.len() - header.frame_bytes()..];
    match header.sample_bytes() {
        1 => bytes.iter().copied().map(u16::from).collect(),
        _ => bytes
            .as_chunks()
            .0
            .iter()
            .copied()
            .map(u16::from_le_bytes)
            .collect(),
    }
}

#[test]
fn video_that_is_not_changed_comes_back_as_good_as_it_was() {
    let table = MadeUp::new(grid(9, 16), 3);
    for colour in [
        "420jpeg", "420mpeg2", "422", "444", "420p10", "422p10", "444p10", "422p12",
    ] {
        for range in ["LIMITED", "FULL"] {
            for (width, height) in [(320, 180), (321, 181), (1024, 578)] {
                let line = format!("YUV4MPEG2 W{width} H{height} C{colour} XCOLORRANGE={range}");
                let input = scene_stream(&line, 1);
                let (output, _) = video(&table, settings(Encoding::Linear), &input).unwrap();
                let header = Header::parse(line.as_bytes()).unwrap();
                let [before, after] = [&input, &output].map(|stream| codes(&header, stream));
                let count = before.len() as f64;
                let differences = before.iter().zip(&after).map(|(a, b)| a.abs_diff(*b));
                let squares = differences.clone().map(|d| f64::from(d).powi(2));
                let mean_square = squares.sum::<f64>() / count;
                let white = f64::from((1_u32 << header.bits()) - 1);
                let psnr = 10.0 * (white.powi(2) / mean_square).log10();
                let within = differences.clone().filter(|d| *d <= 1).count() as f64;
                let share = within / count;
                println!(
                    "{line}: {psnr:.1} dB, {share:.5} within a code, worst {:?}",
                    differences.max()
                );
                // Chroma that four pixels share can be more than one of them, which is
                // darker or brighter, can have: those are cut.
                // A code of 10 bits is a quarter of one of 8.
                let enough = match header.bits() {
                    _ if colour.starts_with("444") => 1.0,
                    8 => 0.995,
                    _ => 0.994,
                };
                assert!(
                    share >= enough && psnr >= 48.0,
                    "{line}: {psnr:.1} dB, {share}"
                );
            }
        }
    }
}

#[test]
fn subsampled_colours_that_rgb_has_come_back_within_a_code() {
    // Chroma within 18 of grey and luma within 40 of the middle is inside RGB for
    // either standard, whatever their combination.
    let table = MadeUp::new(grid(9, 16), 3);
    for (line, luma) in [
        ("YUV4MPEG2 W64 H36 C420", 64 * 36),
        ("YUV4MPEG2 W65 H37 C420 XCOLORRANGE=FULL", 65 * 37),
        ("YUV4MPEG2 W33 H601 C420", 33 * 601),
    ] {
        let mut input = stream(line, 1, 110..=146);
        let start = input.len() - Header::parse(line.as_bytes()).unwrap().frame_bytes();
        let mut random = fastrand::Rng::with_seed(1);
        input[start..start + luma].fill_with(|| random.u8(86..=166));
        let (output, summary) = video(&table, settings(Encoding::Linear), &input).unwrap();
        let worst = input.iter().zip(&output).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(1), "{line}: {worst:?}");
        assert_eq!(summary.clipped, 0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn streams_come_out_alike_for_any_number_of_threads(
        (width, height) in (21_u16..70, 13_u16..70),
        (table_channels, colour) in prop::sample::select(vec![
            (1, "mono"), (1, "420"), (3, "420jpeg"), (3, "422"), (3, "444"),
            (1, "mono10"), (3, "420p10"), (3, "422p10"), (3, "444p12"),
        ]),
    ) {
        let table = MadeUp::of_all_kinds(grid(13, 21), table_channels, 5, 3);
        let input = stream(&format!("YUV4MPEG2 W{width} H{height} C{colour}"), 3, 0..=255);
        let by = |threads| {
            let settings = CompensateOptions { threads, ..CompensateOptions::default() };
            video(&table, settings, &input).unwrap()
        };
        let one = by(1);
        for threads in [2, 5] {
            prop_assert_eq!(&by(threads), &one);
        }
    }

    #[test]
    fn damaged_streams_give_an_error_or_frames(
        place in 0_usize..220,
        byte: u8,
        cut in 0_usize..260,
    ) {
        let table = MadeUp::new(grid(2, 2), 3);
        for line in ["YUV4MPEG2 W6 H4 C444", "YUV4MPEG2 W6 H4 C422p10"] {
            let mut input = stream(line, 3, 0..=255);
            input[place] = byte;
            input.truncate(input.len() - cut);
            let _ = video(&table, CompensateOptions::default(), &input);
        }
    }
}

#[test]
fn frames_before_a_fault_have_been_written_and_the_fault_is_named() {
    let table = MadeUp::new(grid(2, 2), 3);
    let image = table.image();
    let table = Table::check(&image).unwrap();
    let compensator = Compensator::new(&table, CompensateOptions::default()).unwrap();
    let whole = stream("YUV4MPEG2 W6 H4 C444", 3, 0..=255);
    let mut output = Vec::new();
    let counter = Counter::default();
    let error = compensator
        .y4m(&whole[..whole.len() - 1], &mut output, &counter)
        .unwrap_err();
    assert!(matches!(error, VideoError::Y4m(Y4mError::Truncated { .. })));
    assert!(error.to_string().contains("frame 3"));
    assert_eq!(counter.0.load(Ordering::Relaxed), 2);
    let mut reader = Reader::new(&output[..]).unwrap();
    let mut frame = YuvFrame::default();
    assert!(reader.read_frame(&mut frame).unwrap());
    assert!(reader.read_frame(&mut frame).unwrap());
    assert!(!reader.read_frame(&mut frame).unwrap());
}

/// Frames without end.
struct Endless(Vec<u8>, usize);

impl Read for Endless {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        // The header is read once, the frame over and over.
        if self.1 == self.0.len() {
            self.1 = self.0.iter().position(|byte| *byte == b'\n').unwrap_or(0) + 1;
        }
        let count = (&self.0[self.1..]).read(buffer)?;
        self.1 += count;
        Ok(count)
    }
}

#[test]
fn a_reader_that_goes_away_ends_an_endless_stream() {
    let table = MadeUp::new(grid(2, 2), 3);
    let image = table.image();
    let table = Table::check(&image).unwrap();
    let compensator = Compensator::new(&table, CompensateOptions::default()).unwrap();
    let input = Endless(stream("YUV4MPEG2 W6 H4 C444", 1, 0..=255), 0);
    let error = compensator
        .y4m(input, &mut [0; 1000][..], &Counter::default())
        .unwrap_err();
    assert!(matches!(error, VideoError::Y4m(Y4mError::Write { .. })));
}

#[test]
fn a_stream_without_frames_is_refused_as_what_wrote_it_has_failed() {
    let table = MadeUp::new(grid(2, 2), 3);
    let error = video(&table, CompensateOptions::default(), b"YUV4MPEG2 W6 H4\n").unwrap_err();
    assert!(matches!(error, VideoError::NoFrames), "{error}");
}

/// A player that is closed after so many bytes.
struct Closed(usize);

impl Write for Closed {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 = self
            .0
            .checked_sub(bytes.len())
            .ok_or(std::io::ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_player_that_is_closed_is_no_failure_and_the_lost_frames_are_told() {
    let table = MadeUp::new(grid(2, 2), 3).image();
    let table = Table::check(&table).unwrap();
    let compensator = Compensator::new(&table, CompensateOptions::default()).unwrap();
    for (bytes, cut_short) in [(1_000, true), (0, true), (1_000_000, false)] {
        let input = stream("YUV4MPEG2 W6 H4 C444", 30, 0..=255);
        let totals = compensator.y4m(&input[..], Closed(bytes), &Counter::default());
        assert_eq!(totals.unwrap().cut_short, cut_short, "{bytes}");
    }
}

#[test]
fn mono_video_is_refused_by_a_table_of_three_channels() {
    let table = MadeUp::new(grid(2, 2), 3);
    let input = stream("YUV4MPEG2 W6 H4 Cmono", 1, 0..=255);
    let error = video(&table, CompensateOptions::default(), &input).unwrap_err();
    assert!(matches!(error, VideoError::GreyFrame));
}

#[test]
fn files_are_replaced_whole_or_left_alone() {
    let table = MadeUp::new(grid(2, 2), 3);
    let image = table.image();
    let table = Table::check(&image).unwrap();
    let compensator = Compensator::new(&table, CompensateOptions::default()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.y4m"), folder.path().join("out.y4m"));
    let whole = stream("YUV4MPEG2 W6 H4 C444", 3, 0..=255);
    std::fs::write(&input, &whole[..whole.len() - 1]).unwrap();
    std::fs::write(&output, "old").unwrap();
    assert!(
        compensator
            .file(&input, &output, &Counter::default())
            .is_err()
    );
    assert_eq!(std::fs::read(&output).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    std::fs::write(&input, &whole).unwrap();
    compensator
        .file(&input, &output, &Counter::default())
        .unwrap();
    assert_eq!(std::fs::read(&output).unwrap().len(), whole.len());
    let error = compensator
        .file(
            &folder.path().join("none.y4m"),
            &output,
            &Counter::default(),
        )
        .unwrap_err();
    assert!(error.to_string().contains("none.y4m"));
}
