//! Transcripts of the last transfers, for `iltm report`.

use super::Folders;
use std::fs::{self, File};
use std::io;
use std::path::PathBuf;

/// Folder of the files.
const FOLDER: &str = "transcripts";

/// How many are kept.
pub const KEPT: usize = 5;

/// Begins a transcript and removes those that are too old.
///
/// # Errors
/// What the operating system says.
pub fn begin(folders: &Folders) -> io::Result<File> {
    let folder = folders.state.join(FOLDER);
    fs::create_dir_all(&folder)?;
    for old in list(folders).into_iter().skip(KEPT - 1) {
        let _ = fs::remove_file(old);
    }
    let now = jiff::Zoned::now().strftime("%Y%m%d-%H%M%S%.3f");
    File::create(folder.join(format!("flash-{now}-{}.txt", std::process::id())))
}

/// The transcripts, the newest first.
#[must_use]
pub fn list(folders: &Folders) -> Vec<PathBuf> {
    let entries = fs::read_dir(folders.state.join(FOLDER));
    let entries = entries.into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "txt"));
    // Names begin with the time.
    files.sort();
    files.reverse();
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_five_are_kept() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folders = Folders {
            config: folder.path().to_owned(),
            state: folder.path().to_owned(),
        };
        let mut newest = Vec::new();
        for _ in 0..KEPT + 2 {
            begin(&folders).expect("writable");
            newest.insert(0, list(&folders)[0].clone());
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        newest.truncate(KEPT);
        assert_eq!(list(&folders), newest);
    }
}
