//! A serial line as a socket of the emulator's, which takes bytes faster than a
//! terminal.

use iltm::device::Line;
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

/// The host's end.
#[derive(Debug)]
pub struct Socket(UnixStream);

impl Socket {
    /// Waits for the emulator to make the socket.
    ///
    /// # Panics
    /// If it has not in so long.
    #[must_use]
    pub fn connect(path: &Path, patience: Duration) -> Self {
        let end = Instant::now() + patience;
        loop {
            match UnixStream::connect(path) {
                Ok(stream) => return Self(stream),
                Err(error) => assert!(Instant::now() < end, "no line: {error}"),
            }
            thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Line for Socket {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        let wait = wait.max(Duration::from_millis(1));
        self.0.set_read_timeout(Some(wait))?;
        match self.0.read(bytes) {
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Ok(0)
            }
            other => other,
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}
