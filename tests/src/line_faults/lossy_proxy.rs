//! Lossy proxy: a port that damages frames, before a real one.

use super::faults::{FaultCounts, Faults};
use super::lossy_line::LossyLine;
use iltm::device::{DeviceError, Line, Port};
use serialport::{SerialPort, TTYPort};
use std::io::{self, ErrorKind, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Longest that one direction waits for the other: what the proxy adds to the time of a
/// frame, once in each direction.
const ROUND: Duration = Duration::from_millis(1);

/// Bytes that wait for a client that does not read. More are lost, as on a line
/// without flow control.
const MOST_WAITING: usize = 1 << 16;

/// Least time between the last frame and the end of the pseudo-terminal: the kernel
/// hands bytes over a little after they were written.
const HANDED_OVER: Duration = Duration::from_millis(50);

/// Longest that a client may take to read what came before the line was unplugged.
const LONGEST_TO_READ: Duration = Duration::from_secs(2);

/// A pseudo-terminal that stands before a real port and does to frames what
/// [`Faults`] say, for any client program:
///
/// ```no_run
/// use iltm_tests::line_faults::{FaultRates, Faults, LossyProxy};
///
/// let faults = Faults::both_ways(FaultRates::evenly(100), 1);
/// let proxy = LossyProxy::start("/dev/ttyUSB0", 115_200, faults)?;
/// println!("iltm status --port {}", proxy.path());
/// # std::thread::park();
/// # Ok::<(), iltm::device::DeviceError>(())
/// ```
///
/// When the line is unplugged by order, when the real port goes, or when this is
/// dropped, the pseudo-terminal goes too, and the client finds its port gone. Clients
/// may come and go meanwhile.
#[derive(Debug)]
pub struct LossyProxy {
    path: String,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    is_over: AtomicBool,
    counts: Mutex<(FaultCounts, FaultCounts)>,
}

impl LossyProxy {
    /// Stands before the port with this name.
    ///
    /// # Errors
    /// [`DeviceError::Open`] if it cannot be opened, or if the system has no
    /// pseudo-terminal or thread left.
    pub fn start(port: &str, baud: u32, faults: Faults) -> Result<Self, DeviceError> {
        Self::before(Port::open(port, baud)?, faults)
    }

    /// Stands before any line.
    ///
    /// # Errors
    /// [`DeviceError::Open`] if the system has no pseudo-terminal or thread left.
    pub fn before(line: impl Line + Send + 'static, faults: Faults) -> Result<Self, DeviceError> {
        let open = |source| DeviceError::Open {
            source,
            holder: None,
        };
        let (mut ours, theirs) = TTYPort::pair().map_err(open)?;
        ours.set_timeout(ROUND).map_err(open)?;
        let path = theirs.name().unwrap_or_default();
        let shared = Arc::new(Shared::default());
        let thread = thread::Builder::new()
            .name("lossy proxy".to_owned())
            .spawn({
                let shared = Arc::clone(&shared);
                move || {
                    // `theirs` stays open, or ours would end whenever a client closes it.
                    // However this ends, the client will find its port gone.
                    let _ = carry(&mut ours, LossyLine::new(line, faults), &shared);
                    wait_for_reader(&theirs, &shared);
                    shared.is_over.store(true, Ordering::Relaxed);
                }
            });
        let thread = thread.map_err(|error| open(error.into()))?;
        Ok(Self {
            path,
            shared,
            thread: Some(thread),
        })
    }

    /// Where a client finds it.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Whether it has gone: unplugged by order, or with the real port.
    pub fn is_over(&self) -> bool {
        self.shared.is_over.load(Ordering::Relaxed)
    }

    /// What became of frames from host to device.
    pub fn to_device(&self) -> FaultCounts {
        self.counts().0
    }

    /// What became of frames from device to host.
    pub fn to_host(&self) -> FaultCounts {
        self.counts().1
    }

    fn counts(&self) -> (FaultCounts, FaultCounts) {
        let counts = self.shared.counts.lock();
        *counts.unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for LossyProxy {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Carries bytes in both directions until one end has gone.
fn carry(client: &mut TTYPort, mut line: LossyLine<impl Line>, shared: &Shared) -> io::Result<()> {
    let mut bytes = [0; 4_096];
    let mut waiting = Vec::new();
    while !shared.is_over.load(Ordering::Relaxed) {
        let count = some(client.read(&mut bytes))?;
        if count > 0 {
            line.write(&bytes[..count])?;
        }
        let count = line.read(&mut bytes, ROUND)?;
        if waiting.len() < MOST_WAITING {
            waiting.extend(&bytes[..count]);
        }
        if !waiting.is_empty() {
            let count = some(client.write(&waiting))?;
            waiting.drain(..count);
        }
        let mut counts = shared.counts.lock().unwrap_or_else(PoisonError::into_inner);
        *counts = (line.to_device(), line.to_host());
    }
    Ok(())
}

/// Gives the client time to read what has come: a pseudo-terminal that ends takes the
/// bytes along that nobody has read yet.
fn wait_for_reader(theirs: &TTYPort, shared: &Shared) {
    let since = Instant::now();
    let is_unread = || theirs.bytes_to_read().is_ok_and(|count| count > 0);
    while !shared.is_over.load(Ordering::Relaxed)
        && (since.elapsed() < HANDED_OVER || (is_unread() && since.elapsed() < LONGEST_TO_READ))
    {
        thread::sleep(ROUND);
    }
}

/// Nothing to read or no room to write is no reason to end.
fn some(count: io::Result<usize>) -> io::Result<usize> {
    match count {
        Err(error) if is_nothing(&error) => Ok(0),
        other => other,
    }
}

fn is_nothing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock
    )
}
