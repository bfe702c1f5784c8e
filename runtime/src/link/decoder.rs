//! Frame decoder: from single bytes to checked frames.

use super::frame::{LinkFrame, LinkFrameError, MAX_FRAME};
use cobs::{DecodeResult, DecoderState};

/// Collects bytes into frames.
///
/// Every delimiter starts it afresh: garbage costs the frame it is in, and one
/// more if it ate the delimiter between two.
///
/// # Fuzzing
/// Total: any bytes give frames or errors. `tests/fuzz/fuzz_targets/link.rs` holds
/// it to that.
#[derive(Debug)]
pub struct Decoder {
    state: DecoderState,
    bytes: [u8; MAX_FRAME],
    /// Bytes of the current frame, also those that found no room.
    length: usize,
    bad: u32,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Before the first byte.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            state: DecoderState::Idle,
            bytes: [0; MAX_FRAME],
            length: 0,
            bad: 0,
        }
    }

    /// Takes the next byte; it may end a frame, or something that is none.
    ///
    /// Delimiters without anything between them are no frame and no error: a
    /// sender may put one before a frame to end what a receiver may have heard
    /// of the line before.
    pub fn push(&mut self, byte: u8) -> Option<Result<LinkFrame<'_>, LinkFrameError>> {
        match self.state.feed(byte) {
            Ok(DecodeResult::NoData) => None,
            Ok(DecodeResult::DataStart) => {
                self.length = 0;
                None
            }
            Ok(DecodeResult::DataContinue(byte)) => {
                if let Some(place) = self.bytes.get_mut(self.length) {
                    *place = byte;
                }
                self.length = self.length.saturating_add(1);
                None
            }
            Ok(DecodeResult::DataComplete) => {
                let whole = self.bytes.get(..self.length);
                let frame = whole
                    .ok_or(LinkFrameError::TooLong)
                    .and_then(LinkFrame::parse);
                if frame.is_err() {
                    self.bad = self.bad.saturating_add(1);
                }
                Some(frame)
            }
            Err(_) => {
                self.bad = self.bad.saturating_add(1);
                Some(Err(if self.length > MAX_FRAME {
                    LinkFrameError::TooLong
                } else {
                    LinkFrameError::Cobs
                }))
            }
        }
    }

    /// How many times something other than a frame stood between delimiters.
    #[must_use]
    pub const fn bad(&self) -> u32 {
        self.bad
    }
}
