//! A device that is none: the runtime's session over a made-up status, at the end
//! of a line in memory or of a pseudo-terminal.

use crate::fake_tables::FakeTables;
use iltm::device::Line;
use iltm_runtime::image::layout::FORMAT_VERSION;
use iltm_runtime::link::{
    Clipping, DELIMITER, Device, Event, FrameCounts, FrameTime, Hello, Limits, MAX_PAYLOAD, Mode,
    Name, PROTOCOL_VERSION, PassThrough, Refusal, Request, Response, SerialCounts, Session,
    SlotState, Stack, Status, TableName, Version,
};
use std::fmt;
use std::io::{self, Read, Write};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// What the made-up device says of itself.
#[derive(Debug)]
pub struct FakeDevice {
    /// Its status; uptime and frames are added to it.
    pub status: Status,
    /// Its protocol version.
    pub protocol: u16,
    /// Milliseconds since it started.
    pub uptime_ms: u64,
    /// Bytes that came in.
    pub heard: usize,
    /// Its number.
    pub number: u64,
    /// Its tables; without, it refuses what is about tables and makes up a status.
    pub tables: Option<FakeTables>,
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
            heard: 0,
            number: 0x0102_0304_0506_0708,
            tables: None,
        }
    }
}

impl FakeDevice {
    /// A device with a flash for tables.
    #[must_use]
    pub fn with_tables(tables: FakeTables) -> Self {
        Self {
            number: tables.updater().trust().device,
            tables: Some(tables),
            ..Self::default()
        }
    }

    /// The tables of a device that has some.
    ///
    /// # Panics
    /// If it has none.
    pub const fn tables(&mut self) -> &mut FakeTables {
        self.tables.as_mut().expect("a device with tables")
    }

    /// Lets time pass; what became of the tables meanwhile.
    fn poll(&mut self, now_ms: u64) -> Option<Event> {
        let tables = self.tables.as_mut()?;
        // A number that it was given counts from now on.
        self.number = tables.updater().trust().device;
        let change = tables.poll(now_ms)?;
        Some(Event::TableChanged {
            table: change.table,
            reason: change.reason,
            frame: 0,
        })
    }

    /// As after a loss of power.
    pub fn restart(&mut self) {
        if let Some(tables) = &mut self.tables {
            tables.restart();
        }
    }

    /// Who it says it is.
    #[must_use]
    pub fn identity(&self) -> Hello {
        Hello {
            protocol: self.protocol,
            firmware: self.status.firmware,
            board: self.status.board.clone(),
            device: self.number,
            table_format: FORMAT_VERSION,
            max_payload: MAX_PAYLOAD as u16,
            limits: Limits {
                cells: 16_384,
                frame_bytes: 230_400,
                table_bytes: (self.tables.as_ref()).map_or(2_097_152, FakeTables::slot_bytes),
            },
        }
    }
}

impl Device for FakeDevice {
    fn identity(&self) -> Hello {
        Self::identity(self)
    }

    fn carry_out(&mut self, request: Request<'_>, now_ms: u64) -> Response {
        match &mut self.tables {
            Some(tables) => tables.carry_out(request, now_ms),
            None => Response::Refused(Refusal::ReadOnly),
        }
    }

    fn status(&self) -> Status {
        let mut status = self.status.clone();
        status.uptime_ms = self.uptime_ms;
        status.frames.received = (self.uptime_ms * 60 / 1_000) as u32;
        status.frames.shown = status.frames.received;
        if let Some(tables) = &self.tables {
            status.table = tables.updater().table();
            status.slots = tables.updater().states();
            status.mode = match status.table {
                Some(_) => Mode::Compensating,
                None => Mode::PassThrough(PassThrough::NoTable),
            };
        }
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

    fn now_ms(&self) -> u64 {
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
        self.device.uptime_ms = self.now_ms();
        let now = self.now_ms();
        if let Some(event) = self.device.poll(now) {
            self.session.event(&event);
        }
        self.session.poll(now, &self.device);
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
            let now = self.now_ms();
            self.session.receive(&frame, now, &mut self.device);
            if (self.device.tables.as_mut()).is_some_and(FakeTables::restarts) {
                self.session = Session::new();
                self.device.restart();
            }
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
    /// Something looks into it.
    Look(Look),
}

/// Looks into a device.
pub struct Look(Box<dyn FnOnce(&mut FakeDevice) + Send>);

impl fmt::Debug for Look {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Look")
    }
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

    /// What there is to see in the device, or is after this was done to it.
    ///
    /// # Panics
    /// If the device has vanished.
    pub fn look<T: Send + 'static>(
        &self,
        look: impl FnOnce(&mut FakeDevice) -> T + Send + 'static,
    ) -> T {
        let (sender, seen) = channel();
        let look = move |device: &mut FakeDevice| {
            // Whoever asked waits for it.
            let _ = sender.send(look(device));
        };
        self.order(Order::Look(Look(Box::new(look))));
        seen.recv().expect("the device is there")
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
    let mut restart = false;
    loop {
        if std::mem::take(&mut restart) || device.tables.as_mut().is_some_and(FakeTables::restarts)
        {
            session = Session::new();
            device.restart();
            started = Instant::now();
        }
        device.uptime_ms = started.elapsed().as_millis() as u64;
        let now = device.uptime_ms;
        if let Some(event) = device.poll(now) {
            session.event(&event);
        }
        // Nothing to read is an error here, and nothing to do.
        let count = line.read(&mut bytes).unwrap_or(0);
        device.heard += count;
        let mute = device.tables.as_ref().is_some_and(FakeTables::is_mute);
        let count = if mute { 0 } else { count };
        session.receive(&bytes[..count], now, &mut device);
        session.poll(now, &device);
        for order in orders.try_iter() {
            match order {
                Order::Event(event) => session.event(&event),
                Order::Log(bytes) => session.log(&bytes),
                Order::Restart => restart = true,
                Order::Noise(bytes) => {
                    let _ = line.write_all(&bytes);
                }
                Order::Vanish => return,
                Order::Look(Look(look)) => look(&mut device),
            }
        }
        let written = line.write(session.pending()).unwrap_or(0);
        session.sent(written);
    }
}
