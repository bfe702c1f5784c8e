//! Serial ports, and other lines that carry bytes both ways.

use super::DeviceError;
use serialport::{ClearBuffer, SerialPort};
use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

/// Speed of a serial line unless something else is said, bits a second.
pub const BAUD: u32 = 115_200;

/// Bytes both ways: a serial port, or what stands for one in a test.
pub trait Line {
    /// Reads what is there, or waits for it, at most as long as `wait`; 0 if
    /// nothing came.
    ///
    /// # Errors
    /// What the operating system says if the line is not there any more.
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize>;

    /// Writes all.
    ///
    /// # Errors
    /// What the operating system says if the line is not there any more.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// The time by which whoever uses the line measures its own patience. A simulated
    /// line has a clock of its own, which goes on while something is waited for: an
    /// hour on it takes as long as there is to compute.
    fn now(&self) -> Instant {
        Instant::now()
    }
}

impl<L: Line + ?Sized> Line for &mut L {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        (**self).read(bytes, wait)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).write(bytes)
    }

    fn now(&self) -> Instant {
        (**self).now()
    }
}

/// A serial port.
#[derive(Debug)]
pub struct Port {
    port: Box<dyn SerialPort>,
}

impl Port {
    /// Opens a port, which nobody else can open meanwhile.
    ///
    /// # Errors
    /// [`DeviceError::Open`].
    pub fn open(path: &str, baud: u32) -> Result<Self, DeviceError> {
        let port = serialport::new(path, baud)
            .timeout(Duration::from_millis(100))
            .open();
        let port = port.map_err(|source| DeviceError::Open { source })?;
        // What waits there was said to somebody else. Not every port can do this,
        // and frames are told from the rest anyway.
        let _ = port.clear(ClearBuffer::All);
        Ok(Self { port })
    }
}

impl Port {
    /// Goes on at another speed.
    ///
    /// # Errors
    /// [`DeviceError::Open`] if the port cannot do it.
    pub fn set_speed(&mut self, baud: u32) -> Result<(), DeviceError> {
        let set = self.port.set_baud_rate(baud);
        set.map_err(|source| DeviceError::Open { source })
    }
}

/// Longest that one write may wait for a line that does not take bytes.
const WRITE_WAIT: Duration = Duration::from_secs(1);

impl Line for Port {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.port.set_timeout(wait)?;
        match io::Read::read(&mut self.port, bytes) {
            // A port that has been unplugged reads as an end of file.
            Ok(0) if !bytes.is_empty() => Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => Ok(count),
            Err(error) if is_nothing(&error) => Ok(0),
            Err(error) => Err(error),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.set_timeout(WRITE_WAIT)?;
        match io::Write::write_all(&mut self.port, bytes) {
            // The answer will be missed: nothing is gained by failing here.
            Err(error) if is_nothing(&error) => Ok(()),
            done => done,
        }
    }
}

/// Whether this only says that nothing came, or went, in time.
fn is_nothing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock
    )
}
