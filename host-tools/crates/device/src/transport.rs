//! Transport below the client: requests and answers as frames on a line, sent again until
//! they are answered.

use super::error::Heard;
use super::{DeviceError, Line};
use iltm_runtime::link::{
    Channel, DELIMITER, Decoder, Event, LinkFrame, MAX_ENCODED, MAX_PAYLOAD, Request, Response,
};
use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

/// How long a device is waited for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Patience {
    /// For one answer.
    pub answer: Duration,
    /// How often a request is sent before giving up.
    pub tries: u32,
}

impl Default for Patience {
    /// The longest request and answer take .1 s at 115,200 baud.
    fn default() -> Self {
        Self {
            answer: Duration::from_millis(400),
            tries: 5,
        }
    }
}

/// What a device says by itself.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Incoming {
    /// An event.
    Event(Event),
    /// Whole defmt frames; see [`Logs`](super::logs::Logs).
    Log(Vec<u8>),
    /// Frames that the device sent and that did not come.
    Missed {
        /// The channel: events or logs.
        channel: Channel,
        /// How many.
        count: u16,
    },
}

/// A request as it goes on the line.
#[derive(Debug)]
pub(super) struct Posted {
    pub(super) sequence: u16,
    bytes: Vec<u8>,
}

/// A line with frames on it.
#[derive(Debug)]
pub(super) struct Transport<L> {
    line: L,
    decoder: Decoder,
    patience: Patience,
    /// Number of the last request.
    sequence: u16,
    /// Number of the next event and of the next log, once there has been one.
    expected: [Option<u16>; 2],
    incoming: VecDeque<Incoming>,
    heard: Heard,
}

impl<L: Line> Transport<L> {
    pub(super) fn new(line: L, patience: Patience) -> Self {
        Self {
            line,
            decoder: Decoder::new(),
            patience,
            // Answers that an earlier host asked for must not look like ours.
            sequence: fastrand::u16(..),
            expected: [None; 2],
            incoming: VecDeque::new(),
            heard: Heard::default(),
        }
    }

    /// Forgets what the device said to an earlier host.
    pub(super) fn forget(&mut self) {
        self.expected = [None; 2];
        self.incoming.clear();
    }

    /// What the device says next by itself; waits for it at most as long as `wait`.
    pub(super) fn next(&mut self, wait: Duration) -> Result<Option<Incoming>, DeviceError> {
        let end = self.line.now() + wait;
        loop {
            if let Some(incoming) = self.incoming.pop_front() {
                return Ok(Some(incoming));
            }
            let left = end.saturating_duration_since(self.line.now());
            if left.is_zero() {
                return Ok(None);
            }
            // Answers that come too late are of no use to anybody.
            self.listen(left, |_, _| ())?;
        }
    }

    /// Sends a request until it is answered.
    pub(super) fn ask(&mut self, request: Request<'_>) -> Result<Response, DeviceError> {
        self.ask_patiently(request, self.patience)
    }

    /// The usual patience.
    pub(super) const fn patience(&self) -> Patience {
        self.patience
    }

    /// The same with other patience than usual.
    pub(super) fn ask_patiently(
        &mut self,
        request: Request<'_>,
        patience: Patience,
    ) -> Result<Response, DeviceError> {
        let start = self.line.now();
        self.heard = Heard::default();
        let posted = self.post(request);
        for _ in 0..patience.tries {
            self.send(&posted)?;
            if let Some(response) = self.answer(posted.sequence, patience.answer)? {
                return response.map_err(|_| DeviceError::Answer {
                    request: name(request),
                });
            }
        }
        Err(DeviceError::NoAnswer {
            tries: patience.tries,
            seconds: self
                .line
                .now()
                .saturating_duration_since(start)
                .as_secs_f64(),
            heard: self.heard,
        })
    }

    /// A request with a number of its own, to be sent as often as it takes.
    pub(super) fn post(&mut self, request: Request<'_>) -> Posted {
        self.sequence = self.sequence.wrapping_add(1);
        Posted {
            sequence: self.sequence,
            bytes: encoded(self.sequence, request),
        }
    }

    /// Sends a request, for the first time or again.
    pub(super) fn send(&mut self, posted: &Posted) -> Result<(), DeviceError> {
        self.line.write(&posted.bytes).map_err(gone)
    }

    /// The responses that come within `wait`, as soon as there are any; `None` for one
    /// that cannot be read.
    pub(super) fn responses(
        &mut self,
        wait: Duration,
    ) -> Result<Vec<(u16, Option<Response>)>, DeviceError> {
        let mut responses = Vec::new();
        self.listen(wait, |sequence, payload| {
            responses.push((sequence, postcard::from_bytes(payload).ok()));
        })?;
        Ok(responses)
    }

    /// The line's time.
    pub(super) fn now(&self) -> Instant {
        self.line.now()
    }

    pub(super) const fn line(&mut self) -> &mut L {
        &mut self.line
    }

    pub(super) fn into_line(self) -> L {
        self.line
    }

    /// Waits for the response with this number.
    fn answer(
        &mut self,
        sequence: u16,
        patience: Duration,
    ) -> Result<Option<Result<Response, postcard::Error>>, DeviceError> {
        let end = self.line.now() + patience;
        loop {
            let left = end.saturating_duration_since(self.line.now());
            if left.is_zero() {
                return Ok(None);
            }
            let mut answer = None;
            self.listen(left, |number, payload| {
                if number == sequence {
                    answer = Some(postcard::from_bytes(payload));
                }
            })?;
            if answer.is_some() {
                return Ok(answer);
            }
        }
    }

    /// Reads once; `response` gets number and payload of every response in it.
    fn listen(
        &mut self,
        wait: Duration,
        mut response: impl FnMut(u16, &[u8]),
    ) -> Result<(), DeviceError> {
        let mut bytes = [0; 1024];
        let count = self.line.read(&mut bytes, wait).map_err(gone)?;
        self.heard.bytes += count as u64;
        for byte in &bytes[..count] {
            let Some(Ok(frame)) = self.decoder.push(*byte) else {
                continue;
            };
            self.heard.frames += 1;
            let incoming = match frame.channel {
                Channel::Request => continue,
                Channel::Response => {
                    response(frame.sequence, frame.payload);
                    continue;
                }
                Channel::Event => postcard::from_bytes(frame.payload)
                    .map(Incoming::Event)
                    .ok(),
                Channel::Log => Some(Incoming::Log(frame.payload.to_vec())),
            };
            let (channel, sequence) = (frame.channel, frame.sequence);
            let expected = &mut self.expected[usize::from(channel == Channel::Log)];
            let count = sequence.wrapping_sub(expected.unwrap_or(sequence));
            *expected = Some(sequence.wrapping_add(1));
            if count != 0 {
                self.incoming.push_back(Incoming::Missed { channel, count });
            }
            self.incoming.extend(incoming);
        }
        Ok(())
    }
}

const fn gone(source: io::Error) -> DeviceError {
    DeviceError::Gone { source }
}

/// A request as it goes on the line: after a delimiter, which ends whatever the
/// device may have heard before.
fn encoded(sequence: u16, request: Request<'_>) -> Vec<u8> {
    let mut payload = [0; MAX_PAYLOAD];
    let mut bytes = [DELIMITER; 1 + MAX_ENCODED];
    let payload = postcard::to_slice(&request, &mut payload).expect("a request fits a frame");
    let frame = LinkFrame {
        channel: Channel::Request,
        sequence,
        payload,
    };
    let length = frame.emit(&mut bytes[1..]).expect("a payload fits a frame");
    bytes[..=length].to_vec()
}

/// What a request is called in messages.
pub(super) const fn name(request: Request<'_>) -> &'static str {
    match request {
        Request::Hello { .. } => "hello",
        Request::Status => "status",
        Request::Subscribe { .. } => "subscribe",
        Request::Slots => "slots",
        Request::Sectors { .. } => "sectors",
        Request::Begin { .. } => "begin",
        Request::Write { .. } => "write",
        Request::Activate { .. } => "activate",
        Request::Confirm { .. } => "confirm",
        Request::Rollback { .. } => "roll back",
        Request::Provision { .. } => "provision",
    }
}
