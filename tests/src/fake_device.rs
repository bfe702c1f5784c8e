//! A device that is none: the runtime's session over a made-up status, at the end
//! of a line in memory or of a pseudo-terminal.

use iltm::device::fault::{FarEnd, PacedLine};
use iltm_runtime::link::{
    Clipping, Device, Event, FrameCounts, FrameTime, Hello, Limits, MAX_PAYLOAD, Mode, Name,
    PROTOCOL_VERSION, Refusal, Request, Response, SerialCounts, Session, SlotState, Stack, Status,
    TableName, Version,
};
use std::io::{Read, Write};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// What the made-up device says of itself.
#[derive(Clone, Debug)]
pub struct FakeDevice {
    /// Its status; uptime and frames are added to it.
    pub status: Status,
    /// Its protocol version.
    pub protocol: u16,
    /// Milliseconds since it started.
    pub uptime_ms: u64,
}

impl Default for FakeDevice {
    /// A device that compensates 60 frames a second, all numbers different.
    fn default() -> Self {
        let status = Status {
            firmware: Version {
                major: 1,
                minor: 2,
                patch: 300,
            },
            board: Name::try_from("made-up").expect("a short name"),
            uptime_ms: 0,
            table: Some(TableName {
                id: 0x89AB_CDEF,
                version: 7,
            }),
            mode: Mode::Compensating,
            tier: 3,
            top_tier: 5,
            frames: FrameCounts {
                received: 0,
                shown: 0,
                late: 1,
                dropped: 2,
                broken: 3,
            },
            clipping: Clipping {
                last: 120,
                total: 4_500,
                samples: 12_000,
            },
            frame_time: FrameTime {
                last_us: 9_100,
                mean_us: 9_000,
                worst_us: 12_500,
                budget_us: 16_667,
            },
            slots: [SlotState::Active, SlotState::Empty],
            last_fault: None,
            stack: Stack {
                used: 3_000,
                size: 8_192,
            },
            watchdog_resets: 0,
            serial: SerialCounts::default(),
        };
        Self {
            status,
            protocol: PROTOCOL_VERSION,
            uptime_ms: 0,
        }
    }
}

impl FakeDevice {
    /// Who it says it is.
    #[must_use]
    pub fn identity(&self) -> Hello {
        Hello {
            protocol: self.protocol,
            firmware: self.status.firmware,
            board: self.status.board.clone(),
            device: 0x0102_0304_0506_0708,
            table_format: 1,
            max_payload: MAX_PAYLOAD as u16,
            limits: Limits {
                cells: 16_384,
                frame_bytes: 230_400,
                table_bytes: 2_097_152,
            },
        }
    }
}

impl Device for FakeDevice {
    fn identity(&self) -> Hello {
        Self::identity(self)
    }

    fn carry_out(&mut self, _: Request<'_>, _: u64) -> Response {
        Response::Refused(Refusal::ReadOnly)
    }

    fn status(&self) -> Status {
        let mut status = self.status.clone();
        status.uptime_ms = self.uptime_ms;
        status.frames.received = (self.uptime_ms * 60 / 1_000) as u32;
        status.frames.shown = status.frames.received;
        status
    }
}

/// A device in memory with its side of the conversation, as the far end of a line.
#[derive(Debug)]
pub struct FakeEnd {
    /// The device.
    pub device: FakeDevice,
    /// Its side of the conversation.
    pub session: Session,
}

/// A line in memory with a device at its end, on a clock of its own.
pub type FakeLine = PacedLine<FakeEnd>;

impl FakeDevice {
    /// A line with this device at its end.
    #[must_use]
    pub fn line(self, baud: u32) -> FakeLine {
        let end = FakeEnd {
            session: Session::new(),
            device: self,
        };
        PacedLine::new(end, baud)
    }
}

impl FarEnd for FakeEnd {
    fn turn(&mut self, arrived: &[u8], now: Duration) {
        let now = now.as_millis() as u64;
        self.device.uptime_ms = now;
        self.session.receive(arrived, now, &mut self.device);
        self.session.poll(now, &self.device);
    }

    fn pending(&self) -> &[u8] {
        self.session.pending()
    }

    fn sent(&mut self, count: usize) {
        self.session.sent(count);
    }
}

/// Something that a test does to a device behind a port.
#[derive(Debug)]
pub enum Order {
    /// It says this, if the host has subscribed.
    Event(Event),
    /// It logs these bytes, if the host has subscribed.
    Log(Vec<u8>),
    /// It forgets the conversation, as after a loss of power.
    Restart,
    /// It sends these bytes whatever the conversation.
    Noise(Vec<u8>),
    /// It goes, and its port with it.
    Vanish,
}

/// A pseudo-terminal with a device at its end.
#[cfg(unix)]
#[derive(Debug)]
pub struct FakePort {
    path: String,
    orders: Sender<Order>,
    thread: Option<JoinHandle<()>>,
}

#[cfg(unix)]
impl FakePort {
    /// Plugs a device in.
    ///
    /// # Panics
    /// If the system has no pseudo-terminal left.
    #[must_use]
    pub fn new(device: FakeDevice) -> Self {
        use serialport::{SerialPort, TTYPort};
        let (mut ours, theirs) = TTYPort::pair().expect("a pseudo-terminal");
        ours.set_timeout(Duration::from_millis(5))
            .expect("a pseudo-terminal");
        let path = theirs.name().expect("a pseudo-terminal has a name");
        let (orders, received) = channel();
        let thread = thread::spawn(move || {
            // Kept open, or ours would end whenever a host closes it.
            let _theirs = theirs;
            run(&mut ours, device, &received);
        });
        Self {
            path,
            orders,
            thread: Some(thread),
        }
    }

    /// Where a host finds it.
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Does something to the device.
    pub fn order(&self, order: Order) {
        // A device that has vanished takes no orders.
        let _ = self.orders.send(order);
    }
}

#[cfg(unix)]
impl Drop for FakePort {
    fn drop(&mut self) {
        self.order(Order::Vanish);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The firmware's loop, as it were.
#[cfg(unix)]
fn run(line: &mut (impl Read + Write), mut device: FakeDevice, orders: &Receiver<Order>) {
    let mut session = Session::new();
    let mut started = Instant::now();
    let mut bytes = [0; 256];
    loop {
        device.uptime_ms = started.elapsed().as_millis() as u64;
        let now = device.uptime_ms;
        // Nothing to read is an error here, and nothing to do.
        let count = line.read(&mut bytes).unwrap_or(0);
        session.receive(&bytes[..count], now, &mut device);
        session.poll(now, &device);
        for order in orders.try_iter() {
            match order {
                Order::Event(event) => session.event(&event),
                Order::Log(bytes) => session.log(&bytes),
                Order::Restart => {
                    session = Session::new();
                    started = Instant::now();
                }
                Order::Noise(bytes) => {
                    let _ = line.write_all(&bytes);
                }
                Order::Vanish => return,
            }
        }
        let written = line.write(session.pending()).unwrap_or(0);
        session.sent(written);
    }
}
