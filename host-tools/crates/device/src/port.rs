//! Serial ports, and other lines that carry bytes both ways.

use super::DeviceError;
use serialport::{ClearBuffer, SerialPort};
use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;
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
        let port = port.map_err(|source| DeviceError::Open {
            source,
            holder: holder(Path::new(path)),
        })?;
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
        set.map_err(|source| DeviceError::Open {
            source,
            holder: None,
        })
    }
}

/// The other program that has a file open, where `/proc` tells: its name and number.
fn holder(path: &Path) -> Option<String> {
    let path = path.canonicalize().ok()?;
    let own = std::process::id().to_string();
    let processes = fs::read_dir("/proc").ok()?.flatten();
    let mut holding = processes.filter(|process| {
        let number = process.file_name();
        let is_other = number.to_str().is_some_and(|number| {
            number != own && number.bytes().all(|byte| byte.is_ascii_digit())
        });
        let open = |process: &fs::DirEntry| {
            let mut files = fs::read_dir(process.path().join("fd")).ok()?.flatten();
            files.find(|file| fs::read_link(file.path()).is_ok_and(|open| open == path))
        };
        is_other && open(process).is_some()
    });
    let process = holding.next()?;
    let name = fs::read_to_string(process.path().join("comm")).ok()?;
    Some(format!(
        "{} (process {})",
        name.trim().escape_debug(),
        process.file_name().display()
    ))
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

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::process::{Command, Stdio};

    #[test]
    fn only_a_line_that_is_late_says_nothing() {
        for kind in [
            ErrorKind::TimedOut,
            ErrorKind::Interrupted,
            ErrorKind::WouldBlock,
        ] {
            assert!(is_nothing(&kind.into()), "{kind}");
        }
        for kind in [
            ErrorKind::BrokenPipe,
            ErrorKind::UnexpectedEof,
            ErrorKind::Other,
        ] {
            assert!(!is_nothing(&kind.into()), "{kind}");
        }
    }

    #[test]
    fn the_program_that_has_a_file_open_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("port");
        let file = fs::File::create(&path).expect("writable");
        assert_eq!(holder(&path), None, "this process alone");
        let mut sleep = Command::new("sleep");
        let sleep = sleep.arg("60").stdin(Stdio::from(file)).spawn();
        let mut sleep = sleep.expect("sleep is everywhere");
        let held = holder(&path);
        sleep.kill().expect("it runs");
        sleep.wait().expect("killed");
        assert_eq!(held, Some(format!("sleep (process {})", sleep.id())));
    }
}
