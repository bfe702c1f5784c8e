//! Progress of a transfer: a bar on a terminal, an event a line for programs.

use super::super::interrupt;
use super::super::output::Output;
use crate::device::upload::{UploadObserver, UploadStep};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Between two progress events.
const PERIOD: Duration = Duration::from_millis(200);

pub(super) struct Show<'a> {
    output: &'a Output,
    bar: Option<ProgressBar>,
    last: Option<Instant>,
    /// Bytes that the slot held at last, of so many.
    held: Option<[u32; 2]>,
}

impl<'a> Show<'a> {
    pub(super) const fn new(output: &'a Output) -> Self {
        Self {
            output,
            bar: None,
            last: None,
            held: None,
        }
    }

    /// Says something between, without harm to the bar.
    pub(super) fn say(&self, text: &str, data: &Value) {
        self.output.event(data);
        match &self.bar {
            Some(bar) => bar.println(text),
            None => self.output.remark(text),
        }
    }

    pub(super) fn end(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }

    /// Ends before all has arrived.
    pub(super) fn stop(&mut self) {
        self.end();
        if let Some([done, total]) = self.held.filter(|[done, total]| done < total) {
            self.output.remark(&format!(
                "stopped with {done} of {total} bytes in the device's flash"
            ));
        }
    }

    fn progress(&mut self, done: u32, skipped: u32, total: u32) {
        self.held = Some([done, total]);
        let due = self.last.is_none_or(|last| last.elapsed() >= PERIOD);
        if self.output.is_json() && (due || done == total) {
            self.last = Some(Instant::now());
            self.output.event(&json!({
                "event": "progress",
                "done": done,
                "skipped": skipped,
                "total": total,
            }));
        }
        if self.output.terminal && !self.output.is_json() {
            let bar = self.bar.get_or_insert_with(|| bar(skipped, total));
            bar.set_position(done.into());
        }
    }
}

/// What was there before does not count towards the rate.
fn bar(skipped: u32, total: u32) -> ProgressBar {
    let bar = ProgressBar::new(total.into()).with_position(skipped.into());
    let template = "sending  [{bar:30}] {decimal_bytes} of {decimal_total_bytes}, {decimal_bytes_per_sec}, {eta} left";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.reset_eta();
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

impl UploadObserver for Show<'_> {
    fn step(&mut self, step: UploadStep) {
        match step {
            UploadStep::Progress {
                done,
                skipped,
                total,
            } => self.progress(done, skipped, total),
            UploadStep::Quiet { silence } => {
                let seconds = silence.as_secs();
                self.say(
                    &format!("nothing new has arrived for {seconds} s; trying on"),
                    &json!({ "event": "quiet", "seconds": seconds }),
                );
            }
            UploadStep::Restarted => self.say(
                "the device has restarted; going on with what is missing",
                &json!({ "event": "restarted" }),
            ),
            UploadStep::Repeated { sector } => self.say(
                &format!("sector {sector} did not get into the flash; sending it again"),
                &json!({ "event": "repeated", "sector": sector }),
            ),
            UploadStep::Verified => {}
        }
    }

    fn stopped(&self) -> bool {
        interrupt::stopped()
    }
}
