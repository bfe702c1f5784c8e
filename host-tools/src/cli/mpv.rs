//! mpv, the player of films and of what an emulated board shows.

use super::failure::{Failure, Kind};
use std::io::ErrorKind;
use std::process::{Child, Command};

/// A player without the user's own settings. Ctrl-C is for iltm, which asks it to end.
pub(super) fn mpv() -> Command {
    let mut command = Command::new("mpv");
    command.args(["--no-config", "--input-terminal=no", "--osc=no"]);
    // Where there is no graphics processor, software draws.
    command.args(["--vo=gpu", "--gpu-sw=yes"]);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

/// Starts it.
pub(super) fn start(command: &mut Command) -> Result<Child, Failure> {
    command.spawn().map_err(|error| match error.kind() {
        ErrorKind::NotFound => Failure::new(
            Kind::Player,
            "mpv is not installed",
            "Install it: `sudo apt-get install mpv`.",
        ),
        _ => Failure::new(
            Kind::Player,
            format!("mpv cannot be started: {error}"),
            "See whether `mpv FILM` plays.",
        ),
    })
}
