//! Live view on a terminal: draws the lines of the view again as they change.

use super::Show;
use super::event::MonitorEvent;
use super::view::View;
use console::Term;
use std::fmt::Write as _;
use std::io::{self, IsTerminal, Write as _};
use std::time::{Duration, Instant};

/// Between two drawings, so that a talkative device does not make it flicker.
const REDRAW: Duration = Duration::from_millis(100);

/// Whether standard output can show it.
pub(super) fn possible() -> bool {
    io::stdout().is_terminal() && !console::is_dumb()
}

/// The view, on the terminal's other screen; dropping it brings the first back.
#[derive(Debug)]
pub(super) struct Live {
    view: View,
    drawn: Option<Instant>,
}

impl Live {
    pub(super) fn start(port: &str) -> Self {
        let mut out = io::stdout();
        // Other screen, no cursor.
        let _ = out.write_all(b"\x1b[?1049h\x1b[?25l");
        let _ = out.flush();
        Self {
            view: View::new(port),
            drawn: None,
        }
    }

    /// All of it in one write, over what is there: clearing first would flicker.
    fn draw(&mut self) -> io::Result<()> {
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < REDRAW) {
            return Ok(());
        }
        self.drawn = Some(Instant::now());
        let (height, width) = Term::stdout().size();
        let lines = self.view.lines(width.into(), height.into());
        let mut text = String::from("\x1b[H");
        for (number, line) in lines.iter().enumerate() {
            let end = if number == 0 { "" } else { "\r\n" };
            let _ = write!(text, "{end}{line}\x1b[K");
        }
        text.push_str("\x1b[J");
        let mut out = io::stdout();
        out.write_all(text.as_bytes())?;
        out.flush()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        let mut out = io::stdout();
        let _ = out.write_all(b"\x1b[?25h\x1b[?1049l");
        let _ = out.flush();
        // What one would scroll back for.
        for line in self.view.last_words() {
            let _ = writeln!(out, "{line}");
        }
    }
}

impl Show for Live {
    fn show(&mut self, event: &MonitorEvent) -> io::Result<()> {
        self.view.take(event);
        self.draw()
    }

    fn tick(&mut self) -> io::Result<()> {
        // The terminal may have another size.
        self.draw()
    }
}
