//! Progress bars, on a terminal only.

use super::output::Output;
use iltm_picture::progress::{Progress, Silent};
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// How long work shows itself on this output.
pub(super) fn progress(output: &Output) -> Box<dyn Progress> {
    if output.terminal {
        Box::new(Bars::default())
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
