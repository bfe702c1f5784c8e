//! Files that others wrote: nothing without an end is read.

use crate::whole_file::followed;
use std::fs::{self, File, FileType};
use std::io::{self, Read};
use std::path::Path;

/// Opens a regular file or a named pipe.
///
/// # Errors
/// What the operating system says; [`io::ErrorKind::NotFound`] with the place that it points to
/// for a symbolic link to nothing; [`io::ErrorKind::InvalidInput`] for a device, which may give
/// bytes for ever or do something when it is opened.
pub fn open(path: &Path) -> io::Result<File> {
    let kind = fs::metadata(path).map_err(|error| no_target(path, error))?;
    let kind = kind.file_type();
    // The operating system has its own words for a folder.
    if kind.is_file() || kind.is_dir() || is_pipe(kind) {
        return File::open(path);
    }
    let reason = "it is neither a regular file nor a pipe";
    Err(io::Error::new(io::ErrorKind::InvalidInput, reason))
}

/// Where a symbolic link points to, if that is why there is nothing.
fn no_target(path: &Path, error: io::Error) -> io::Error {
    if error.kind() != io::ErrorKind::NotFound || !path.is_symlink() {
        return error;
    }
    let target = followed(path);
    let reason = format!("it is a link to {}, which is not there", target.display());
    io::Error::new(io::ErrorKind::NotFound, reason)
}

/// Reads a regular file or a named pipe of `most` bytes at most.
///
/// # Errors
/// Those of [`open`]; [`io::ErrorKind::FileTooLarge`] if it is longer.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let reason = format!("it is longer than {most} bytes");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, reason));
    }
    Ok(bytes)
}

/// The same, as text.
///
/// # Errors
/// Those of [`read`]; [`io::ErrorKind::InvalidData`] for what is not UTF-8.
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    let text = String::from_utf8(read(path, most)?);
    text.map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

#[cfg(unix)]
fn is_pipe(kind: FileType) -> bool {
    std::os::unix::fs::FileTypeExt::is_fifo(&kind)
}

#[cfg(not(unix))]
fn is_pipe(_: FileType) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_limit_and_no_longer_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("four");
        fs::write(&path, "1234").unwrap();
        assert_eq!(read_text(&path, 4).unwrap(), "1234");
        let error = read(&path, 3).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(error.to_string(), "it is longer than 3 bytes");
    }

    #[cfg(unix)]
    #[test]
    fn of_a_link_to_nothing_it_is_said_where_it_points_to() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("gone/file", &link).unwrap();
        let error = open(&link).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
        let target = folder.path().join("gone/file");
        let says = format!("it is a link to {}, which is not there", target.display());
        assert_eq!(error.to_string(), says);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_not_opened_and_a_pipe_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let zero = folder.path().join("zero");
        std::os::unix::fs::symlink("/dev/zero", &zero).unwrap();
        assert_eq!(open(&zero).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let writer = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::write(pipe, "bytes")
        });
        assert_eq!(read(&pipe, 5).unwrap(), b"bytes");
        writer.join().unwrap().unwrap();
    }
}
