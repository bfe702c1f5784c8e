//! Line direction: one direction of a line that damages frames: bytes in, bytes out.

use super::faults::{FaultCounts, FaultKind, FaultRates};
use fastrand::Rng;
use iltm_runtime::link::DELIMITER;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Silence that ends a frame without a delimiter, so that what is no frame gets
/// through as well; and longest that a frame waits for one to change places with.
pub(super) const PAUSE: Duration = Duration::from_millis(20);

/// A frame longer than this is passed on in pieces: whatever a line carries, what is
/// kept of it is bounded.
const LONGEST: usize = 4_096;

/// Most bytes that wait for their time; beyond, frames pass at once.
const MOST_HELD: usize = 1 << 20;

#[derive(Debug)]
pub(super) struct Direction {
    rates: FaultRates,
    random: Rng,
    /// A frame whose end has not come, and when its last byte came.
    frame: Vec<u8>,
    heard: Option<Instant>,
    held: Vec<Held>,
    /// Bytes that are through.
    pub(super) ready: VecDeque<u8>,
    pub(super) counts: FaultCounts,
}

/// A frame that waits.
#[derive(Debug)]
struct Held {
    bytes: Vec<u8>,
    due: Instant,
    /// Or goes as soon as another has passed it.
    changes_places: bool,
}

impl Direction {
    pub(super) fn new(rates: FaultRates, seed: u64) -> Self {
        Self {
            rates,
            random: Rng::with_seed(seed),
            frame: Vec::new(),
            heard: None,
            held: Vec::new(),
            ready: VecDeque::new(),
            counts: FaultCounts::default(),
        }
    }

    /// Takes bytes from the sender, and `left` frames at most; the rest is lost.
    pub(super) fn take(&mut self, bytes: &[u8], now: Instant, left: &mut u64) {
        for byte in bytes {
            // Delimiters in a row begin the frame that follows: one that a sender puts
            // before a frame as well is no frame of its own.
            let is_begun = self.frame.last().is_some_and(|last| *last != DELIMITER);
            self.frame.push(*byte);
            self.heard = Some(now);
            if (*byte == DELIMITER && is_begun) || self.frame.len() >= LONGEST {
                self.end(now, left);
            }
        }
    }

    /// Lets through whose time has come.
    pub(super) fn tick(&mut self, now: Instant, left: &mut u64) {
        if self.heard.is_some_and(|heard| now >= heard + PAUSE) {
            self.end(now, left);
        }
        self.release(|held| now >= held.due);
    }

    /// When something happens next if nothing more comes.
    pub(super) fn due(&self) -> Option<Instant> {
        let pause = self.heard.map(|heard| heard + PAUSE);
        let held = self.held.iter().map(|held| held.due);
        held.chain(pause).min()
    }

    /// Forgets what is under way.
    pub(super) fn forget(&mut self) {
        self.frame.clear();
        self.heard = None;
        self.held.clear();
        self.ready.clear();
    }

    /// The frame is whole: its fault is drawn.
    fn end(&mut self, now: Instant, left: &mut u64) {
        let mut frame = std::mem::take(&mut self.frame);
        self.heard = None;
        if *left == 0 {
            return;
        }
        if frame.iter().all(|byte| *byte == DELIMITER) {
            self.ready.extend(frame);
            return;
        }
        *left -= 1;
        let fault = self.rates.draw(&mut self.random);
        self.counts.count(fault);
        match fault {
            Some(FaultKind::Drop) => return,
            Some(FaultKind::Duplicate) => self.ready.extend(&frame),
            Some(FaultKind::Corrupt) => self.corrupt(&mut frame),
            Some(FaultKind::Cut) => frame.truncate(self.random.usize(..frame.len())),
            Some(FaultKind::Reorder) => return self.hold(frame, now, PAUSE, true),
            Some(FaultKind::Delay) => return self.hold(frame, now, self.rates.delay_by, false),
            None => {}
        }
        self.ready.extend(frame);
        self.release(|held| held.changes_places);
    }

    fn corrupt(&mut self, frame: &mut [u8]) {
        let from = self.random.usize(..frame.len());
        let count = self.random.usize(1..=4);
        for byte in frame.iter_mut().skip(from).take(count) {
            *byte ^= self.random.u8(1..);
        }
    }

    fn hold(&mut self, bytes: Vec<u8>, now: Instant, wait: Duration, changes_places: bool) {
        let waiting: usize = self.held.iter().map(|held| held.bytes.len()).sum();
        match now.checked_add(wait) {
            Some(due) if waiting < MOST_HELD => self.held.push(Held {
                bytes,
                due,
                changes_places,
            }),
            _ => self.ready.extend(bytes),
        }
    }

    fn release(&mut self, goes: impl Fn(&Held) -> bool) {
        let ready = &mut self.ready;
        self.held.retain(|held| {
            let stays = !goes(held);
            if !stays {
                ready.extend(&held.bytes);
            }
            stays
        });
    }
}
