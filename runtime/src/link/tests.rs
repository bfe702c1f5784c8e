//! Frames: there and back, and through harm.

use super::*;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

/// A frame that outlives the decoder's buffer.
type Owned = (Channel, u16, Vec<u8>);

fn encoded(channel: Channel, sequence: u16, payload: &[u8]) -> Vec<u8> {
    let mut bytes = [0; MAX_ENCODED];
    let frame = LinkFrame {
        channel,
        sequence,
        payload,
    };
    let length = frame.emit(&mut bytes).expect("the payload is not too long");
    bytes[..length].to_vec()
}

fn decoded(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Result<Owned, LinkFrameError>> {
    let mut frames = Vec::new();
    for byte in bytes {
        if let Some(frame) = decoder.push(*byte) {
            frames.push(frame.map(|it| (it.channel, it.sequence, it.payload.to_vec())));
        }
    }
    frames
}

fn channel() -> impl Strategy<Value = Channel> {
    prop_oneof![
        Just(Channel::Request),
        Just(Channel::Response),
        Just(Channel::Event),
        Just(Channel::Log),
    ]
}

/// Payloads of every length, of zeros and of bytes without a zero too: what COBS
/// treats differently.
fn payload() -> impl Strategy<Value = Vec<u8>> {
    let length = 0..=MAX_PAYLOAD;
    prop_oneof![
        prop::collection::vec(any::<u8>(), length.clone()),
        prop::collection::vec(1..=u8::MAX, length.clone()),
        length.prop_map(|length| vec![0; length]),
    ]
}

proptest! {
    #[test]
    fn a_frame_arrives_as_it_was_sent(
        channel in channel(), sequence: u16, payload in payload(), noise in prop::collection::vec(1..=u8::MAX, 0..40)
    ) {
        let frame = encoded(channel, sequence, &payload);
        prop_assert!(frame.len() <= MAX_ENCODED);
        prop_assert_eq!(frame.iter().position(|byte| *byte == DELIMITER), Some(frame.len() - 1));
        let mut decoder = Decoder::new();
        // Whatever the line carried before: the frame after a delimiter is safe.
        decoded(&mut decoder, &noise);
        decoded(&mut decoder, &[DELIMITER]);
        prop_assert_eq!(decoded(&mut decoder, &frame), [Ok((channel, sequence, payload))]);
    }

    #[test]
    fn a_frame_with_a_changed_byte_is_refused_and_the_next_one_taken(
        payload in payload(), at: prop::sample::Index, change in 1..=u8::MAX
    ) {
        let frame = encoded(Channel::Request, 7, &payload);
        let mut changed = frame.clone();
        // The delimiter is left alone: without it there is no frame at all.
        changed[at.index(frame.len() - 1)] ^= change;
        let mut decoder = Decoder::new();
        let mut got = decoded(&mut decoder, &changed);
        got.extend(decoded(&mut decoder, &frame));
        prop_assert_eq!(got.pop(), Some(Ok((Channel::Request, 7, payload))));
        prop_assert!(got.iter().all(Result::is_err));
        prop_assert_eq!(decoder.bad() as usize, got.len());
        prop_assert!(!got.is_empty());
    }

    #[test]
    fn a_cut_frame_is_refused_and_the_next_one_taken(payload in payload(), at: prop::sample::Index) {
        let frame = encoded(Channel::Log, 7, &payload);
        let mut cut = frame[..at.index(frame.len() - 1)].to_vec();
        cut.push(DELIMITER);
        cut.extend(&frame);
        let got = decoded(&mut Decoder::new(), &cut);
        prop_assert_eq!(got.last(), Some(&Ok((Channel::Log, 7, payload))));
        prop_assert!(got[..got.len() - 1].iter().all(Result::is_err));
    }
}

#[test]
fn a_frame_without_an_end_is_too_long_and_costs_nothing_after_it() {
    let mut decoder = Decoder::new();
    assert!(decoded(&mut decoder, &vec![1; 100_000]).is_empty());
    assert_eq!(
        decoded(&mut decoder, &[DELIMITER]),
        [Err(LinkFrameError::TooLong)]
    );
    let frame = encoded(Channel::Event, 1, b"next");
    let next = Ok((Channel::Event, 1, b"next".to_vec()));
    assert_eq!(decoded(&mut decoder, &frame), [next]);
    assert_eq!(decoder.bad(), 1);
}

#[test]
fn delimiters_alone_are_neither_frames_nor_errors() {
    let mut decoder = Decoder::new();
    assert!(decoded(&mut decoder, &[DELIMITER; 100]).is_empty());
    assert_eq!(decoder.bad(), 0);
}

#[test]
fn every_kind_of_bad_frame_says_what_it_is() {
    let cobs = |content: &[u8]| {
        let mut out = vec![0; content.len() + 10];
        let length = cobs::encode(content, &mut out);
        out.truncate(length);
        out.push(DELIMITER);
        decoded(&mut Decoder::new(), &out)
    };
    let with_crc = |content: &[u8]| {
        let crc = crate::image::crc32(&[content]).to_le_bytes();
        cobs(&[content, &crc].concat())
    };
    assert_eq!(cobs(b"123456"), [Err(LinkFrameError::TooShort)]);
    assert_eq!(cobs(b"1234567"), [Err(LinkFrameError::Checksum)]);
    assert_eq!(
        with_crc(&[4, 0, 0]),
        [Err(LinkFrameError::Channel { number: 4 })]
    );
    assert_eq!(
        with_crc(&[0; 3 + MAX_PAYLOAD + 1]),
        [Err(LinkFrameError::TooLong)]
    );
    // Cut short, but too long already.
    let mut block = vec![u8::MAX];
    block.resize(255, 1);
    let long = [&block.repeat(MAX_FRAME / 254 + 1)[..], &[5, 1, DELIMITER]].concat();
    assert_eq!(
        decoded(&mut Decoder::new(), &long),
        [Err(LinkFrameError::TooLong)]
    );
    assert_eq!(
        decoded(&mut Decoder::new(), &[5, 1, DELIMITER]),
        [Err(LinkFrameError::Cobs)]
    );
}

#[test]
fn a_payload_that_is_too_long_is_not_sent() {
    let long = [0; MAX_PAYLOAD + 1];
    let frame = |payload| LinkFrame {
        channel: Channel::Log,
        sequence: 0,
        payload,
    };
    let mut out = [0; 2 * MAX_ENCODED];
    assert_eq!(frame(&long).emit(&mut out), None);
    assert_eq!(frame(b"abc").emit(&mut [0; 11]), None);
    // 3 bytes of payload, 7 around them, 1 of COBS, 1 delimiter.
    assert_eq!(frame(b"abc").emit(&mut [0; 12]), Some(12));
}

proptest! {
    #[test]
    fn an_outbox_keeps_frames_whole_and_in_order(
        steps in prop::collection::vec((0..200_usize, 0..300_usize), 1..100)
    ) {
        let mut outbox = Outbox::<400>::new();
        let (mut expected, mut line) = (Vec::new(), Vec::new());
        let mut refused = 0;
        for (number, (length, sent)) in steps.into_iter().enumerate() {
            let payload = vec![number as u8; length];
            let frame = encoded(Channel::Log, number as u16, &payload);
            let frame_value = LinkFrame { channel: Channel::Log, sequence: number as u16, payload: &payload };
            if outbox.push(frame_value) {
                expected.extend(frame);
            } else {
                refused += 1;
                prop_assert!(expected.len() - line.len() + frame.len() > 400);
            }
            prop_assert_eq!(outbox.refused(), refused);
            let sent = sent.min(outbox.pending().len());
            line.extend_from_slice(&outbox.pending()[..sent]);
            outbox.sent(sent);
        }
        while !outbox.pending().is_empty() {
            line.extend_from_slice(outbox.pending());
            outbox.sent(usize::MAX);
        }
        prop_assert_eq!(line, expected);
    }
}
