//! Send buffer: bytes that wait for the line.

use super::frame::{LinkFrame, MAX_ENCODED};

/// A ring of `N` bytes that takes frames whole or not at all.
#[derive(Debug)]
pub struct Outbox<const N: usize> {
    bytes: [u8; N],
    /// Where the next byte to send is.
    start: usize,
    length: usize,
    refused: u32,
}

impl<const N: usize> Default for Outbox<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Outbox<N> {
    /// An empty one.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: [0; N],
            start: 0,
            length: 0,
            refused: 0,
        }
    }

    /// Encodes a frame behind the bytes that wait; `false`, and one more refused,
    /// if it has no room.
    pub fn push(&mut self, frame: LinkFrame<'_>) -> bool {
        let mut encoded = [0; MAX_ENCODED];
        let length = frame.emit(&mut encoded);
        let encoded = length.and_then(|length| encoded.get(..length));
        let taken = encoded.is_some_and(|encoded| self.append(encoded));
        if !taken {
            self.refused = self.refused.saturating_add(1);
        }
        taken
    }

    fn append(&mut self, bytes: &[u8]) -> bool {
        if bytes.len() > N - self.length {
            return false;
        }
        for byte in bytes {
            let end = self.start + self.length;
            let end = if end < N { end } else { end - N };
            if let Some(place) = self.bytes.get_mut(end) {
                *place = *byte;
            }
            self.length += 1;
        }
        true
    }

    /// The bytes that are next, as many as lie side by side.
    #[must_use]
    pub fn pending(&self) -> &[u8] {
        let end = (self.start + self.length).min(N);
        self.bytes.get(self.start..end).unwrap_or(&[])
    }

    /// The first `count` bytes of [`pending`](Self::pending) are on the line.
    pub fn sent(&mut self, count: usize) {
        let count = count.min(self.pending().len());
        self.length -= count;
        self.start += count;
        if self.start == N {
            self.start = 0;
        }
    }

    /// Frames that had no room.
    #[must_use]
    pub const fn refused(&self) -> u32 {
        self.refused
    }
}
