//! Session: the device's side of the conversation, without a line of its own.
//!
//! ```text
//! bytes from the line -> receive -+            +-> pending, sent -> bytes to the line
//! time                -> poll ----+-> Session -+
//! events, logs        -> event, log +
//! ```

use super::decoder::Decoder;
use super::frame::{Channel, LinkFrame, MAX_ENCODED, MAX_PAYLOAD};
use super::message::{Event, Hello, Refusal, Request, Response};
use super::outbox::Outbox;
use super::status::{SerialCounts, Status};
use serde::Serialize;

/// Shortest time between two statuses that nobody asked for, milliseconds. At
/// 115,200 baud a status of the usual length takes a tenth of it.
pub const MIN_PERIOD_MS: u16 = 100;

/// Milliseconds without a frame from the host after which a subscription ends.
pub const LAPSE_MS: u16 = 5_000;

/// Bytes that may wait for the line: room for two of the longest frames.
pub const OUTBOX: usize = 2 * MAX_ENCODED;

/// What a session asks of the device around it.
pub trait Device {
    /// Who it is.
    fn identity(&self) -> Hello;

    /// How it is. The session fills in [`Status::serial`].
    fn status(&self) -> Status;

    /// Does what a request says that is about tables; the session answers hello,
    /// status and subscribe itself. Repeating it must do no harm.
    fn carry_out(&mut self, request: Request<'_>, now_ms: u64) -> Response;

    /// Called after every answer: a piece of the line may hold many requests, and a
    /// device has frames to look after.
    fn answered(&mut self) {}
}

/// A conversation with whatever host is at the other end.
///
/// It says nothing before a frame has come in whole; it answers every request,
/// and sends events and logs only to a host that has subscribed and still speaks.
/// Times are milliseconds on any clock that does not run backwards.
#[derive(Debug)]
pub struct Session {
    decoder: Decoder,
    talk: Talk,
}

/// All of it but the frame that comes in, which a request may lie in.
#[derive(Debug)]
struct Talk {
    outbox: Outbox<OUTBOX>,
    greeted: bool,
    subscription: Option<Subscription>,
    events: u16,
    logs: u16,
}

#[derive(Clone, Copy, Debug)]
struct Subscription {
    period_ms: u16,
    /// When the next status is due.
    due: u64,
    /// When the host spoke last.
    heard: u64,
}

impl Default for Session {
    fn default() -> Self {
        Self::new()
    }
}

impl Session {
    /// Of a device that has just started.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            decoder: Decoder::new(),
            talk: Talk {
                outbox: Outbox::new(),
                greeted: false,
                subscription: None,
                events: 0,
                logs: 0,
            },
        }
    }

    /// Takes bytes from the line and answers the requests that they complete.
    pub fn receive(&mut self, bytes: &[u8], now_ms: u64, device: &mut impl Device) {
        let Self { decoder, talk } = self;
        for byte in bytes {
            let bad = decoder.bad();
            let Some(Ok(frame)) = decoder.push(*byte) else {
                continue;
            };
            // A host hears nothing on this channel, and says nothing on others.
            if frame.channel != Channel::Request {
                continue;
            }
            if let Some(subscription) = &mut talk.subscription {
                subscription.heard = now_ms;
            }
            let response = match Request::parse(frame.payload) {
                Ok(request) => talk.answer(request, now_ms, bad, device),
                Err(refusal) => Response::Refused(refusal),
            };
            talk.send(Channel::Response, frame.sequence, &response);
            device.answered();
        }
    }

    /// Sends what is due by now. Call it a few times per [`MIN_PERIOD_MS`].
    pub fn poll(&mut self, now_ms: u64, device: &impl Device) {
        let Some(subscription) = &mut self.talk.subscription else {
            return;
        };
        if now_ms.saturating_sub(subscription.heard) > u64::from(LAPSE_MS) {
            self.talk.subscription = None;
        } else if now_ms >= subscription.due {
            subscription.due = now_ms.saturating_add(u64::from(subscription.period_ms));
            let status = self.talk.status(device, self.decoder.bad());
            self.talk.event(&Event::Status(status));
        }
    }

    /// Tells a subscribed host of something; nothing happens without one.
    ///
    /// Inlined, so that a firmware has what makes bytes of a message once, compiled by its own
    /// settings.
    #[inline]
    pub fn event(&mut self, event: &Event) {
        self.talk.event(event);
    }

    /// Sends whole defmt frames, at most [`MAX_PAYLOAD`] bytes, to a subscribed
    /// host; nothing happens without one.
    pub fn log(&mut self, frames: &[u8]) {
        if self.is_subscribed() {
            let sequence = self.talk.logs;
            self.talk.logs = sequence.wrapping_add(1);
            self.talk.outbox.push(LinkFrame {
                channel: Channel::Log,
                sequence,
                payload: frames,
            });
        }
    }

    /// Whether a host wants events and logs.
    #[must_use]
    pub const fn is_subscribed(&self) -> bool {
        self.talk.subscription.is_some()
    }

    /// Bytes for the line, as many as lie side by side; empty if there are none.
    #[must_use]
    pub fn pending(&self) -> &[u8] {
        self.talk.outbox.pending()
    }

    /// The first `count` bytes of [`pending`](Self::pending) are on the line.
    pub fn sent(&mut self, count: usize) {
        self.talk.outbox.sent(count);
    }

    /// What went wrong on the line so far.
    #[must_use]
    pub const fn trouble(&self) -> SerialCounts {
        SerialCounts {
            bad: self.decoder.bad(),
            unsent: self.talk.outbox.refused(),
        }
    }
}

impl Talk {
    fn answer(
        &mut self,
        request: Request<'_>,
        now_ms: u64,
        bad: u32,
        device: &mut impl Device,
    ) -> Response {
        match request {
            Request::Hello { .. } => {
                self.greeted = true;
                self.subscription = None;
                Response::Hello(device.identity())
            }
            _ if !self.greeted => Response::Refused(Refusal::HelloFirst),
            Request::Status => Response::Status(self.status(device, bad)),
            Request::Subscribe { period_ms: 0 } => {
                self.subscription = None;
                Response::Subscribed {
                    period_ms: 0,
                    lapse_ms: LAPSE_MS,
                }
            }
            Request::Subscribe { period_ms } => {
                let period_ms = period_ms.max(MIN_PERIOD_MS);
                // Renewing must not put the next status off.
                let next = now_ms.saturating_add(u64::from(period_ms));
                let due = self.subscription.map_or(next, |old| old.due.min(next));
                self.subscription = Some(Subscription {
                    period_ms,
                    due,
                    heard: now_ms,
                });
                Response::Subscribed {
                    period_ms,
                    lapse_ms: LAPSE_MS,
                }
            }
            about_tables => device.carry_out(about_tables, now_ms),
        }
    }

    #[inline]
    fn event(&mut self, event: &Event) {
        if self.subscription.is_some() {
            let sequence = self.events;
            self.events = sequence.wrapping_add(1);
            self.send(Channel::Event, sequence, event);
        }
    }

    /// `bad` are the line's bad frames.
    fn status(&self, device: &impl Device, bad: u32) -> Status {
        Status {
            serial: SerialCounts {
                bad,
                unsent: self.outbox.refused(),
            },
            ..device.status()
        }
    }

    /// Not inlined: its buffers would lie on the stack under whatever a request does.
    #[inline(never)]
    fn send(&mut self, channel: Channel, sequence: u16, message: &impl Serialize) {
        let mut bytes = [0; MAX_PAYLOAD];
        // The longest message has room, which a test makes sure of.
        if let Ok(payload) = postcard::to_slice(message, &mut bytes) {
            self.outbox.push(LinkFrame {
                channel,
                sequence,
                payload,
            });
        }
    }
}
