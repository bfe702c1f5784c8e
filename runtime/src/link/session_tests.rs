//! Sessions against a host of the test's own.

use super::test_device::{FullDevice, identity};
use super::*;
use proptest::prelude::*;
use std::vec::Vec;

/// What a session said, by channel and sequence number.
#[derive(PartialEq, Debug)]
enum Said {
    Response(u16, Response),
    Event(u16, Event),
    Log(u16, Vec<u8>),
}

struct Conversation {
    session: Session,
    now: u64,
}

impl Conversation {
    fn new() -> Self {
        let session = Session::new();
        Self { session, now: 0 }
    }

    /// Everything that waits for the line.
    fn said(&mut self) -> Vec<Said> {
        let (mut decoder, mut said) = (Decoder::new(), Vec::new());
        while !self.session.pending().is_empty() {
            let bytes = self.session.pending().to_vec();
            self.session.sent(bytes.len());
            for byte in bytes {
                let Some(frame) = decoder.push(byte) else {
                    continue;
                };
                let frame = frame.expect("a device sends whole frames");
                said.push(match frame.channel {
                    Channel::Request => panic!("devices do not ask"),
                    Channel::Response => {
                        let response = postcard::from_bytes(frame.payload);
                        Said::Response(frame.sequence, response.expect("a response"))
                    }
                    Channel::Event => {
                        let event = postcard::from_bytes(frame.payload);
                        Said::Event(frame.sequence, event.expect("an event"))
                    }
                    Channel::Log => Said::Log(frame.sequence, frame.payload.to_vec()),
                });
            }
        }
        said
    }

    fn frame(&mut self, channel: Channel, sequence: u16, payload: &[u8]) -> Vec<Said> {
        let mut bytes = [0; MAX_ENCODED];
        let frame = LinkFrame {
            channel,
            sequence,
            payload,
        };
        let length = frame.emit(&mut bytes).expect("short enough");
        self.session
            .receive(&bytes[..length], self.now, &mut FullDevice);
        self.said()
    }

    fn ask(&mut self, sequence: u16, request: Request<'_>) -> Vec<Said> {
        let mut bytes = [0; MAX_PAYLOAD];
        let payload = postcard::to_slice(&request, &mut bytes).expect("short enough");
        let payload = payload.to_vec();
        self.frame(Channel::Request, sequence, &payload)
    }

    fn greet(&mut self) {
        let answer = self.ask(0, HELLO);
        assert_eq!(answer, [Said::Response(0, Response::Hello(identity()))]);
    }

    /// Time goes on; the firmware polls every 10 ms.
    fn wait(&mut self, ms: u64) -> Vec<Said> {
        let mut said = Vec::new();
        for _ in 0..ms / 10 {
            self.now += 10;
            self.session.poll(self.now, &FullDevice);
            said.extend(self.said());
        }
        said
    }
}

const HELLO: Request<'_> = Request::Hello {
    protocol: PROTOCOL_VERSION,
};

const CHANGED: Event = Event::TierChanged {
    from: 3,
    to: 2,
    reason: TierReason::OverBudget,
    frame: 77,
};

fn refused(sequence: u16, refusal: Refusal) -> Vec<Said> {
    Vec::from([Said::Response(sequence, Response::Refused(refusal))])
}

#[test]
fn the_longest_messages_fit_a_frame() {
    let mut bytes = [0; MAX_PAYLOAD];
    let status = postcard::to_slice(&FullDevice.status(), &mut bytes).expect("it fits");
    // The board's name 33 bytes; 20 numbers of 32 bits 5 each, 3 of 64 bits 10
    // each, 5 of 16 bits 3 each; 12 variants and numbers of a byte.
    assert_eq!(status.len(), 190);
    let hello = postcard::to_slice(&identity(), &mut bytes).expect("it fits");
    assert_eq!(hello.len(), 76);
}

#[test]
fn a_device_says_nothing_unless_spoken_to() {
    let mut host = Conversation::new();
    host.session.event(&CHANGED);
    host.session.log(b"log");
    assert_eq!(host.wait(60_000), []);
    // A hello is answered and no more.
    host.greet();
    host.session.event(&CHANGED);
    host.session.log(b"log");
    assert_eq!(host.wait(60_000), []);
}

#[test]
fn whoever_does_not_say_hello_is_told_to() {
    let mut host = Conversation::new();
    assert_eq!(
        host.ask(9, Request::Status),
        refused(9, Refusal::HelloFirst)
    );
    let subscribe = Request::Subscribe { period_ms: 500 };
    assert_eq!(host.ask(10, subscribe), refused(10, Refusal::HelloFirst));
    assert!(!host.session.is_subscribed());
}

#[test]
fn a_status_is_answered_with_the_same_number_as_often_as_asked() {
    let mut host = Conversation::new();
    host.greet();
    for _ in 0..3 {
        let answer = host.ask(0xABCD, Request::Status);
        let status = Response::Status(Status {
            serial: SerialCounts::default(),
            ..FullDevice.status()
        });
        assert_eq!(answer, [Said::Response(0xABCD, status)]);
    }
}

#[test]
fn requests_of_a_later_version_are_refused_as_unknown() {
    let mut host = Conversation::new();
    host.greet();
    for kind in 11..=u8::MAX {
        let answer = host.frame(Channel::Request, 5, &[kind, 1, 2, 3]);
        assert_eq!(answer, refused(5, Refusal::Unknown));
    }
}

#[test]
fn requests_with_too_few_or_too_many_bytes_are_refused_as_malformed() {
    let mut host = Conversation::new();
    host.greet();
    // Nothing; a hello without its version; a status with a byte too many; a
    // period beyond 16 bits.
    for payload in [&[][..], &[0], &[1, 0], &[2, 0xFF, 0xFF, 0x7F]] {
        let answer = host.frame(Channel::Request, 5, payload);
        assert_eq!(answer, refused(5, Refusal::Malformed), "{payload:?}");
    }
}

#[test]
fn frames_on_the_devices_own_channels_are_left_alone() {
    let mut host = Conversation::new();
    for channel in [Channel::Response, Channel::Event, Channel::Log] {
        assert_eq!(host.frame(channel, 1, &[0, 1]), []);
    }
}

fn statuses(said: &[Said]) -> usize {
    let status = |it: &&Said| matches!(it, Said::Event(_, Event::Status(_)));
    said.iter().filter(status).count()
}

#[test]
fn a_subscriber_gets_statuses_events_and_logs_numbered_without_gaps() {
    let mut host = Conversation::new();
    host.greet();
    let answer = host.ask(1, Request::Subscribe { period_ms: 500 });
    let agreed = Response::Subscribed {
        period_ms: 500,
        lapse_ms: LAPSE_MS,
    };
    assert_eq!(answer, [Said::Response(1, agreed)]);
    let said = host.wait(2_000);
    assert_eq!((said.len(), statuses(&said)), (4, 4));
    host.session.event(&CHANGED);
    host.session.log(b"first");
    host.session.log(b"second");
    let said = host.said();
    let expected = [
        Said::Event(4, CHANGED),
        Said::Log(0, b"first".to_vec()),
        Said::Log(1, b"second".to_vec()),
    ];
    assert_eq!(said, expected);
}

#[test]
fn a_subscription_ends_when_the_host_says_so_or_says_nothing() {
    let mut host = Conversation::new();
    host.greet();
    host.ask(1, Request::Subscribe { period_ms: 1_000 });
    assert_eq!(statuses(&host.wait(60_000)), 5, "5 s of silence are enough");
    assert!(!host.session.is_subscribed());

    host.ask(2, Request::Subscribe { period_ms: 1_000 });
    let mut count = 0;
    for sequence in 3..23 {
        // Any request shows that the host is there; a renewal does not put the
        // next status off.
        host.ask(sequence, Request::Subscribe { period_ms: 1_000 });
        count += statuses(&host.wait(900));
    }
    assert_eq!(count, 18);
    host.ask(90, Request::Subscribe { period_ms: 0 });
    assert_eq!(host.wait(60_000), []);

    // Another host's hello ends it too.
    host.ask(91, Request::Subscribe { period_ms: 1_000 });
    host.greet();
    assert_eq!(host.wait(60_000), []);
}

#[test]
fn no_host_can_ask_for_more_statuses_than_the_line_carries() {
    let mut host = Conversation::new();
    host.greet();
    let answer = host.ask(1, Request::Subscribe { period_ms: 1 });
    let agreed = Response::Subscribed {
        period_ms: MIN_PERIOD_MS,
        lapse_ms: LAPSE_MS,
    };
    assert_eq!(answer, [Said::Response(1, agreed)]);
    assert_eq!(statuses(&host.wait(1_000)), 10);
}

#[test]
fn what_finds_no_room_on_a_busy_line_is_counted_and_leaves_a_gap() {
    let mut host = Conversation::new();
    host.greet();
    host.ask(1, Request::Subscribe { period_ms: 60_000 });
    // Nothing is taken from the outbox meanwhile.
    for _ in 0..10 {
        host.session.log(&[b'x'; MAX_PAYLOAD]);
    }
    assert_eq!(host.session.trouble().unsent, 8);
    assert_eq!(host.said().len(), 2);
    host.session.log(b"after");
    assert_eq!(host.said(), [Said::Log(10, b"after".to_vec())]);
}

#[test]
fn after_a_million_bytes_of_garbage_every_request_is_answered() {
    let mut host = Conversation::new();
    host.greet();
    // xorshift64 (Marsaglia, 2003), seeded.
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    for round in 0..1_000_u16 {
        let mut garbage = [0; 1_000];
        for byte in &mut garbage {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            *byte = state as u8;
        }
        host.session.receive(&garbage, host.now, &mut FullDevice);
        host.session
            .receive(&[DELIMITER], host.now, &mut FullDevice);
        assert_eq!(host.said(), [], "garbage is not answered");
        let answer = host.ask(round, Request::Status);
        assert!(
            matches!(answer[..], [Said::Response(number, Response::Status(_))] if number == round)
        );
    }
    // One byte in 256 is a delimiter; most of what is between two is no frame.
    assert!(host.session.trouble().bad > 3_000);
}

proptest! {
    #[test]
    fn no_bytes_at_any_time_keep_a_session_from_answering(
        pieces in prop::collection::vec((prop::collection::vec(any::<u8>(), 0..700), 0..10_000_u64), 0..20)
    ) {
        let mut host = Conversation::new();
        for (bytes, ms) in pieces {
            host.session.receive(&bytes, host.now, &mut FullDevice);
            host.now += ms;
            host.session.poll(host.now, &FullDevice);
        }
        host.session.receive(&[DELIMITER], host.now, &mut FullDevice);
        host.said();
        host.greet();
    }
}
