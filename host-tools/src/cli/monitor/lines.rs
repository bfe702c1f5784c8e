//! Lines on standard output, one for each event, as text or JSON.

use super::super::output::printable;
use super::super::words;
use super::Show;
use super::event::MonitorEvent;
use super::view::Rates;
use iltm_runtime::link::Event;
use std::io::{self, Write};

/// One JSON object a line.
#[derive(Debug)]
pub(super) struct Json;

impl Show for Json {
    fn show(&mut self, event: &MonitorEvent) -> io::Result<()> {
        line(&event.data().to_string())
    }
}

/// Words.
#[derive(Debug, Default)]
pub(super) struct Plain {
    rates: Rates,
    /// Whether it was said that there is a log that cannot be read.
    hinted: bool,
}

impl Show for Plain {
    fn show(&mut self, event: &MonitorEvent) -> io::Result<()> {
        match event {
            MonitorEvent::Device(Event::Status(status)) => {
                self.rates.add(status);
                let time = status.frame_time;
                line(&format!(
                    "{} {}, tier {} of {}, {}, \
                     {:.1} of {:.1} ms, {:.2} % clipped, {} late, {} dropped, {} broken",
                    words::duration(status.uptime_ms),
                    status.mode,
                    status.tier,
                    status.top_tier,
                    self.rates.words(),
                    f64::from(time.mean_us) / 1000.0,
                    f64::from(time.budget_us) / 1000.0,
                    100.0 * words::clipped_share(status),
                    status.frames.late,
                    status.frames.dropped,
                    status.frames.broken,
                ))
            }
            MonitorEvent::Connected(_) => {
                self.rates = Rates::default();
                line(&event.words().unwrap_or_default())
            }
            MonitorEvent::UnreadLog { .. } if std::mem::replace(&mut self.hinted, true) => Ok(()),
            other => line(&other.words().unwrap_or_default()),
        }
    }
}

/// A line, seen at once also through a pipe.
fn line(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{}", printable(text))?;
    out.flush()
}
