//! Temporary files and folders of this process, so that a process that is stopped can remove
//! them, and steps that a stop must not fall into.
//!
//! A program that handles ctrl-C calls [`remove_all`] before it ends the process. Until then
//! every temporary file and folder is on a list; what gives it its final name takes it off, in
//! one [`step`].

use std::cell::Cell;
use std::fs;
use std::io;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;
use tempfile::TempDir;

/// Held during each step; taken for good by [`remove_all`].
static STEP: Mutex<()> = Mutex::new(());

/// What is not finished.
static LIST: Mutex<Vec<Entry>> = Mutex::new(Vec::new());

thread_local! {
    /// Whether this thread is inside a step: steps may lie in one another.
    static INSIDE: Cell<bool> = const { Cell::new(false) };
}

/// How often a folder is removed that another thread still writes into, and the wait between.
const ATTEMPTS: u32 = 100;
const WAIT: Duration = Duration::from_millis(10);

#[derive(Clone, PartialEq, Eq, Debug)]
enum Entry {
    /// A temporary file or folder.
    Temporary(PathBuf),
    /// A folder that this process has made under its final name: removed if it is empty.
    Made(PathBuf),
}

/// A temporary file or folder on the list; dropped, it is off it.
#[derive(Debug)]
pub(crate) struct Listed(Entry);

impl Listed {
    /// Makes something temporary and puts it on the list; `path` says where it is.
    ///
    /// # Errors
    /// Those of `make`.
    pub(crate) fn make<T>(
        make: impl FnOnce() -> io::Result<T>,
        path: impl FnOnce(&T) -> &Path,
    ) -> io::Result<(T, Self)> {
        step(|| {
            let made = make()?;
            let entry = Entry::Temporary(path(&made).to_owned());
            list().push(entry.clone());
            Ok((made, Self(entry)))
        })
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        let mut list = list();
        if let Some(at) = list.iter().position(|entry| *entry == self.0) {
            list.swap_remove(at);
        }
    }
}

fn list() -> MutexGuard<'static, Vec<Entry>> {
    LIST.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does work that [`remove_all`] waits for. Keep it short: a person who stops the program
/// waits as well.
pub fn step<R>(work: impl FnOnce() -> R) -> R {
    if INSIDE.get() {
        return work();
    }
    let held = STEP.lock().unwrap_or_else(PoisonError::into_inner);
    INSIDE.set(true);
    let result = work();
    INSIDE.set(false);
    drop(held);
    result
}

/// Makes a folder, and those that it lies in. [`remove_all`] removes those that are still empty.
///
/// # Errors
/// What the system says.
pub fn make_folder(folder: &Path) -> io::Result<()> {
    let missing: Vec<&Path> = folder
        .ancestors()
        .take_while(|at| !at.as_os_str().is_empty() && !at.exists())
        .collect();
    step(|| {
        fs::create_dir_all(folder)?;
        let made = missing.iter().rev().map(|at| Entry::Made((*at).to_owned()));
        list().extend(made);
        Ok(())
    })
}

/// Removes all that is not finished, waiting for steps that go on. No other step begins after
/// it: the process is about to end. Not to be called inside a step.
pub fn remove_all() {
    mem::forget(STEP.lock().unwrap_or_else(PoisonError::into_inner));
    let listed = mem::take(&mut *list());
    listed.iter().rev().for_each(remove);
}

/// Removes the folders made by [`make_folder`] that have remained empty: what was to go there
/// has failed.
pub fn remove_empty_folders() {
    let made = |entry: &mut Entry| matches!(entry, Entry::Made(_));
    let made: Vec<Entry> = list().extract_if(.., made).collect();
    made.iter().rev().for_each(remove);
}

/// Whoever ends has no use for an error here.
fn remove(entry: &Entry) {
    match entry {
        Entry::Made(folder) => {
            let _ = fs::remove_dir(folder);
        }
        Entry::Temporary(path) if path.is_dir() => {
            for _ in 0..ATTEMPTS {
                if fs::remove_dir_all(path).is_ok() || !path.exists() {
                    break;
                }
                thread::sleep(WAIT);
            }
        }
        Entry::Temporary(path) => {
            let _ = fs::remove_file(path);
        }
    }
}

/// A temporary folder, gone when it is dropped or the process is stopped.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: TempDir,
    _listed: Listed,
}

impl TemporaryFolder {
    /// An empty one in the system's place for such folders.
    ///
    /// # Errors
    /// What the system says.
    pub fn new() -> io::Result<Self> {
        Self::made(tempfile::tempdir)
    }

    /// An empty one in a folder, with a name that begins like this.
    ///
    /// # Errors
    /// What the system says.
    pub fn within(folder: &Path, prefix: &str) -> io::Result<Self> {
        Self::made(|| tempfile::Builder::new().prefix(prefix).tempdir_in(folder))
    }

    fn made(make: impl FnOnce() -> io::Result<TempDir>) -> io::Result<Self> {
        let (folder, listed) = Listed::make(make, TempDir::path)?;
        Ok(Self {
            folder,
            _listed: listed,
        })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}
