//! Wire: a simulated device at the end of a line in memory, and the host's end of it.

use crate::slots::SimDevice;
use iltm_runtime::link::{Channel, Decoder, Event, MAX_PAYLOAD, Response, Session};
use iltm_runtime::link::{DELIMITER, LinkFrame, MAX_ENCODED, Request};

/// What a device said.
#[derive(Debug, Default)]
pub(super) struct Said {
    /// Sequence numbers and responses.
    pub(super) responses: Vec<(u16, Response)>,
    /// Events.
    pub(super) events: Vec<Event>,
}

/// Both ends.
#[derive(Debug)]
pub(super) struct Wire<const W: usize, const E: usize> {
    pub(super) device: SimDevice<W, E>,
    session: Session,
    decoder: Decoder,
    next_event: u16,
}

impl<const W: usize, const E: usize> Wire<W, E> {
    pub(super) fn new(device: SimDevice<W, E>) -> Self {
        Self {
            device,
            session: Session::new(),
            decoder: Decoder::new(),
            next_event: 0,
        }
    }

    /// The device has bytes from the line. It is given them in pieces of at most
    /// `piece`.
    pub(super) fn hear(&mut self, bytes: &[u8], piece: usize) -> Said {
        for piece in bytes.chunks(piece.max(1)) {
            let now = self.device.now_ms;
            self.session.receive(piece, now, &mut self.device);
        }
        self.say()
    }

    /// Time passes.
    pub(super) fn wait(&mut self, ms: u64) -> Said {
        self.device.wait(ms);
        self.session.poll(self.device.now_ms, &self.device);
        self.say()
    }

    /// Takes what the device has to say, which is whole frames.
    fn say(&mut self) -> Said {
        if let Some(change) = self.device.updater.take_change() {
            self.session.event(&Event::TableChanged {
                table: change.table,
                reason: change.reason,
                frame: 0,
            });
        }
        let mut said = Said::default();
        while !self.session.pending().is_empty() {
            let pending = self.session.pending();
            for byte in pending {
                match self.decoder.push(*byte) {
                    None => {}
                    Some(Ok(frame)) => said.take(frame, &mut self.next_event),
                    Some(Err(error)) => panic!("a device sends whole frames: {error}"),
                }
            }
            let count = pending.len();
            self.session.sent(count);
        }
        said
    }
}

impl Said {
    fn take(&mut self, frame: LinkFrame<'_>, next_event: &mut u16) {
        match frame.channel {
            Channel::Response => {
                let response = postcard::from_bytes(frame.payload).expect("a response");
                self.responses.push((frame.sequence, response));
            }
            Channel::Event => {
                assert_eq!(frame.sequence, *next_event, "events are counted");
                *next_event = next_event.wrapping_add(1);
                let event = postcard::from_bytes(frame.payload).expect("an event");
                self.events.push(event);
            }
            channel => panic!("a device has nothing to say on {channel:?}"),
        }
    }
}

/// A request's payload.
pub(super) fn payload(request: &Request<'_>) -> Vec<u8> {
    let mut bytes = [0; MAX_PAYLOAD];
    let payload = postcard::to_slice(request, &mut bytes).expect("a request fits");
    payload.to_vec()
}

/// A frame as it goes on the line.
pub(super) fn framed(channel: Channel, sequence: u16, payload: &[u8]) -> Vec<u8> {
    let mut encoded = [0; MAX_ENCODED];
    let frame = LinkFrame {
        channel,
        sequence,
        payload,
    };
    let length = frame.emit(&mut encoded).expect("it fits");
    encoded[..length].to_vec()
}

/// How many things that are no frames a host has sent, and whether one is unfinished.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Noise {
    /// Ended ones.
    pub(super) bad: u32,
    /// Bytes have come since the last delimiter.
    pub(super) open: bool,
}

impl Noise {
    /// Bytes that are no frame.
    pub(super) fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if *byte == DELIMITER {
                self.bad += u32::from(self.open);
            }
            self.open = *byte != DELIMITER;
        }
    }

    /// A frame; whether it arrives as one.
    pub(super) fn frame(&mut self) -> bool {
        let spoiled = self.open;
        self.bad += u32::from(spoiled);
        self.open = false;
        !spoiled
    }
}
