//! Ring buffer of bytes between an interrupt and the loop.
//!
//! Atomics and no locks: neither side waits for the other, whichever interrupts
//! which.
//!
//! Why not `heapless::spsc`: its queue is split into a producer and a consumer, and an
//! interrupt handler has no arguments that could hand it its half; it would have to come
//! out of a static through a lock or unsafe code. A [`Ring`] is a plain `static` that
//! both sides name, and since its bytes are atomics there is nothing unsafe in it.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// A queue of `N` bytes, a power of two, for one writer and one reader, which may
/// interrupt each other.
///
/// With two writers or two readers bytes get lost; the memory stays sound.
#[derive(Debug)]
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    /// Bytes ever written, and ever read; both wrap around.
    written: AtomicUsize,
    read: AtomicUsize,
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Ring<N> {
    /// An empty queue.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two()) };
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            written: AtomicUsize::new(0),
            read: AtomicUsize::new(0),
        }
    }

    /// Bytes waiting.
    #[must_use]
    pub fn len(&self) -> usize {
        let written = self.written.load(Ordering::Acquire);
        written.wrapping_sub(self.read.load(Ordering::Acquire))
    }

    /// Whether none wait.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether there is no room for another.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.len() >= N
    }

    /// Appends a byte; `false` if there is no room.
    pub fn push(&self, byte: u8) -> bool {
        if self.is_full() {
            return false;
        }
        let written = self.written.load(Ordering::Relaxed);
        if let Some(slot) = self.bytes.get(written % N) {
            slot.store(byte, Ordering::Relaxed);
        }
        self.written
            .store(written.wrapping_add(1), Ordering::Release);
        true
    }

    /// Takes the oldest byte.
    pub fn pop(&self) -> Option<u8> {
        if self.is_empty() {
            return None;
        }
        let read = self.read.load(Ordering::Relaxed);
        let byte = self.bytes.get(read % N)?.load(Ordering::Relaxed);
        self.read.store(read.wrapping_add(1), Ordering::Release);
        Some(byte)
    }

    /// The byte that [`pop`](Self::pop) would take.
    #[must_use]
    pub fn peek(&self) -> Option<u8> {
        if self.is_empty() {
            return None;
        }
        let read = self.read.load(Ordering::Relaxed);
        Some(self.bytes.get(read % N)?.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_takes_as_many_bytes_as_it_has_room_for_and_gives_them_back_in_order() {
        let ring = Ring::<8>::new();
        for start in 0..100_u8 {
            for byte in 0..8 {
                assert!(ring.push(start + byte));
            }
            assert!(ring.is_full());
            assert!(!ring.push(0));
            assert_eq!(ring.peek(), Some(start));
            for byte in 0..8 {
                assert_eq!(ring.pop(), Some(start + byte));
            }
            assert!(ring.is_empty());
            assert_eq!((ring.pop(), ring.peek()), (None, None));
        }
    }

    #[test]
    fn no_byte_is_lost_or_doubled_between_two_threads() {
        const BYTES: u32 = 200_000;
        let ring = &Ring::<16>::new();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for number in 0..BYTES {
                    while !ring.push(number as u8) {
                        std::thread::yield_now();
                    }
                }
            });
            for number in 0..BYTES {
                let byte = loop {
                    match ring.pop() {
                        Some(byte) => break byte,
                        None => std::thread::yield_now(),
                    }
                };
                assert_eq!(byte, number as u8);
            }
        });
    }
}
