//! A device that is none: the runtime's session over a made-up status, at the end
//! of a line in memory or of a pseudo-terminal.

use iltm::device::Line;
use iltm_runtime::link::{
    Clipping, DELIMITER, Device, Event, FrameCounts, FrameTime, Hello, Limits, MAX_PAYLOAD, Mode,
    Name, PROTOCOL_VERSION, Refusal, Request, Response, SerialCounts, Session, SlotState, Stack,
    Status, TableName, Version,
};
use std::io::{self, Read, Write};
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

/// What happens to frames on a line, in parts of 100, one after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct Harm {
    /// Are lost.
    pub lost: u8,
    /// Have a byte changed.
    pub changed: u8,
    /// Come twice.
    pub doubled: u8,
    /// Lose their end, delimiter included.
    pub cut: u8,
}

impl Harm {
    fn to(self, frame: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
        let mut frame = frame.to_vec();
        let mut happens = |parts: u8| random.u8(0..100) < parts;
        let (lost, changed) = (happens(self.lost), happens(self.changed));
        let (doubled, cut) = (happens(self.doubled), happens(self.cut));
        if lost {
            return Vec::new();
        }
        if changed {
            let at = random.usize(0..frame.len());
            frame[at] ^= random.u8(1..);
        }
        if doubled {
            frame.extend(frame.clone());
        }
        if cut {
            frame.truncate(random.usize(0..frame.len()));
        }
        frame
    }
}

/// A line in memory with a device at its end, which does frames some harm both
/// ways, by seed.
#[derive(Debug)]
pub struct FakeLine {
    /// The device.
    pub device: FakeDevice,
    /// Its side of the conversation.
    pub session: Session,
    harm: Harm,
    random: fastrand::Rng,
    started: Instant,
    to_host: Vec<u8>,
}

impl FakeLine {
    /// A line that does this harm.
    #[must_use]
    pub fn new(device: FakeDevice, harm: Harm, seed: u64) -> Self {
        Self {
            session: Session::new(),
            device,
            harm,
            random: fastrand::Rng::with_seed(seed),
            started: Instant::now(),
            to_host: Vec::new(),
        }
    }

    fn now(&self) -> u64 {
        self.started.elapsed().as_millis() as u64
    }

    fn pump(&mut self) {
        let mut bytes = Vec::new();
        while !self.session.pending().is_empty() {
            bytes.extend(self.session.pending());
            self.session.sent(usize::MAX);
        }
        for frame in bytes.split_inclusive(|byte| *byte == DELIMITER) {
            self.to_host.extend(self.harm.to(frame, &mut self.random));
        }
    }
}

impl Line for FakeLine {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.device.uptime_ms = self.now();
        self.session.poll(self.now(), &self.device);
        self.pump();
        if self.to_host.is_empty() {
            thread::sleep(wait.min(Duration::from_millis(1)));
        }
        let count = bytes.len().min(self.to_host.len());
        let rest = self.to_host.split_off(count);
        bytes[..count].copy_from_slice(&self.to_host);
        self.to_host = rest;
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        for frame in bytes.split_inclusive(|byte| *byte == DELIMITER) {
            let frame = self.harm.to(frame, &mut self.random);
            let now = self.now();
            self.session.receive(&frame, now, &mut self.device);
        }
        self.pump();
        Ok(())
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
