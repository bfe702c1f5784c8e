//! What a slide is shown on.

use super::SessionError;
use super::list::Planned;
use super::shell::{self, Ran};
use std::time::Duration;

/// Longest that a user's command may take to show a slide.
const PATIENCE: Duration = Duration::from_secs(30);

/// Shows slides full screen.
pub trait Screen {
    /// Shows a slide; on return, the system has it.
    ///
    /// # Errors
    /// [`SessionError::Display`], or [`SessionError::Stopped`].
    fn show(&mut self, planned: &Planned) -> Result<(), SessionError>;
}

/// Shows a slide by a command that the user gave.
pub struct CommandScreen<'a> {
    command: String,
    stop: &'a dyn Fn() -> bool,
}

impl<'a> CommandScreen<'a> {
    /// `command` has `{slide}` where the picture's name belongs, and returns as soon
    /// as that is shown.
    #[must_use]
    pub fn new(command: &str, stop: &'a dyn Fn() -> bool) -> Self {
        Self {
            command: command.to_owned(),
            stop,
        }
    }
}

impl Screen for CommandScreen<'_> {
    fn show(&mut self, planned: &Planned) -> Result<(), SessionError> {
        let refuse = |reason: String| SessionError::Display { reason };
        let command = shell::filled(&self.command, planned, &planned.photo);
        match shell::run(&command, PATIENCE, self.stop) {
            Ok(Ran::Ended(status, _)) if status.success() => Ok(()),
            Ok(Ran::Ended(status, words)) => Err(refuse(format!(
                "`{command}` ended with {status}; it says: {words}"
            ))),
            Ok(Ran::TooLong(words)) => Err(refuse(format!(
                "`{command}` did not return within {} s; it says: {words}",
                PATIENCE.as_secs()
            ))),
            Ok(Ran::Stopped) => Err(SessionError::Stopped),
            Err(error) => Err(refuse(format!("`{command}` cannot be run: {error}"))),
        }
    }
}
