//! Logger: defmt frames on their way to the serial line.
//!
//! A frame is collected until it is whole, then goes into a ring with its length
//! before it; one that is too long, or finds no room, is dropped and counted.
//! Logging never waits.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering};
use critical_section::RestoreState;
use iltm_runtime::ring::Ring;

/// Longest frame: the ring's length byte and any message there is.
const MAX_FRAME: usize = 120;

/// Bytes that wait for the line, length bytes included.
const WAIT: usize = 1_024;

static WAITING: Ring<WAIT> = Ring::new();
static DROPPED: AtomicU32 = AtomicU32::new(0);
static MILLISECONDS: AtomicU32 = AtomicU32::new(0);
static COLLECTOR: Collector = Collector(UnsafeCell::new(Collected {
    frame: [0; MAX_FRAME],
    length: 0,
    restore: RestoreState::invalid(),
    taken: false,
}));

defmt::timestamp!("{=u32:ms}", MILLISECONDS.load(Ordering::Relaxed));

/// Tells the logger the time.
pub fn set_time(milliseconds: u64) {
    MILLISECONDS.store(milliseconds as u32, Ordering::Relaxed);
}

/// Frames that were dropped since this was asked last.
pub fn take_dropped() -> u32 {
    DROPPED.swap(0, Ordering::Relaxed)
}

/// Moves whole frames into `bytes`, one behind the other, and returns how many
/// bytes they take.
pub fn take(bytes: &mut [u8]) -> usize {
    let mut used = 0;
    while let Some(length) = WAITING.peek() {
        let Some(place) = bytes.get_mut(used..used + usize::from(length)) else {
            break;
        };
        WAITING.pop();
        for slot in place {
            *slot = WAITING.pop().unwrap_or(0);
        }
        used += usize::from(length);
    }
    used
}

/// The frame that is being written.
struct Collected {
    frame: [u8; MAX_FRAME],
    /// Bytes of it, also those that found no room.
    length: usize,
    restore: RestoreState,
    taken: bool,
}

struct Collector(UnsafeCell<Collected>);

// SAFETY: what is inside is reached between `acquire` and `release` only, with
// interrupts off on a single core.
unsafe impl Sync for Collector {}

#[defmt::global_logger]
struct Logger;

// SAFETY: `acquire` turns interrupts off until `release`, so nobody else logs in
// between; a log statement inside another one would panic in `acquire`, as defmt
// asks, before it could reach the frame.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: ends with `release`, which defmt calls after this.
        let restore = unsafe { critical_section::acquire() };
        // SAFETY: interrupts are off and nobody holds the collector, or we stop.
        let collected = unsafe { &mut *COLLECTOR.0.get() };
        assert!(!collected.taken, "a log statement inside a log statement");
        collected.taken = true;
        collected.length = 0;
        collected.restore = restore;
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: defmt calls this between `acquire` and `release`.
        let collected = unsafe { &mut *COLLECTOR.0.get() };
        for byte in bytes {
            if let Some(slot) = collected.frame.get_mut(collected.length) {
                *slot = *byte;
            }
            collected.length += 1;
        }
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: as in `write`.
        let collected = unsafe { &mut *COLLECTOR.0.get() };
        let frame = collected.frame.get(..collected.length);
        let room = WAIT - WAITING.len();
        match frame {
            Some(frame) if frame.len() < room => {
                WAITING.push(frame.len() as u8);
                for byte in frame {
                    WAITING.push(*byte);
                }
            }
            _ => {
                DROPPED.fetch_add(1, Ordering::Relaxed);
            }
        }
        collected.taken = false;
        let restore = collected.restore;
        // SAFETY: the state that `acquire` got.
        unsafe { critical_section::release(restore) };
    }
}
