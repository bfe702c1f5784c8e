//! Watch on a file that is read again when it changes.

use iltm_picture::foreign_file;
use std::fs;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, SystemTime};

/// Time between two looks at the file.
const PERIOD: Duration = Duration::from_millis(100);

/// What tells a file from its earlier self.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Stamp {
    changed: Option<SystemTime>,
    bytes: u64,
    /// Another file under the same name has another number.
    number: u64,
}

impl Stamp {
    fn of(path: &Path) -> Option<Self> {
        let metadata = fs::metadata(path).ok()?;
        Some(Self {
            changed: metadata.modified().ok(),
            bytes: metadata.len(),
            number: number(&metadata),
        })
    }
}

#[cfg(unix)]
fn number(metadata: &fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(metadata)
}

#[cfg(not(unix))]
fn number(_: &fs::Metadata) -> u64 {
    0
}

/// Watches a file from its own thread until it is dropped.
#[derive(Debug)]
pub struct FileWatch {
    changed: Receiver<Vec<u8>>,
    // Dropped with the watch, which ends the thread.
    #[allow(dead_code, reason = "the watching ends when it is dropped")]
    alive: Sender<()>,
}

impl FileWatch {
    /// Reads the file of `most` bytes at most, and watches it from then on.
    ///
    /// # Errors
    /// What reading it gives.
    pub fn read(path: &Path, most: u64) -> Result<(Vec<u8>, Self), std::io::Error> {
        // The stamp is older than the bytes: a change in between is read again.
        let stamp = Stamp::of(path);
        let bytes = foreign_file::read(path, most)?;
        let (send, changed) = channel();
        let (alive, ended) = channel();
        let path = path.to_owned();
        thread::spawn(move || watch(&path, most, stamp, &send, &ended));
        Ok((bytes, Self { changed, alive }))
    }

    /// The file's newest bytes, once, if it has changed and stands still.
    #[must_use]
    pub fn newer(&self) -> Option<Vec<u8>> {
        self.changed.try_iter().last()
    }
}

fn watch(
    path: &Path,
    most: u64,
    mut known: Option<Stamp>,
    send: &Sender<Vec<u8>>,
    ended: &Receiver<()>,
) {
    let mut before = known;
    while ended.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
        let now = Stamp::of(path);
        // Read once it is the same at two looks: a copy that still grows is none. A file
        // that is gone may be about to be replaced.
        let still = now == before && now != known;
        before = now;
        if !still || now.is_none() {
            continue;
        }
        let Ok(bytes) = foreign_file::read(path, most) else {
            continue;
        };
        // Written to while it was read: the next looks will tell.
        if Stamp::of(path) != now {
            continue;
        }
        known = now;
        if send.send(bytes).is_err() {
            break;
        }
    }
}
