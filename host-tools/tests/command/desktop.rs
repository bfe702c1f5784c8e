//! A desktop without a screen, for what shows something.

use super::user::User;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

/// An X server without a screen, its picture in a file.
pub(crate) struct Desktop {
    server: Child,
    display: String,
    pub(crate) folder: TempDir,
}

impl Desktop {
    pub(crate) fn start(size: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", size])
            .arg("-fbdir")
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb is installed: `sudo apt-get install xvfb`");
        let mut number = String::new();
        let mut said = BufReader::new(server.stdout.take().expect("piped"));
        said.read_line(&mut number).expect("a display number");
        Self {
            server,
            display: format!(":{}", number.trim()),
            folder,
        }
    }

    /// Runs a command line of `iltm` on it.
    pub(crate) fn spawn(&self, user: &User, line: &str) -> Child {
        let mut command = user.iltm(line);
        let child = command.env("DISPLAY", &self.display).spawn();
        child.expect("a binary")
    }
}

impl Drop for Desktop {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}
