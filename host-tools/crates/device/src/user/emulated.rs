//! Ports of emulated boards that run now.
//!
//! A pseudo-terminal is in no list of the system. Whoever emulates a board keeps a
//! locked file with its port here while it runs; a file that nobody has locked is left
//! over from a process that was killed.

use super::Folders;
use iltm_picture::WholeFile;
use serde::{Deserialize, Serialize};
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Write};
use std::path::PathBuf;

/// Folder of the files.
const FOLDER: &str = "emulated";

#[derive(Serialize, Deserialize)]
struct BoardEntry {
    port: String,
    board: String,
}

/// A board that others find until this is dropped.
#[derive(Debug)]
pub struct BoardRegistration {
    path: PathBuf,
    _locked: File,
}

impl Drop for BoardRegistration {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

/// Has others find a board.
///
/// # Errors
/// What the operating system says.
pub fn register(folders: &Folders, port: &str, board: &str) -> io::Result<BoardRegistration> {
    let folder = folders.state.join(FOLDER);
    fs::create_dir_all(&folder)?;
    let entry = BoardEntry {
        port: port.to_owned(),
        board: board.to_owned(),
    };
    let name = format!("{}-{:08x}.json", std::process::id(), fastrand::u32(..));
    let path = folder.join(name);
    // Locked before it has its name: whoever sees it finds it locked.
    let mut whole = WholeFile::create(&path)?;
    whole.file().lock()?;
    whole
        .file()
        .write_all(serde_json::to_string(&entry)?.as_bytes())?;
    Ok(BoardRegistration {
        path,
        _locked: whole.finish()?,
    })
}

/// Port and board of each that runs; files of others are removed.
#[must_use]
pub fn registered(folders: &Folders) -> Vec<(String, String)> {
    let Ok(entries) = fs::read_dir(folders.state.join(FOLDER)) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for entry in entries.flatten() {
        let path = entry.path();
        if path.extension().is_none_or(|extension| extension != "json") {
            continue;
        }
        let Ok(mut file) = File::open(&path) else {
            continue;
        };
        match file.try_lock_shared() {
            Err(TryLockError::WouldBlock) => {
                let mut text = String::new();
                let read = file.read_to_string(&mut text);
                let entry = serde_json::from_str::<BoardEntry>(&text);
                if let (Ok(_), Ok(entry)) = (read, entry) {
                    found.push((entry.port, entry.board));
                }
            }
            // Nobody holds it any more.
            Ok(()) => {
                let _ = fs::remove_file(&path);
            }
            Err(TryLockError::Error(_)) => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_is_found_while_it_runs_and_what_a_killed_one_left_is_removed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folders = Folders {
            config: folder.path().to_owned(),
            state: folder.path().to_owned(),
        };
        assert!(registered(&folders).is_empty());
        let running = register(&folders, "/dev/pts/9", "mps2-an500").expect("writable");
        let left = folder.path().join(FOLDER).join("1-00000000.json");
        fs::write(&left, "{\"port\":\"/dev/pts/8\",\"board\":\"x\"}").expect("writable");
        let boards = [("/dev/pts/9".to_owned(), "mps2-an500".to_owned())];
        assert_eq!(registered(&folders), boards);
        assert!(!left.exists());
        drop(running);
        assert!(registered(&folders).is_empty());
    }
}
