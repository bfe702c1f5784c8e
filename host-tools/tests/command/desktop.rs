//! A desktop without a screen, for what shows something.

use super::user::User;
use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

/// An X server without a screen. Of one display, it has the picture in a file.
pub(crate) struct Desktop {
    server: Child,
    pub(crate) display: String,
    pub(crate) folder: TempDir,
}

impl Desktop {
    pub(crate) fn start(size: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut server = Command::new("Xvfb");
        server.args(["-screen", "0", size]);
        server.arg("-fbdir").arg(folder.path());
        Self::of(server, folder)
    }

    /// A desktop of several displays beside each other, of these widths and heights, their upper edges
    /// at one height.
    pub(crate) fn with_displays(displays: &[(u16, u16)]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let socket = folder.path().join("socket");
        let [width, height] = around(displays);
        let mut server = Command::new("Xvnc");
        server.args(["-geometry", &format!("{width}x{height}"), "-depth", "24"]);
        server.args(["-SecurityTypes", "None", "-rfbport", "-1"]);
        server.arg("-rfbunixpath").arg(&socket);
        let desktop = Self::of(server, folder);
        desktop.divide(displays);
        desktop
    }

    /// Has other displays from now on.
    pub(crate) fn divide(&self, displays: &[(u16, u16)]) {
        let socket = self.folder.path().join("socket");
        divide(&socket, displays).expect("a server that listens");
    }

    fn of(mut server: Command, folder: TempDir) -> Self {
        let name = server.get_program().to_string_lossy().into_owned();
        let mut server = server
            .args(["-displayfd", "1", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|error| panic!("{name}: {error}; `tests/run.sh` installs it"));
        let mut number = String::new();
        let mut said = BufReader::new(server.stdout.take().expect("piped"));
        said.read_line(&mut number).expect("a display number");
        Self {
            server,
            display: format!(":{}", number.trim()),
            folder,
        }
    }

    /// A command line of `iltm` for it.
    pub(crate) fn command(&self, user: &User, line: &str) -> Command {
        let mut command = user.iltm(line);
        command.env("DISPLAY", &self.display);
        command
    }

    /// Runs a command line of `iltm` on it.
    pub(crate) fn spawn(&self, user: &User, line: &str) -> Child {
        self.command(user, line).spawn().expect("a binary")
    }
}

impl Drop for Desktop {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// Width and height of a desktop of these displays.
fn around(displays: &[(u16, u16)]) -> [u16; 2] {
    let height = displays.iter().map(|(_, height)| *height).max();
    [
        displays.iter().map(|(width, _)| width).sum(),
        height.unwrap_or(0),
    ]
}

/// Asks a VNC server on a socket to divide its desktop into displays, by the message `SetDesktopSize`
/// (251) that the community's extension `ExtendedDesktopSize` (-308) adds to the Remote Framebuffer
/// Protocol (RFC 6143).
fn divide(socket: &Path, displays: &[(u16, u16)]) -> io::Result<()> {
    let mut server = UnixStream::connect(socket)?;
    // Its version, and ways to log in, the only one of which is none.
    server.read_exact(&mut [0; 12])?;
    server.write_all(b"RFB 003.008\n")?;
    server.read_exact(&mut [0; 2])?;
    // None; beside other clients.
    server.write_all(&[1, 1])?;
    let words = |words: &[u16]| words.iter().flat_map(|word| word.to_be_bytes()).collect();
    // A list of one: this client understands desktops of several displays, by the number -308.
    let mut sent: Vec<u8> = words(&[0x0200, 1, 0xffff, 0xfecc]);
    let mut left = 0;
    let mut list = Vec::new();
    for (number, (width, height)) in (0..).zip(displays) {
        list.extend([0, number, left, 0, *width, *height, 0, 0]);
        left += width;
    }
    let count = u8::try_from(displays.len()).expect("a few displays");
    sent.extend([251, 0]);
    let [width, height] = around(displays);
    sent.extend::<Vec<u8>>(words(&[width, height, u16::from_be_bytes([count, 0])]));
    sent.extend::<Vec<u8>>(words(&list));
    server.write_all(&sent)?;
    // The server hangs up once it has done everything.
    server.shutdown(Shutdown::Write)?;
    server.read_to_end(&mut Vec::new()).map(|_| ())
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
