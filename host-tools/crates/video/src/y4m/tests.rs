use super::*;
use proptest::prelude::*;
use std::io::{ErrorKind, Read};

fn read_all(stream: &[u8]) -> Result<Vec<YuvFrame>, Y4mError> {
    let mut reader = Reader::new(stream)?;
    let mut frames = Vec::new();
    loop {
        let mut frame = YuvFrame::default();
        if !reader.read_frame(&mut frame)? {
            return Ok(frames);
        }
        frames.push(frame);
    }
}

fn error(stream: &[u8]) -> Y4mError {
    read_all(stream).expect_err("the stream is at fault")
}

#[test]
fn tags_say_how_frames_are_laid_out() {
    use ChromaSampling::{Chroma420, Chroma422, Chroma444, Mono};
    use CodeRange::{Full, Limited};
    for (line, sampling, range, bytes) in [
        ("W5 H3", Chroma420, Limited, 15 + 2 * 3 * 2),
        ("W5 H3 C420mpeg2", Chroma420, Limited, 27),
        (
            "W5 H3 C420paldv XCOLORRANGE=LIMITED",
            Chroma420,
            Limited,
            27,
        ),
        ("H3 W5 Ip C420jpeg XCOLORRANGE=FULL", Chroma420, Full, 27),
        ("W5 H3 I? C444 A1:1 F30000:1001", Chroma444, Limited, 45),
        ("W5 H3  Cmono Xsomething", Mono, Full, 15),
        ("W1 H1", Chroma420, Limited, 3),
        ("W5 H3 C422", Chroma422, Limited, 15 + 2 * 3 * 3),
        ("W5 H3 C420p10", Chroma420, Limited, 2 * 27),
        ("W5 H3 C422p10", Chroma422, Limited, 2 * 33),
        ("W5 H3 C444p12", Chroma444, Limited, 2 * 45),
        ("W5 H3 Cmono12", Mono, Full, 2 * 15),
    ] {
        let line = &format!("YUV4MPEG2 {line}");
        let header = Header::parse(line.as_bytes()).expect(line);
        assert_eq!(
            (header.sampling(), header.range()),
            (sampling, range),
            "{line}"
        );
        assert_eq!(header.frame_bytes(), bytes, "{line}");
    }
}

#[test]
fn a_header_of_ours_reads_as_what_it_was_made_for() {
    let size = iltm_runtime::FrameSize::new(640, 361).expect("not empty");
    for sampling in [
        ChromaSampling::Mono,
        ChromaSampling::Chroma420,
        ChromaSampling::Chroma422,
        ChromaSampling::Chroma444,
    ] {
        for range in [CodeRange::Limited, CodeRange::Full] {
            let header = Header::new(size, (30_000, 1001), sampling, range);
            assert_eq!(Header::parse(header.line()).expect("our own"), header);
        }
    }
}

#[test]
fn frames_come_back_byte_for_byte_with_their_parameters() {
    let stream = b"YUV4MPEG2 W2 H1 F25:1 Ip A1:1 C444 Xa comment\nFRAME\nabcdefFRAME Xb=1\nghijkl";
    let mut reader = Reader::new(&stream[..]).unwrap();
    let mut writer = Writer::new(Vec::new(), reader.header()).unwrap();
    let mut frame = YuvFrame::default();
    while reader.read_frame(&mut frame).unwrap() {
        writer.write_frame(&frame).unwrap();
    }
    assert_eq!(writer.finish().unwrap(), stream);
}

#[test]
fn what_is_no_stream_header_is_named() {
    assert!(matches!(error(b""), Y4mError::NotY4m));
    assert!(matches!(error(b"RIFF...."), Y4mError::NotY4m));
    assert!(matches!(error(b"YUV4MPEG3 W1 H1\n"), Y4mError::NotY4m));
    assert!(matches!(error(b"YUV4MPEG2W1 H1\n"), Y4mError::NotY4m));
    assert!(matches!(
        error(b"YUV4MPEG2 W1 H1"),
        Y4mError::Truncated { given: 15, .. }
    ));
    let endless = [b"YUV4MPEG2 W1 H1 X".as_slice(), &[b'a'; 1 << 13]].concat();
    assert!(matches!(
        error(&endless),
        Y4mError::LongLine { limit: 4096, .. }
    ));
}

#[test]
fn tags_that_mean_nothing_are_named_with_their_place() {
    for (line, tag, place) in [
        ("YUV4MPEG2 W0 H1\n", "W0", 10),
        ("YUV4MPEG2 W1 H\n", "H", 13),
        ("YUV4MPEG2 W1 H-1\n", "H-1", 13),
        ("YUV4MPEG2 W1x H1\n", "W1x", 10),
        ("YUV4MPEG2 W1 H1 W2\n", "W2", 16),
        ("YUV4MPEG2 W1 H1 C444 C420\n", "C420", 21),
        ("YUV4MPEG2 W1 H1 Iz\n", "Iz", 16),
        ("YUV4MPEG2 W1 H1 XCOLORRANGE=SOME\n", "XCOLORRANGE=SOME", 16),
    ] {
        match error(line.as_bytes()) {
            Y4mError::Tag {
                tag: found, offset, ..
            } => assert_eq!((&*found, offset), (tag, place)),
            other => panic!("{line}: {other}"),
        }
    }
    assert!(matches!(
        error(b"YUV4MPEG2 W1\n"),
        Y4mError::NoSize { tag: 'H' }
    ));
    assert!(matches!(
        error(b"YUV4MPEG2\n"),
        Y4mError::NoSize { tag: 'W' }
    ));
    for colour in ["420p14", "422p16", "411", "444alpha", "mono16", ""] {
        let line = format!("YUV4MPEG2 W1 H1 C{colour}\n");
        let error = error(line.as_bytes());
        assert!(
            matches!(error, Y4mError::Colour { offset: 16, .. }),
            "{error}"
        );
        assert!(error.to_string().contains("420jpeg"));
    }
    for fields in ["It", "Ib", "Im"] {
        let line = format!("YUV4MPEG2 W1 H1 {fields}\n");
        assert!(matches!(
            error(line.as_bytes()),
            Y4mError::Interlaced { offset: 16, .. }
        ));
    }
}

#[test]
fn frames_that_no_memory_could_hold_are_refused_by_their_header() {
    for size in [
        "W65536 H1",
        "W1 H65536",
        "W65535 H65535",
        "W8193 H8192",
        "W18446744073709551616 H18446744073709551616",
        "W99999999999999999999999999999999 H1",
    ] {
        let line = format!("YUV4MPEG2 {size}\n");
        assert!(
            matches!(error(line.as_bytes()), Y4mError::TooLarge { .. }),
            "{size}"
        );
    }
}

#[test]
fn a_stream_that_ends_within_a_frame_says_which_and_where() {
    let whole = b"YUV4MPEG2 W2 H1 C444\nFRAME\nabcdefFRAME\nghijkl";
    assert_eq!(read_all(whole).unwrap().len(), 2);
    for end in 22..whole.len() {
        let frames_end = 21 + 12;
        match read_all(&whole[..end]) {
            Ok(frames) => assert_eq!((end, frames.len()), (frames_end, 1)),
            Err(Y4mError::Truncated { place, offset, .. }) => {
                assert_eq!(
                    place,
                    if end < frames_end {
                        "frame 1"
                    } else {
                        "frame 2"
                    }
                );
                assert_eq!(offset, end as u64);
            }
            Err(other) => panic!("{end}: {other}"),
        }
    }
}

#[test]
fn what_stands_in_the_place_of_a_frame_is_named() {
    // The header says 444, the frames are 420: the second does not begin where it
    // should.
    let lying = b"YUV4MPEG2 W2 H2 C444\nFRAME\nabcdefFRAME\nabcdefFRAME\nabcdef";
    assert!(matches!(
        error(lying),
        Y4mError::NotAFrame {
            frame: 2,
            offset: 39
        }
    ));
    for other in ["FRAMEX\nabc", "frame\nabc", "\nabc"] {
        let stream = format!("YUV4MPEG2 W1 H1 C444\n{other}");
        assert!(matches!(
            error(stream.as_bytes()),
            Y4mError::NotAFrame {
                frame: 1,
                offset: 21
            }
        ));
    }
    let endless = [b"YUV4MPEG2 W1 H1\nFRAME ".as_slice(), &[b'a'; 1 << 13]].concat();
    assert!(matches!(
        error(&endless),
        Y4mError::LongLine { offset: 16, .. }
    ));
}

/// Gives one byte at a time and is interrupted before each.
struct Slow<'s>(&'s [u8], bool);

impl Read for Slow<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.1 = !self.1;
        if self.1 {
            return Err(ErrorKind::Interrupted.into());
        }
        let count = buffer.len().min(1);
        self.0.read(&mut buffer[..count])
    }
}

#[test]
fn a_pipe_that_gives_single_bytes_gives_whole_frames() {
    let stream = b"YUV4MPEG2 W2 H1 C444\nFRAME\nabcdefFRAME\nghijkl";
    let mut reader = Reader::new(Slow(stream, false)).unwrap();
    let mut frame = YuvFrame::default();
    assert!(reader.read_frame(&mut frame).unwrap());
    assert!(reader.read_frame(&mut frame).unwrap());
    assert_eq!(frame.samples, b"ghijkl");
    assert!(!reader.read_frame(&mut frame).unwrap());
}

#[test]
fn an_output_that_is_full_says_at_which_frame() {
    let header = Header::parse(b"YUV4MPEG2 W2 H1 C444").unwrap();
    assert!(matches!(
        Writer::new(&mut [0; 5][..], &header),
        Err(Y4mError::Write { frame: 0, .. })
    ));
    let mut room = [0; 40];
    let mut writer = Writer::new(&mut room[..], &header).unwrap();
    let frame = YuvFrame {
        samples: vec![0; 6],
        ..YuvFrame::default()
    };
    writer.write_frame(&frame).unwrap();
    assert!(matches!(
        writer.write_frame(&frame),
        Err(Y4mError::Write { frame: 2, .. })
    ));
}

proptest! {
    #[test]
    fn random_bytes_give_frames_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = read_all(&bytes);
        let _ = read_all(&[b"YUV4MPEG2 ".as_slice(), &bytes].concat());
        let _ = read_all(&[b"YUV4MPEG2 W3 H2\n".as_slice(), &bytes].concat());
        let _ = read_all(&[b"YUV4MPEG2 W3 H2\nFRAME".as_slice(), &bytes].concat());
    }

    #[test]
    fn random_tags_give_a_header_or_an_error(
        tags in prop::collection::vec("[WHFIACX][0-9a-zA-Z=:]{0,12}", 0..6),
    ) {
        let line = format!("YUV4MPEG2 {}\n", tags.join(" "));
        let _ = Reader::new(line.as_bytes());
    }
}
