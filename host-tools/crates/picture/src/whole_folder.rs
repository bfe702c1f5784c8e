//! Atomic folders: written under another name, then renamed, so that a folder is there
//! whole or not at all.

use crate::unfinished::{Listed, make_folder, step};
use crate::whole_file::{self, followed};
use crate::{FileError, Picture, png};
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Why a folder could not be written.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// There is something in its place.
    #[error("{}: it is there already, and not empty", path.display())]
    Taken {
        /// The folder.
        path: PathBuf,
    },
    /// It would be replaced, and holds something that another command or a person made.
    #[error("{}: it holds {name}, which this command does not make", path.display())]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// What it holds.
        name: String,
    },
    /// A file or folder could not be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

impl FolderError {
    /// Says of which file or folder an error of the system is.
    pub fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }
}

/// A folder that is written under a temporary name beside its own.
///
/// [`finish`](Self::finish) gives it its name, in one step. Dropped before that, it
/// leaves nothing behind.
#[derive(Debug)]
pub struct WholeFolder {
    out: PathBuf,
    beside: TempDir,
    listed: Listed,
    replaces: Option<IsOwn>,
}

/// Whether a folder's maker makes files of this name.
pub type IsOwn = fn(&str) -> bool;

impl WholeFolder {
    /// Begins a folder that is to be called `out`, where nothing or an empty folder is.
    ///
    /// # Errors
    /// [`FolderError`] if something is in its place or nothing can be made beside it.
    pub fn create(out: &Path) -> Result<Self, FolderError> {
        check_free(out)?;
        Self::beside(out)
    }

    /// Begins a folder in the place of one that was made the same way, or of none.
    ///
    /// # Errors
    /// Those of [`check_own`], or if nothing can be made beside it.
    pub fn replace(out: &Path, is_own: IsOwn) -> Result<Self, FolderError> {
        check_own(out, is_own)?;
        let mut folder = Self::beside(out)?;
        folder.replaces = Some(is_own);
        Ok(folder)
    }

    /// Begins a folder that is to be called `out`, whatever is there.
    ///
    /// # Errors
    /// [`FolderError::Io`] if a file is there or nothing can be made beside it.
    pub fn beside(out: &Path) -> Result<Self, FolderError> {
        let out = followed(out);
        if out.exists() && !out.is_dir() {
            return Err(FolderError::io(&out)(io::ErrorKind::NotADirectory.into()));
        }
        let parent = match out.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let mut prefix = OsString::from(".");
        prefix.push(out.file_name().unwrap_or_default());
        let mut builder = tempfile::Builder::new();
        let make = || builder.prefix(&prefix).tempdir_in(parent);
        let (beside, listed) =
            Listed::make(make, TempDir::path).map_err(FolderError::io(parent))?;
        Ok(Self {
            out,
            beside,
            listed,
            replaces: None,
        })
    }

    /// Where to write.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.beside.path()
    }

    /// Makes a folder in it.
    ///
    /// # Errors
    /// [`FolderError::Io`].
    pub fn folder(&self, name: &str) -> Result<(), FolderError> {
        let path = self.path().join(name);
        fs::create_dir(&path).map_err(FolderError::io(&path))
    }

    /// Writes a file in it.
    ///
    /// # Errors
    /// [`FolderError::Io`].
    pub fn file(
        &self,
        name: impl AsRef<Path>,
        contents: impl AsRef<[u8]>,
    ) -> Result<(), FolderError> {
        let path = self.path().join(name);
        fs::write(&path, contents).map_err(FolderError::io(&path))
    }

    /// Writes a picture in it, as PNG.
    ///
    /// # Errors
    /// [`FolderError::Io`].
    pub fn picture(&self, name: impl AsRef<Path>, picture: &Picture) -> Result<(), FolderError> {
        self.file(name, png::encode(picture))
    }

    /// Gives the folder its name.
    ///
    /// # Errors
    /// [`FolderError::Io`]; nothing is left behind then.
    pub fn finish(self) -> Result<(), FolderError> {
        let Self {
            out,
            beside,
            listed,
            replaces,
        } = self;
        open_to_all(beside.path()).map_err(FolderError::io(&out))?;
        step(|| {
            if let Some(is_own) = replaces {
                // Somebody may have put something there meanwhile.
                check_own(&out, is_own)?;
                empty(&out).map_err(FolderError::io(&out))?;
            }
            // An empty folder in its place gives way to the rename.
            let kept = beside.keep();
            let renamed = fs::rename(&kept, &out).map_err(|source| {
                let _ = fs::remove_dir_all(&kept);
                FolderError::io(&out)(source)
            });
            drop(listed);
            renamed
        })
    }

    /// Puts the files where the folder is to be: files of the same names are replaced, others
    /// are left alone.
    ///
    /// # Errors
    /// [`FolderError::Io`]; nothing has changed if a folder is in the place of a file or a file
    /// in that of a folder.
    pub fn finish_over(self) -> Result<(), FolderError> {
        if check_free(&self.out).is_ok() {
            return self.finish();
        }
        let from = self.beside.path();
        step(|| over(from, &self.out, false).and_then(|()| over(from, &self.out, true)))
    }
}

/// Moves files over those of another folder, or only sees whether each has its place.
fn over(from: &Path, to: &Path, moves: bool) -> Result<(), FolderError> {
    if moves {
        fs::create_dir_all(to).map_err(FolderError::io(to))?;
    }
    for entry in fs::read_dir(from).map_err(FolderError::io(from))? {
        let entry = entry.map_err(FolderError::io(from))?;
        let place = to.join(entry.file_name());
        let is_folder = entry.path().is_dir();
        if place.exists() && place.is_dir() != is_folder {
            return Err(FolderError::io(&place)(io::ErrorKind::AlreadyExists.into()));
        }
        if is_folder {
            over(&entry.path(), &place, moves)?;
        } else if moves {
            fs::rename(entry.path(), &place).map_err(FolderError::io(&place))?;
        }
    }
    Ok(())
}

/// Writes files into a folder, which is made if it is not there; each replaces one of its name.
/// A process that is stopped has written all of them or none.
///
/// # Errors
/// [`FileError`].
pub fn put(folder: &Path, files: &[(impl AsRef<Path>, impl AsRef<[u8]>)]) -> Result<(), FileError> {
    step(|| {
        make_folder(folder).map_err(|source| FileError {
            path: folder.to_owned(),
            source,
        })?;
        let mut files = files.iter();
        files.try_for_each(|(name, bytes)| whole_file::write(&folder.join(name), bytes.as_ref()))
    })
}

/// Refuses a place that has something in it.
///
/// # Errors
/// [`FolderError::Taken`], or what reading the folder gives.
pub fn check_free(out: &Path) -> Result<(), FolderError> {
    let taken = match fs::read_dir(out) {
        Ok(mut entries) => entries.next().is_some(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => false,
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => true,
        Err(source) => return Err(FolderError::io(out)(source)),
    };
    if taken {
        let path = out.to_owned();
        return Err(FolderError::Taken { path });
    }
    Ok(())
}

/// Refuses a place that holds anything but files that its maker makes.
///
/// # Errors
/// [`FolderError::Foreign`], [`FolderError::Taken`] if it is no folder, or what reading it gives.
pub fn check_own(out: &Path, is_own: IsOwn) -> Result<(), FolderError> {
    if !out.is_dir() {
        return check_free(out);
    }
    for entry in fs::read_dir(out).map_err(FolderError::io(out))? {
        let entry = entry.map_err(FolderError::io(out))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !is_own(&name) || entry.path().is_dir() {
            let path = out.to_owned();
            return Err(FolderError::Foreign { path, name });
        }
    }
    Ok(())
}

/// Removes the files of a folder, if there is one.
fn empty(folder: &Path) -> io::Result<()> {
    if !folder.is_dir() {
        return Ok(());
    }
    fs::read_dir(folder)?.try_for_each(|entry| fs::remove_file(entry?.path()))
}

/// A temporary folder is for its owner only; what is written is like any other folder.
#[cfg(unix)]
fn open_to_all(folder: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn open_to_all(_folder: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_replaced_whole_unless_it_holds_what_others_made() {
        let around = tempfile::tempdir().unwrap();
        let out = around.path().join("results");
        let make = |name: &str| {
            let folder = WholeFolder::replace(&out, |name| name.ends_with("csv"))?;
            folder.file(name, name)?;
            folder.finish()
        };
        let names = || {
            let names = fs::read_dir(&out).unwrap();
            let names = names.map(|entry| entry.unwrap().file_name());
            names.collect::<Vec<_>>()
        };
        make("a.csv").unwrap();
        make("b.csv").unwrap();
        assert_eq!(names(), ["b.csv"]);
        fs::write(out.join("photo.png"), "mine").unwrap();
        let refused = make("c.csv").unwrap_err();
        assert!(matches!(refused, FolderError::Foreign { name, .. } if name == "photo.png"));
        assert_eq!(names().len(), 2);
        assert_eq!(fs::read_dir(around.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_is_not_finished_leaves_nothing() {
        let around = tempfile::tempdir().unwrap();
        let out = around.path().join("capture");
        let folder = WholeFolder::create(&out).unwrap();
        folder.folder("photos").unwrap();
        folder.file("photos/000.png", b"half").unwrap();
        drop(folder);
        assert_eq!(fs::read_dir(around.path()).unwrap().count(), 0);
    }

    #[test]
    fn an_empty_folder_gives_way_and_a_full_one_stays() {
        let around = tempfile::tempdir().unwrap();
        let out = around.path().join("capture");
        fs::create_dir(&out).unwrap();
        let folder = WholeFolder::create(&out).unwrap();
        folder.file("capture.csv", b"list").unwrap();
        folder.finish().unwrap();
        assert_eq!(fs::read(out.join("capture.csv")).unwrap(), b"list");
        let error = WholeFolder::create(&out).unwrap_err();
        assert!(matches!(error, FolderError::Taken { .. }), "{error}");
        assert_eq!(fs::read_dir(around.path()).unwrap().count(), 1);
    }
}
