//! `iltm monitor`
//!
//! | what | file |
//! |---|---|
//! | the conversation, and beginning it anew when it breaks | here |
//! | events, in words and as data | [`event`] |
//! | a line of text or JSON for each | [`lines`] |
//! | the live view: its state as lines | [`view`] |
//! | the live view: those lines on a terminal | [`live`] |

mod event;
mod lines;
mod live;
mod view;

use super::args::Monitor;
use super::connect::{Wire, connect};
use super::failure::{Failure, Kind};
use super::interrupt;
use super::output::Output;
use crate::device::logs::Logs;
use crate::device::{Client, DeviceError, Incoming, Patience, Port};
use event::MonitorEvent;
use iltm_runtime::link::{Channel, Refusal};
use serde_json::json;
use std::io;
use std::thread;
use std::time::{Duration, Instant};

/// Between two attempts to find a device that has gone.
const RETRY: Duration = Duration::from_secs(1);

/// Longest wait before the screen and ctrl-C are looked at again.
const TICK: Duration = Duration::from_millis(100);

/// Somebody who is shown what happens.
trait Show {
    /// Shows one thing.
    fn show(&mut self, event: &MonitorEvent) -> io::Result<()>;

    /// Time has passed.
    fn tick(&mut self) -> io::Result<()> {
        Ok(())
    }
}

pub(super) fn run(arguments: &Monitor, output: &Output) -> Result<(), Failure> {
    let logs = arguments.firmware.as_deref().map(Logs::read).transpose()?;
    let period = Duration::from_millis(arguments.period.into());
    // A first failure ends the command; later ones are the device's business.
    let mut connection = connect(&arguments.line, output)?;
    connection.remember(output);
    let endpoint = Endpoint {
        port: connection.port,
        baud: connection.baud,
    };
    let line = &endpoint;
    let first = MonitoredDevice::of(connection.client, period, logs.as_ref());
    let first = first.map_err(|error| Failure::of_device(&line.port, &error))?;
    interrupt::catch();
    let mut show: Box<dyn Show> = if output.is_json() {
        Box::new(lines::Json)
    } else if live::possible() {
        Box::new(live::Live::start(&line.port))
    } else {
        Box::new(lines::Plain::default())
    };
    match watch(first, line, period, logs.as_ref(), show.as_mut()) {
        Ok(()) => {
            output.result(&json!({ "event": "end" }), "");
            Ok(())
        }
        // Whoever read has read enough, as `head` does.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        Err(error) => {
            let message = format!("standard output: {error}");
            let next_step = "Check where standard output goes.";
            Err(Failure::new(Kind::Write, message, next_step))
        }
    }
}

/// Where the device was found.
struct Endpoint {
    port: String,
    baud: u32,
}

/// Shows what happens until somebody stops it.
fn watch(
    first: MonitoredDevice<'_>,
    line: &Endpoint,
    period: Duration,
    logs: Option<&Logs>,
    show: &mut dyn Show,
) -> io::Result<()> {
    let mut current = Ok(first);
    // Said once for each time that the device is lost.
    let mut said = false;
    while !interrupt::stopped() {
        match current {
            Ok(mut watch) => {
                show.show(&MonitorEvent::Connected(watch.client.device().clone()))?;
                said = false;
                let error = watch.until_lost(show)?;
                let Some(error) = error else {
                    break;
                };
                current = Err(error);
            }
            Err(DeviceError::Refused {
                refusal: Refusal::HelloFirst,
                ..
            }) => {
                show.show(&MonitorEvent::Restarted)?;
                current = MonitoredDevice::begin(line, period, logs);
            }
            Err(error) => {
                if !said {
                    show.show(&MonitorEvent::Lost(error.to_string()))?;
                    said = true;
                }
                let end = Instant::now() + RETRY;
                while Instant::now() < end && !interrupt::stopped() {
                    thread::sleep(TICK);
                    show.tick()?;
                }
                current = MonitoredDevice::begin(line, period, logs);
            }
        }
    }
    Ok(())
}

/// A conversation with a device that has granted a subscription.
struct MonitoredDevice<'l> {
    client: Client<Wire>,
    logs: Option<&'l Logs>,
    period: Duration,
    /// Between two renewals of the subscription.
    renewal: Duration,
}

impl<'l> MonitoredDevice<'l> {
    fn begin(
        line: &Endpoint,
        period: Duration,
        logs: Option<&'l Logs>,
    ) -> Result<Self, DeviceError> {
        let port = Port::open(&line.port, line.baud)?;
        let client = Client::greet(Wire::new(port), Patience::default())?;
        Self::of(client, period, logs)
    }

    fn of(
        mut client: Client<Wire>,
        period: Duration,
        logs: Option<&'l Logs>,
    ) -> Result<Self, DeviceError> {
        let subscription = client.subscribe(period)?;
        Ok(Self {
            client,
            logs,
            period,
            renewal: subscription.lapse / 4,
        })
    }

    /// Shows what the device says until it is lost, or `None` until somebody
    /// stops it.
    fn until_lost(&mut self, show: &mut dyn Show) -> io::Result<Option<DeviceError>> {
        // What was queued during the subscription comes out at once.
        let mut renew = Instant::now() + self.renewal;
        if let Err(error) = self.ask_slots(show)? {
            return Ok(Some(error));
        }
        while !interrupt::stopped() {
            if Instant::now() >= renew {
                renew = Instant::now() + self.renewal;
                if let Err(error) = self.client.subscribe(self.period) {
                    return Ok(Some(error));
                }
                if let Err(error) = self.ask_slots(show)? {
                    return Ok(Some(error));
                }
            }
            match self.client.next(TICK) {
                Ok(Some(incoming)) => self.show(incoming, show)?,
                Ok(None) => show.tick()?,
                Err(error) => return Ok(Some(error)),
            }
        }
        // The device would stop by itself; asking is kinder to whoever is next.
        let _ = self.client.subscribe(Duration::ZERO);
        Ok(None)
    }

    /// Names of tables and the time left of a trial, which a status does not say.
    fn ask_slots(&mut self, show: &mut dyn Show) -> io::Result<Result<(), DeviceError>> {
        match self.client.slots() {
            Ok(slots) => show.show(&MonitorEvent::Slots(Box::new(slots))).map(Ok),
            Err(DeviceError::Refused {
                refusal: Refusal::ReadOnly,
                ..
            }) => Ok(Ok(())),
            Err(error) => Ok(Err(error)),
        }
    }

    fn show(&self, incoming: Incoming, show: &mut dyn Show) -> io::Result<()> {
        match incoming {
            Incoming::Event(event) => show.show(&MonitorEvent::Device(event)),
            Incoming::Log(payload) => match self.logs {
                Some(logs) => {
                    for message in logs.messages(&payload) {
                        show.show(&MonitorEvent::Log(message))?;
                    }
                    Ok(())
                }
                None => show.show(&MonitorEvent::UnreadLog {
                    bytes: payload.len(),
                }),
            },
            Incoming::Missed { channel, count } => show.show(&MonitorEvent::Missed {
                what: if channel == Channel::Log {
                    "log"
                } else {
                    "event"
                },
                count,
            }),
        }
    }
}
