//! Fake device: the runtime's session over a made-up status and simulated table slots, at
//! the end of a line in memory or of a pseudo-terminal.

use crate::flash_simulator::NorSimulator;
use crate::line_faults::{FarEnd, PacedLine};
use crate::slots::{SimDevice, SlotLayout};
use iltm_runtime::image::layout::FORMAT_VERSION;
use iltm_runtime::image::{Table, content, unseal};
use iltm_runtime::link::{
    Clipping, Device, Event, FrameCounts, FrameKind, FrameTime, Hello, Limits, MAX_PAYLOAD, Mode,
    Name, PROTOCOL_VERSION, PassThrough, Refusal, Request, Response, SerialCounts, Session,
    SlotState, Stack, Status, TableName, Version,
};
use iltm_runtime::store::{Slot, Updater};
use iltm_runtime::units::ClippedSamples;
use std::fmt;
use std::io::{Read, Write};
use std::ops::Range;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Bytes of a sector of the fake device's flash, which is written in words.
pub const SECTOR: usize = 4_096;

/// The fake device's flash.
pub type Flash = NorSimulator<4, SECTOR>;

const LAYOUT: SlotLayout = SlotLayout {
    slot: 32,
    sector: SECTOR,
};

/// Where each slot is.
pub const fn slot(index: usize) -> Range<usize> {
    LAYOUT.slot(Slot::ALL[index])
}

/// The table slots of a fake device, and what a test orders them to do.
#[derive(Debug)]
pub struct FakeTables {
    device: SimDevice<4, SECTOR>,
    /// Offset of every chunk that came.
    pub writes: Vec<u32>,
    /// Restarts once so many chunks have come, before it answers the last.
    pub restart_after: Option<usize>,
    /// Carries out and answers nothing from the chunk of this number on.
    pub mute_after: Option<usize>,
}

impl Default for FakeTables {
    fn default() -> Self {
        Self::new(Flash::new(LAYOUT.sectors(), 1))
    }
}

impl FakeTables {
    /// What a device finds in this flash when it starts.
    pub fn new(flash: Flash) -> Self {
        Self {
            device: SimDevice::start(flash, LAYOUT),
            writes: Vec::new(),
            restart_after: None,
            mute_after: None,
        }
    }

    /// As after a loss of power.
    pub fn restart(&mut self) {
        self.device = self.device.clone().restarted();
    }

    /// Of a device with this key and number.
    pub fn provisioned(key: [u8; 32], device: u64) -> Self {
        let mut tables = Self::default();
        let response = tables.device.ask(Request::Provision {
            key,
            device,
            even_so: true,
        });
        assert_eq!(response, Response::Provisioned);
        tables
    }

    /// The updater.
    pub const fn updater(&self) -> &Updater<Flash> {
        &self.device.updater
    }

    /// What the flash holds.
    pub fn contents(&self) -> Vec<u8> {
        self.device.flash().contents().to_vec()
    }

    /// The least frames that the table in use takes.
    fn frames(&self) -> Option<FrameKind> {
        let range = slot(self.updater().in_use()?.index());
        let contents = self.device.flash().contents();
        let file = content(&contents[range]);
        let (image, _) = unseal(file).ok()?;
        let table = Table::check(image).ok()?;
        Some(FrameKind {
            width: table.grid().cols() as u16,
            height: table.grid().rows() as u16,
            channels: table.channels(),
        })
    }

    /// Whether it answers nothing any more.
    pub fn is_mute(&self) -> bool {
        self.mute_after
            .is_some_and(|count| self.writes.len() >= count)
    }

    /// Whether it is about to restart; true once.
    fn restarts(&mut self) -> bool {
        let count = self.writes.len();
        self.restart_after
            .take_if(|after| count >= *after)
            .is_some()
    }
}

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
                last: ClippedSamples {
                    black: 120,
                    white: 60,
                },
                black: 4_500,
                white: 900,
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
            input: Some(FrameKind {
                width: 320,
                height: 240,
                channels: 1,
            }),
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
    pub fn with_tables(tables: FakeTables) -> Self {
        Self {
            number: tables.updater().trust().device,
            tables: Some(tables),
            ..Self::default()
        }
    }

    /// The tables of a device that has some.
    pub const fn tables(&mut self) -> &mut FakeTables {
        self.tables.as_mut().expect("a device with tables")
    }

    /// Lets time pass; what became of the tables meanwhile.
    fn poll(&mut self, now_ms: u64) -> Option<Event> {
        let tables = self.tables.as_mut()?;
        // A number that it was given counts from now on.
        self.number = tables.updater().trust().device;
        tables.device.poll(now_ms);
        let change = tables.device.updater.take_change()?;
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
                table_bytes: (self.tables.as_ref())
                    .map_or(2_097_152, |tables| tables.updater().map().slot_bytes()),
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
            Some(tables) => {
                if let Request::Write { offset, .. } = request {
                    tables.writes.push(offset);
                }
                Device::carry_out(&mut tables.device, request, now_ms)
            }
            None => Response::Refused(Refusal::ReadOnly),
        }
    }

    fn status(&self) -> Status {
        let mut status = self.status.clone();
        status.uptime_ms = self.uptime_ms;
        status.frames.received = (self.uptime_ms * 60 / 1_000) as u32;
        if status.input.is_none() {
            status.frames.received = 0;
        }
        status.frames.shown = status.frames.received;
        if let Some(tables) = &self.tables {
            status.table = tables.updater().table();
            status.slots = tables.updater().states();
            status.mode = match tables.frames().zip(status.input) {
                None if status.table.is_some() => Mode::Compensating,
                None => Mode::PassThrough(PassThrough::NoTable),
                Some((least, input))
                    if least.channels == input.channels
                        && least.width <= input.width
                        && least.height <= input.height =>
                {
                    Mode::Compensating
                }
                Some(_) => Mode::PassThrough(PassThrough::OtherFrames),
            };
        }
        status
    }
}

/// Tables and slots are its own, the rest is made up.
impl<const W: usize, const E: usize> Device for SimDevice<W, E> {
    fn identity(&self) -> Hello {
        Hello {
            device: self.updater.trust().device,
            ..FakeDevice::default().identity()
        }
    }

    fn status(&self) -> Status {
        Status {
            table: self.updater.table(),
            slots: self.updater.states(),
            ..FakeDevice::default().status
        }
    }

    fn carry_out(&mut self, request: Request<'_>, now_ms: u64) -> Response {
        self.updater.answer(request, now_ms, &mut self.tables)
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
    pub fn line(self, baud: u32) -> FakeLine {
        let end = FakeEnd {
            session: Session::new(),
            device: self,
        };
        PacedLine::new(end, baud)
    }
}

impl FakeEnd {
    /// As after a loss of power.
    pub fn restart(&mut self) {
        self.session = Session::new();
        self.device.restart();
    }
}

impl FarEnd for FakeEnd {
    fn turn(&mut self, arrived: &[u8], now: Duration) {
        let now = now.as_millis() as u64;
        self.device.uptime_ms = now;
        let mute = self.device.tables.as_ref().is_some_and(FakeTables::is_mute);
        let arrived = if mute { &[] } else { arrived };
        self.session.receive(arrived, now, &mut self.device);
        if (self.device.tables.as_mut()).is_some_and(FakeTables::restarts) {
            self.restart();
        }
        if let Some(event) = self.device.poll(now) {
            self.session.event(&event);
        }
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
#[derive(Debug)]
pub struct FakePort {
    path: String,
    orders: Sender<Order>,
    thread: Option<JoinHandle<()>>,
}

impl FakePort {
    /// Plugs a device in.
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
    pub fn path(&self) -> &str {
        &self.path
    }

    /// What there is to see in the device, or is after this was done to it.
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

    /// Restarts the device, and waits until it has.
    pub fn restart(&self) {
        self.order(Order::Restart);
        self.look(|_| ());
    }

    /// Does something to the device.
    pub fn order(&self, order: Order) {
        // A device that has vanished takes no orders.
        let _ = self.orders.send(order);
    }
}

impl Drop for FakePort {
    fn drop(&mut self) {
        self.order(Order::Vanish);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The firmware's loop, as it were.
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
                Order::Restart => {
                    restart = true;
                    // What is ordered after it finds it done.
                    break;
                }
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
