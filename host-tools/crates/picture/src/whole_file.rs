//! Atomic files: written under another name, then renamed, so that a file is there whole or not at all.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Why a file could not be written or put in its place.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What the operating system says.
    pub source: std::io::Error,
}

impl From<FileError> for std::io::Error {
    fn from(error: FileError) -> Self {
        error.source
    }
}

/// Writes a file whole or not at all.
///
/// # Errors
/// [`FileError`]; a file that was there is as it was then.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let mut whole = WholeFile::create(path)?;
    let written = whole.file().write_all(bytes);
    written.map_err(|source| FileError {
        path: path.to_owned(),
        source,
    })?;
    whole.finish().map(drop)
}

/// A file that is written under a temporary name beside its own.
///
/// [`finish`](Self::finish) gives it its name, in one step, over a file that may
/// be there. Dropped before that, it leaves nothing behind and the other file as
/// it was.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    file: NamedTempFile,
}

impl WholeFile {
    /// Begins a file that is to be called `path`.
    ///
    /// # Errors
    /// [`FileError`] if nothing can be created in its folder.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".iltm-").suffix(".part");
        // As for any file, the process's mask decides who may read it; temporary
        // files are otherwise for their owner only.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        match builder.tempfile_in(folder) {
            Ok(file) => Ok(Self {
                path: path.to_owned(),
                file,
            }),
            // The temporary name that the error carries helps nobody.
            Err(error) => Err(FileError {
                path: path.to_owned(),
                source: error.kind().into(),
            }),
        }
    }

    /// What is to be written to.
    pub fn file(&mut self) -> &mut File {
        self.file.as_file_mut()
    }

    /// Gives the file its name; it stays open.
    ///
    /// # Errors
    /// [`FileError`] if that fails; nothing is left behind then.
    pub fn finish(self) -> Result<File, FileError> {
        match self.file.persist(&self.path) {
            Ok(file) => Ok(file),
            Err(error) => Err(FileError {
                path: self.path,
                source: error.error,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_not_finished_leaves_the_old_one_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("video.y4m");
        std::fs::write(&path, "old").unwrap();
        let mut file = WholeFile::create(&path).unwrap();
        file.file().write_all(b"half").unwrap();
        drop(file);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let mut file = WholeFile::create(&path).unwrap();
        file.file().write_all(b"new").unwrap();
        file.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let error = WholeFile::create(Path::new("/no/such/folder/video.y4m")).unwrap_err();
        assert!(error.to_string().contains("/no/such/folder/video.y4m"));
    }
}
