//! Wire: one direction of a serial line of a given speed, by a clock in nanoseconds.

use std::collections::VecDeque;

/// Start bit, eight bits, stop bit.
const BITS: u128 = 10;

/// Bytes that wait to be sent, as in an operating system's or a driver's buffer.
const BUFFER: usize = 4_096;

#[derive(Debug)]
pub(super) struct Wire {
    baud: u128,
    pub(super) latency: u64,
    queue: VecDeque<u8>,
    /// When the wire was idle last, and bytes it has carried since: times are computed
    /// from there, so that no rounding adds up.
    idle: u64,
    since: u64,
    /// Bytes that are through, and when.
    arrived: VecDeque<(u64, u8)>,
    /// Bytes ever taken at the other end.
    pub(super) carried: u64,
}

impl Wire {
    pub(super) fn new(baud: u32) -> Self {
        Self {
            baud: baud.max(1).into(),
            latency: 0,
            queue: VecDeque::new(),
            idle: 0,
            since: 0,
            arrived: VecDeque::new(),
            carried: 0,
        }
    }

    /// Queues as many of these bytes as there is room for, and says how many.
    pub(super) fn push(&mut self, bytes: &[u8], now: u64) -> usize {
        self.advance(now);
        if self.queue.is_empty() {
            (self.idle, self.since) = (now, 0);
        }
        let room = BUFFER.saturating_sub(self.queue.len());
        let count = bytes.len().min(room);
        self.queue.extend(bytes.iter().take(count));
        count
    }

    /// When the byte that is being sent has left, stop bit included.
    pub(super) fn leaves(&self) -> Option<u64> {
        self.queue.front()?;
        let nanoseconds = (u128::from(self.since) + 1) * BITS * 1_000_000_000;
        Some(self.idle + nanoseconds.div_ceil(self.baud) as u64)
    }

    /// When the next byte arrives.
    pub(super) fn arrives(&self) -> Option<u64> {
        let under_way = self.arrived.front().map(|(time, _)| *time);
        under_way.or_else(|| Some(self.leaves()? + self.latency))
    }

    /// Sends what is sent by now.
    fn advance(&mut self, now: u64) {
        while let Some(time) = self.leaves().filter(|time| *time <= now)
            && let Some(byte) = self.queue.pop_front()
        {
            self.since += 1;
            self.arrived.push_back((time + self.latency, byte));
        }
    }

    /// Takes the next byte that has arrived by now.
    pub(super) fn pop(&mut self, now: u64) -> Option<u8> {
        self.advance(now);
        let (_, byte) = self.arrived.pop_front_if(|(time, _)| *time <= now)?;
        self.carried += 1;
        Some(byte)
    }
}
