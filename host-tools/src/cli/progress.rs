//! Progress of long work on standard error: bars on a terminal, lines for programs.

use super::output::Output;
use iltm_picture::progress::{Progress, Silent};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use std::io::{self, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Least time between two lines of one step.
const PERIOD: Duration = Duration::from_secs(1);

/// How long work shows itself on this output.
pub(super) fn progress(output: &Output) -> Box<dyn Progress> {
    if output.terminal {
        Box::new(Bars::default())
    } else if output.is_json() {
        Box::new(Lines::default())
    } else {
        Box::new(Silent)
    }
}

/// One bar a step, gone when the step is done.
#[derive(Default)]
struct Bars {
    current: Mutex<Option<ProgressBar>>,
}

impl Bars {
    fn replace(&self, bar: Option<ProgressBar>) {
        // A panic elsewhere must not keep the bar from being cleared.
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(old) = std::mem::replace(&mut *current, bar) {
            old.finish_and_clear();
        }
    }
}

impl Progress for Bars {
    fn begin(&self, what: &str, total: u64) {
        let (bar, template) = if total == 0 {
            (ProgressBar::new_spinner(), "{spinner} {msg} {elapsed}")
        } else {
            let template = "{msg:30} [{bar:40}] {pos}/{len} {eta}";
            (ProgressBar::new(total), template)
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(what.to_owned());
        bar.enable_steady_tick(Duration::from_millis(100));
        self.replace(Some(bar));
    }

    fn advance(&self, parts: u64) {
        let current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bar) = &*current {
            bar.inc(parts);
        }
    }

    fn end(&self) {
        self.replace(None);
    }
}

/// A line when a step begins, and one a second while it goes on.
#[derive(Default)]
struct Lines {
    current: Mutex<Option<Step>>,
}

struct Step {
    what: String,
    done: u64,
    total: u64,
    said: Instant,
}

impl Step {
    fn say(&mut self) {
        self.said = Instant::now();
        let total = (self.total > 0).then_some(self.total);
        let step = json!({ "step": self.what, "done": self.done, "total": total });
        // Who listens no more wants the result all the same.
        let _ = writeln!(io::stderr(), "{}", json!({ "progress": step }));
    }
}

impl Lines {
    fn current(&self) -> MutexGuard<'_, Option<Step>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Lines {
    fn begin(&self, what: &str, total: u64) {
        let (what, said) = (what.to_owned(), Instant::now());
        let step = Step {
            what,
            done: 0,
            total,
            said,
        };
        self.current().insert(step).say();
    }

    fn advance(&self, parts: u64) {
        if let Some(step) = &mut *self.current() {
            step.done += parts;
            if step.said.elapsed() >= PERIOD {
                step.say();
            }
        }
    }

    fn end(&self) {
        *self.current() = None;
    }
}
