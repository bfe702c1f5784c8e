//! Atomic files: written under another name, then renamed, so that a file is there whole or not at all.

use crate::unfinished::{Listed, step};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Why a file could not be written or put in its place.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What the operating system says.
    pub source: io::Error,
}

impl From<FileError> for io::Error {
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
/// [`finish`](Self::finish) gives it its name, in one step, over a file that may be there.
/// Dropped before that, it leaves nothing behind and the other file as it was. A symbolic link
/// is followed. What is no regular file, a device or a named pipe, is never replaced: it is
/// written into at once.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    target: Target,
}

#[derive(Debug)]
enum Target {
    Temporary(NamedTempFile, Listed),
    Device(File),
}

impl WholeFile {
    /// Begins a file that is to be called `path`.
    ///
    /// # Errors
    /// [`FileError`] if nothing can be created in its folder, if `path` is a folder, or if what
    /// is there cannot be written into.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let failed = |source: io::Error| FileError {
            path: path.to_owned(),
            source,
        };
        let place = check_place(path)?;
        match fs::metadata(&place) {
            Ok(there) if !there.is_file() => {
                let opened = OpenOptions::new().write(true).open(&place);
                Ok(Self {
                    path: place,
                    target: Target::Device(opened.map_err(failed)?),
                })
            }
            _ => {
                let folder = folder_of(&place);
                // The temporary name that the error carries helps nobody.
                let made = Listed::make(|| temporary(folder), NamedTempFile::path);
                let (file, listed) = made.map_err(|error| failed(error.kind().into()))?;
                Ok(Self {
                    path: place,
                    target: Target::Temporary(file, listed),
                })
            }
        }
    }

    /// What is to be written to.
    pub fn file(&mut self) -> &mut File {
        match &mut self.target {
            Target::Temporary(file, _) => file.as_file_mut(),
            Target::Device(file) => file,
        }
    }

    /// Gives the file its name; it stays open.
    ///
    /// # Errors
    /// [`FileError`] if that fails; nothing is left behind then.
    pub fn finish(self) -> Result<File, FileError> {
        let Self { path, target } = self;
        match target {
            Target::Device(file) => Ok(file),
            Target::Temporary(file, listed) => step(|| {
                let named = file.persist(&path);
                drop(listed);
                named.map_err(|error| FileError {
                    path,
                    source: error.error,
                })
            }),
        }
    }
}

/// Whether a file can be put in a place: it is no folder, and its folder is there. Returns the
/// place that symbolic links lead to.
///
/// # Errors
/// [`FileError`].
pub fn check_place(path: &Path) -> Result<PathBuf, FileError> {
    let failed = |kind, reason: String| FileError {
        path: path.to_owned(),
        source: io::Error::new(kind, reason),
    };
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => {
            let reason = "it is a folder".to_owned();
            return Err(failed(io::ErrorKind::IsADirectory, reason));
        }
        // A link to a pipe without a name leads to no place.
        Ok(there) if !there.is_file() => return Ok(path.to_owned()),
        _ => {}
    }
    let followed = followed(path);
    let folder = folder_of(&followed);
    match fs::metadata(folder) {
        Ok(there) if there.is_dir() => return Ok(followed),
        Err(source) if source.kind() != io::ErrorKind::NotFound => {
            let path = path.to_owned();
            return Err(FileError { path, source });
        }
        _ => {}
    }
    let link = if path.is_symlink() {
        format!("it is a link to {}, and ", followed.display())
    } else {
        String::new()
    };
    let reason = format!("{link}there is no folder {}", folder.display());
    Err(failed(io::ErrorKind::NotFound, reason))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".iltm-").suffix(".part");
    // As for any file, the process's mask decides who may read it; temporary
    // files are otherwise for their owner only.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// Most symbolic links that lead to one another, as Linux has it.
const MOST_LINKS: usize = 40;

/// The place that symbolic links lead to, whether something is there or not.
pub(crate) fn followed(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&path) {
            // An absolute target replaces the whole path.
            Ok(target) => path = path.parent().unwrap_or(Path::new("")).join(target),
            Err(_) => break,
        }
    }
    path
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

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_a_named_pipe_is_written_into() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("there")).unwrap();
        symlink("there/file", at("dangling")).unwrap();
        symlink("dangling", at("link")).unwrap();
        for text in ["new", "newer"] {
            write(&at("link"), text.as_bytes()).unwrap();
            assert_eq!(std::fs::read_to_string(at("there/file")).unwrap(), text);
            assert!(at("link").is_symlink() && at("dangling").is_symlink());
        }
        let made = std::process::Command::new("mkfifo")
            .arg(at("pipe"))
            .status();
        assert!(made.unwrap().success());
        let reader = std::thread::spawn({
            let pipe = at("pipe");
            move || std::fs::read(pipe).unwrap()
        });
        write(&at("pipe"), b"frames").unwrap();
        assert_eq!(reader.join().unwrap(), b"frames");
        let kind = std::fs::metadata(at("pipe")).unwrap().file_type();
        assert!(kind.is_fifo());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_pipe_without_a_name_is_written_into() {
        use std::io::Read;
        use std::os::fd::AsRawFd;
        let (mut reader, writer) = io::pipe().unwrap();
        // What /dev/stdout leads to.
        let path = format!("/proc/self/fd/{}", writer.as_raw_fd());
        write(Path::new(&path), b"frames").unwrap();
        drop(writer);
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes, b"frames");
    }

    #[test]
    fn a_folder_in_the_place_of_a_file_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let error = WholeFile::create(folder.path()).unwrap_err();
        assert_eq!(error.source.kind(), io::ErrorKind::IsADirectory);
    }

    #[cfg(unix)]
    #[test]
    fn of_a_link_into_a_folder_that_is_not_there_both_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("gone/file", &link).unwrap();
        let error = WholeFile::create(&link).unwrap_err();
        let gone = folder.path().join("gone");
        let says = format!(
            "{}: it is a link to {}, and there is no folder {}",
            link.display(),
            gone.join("file").display(),
            gone.display()
        );
        assert_eq!(error.to_string(), says);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let error = WholeFile::create(Path::new("/no/such/folder/video.y4m")).unwrap_err();
        assert!(error.to_string().contains("/no/such/folder/video.y4m"));
    }
}
