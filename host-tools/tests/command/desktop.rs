//! A desktop without a screen, for what shows something.

use super::user::User;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

/// An X server without a screen, its picture in a file.
pub(crate) struct Desktop {
    server: Child,
    pub(crate) display: String,
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

/// What an X server shows, `0RGB` a pixel, from its file in the format of `xwd`
/// (`XWDFile.h`): 25 big-endian words, the second pair of which are sizes, a colour map
/// of 12 bytes an entry, the pixels.
pub(crate) fn on_the_screen(file: &Path) -> (usize, Vec<u32>) {
    let mut bytes = Vec::new();
    let mut opened = fs::File::open(file).expect("kept");
    opened.read_to_end(&mut bytes).expect("readable");
    let word = |at: usize| {
        let word: [u8; 4] = bytes[4 * at..4 * at + 4].try_into().expect("four bytes");
        u32::from_be_bytes(word) as usize
    };
    let (header, width, height, line, colours) = (word(0), word(4), word(5), word(12), word(19));
    let little = word(7) == 0;
    let from = header + 12 * colours;
    let mut pixels = Vec::new();
    for y in 0..height {
        let row = &bytes[from + y * line..][..4 * width];
        for pixel in row.chunks_exact(4) {
            let pixel: [u8; 4] = pixel.try_into().expect("four bytes");
            let value = if little {
                u32::from_le_bytes(pixel)
            } else {
                u32::from_be_bytes(pixel)
            };
            pixels.push(value & 0xff_ff_ff);
        }
    }
    (width, pixels)
}
