//! Lossy line: damages frames on their way.

use super::direction::Direction;
use super::faults::{FaultCounts, Faults};
use iltm::device::Line;
use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

/// A line around another one, that drops, duplicates, corrupts, reorders, delays and
/// cuts frames in both directions, as [`Faults`] say.
///
/// At rates of 0 all bytes pass in their order; those behind the last delimiter .02 s
/// late, when it is clear that no delimiter follows.
///
/// Frames that wait go on when somebody reads, so their time is the line's own
/// ([`Line::now`]), and a host that only writes overtakes nothing.
#[derive(Debug)]
pub struct LossyLine<L> {
    line: L,
    to_device: Direction,
    to_host: Direction,
    /// Frames until the line is unplugged.
    left: u64,
}

impl<L: Line> LossyLine<L> {
    /// Puts these faults between a host and this line.
    pub fn new(line: L, faults: Faults) -> Self {
        let mut seeds = fastrand::Rng::with_seed(faults.seed);
        Self {
            line,
            to_device: Direction::new(faults.to_device, seeds.u64(..)),
            to_host: Direction::new(faults.to_host, seeds.u64(..)),
            left: faults.unplug_after.unwrap_or(u64::MAX),
        }
    }

    /// The line within.
    pub const fn line(&self) -> &L {
        &self.line
    }

    /// The line within, to do other things to it.
    pub const fn line_mut(&mut self) -> &mut L {
        &mut self.line
    }

    /// What became of frames from host to device.
    pub const fn to_device(&self) -> FaultCounts {
        self.to_device.counts
    }

    /// What became of frames from device to host.
    pub const fn to_host(&self) -> FaultCounts {
        self.to_host.counts
    }

    /// Unplugs the line after so many more frames, both ways together; at once with 0.
    pub const fn unplug_after(&mut self, frames: u64) {
        self.left = frames;
    }

    /// Plugs the line in again, for good. What was under way is lost.
    pub fn plug_in(&mut self) {
        self.left = u64::MAX;
        self.to_device.forget();
        self.to_host.forget();
    }

    /// Whether it has been unplugged.
    pub const fn is_unplugged(&self) -> bool {
        self.left == 0
    }

    /// Lets through whose time has come.
    fn tick(&mut self) -> io::Result<()> {
        let now = self.line.now();
        self.to_host.tick(now, &mut self.left);
        self.to_device.tick(now, &mut self.left);
        self.pass_on()
    }

    fn pass_on(&mut self) -> io::Result<()> {
        if self.to_device.ready.is_empty() {
            return Ok(());
        }
        let bytes: Vec<u8> = self.to_device.ready.drain(..).collect();
        self.line.write(&bytes)
    }

    fn next_due(&self) -> Option<Instant> {
        let both = [self.to_device.due(), self.to_host.due()];
        both.into_iter().flatten().min()
    }
}

impl<L: Line> Line for LossyLine<L> {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        let end = self.line.now().checked_add(wait);
        loop {
            if !self.is_unplugged() {
                self.tick()?;
            }
            let ready = &mut self.to_host.ready;
            if !ready.is_empty() || bytes.is_empty() {
                let count = ready.len().min(bytes.len());
                for (byte, ready) in bytes.iter_mut().zip(ready.drain(..count)) {
                    *byte = ready;
                }
                return Ok(count);
            }
            if self.is_unplugged() {
                return Err(unplugged());
            }
            let before = self.line.now();
            let due = self.next_due();
            let until = |time: Option<Instant>| {
                time.map_or(wait, |time| time.saturating_duration_since(before))
            };
            let mut heard = [0; 1_024];
            let wait = until(end).min(until(due));
            let count = self.line.read(&mut heard, wait)?;
            let now = self.line.now();
            let heard = heard.get(..count).unwrap_or(&heard);
            self.to_host.take(heard, now, &mut self.left);
            // Where less than a frame has come, or another frame's turn, it goes on;
            // but not for ever on a line whose clock stands still.
            let is_due = due.is_some_and(|due| now >= due);
            let is_over = count == 0 || now == before || end.is_some_and(|end| now >= end);
            if is_over && !is_due && self.to_host.ready.is_empty() {
                return Ok(0);
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.is_unplugged() {
            return Err(unplugged());
        }
        let now = self.line.now();
        self.to_device.take(bytes, now, &mut self.left);
        self.pass_on()
    }

    fn now(&self) -> Instant {
        self.line.now()
    }
}

fn unplugged() -> io::Error {
    io::Error::new(ErrorKind::NotConnected, "unplugged by order")
}
