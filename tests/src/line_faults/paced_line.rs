//! Paced line: a serial line of a given speed, on a clock of its own.

use super::wire::Wire;
use iltm::device::Line;
use std::io;
use std::time::{Duration, Instant};

/// The device at the far end of a simulated line. The shape is that of
/// [`iltm_runtime::link::Session`], and of a firmware's loop around it.
pub trait FarEnd {
    /// One round of its loop: takes the bytes that have arrived since the last, and
    /// does what is to be done at `now`, counted from the start of the line.
    fn turn(&mut self, arrived: &[u8], now: Duration);

    /// Bytes that it wants to send.
    fn pending(&self) -> &[u8];

    /// That the first `count` of these have gone to the line.
    fn sent(&mut self, count: usize);
}

/// A serial line in memory between a host (this is its [`Line`]) and a device: each
/// byte takes ten bits of time, both ways at once.
///
/// The clock is virtual. It stands still while host or device compute, and goes on
/// where the host waits: in a read, until bytes arrive or the wait is over; in a write,
/// while 4,096 bytes wait to be sent already. So rates come out exact and the same
/// each time, and timeouts take no time:
///
/// ```
/// use iltm::device::Line;
/// use iltm_tests::line_faults::{FarEnd, PacedLine};
/// use std::time::Duration;
///
/// /// Sends back what it hears.
/// #[derive(Default)]
/// struct Echo(Vec<u8>);
/// impl FarEnd for Echo {
///     fn turn(&mut self, arrived: &[u8], _now: Duration) {
///         self.0.extend(arrived);
///     }
///     fn pending(&self) -> &[u8] {
///         &self.0
///     }
///     fn sent(&mut self, count: usize) {
///         self.0.drain(..count);
///     }
/// }
///
/// let mut line = PacedLine::new(Echo::default(), 921_600);
/// line.write(b"hello")?;
/// let mut heard = Vec::<u8>::new();
/// while heard.len() < 5 {
///     let mut bytes = [0; 64];
///     let count = line.read(&mut bytes, Duration::from_secs(1))?;
///     assert!(count > 0, "nothing for a second");
///     heard.extend(&bytes[..count]);
/// }
/// assert_eq!(heard, b"hello");
/// println!("{} bytes in {:?}", line.bytes_to_device(), line.elapsed());
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// Goodput is the bytes that matter over [`elapsed`](Self::elapsed), to be compared
/// with a tenth of the baud.
#[derive(Debug)]
pub struct PacedLine<F> {
    far_end: F,
    start: Instant,
    /// Nanoseconds since then.
    now: u64,
    next_turn: u64,
    period: u64,
    to_device: Wire,
    to_host: Wire,
    /// What has arrived for a turn; kept for its memory.
    arrived: Vec<u8>,
}

/// What a read takes that finds nothing and shall not wait: a host that does nothing
/// else lets time pass as well.
const SYSTEM_CALL: u64 = 1_000;

/// Longest that one read waits.
const LONGEST_WAIT: Duration = Duration::from_hours(1);

impl<F: FarEnd> PacedLine<F> {
    /// A line of so many bits a second (at least 1). The device takes a turn every
    /// .1 ms, at first at 0.
    pub fn new(far_end: F, baud: u32) -> Self {
        Self {
            far_end,
            start: Instant::now(),
            now: 0,
            next_turn: 0,
            period: 100_000,
            to_device: Wire::new(baud),
            to_host: Wire::new(baud),
            arrived: Vec::new(),
        }
    }

    /// Lets the device take a turn once in a `period` (at least 1 us): how long its
    /// loop may take, and how finely its answers are timed. Turns are what a simulated
    /// second costs.
    pub fn with_turns_every(mut self, period: Duration) -> Self {
        self.period = nanoseconds(period).max(1_000);
        self
    }

    /// Lets every byte arrive so much later, both ways, as behind a USB adapter that
    /// collects bytes before it passes them on.
    pub fn with_latency(mut self, latency: Duration) -> Self {
        let latency = nanoseconds(latency.min(LONGEST_WAIT));
        (self.to_device.latency, self.to_host.latency) = (latency, latency);
        self
    }

    /// Time since the start of the line, by its clock.
    pub const fn elapsed(&self) -> Duration {
        Duration::from_nanos(self.now)
    }

    /// Bytes that the device has been given.
    pub const fn bytes_to_device(&self) -> u64 {
        self.to_device.carried
    }

    /// Bytes that the host has read.
    pub const fn bytes_to_host(&self) -> u64 {
        self.to_host.carried
    }

    /// The device.
    pub const fn far_end(&self) -> &F {
        &self.far_end
    }

    /// The device, to do something to it.
    pub const fn far_end_mut(&mut self) -> &mut F {
        &mut self.far_end
    }

    /// Lets time pass up to `time`; the device takes its turns.
    fn run(&mut self, time: u64) {
        while self.next_turn <= time {
            self.now = self.next_turn;
            self.next_turn = self.next_turn.saturating_add(self.period);
            self.turn();
        }
        self.now = self.now.max(time);
    }

    fn turn(&mut self) {
        self.arrived.clear();
        while let Some(byte) = self.to_device.pop(self.now) {
            self.arrived.push(byte);
        }
        let now = Duration::from_nanos(self.now);
        self.far_end.turn(&self.arrived, now);
        loop {
            let count = self.to_host.push(self.far_end.pending(), self.now);
            if count == 0 {
                break;
            }
            self.far_end.sent(count);
        }
    }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

impl<F: FarEnd> Line for PacedLine<F> {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let wait = nanoseconds(wait.min(LONGEST_WAIT)).max(SYSTEM_CALL);
        let end = self.now.saturating_add(wait);
        loop {
            let mut count = 0;
            for byte in bytes.iter_mut() {
                let Some(arrived) = self.to_host.pop(self.now) else {
                    break;
                };
                *byte = arrived;
                count += 1;
            }
            if count > 0 || self.now >= end {
                return Ok(count);
            }
            let next = self.to_host.arrives().unwrap_or(end);
            // A turn may bring what arrives before all else.
            self.run(
                next.max(self.now)
                    .min(end)
                    .min(self.next_turn.max(self.now)),
            );
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut rest = bytes;
        loop {
            let count = self.to_device.push(rest, self.now);
            rest = rest.get(count..).unwrap_or_default();
            let Some(leaves) = self.to_device.leaves().filter(|_| !rest.is_empty()) else {
                return Ok(());
            };
            self.run(leaves.max(self.now));
        }
    }

    fn now(&self) -> Instant {
        self.start + Duration::from_nanos(self.now)
    }
}
