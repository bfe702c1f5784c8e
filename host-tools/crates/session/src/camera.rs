//! Cameras: a command that takes a photograph, or a person whose camera fills a folder.

use super::SessionError;
use super::plan::{Planned, endings};
use super::shell::{self, Ran};
use iltm_capture::FileFormat;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Takes photographs of what is shown.
pub trait CameraDriver {
    /// Takes one and gives its file, in `folder`, which is empty and for this one
    /// photograph.
    ///
    /// # Errors
    /// [`SessionError::Camera`] with the reason, or [`SessionError::Stopped`].
    fn shoot(&mut self, planned: &Planned, folder: &Path) -> Result<PathBuf, SessionError>;

    /// Whether it takes a photograph as soon as it is asked, so that latency can be
    /// measured with it.
    fn is_prompt(&self) -> bool;
}

/// A camera on a cable, operated by a command that the user gave.
pub struct CommandCamera<'a> {
    command: String,
    patience: Duration,
    stop: &'a dyn Fn() -> bool,
}

impl<'a> CommandCamera<'a> {
    /// `command` has `{photo}` (or `{stem}`, the same without its ending) where the
    /// file to write belongs.
    #[must_use]
    pub fn new(command: &str, patience: Duration, stop: &'a dyn Fn() -> bool) -> Self {
        Self {
            command: command.to_owned(),
            patience,
            stop,
        }
    }

    /// Whether a command says where the photograph goes.
    #[must_use]
    pub fn is_complete(command: &str) -> bool {
        command.contains("{photo}") || command.contains("{stem}")
    }
}

impl CameraDriver for CommandCamera<'_> {
    fn shoot(&mut self, planned: &Planned, folder: &Path) -> Result<PathBuf, SessionError> {
        let refuse = |reason: String| SessionError::Camera {
            index: planned.index,
            reason,
        };
        let photo = folder.join(planned.photo.file_name().unwrap_or_default());
        let command = shell::filled(&self.command, planned, &photo);
        let words = match shell::run(&command, self.patience, self.stop) {
            Ok(Ran::Ended(status, words)) if status.success() => words,
            Ok(Ran::Ended(status, words)) => {
                return Err(refuse(format!(
                    "the camera command ended with {status}{}",
                    shell::says(&words)
                )));
            }
            Ok(Ran::TooLong(words)) => {
                return Err(refuse(format!(
                    "the camera command took longer than {} s{}",
                    self.patience.as_secs_f64(),
                    shell::says(&words)
                )));
            }
            Ok(Ran::Stopped) => return Err(SessionError::Stopped),
            Err(error) => return Err(refuse(format!("the command cannot be run: {error}"))),
        };
        match endings(&photo).as_slice() {
            [file] => Ok(file.clone()),
            [] => Err(refuse(format!(
                "the camera command wrote no {}{}",
                photo.file_name().unwrap_or_default().to_string_lossy(),
                shell::says(&words)
            ))),
            several => Err(refuse(format!(
                "the camera command wrote {} files of that name; one is wanted",
                several.len()
            ))),
        }
    }

    fn is_prompt(&self) -> bool {
        true
    }
}

/// A file's length and time have to stay for so long.
const STABLE: Duration = Duration::from_millis(600);

/// A folder that a camera, or the program that comes with it, puts photographs into.
pub struct WatchedFolder<'a> {
    folder: PathBuf,
    patience: Duration,
    stop: &'a dyn Fn() -> bool,
}

/// What tells a file from one of the same name: how long and from when it is.
type Look = (u64, Option<SystemTime>);

impl<'a> WatchedFolder<'a> {
    /// Takes what appears in `folder` within `patience` after a slide is shown.
    #[must_use]
    pub fn new(folder: &Path, patience: Duration, stop: &'a dyn Fn() -> bool) -> Self {
        Self {
            folder: folder.to_owned(),
            patience,
            stop,
        }
    }

    /// The photographs that are there.
    fn looks(&self) -> std::io::Result<HashMap<PathBuf, Look>> {
        let mut looks = HashMap::new();
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
            // A file that goes away at this moment was not meant.
            let metadata = fs::metadata(&path).ok().filter(fs::Metadata::is_file);
            if let Some(metadata) = metadata
                && FileFormat::EXTENSIONS.iter().any(|known| ending == *known)
            {
                looks.insert(path, (metadata.len(), metadata.modified().ok()));
            }
        }
        Ok(looks)
    }
}

impl CameraDriver for WatchedFolder<'_> {
    fn shoot(&mut self, planned: &Planned, folder: &Path) -> Result<PathBuf, SessionError> {
        let refuse = |reason: String| SessionError::Camera {
            index: planned.index,
            reason,
        };
        let unreadable = |error: std::io::Error| {
            refuse(format!("{} cannot be read: {error}", self.folder.display()))
        };
        let before = self.looks().map_err(unreadable)?;
        let begun = Instant::now();
        let mut last: Option<(PathBuf, Look)> = None;
        loop {
            let mut new: Vec<(PathBuf, Look)> = self
                .looks()
                .map_err(unreadable)?
                .into_iter()
                .filter(|(path, look)| before.get(path) != Some(look))
                .collect();
            // The first of several: cameras number what they write.
            new.sort_by(|a, b| (a.1.1, &a.0).cmp(&(b.1.1, &b.0)));
            let first = new.into_iter().next();
            if let (Some((path, look)), true) = (&first, first == last)
                && look.0 > 0
            {
                let ending = path.extension().unwrap_or_default();
                let name = planned.photo.with_extension(ending);
                let taken = folder.join(name.file_name().unwrap_or_default());
                fs::copy(path, &taken).map_err(|error| {
                    refuse(format!("{} cannot be copied: {error}", path.display()))
                })?;
                return Ok(taken);
            }
            if begun.elapsed() > self.patience {
                return Err(refuse(format!(
                    "no new photograph appeared in {} for {} s",
                    self.folder.display(),
                    self.patience.as_secs_f64()
                )));
            }
            last = first;
            if !shell::wait(STABLE, self.stop) {
                return Err(SessionError::Stopped);
            }
        }
    }

    fn is_prompt(&self) -> bool {
        false
    }
}
