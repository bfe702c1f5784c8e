//! Client of a device: greeting, status, and subscription to its events.

use super::transport::{Incoming, Patience, Transport, name};
use super::{Authority, DeviceError, Line};
use iltm_runtime::link::{Hello, PROTOCOL_VERSION, Request, Response, Status};
use std::time::Duration;

/// What a subscription was granted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Subscription {
    /// Between two statuses; zero if there will be none.
    pub period: Duration,
    /// Silence of the host after which the device stops.
    pub lapse: Duration,
}

/// A conversation with a device.
///
/// A request without an answer is sent again under the same number, which does
/// no harm: the device answers each copy alike, and any of the answers will do.
#[derive(Debug)]
pub struct Client<L> {
    pub(super) transport: Transport<L>,
    device: Hello,
    /// Whoever signs rights for a device with a key.
    pub(super) authority: Option<Authority>,
}

impl<L: Line> Client<L> {
    /// Says hello.
    ///
    /// # Errors
    /// [`DeviceError`] if nothing answers, or something of another version.
    pub fn greet(line: L, patience: Patience) -> Result<Self, DeviceError> {
        let mut transport = Transport::new(line, patience);
        let hello = Request::Hello {
            protocol: PROTOCOL_VERSION,
        };
        match transport.ask(hello)? {
            Response::Hello(device) if device.protocol == PROTOCOL_VERSION => {
                transport.forget();
                Ok(Self {
                    transport,
                    device,
                    authority: None,
                })
            }
            Response::Hello(device) => Err(DeviceError::Protocol {
                device: device.protocol,
            }),
            other => Err(unexpected(hello, &other)),
        }
    }

    /// Says hello again, to a device that has restarted.
    ///
    /// # Errors
    /// As [`greet`](Self::greet), and [`DeviceError::Exchanged`] if it is not the device
    /// that it was.
    pub fn greet_again(&mut self) -> Result<(), DeviceError> {
        let hello = Request::Hello {
            protocol: PROTOCOL_VERSION,
        };
        let device = match self.transport.ask(hello)? {
            Response::Hello(device) => device,
            other => return Err(unexpected(hello, &other)),
        };
        self.transport.forget();
        if device.protocol != PROTOCOL_VERSION {
            return Err(DeviceError::Protocol {
                device: device.protocol,
            });
        }
        if device.board != self.device.board || device.device != self.device.device {
            return Err(DeviceError::Exchanged);
        }
        self.device = device;
        Ok(())
    }

    /// The line.
    pub const fn line(&mut self) -> &mut L {
        self.transport.line()
    }

    /// Ends the conversation.
    #[must_use]
    pub fn into_line(self) -> L {
        self.transport.into_line()
    }

    /// What is asked of a device with a key is signed by this from now on.
    pub fn authorise(&mut self, authority: Authority) {
        self.authority = Some(authority);
    }

    /// Who the device is.
    #[must_use]
    pub const fn device(&self) -> &Hello {
        &self.device
    }

    /// How the device is.
    ///
    /// # Errors
    /// [`DeviceError`] if it does not answer, or not this.
    pub fn status(&mut self) -> Result<Status, DeviceError> {
        match self.transport.ask(Request::Status)? {
            Response::Status(status) => Ok(status),
            other => Err(unexpected(Request::Status, &other)),
        }
    }

    /// Asks for events and logs, with a status each `period`, or for nothing more
    /// if that is zero. To be repeated before [`Subscription::lapse`] is over.
    ///
    /// # Errors
    /// [`DeviceError`] if the device does not answer, or not this.
    pub fn subscribe(&mut self, period: Duration) -> Result<Subscription, DeviceError> {
        let request = Request::Subscribe {
            period_ms: u16::try_from(period.as_millis()).unwrap_or(u16::MAX),
        };
        match self.transport.ask(request)? {
            Response::Subscribed {
                period_ms,
                lapse_ms,
            } => Ok(Subscription {
                period: Duration::from_millis(period_ms.into()),
                lapse: Duration::from_millis(lapse_ms.into()),
            }),
            other => Err(unexpected(request, &other)),
        }
    }

    /// What the device says next by itself; waits for it at most as long as `wait`.
    ///
    /// # Errors
    /// [`DeviceError::Gone`].
    pub fn next(&mut self, wait: Duration) -> Result<Option<Incoming>, DeviceError> {
        self.transport.next(wait)
    }
}

pub(super) const fn unexpected(request: Request<'_>, response: &Response) -> DeviceError {
    let request = name(request);
    match response {
        Response::Refused(refusal) => DeviceError::Refused {
            request,
            refusal: *refusal,
        },
        _ => DeviceError::Answer { request },
    }
}
