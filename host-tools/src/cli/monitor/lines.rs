//! Lines on standard output, one for each event, as text or JSON.

use super::super::output::printable;
use super::super::words;
use super::Show;
use super::event::MonitorEvent;
use super::view::Rates;
use iltm_runtime::link::{Event, Slots, TableName};
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
    /// The table in use and whether it is on trial, as last said.
    table: Option<(Option<TableName>, bool)>,
    trial_s: u32,
    /// Whether it was said that there is a log that cannot be read.
    hinted: bool,
}

impl Show for Plain {
    fn show(&mut self, event: &MonitorEvent) -> io::Result<()> {
        match event {
            MonitorEvent::Device(Event::Status(status)) => {
                self.rates.add(status);
                let time = status.frame_time;
                let [black, white] = words::clipped_percent(status);
                line(&format!(
                    "{} {}{}, tier {} of {}, {}, \
                     {:.1} of {:.1} ms, clipped {:.2} % at black and {:.2} % at white, \
                     {} late, {} dropped, {} broken",
                    words::duration(status.uptime_ms),
                    status.mode,
                    match self.trial_s {
                        0 => String::new(),
                        left => format!(", {left} s of trial left"),
                    },
                    status.tier,
                    status.top_tier,
                    self.rates.words(),
                    f64::from(time.mean_us) / 1000.0,
                    f64::from(time.budget_us) / 1000.0,
                    black,
                    white,
                    status.frames.late,
                    status.frames.dropped,
                    status.frames.broken,
                ))
            }
            MonitorEvent::Connected(_) => {
                self.rates = Rates::default();
                line(&event.words().unwrap_or_default())
            }
            MonitorEvent::Slots(slots) => self.slots(slots, event),
            MonitorEvent::UnreadLog { .. } if std::mem::replace(&mut self.hinted, true) => Ok(()),
            other => line(&other.words().unwrap_or_default()),
        }
    }
}

impl Plain {
    /// Says which table is in use where that has changed.
    fn slots(&mut self, slots: &Slots, event: &MonitorEvent) -> io::Result<()> {
        self.trial_s = slots.trial_ms.div_ceil(1_000);
        let table = words::in_use(slots).map(|table| table.name);
        let now = Some((table, slots.trial_ms > 0));
        if std::mem::replace(&mut self.table, now) == now {
            return Ok(());
        }
        line(&event.words().unwrap_or_default())
    }
}

/// A line, seen at once also through a pipe.
fn line(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{}", printable(text))?;
    out.flush()
}
