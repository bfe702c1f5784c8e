//! Tests of the simulated lines, and a device for them.

mod lossy_line;
mod paced_line;

use super::FarEnd;
use std::time::Duration;

/// A device that notes what it hears and when, and says what it is told to.
#[derive(Debug, Default)]
struct Notes {
    heard: Vec<u8>,
    says: Vec<u8>,
    last: Duration,
}

impl FarEnd for Notes {
    fn turn(&mut self, arrived: &[u8], now: Duration) {
        if !arrived.is_empty() {
            self.last = now;
        }
        self.heard.extend(arrived);
    }

    fn pending(&self) -> &[u8] {
        &self.says
    }

    fn sent(&mut self, count: usize) {
        self.says.drain(..count);
    }
}

const SECOND: Duration = Duration::from_secs(1);
