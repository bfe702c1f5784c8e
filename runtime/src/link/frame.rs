//! Wire frame: one frame on the serial line.
//!
//! ```text
//! COBS( channel u8 | sequence u16 | payload | CRC-32 u32 ) 0x00
//! ```
//!
//! Little-endian. COBS (Cheshire and Baker, 1999) leaves no zero byte in a frame,
//! so every zero byte on the line is the end of one, whatever was lost before.
//! The CRC-32 (ISO-HDLC) covers everything before it.

use crate::image::crc32;
use cobs::CobsEncoder;
use core::fmt;

/// The byte that ends every frame and is nowhere inside one.
pub const DELIMITER: u8 = 0;

/// Most bytes of a payload: 512 of a table and a message around them.
pub const MAX_PAYLOAD: usize = 576;

/// Most bytes of a frame before COBS.
pub const MAX_FRAME: usize = field::OVERHEAD + MAX_PAYLOAD;

/// Most bytes of a frame on the line, delimiter included.
pub const MAX_ENCODED: usize = cobs::max_encoding_length(MAX_FRAME) + 1;

/// Lengths of the fields.
mod field {
    /// Channel and sequence number.
    pub(super) const HEAD: usize = 3;
    /// CRC-32.
    pub(super) const CRC: usize = 4;
    /// Everything but the payload.
    pub(super) const OVERHEAD: usize = HEAD + CRC;
}

/// What a frame is for. The numbers are the wire format: do not reorder.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Channel {
    /// Host to device: a [`Request`](super::Request).
    Request = 0,
    /// Device to host: the [`Response`](super::Response) to the request with the
    /// same sequence number.
    Response = 1,
    /// Device to host, by subscription: an [`Event`](super::Event). Events count
    /// their own sequence numbers; a gap is an event that was lost.
    Event = 2,
    /// Device to host, by subscription: whole defmt frames in raw encoding. Logs
    /// count their own sequence numbers as well.
    Log = 3,
}

impl Channel {
    const fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Request,
            1 => Self::Response,
            2 => Self::Event,
            3 => Self::Log,
            _ => return None,
        })
    }
}

/// A frame with its checksum verified, or one to send.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LinkFrame<'a> {
    /// What it is for.
    pub channel: Channel,
    /// Its number in the channel.
    pub sequence: u16,
    /// At most [`MAX_PAYLOAD`] bytes.
    pub payload: &'a [u8],
}

/// Why bytes between two delimiters are no frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LinkFrameError {
    /// They are not COBS: the delimiter came too early.
    Cobs,
    /// They are more than any frame has.
    TooLong,
    /// They are fewer than any frame has.
    TooShort,
    /// They do not match their CRC.
    Checksum,
    /// The channel does not exist.
    Channel {
        /// Its number.
        number: u8,
    },
}

impl fmt::Display for LinkFrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cobs => f.write_str("the frame ends too early"),
            Self::TooLong => f.write_str("the frame is too long"),
            Self::TooShort => f.write_str("the frame is too short"),
            Self::Checksum => f.write_str("the frame does not match its checksum"),
            Self::Channel { number } => write!(f, "the frame is for unknown channel {number}"),
        }
    }
}

impl core::error::Error for LinkFrameError {}

impl<'a> LinkFrame<'a> {
    /// Reads the bytes of a frame after COBS.
    ///
    /// # Errors
    /// [`LinkFrameError`], except for [`LinkFrameError::Cobs`].
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, LinkFrameError> {
        let (checked, crc) = bytes
            .split_last_chunk::<{ field::CRC }>()
            .ok_or(LinkFrameError::TooShort)?;
        let (head, payload) = checked
            .split_first_chunk::<{ field::HEAD }>()
            .ok_or(LinkFrameError::TooShort)?;
        if crc32(&[checked]) != u32::from_le_bytes(*crc) {
            return Err(LinkFrameError::Checksum);
        }
        if payload.len() > MAX_PAYLOAD {
            return Err(LinkFrameError::TooLong);
        }
        let [number, low, high] = *head;
        let channel = Channel::from_number(number).ok_or(LinkFrameError::Channel { number })?;
        Ok(Self {
            channel,
            sequence: u16::from_le_bytes([low, high]),
            payload,
        })
    }

    /// Writes it as it goes on the line, delimiter included, into `out`.
    ///
    /// Returns its length, at most [`MAX_ENCODED`]; `None` if the payload is too long
    /// or `out` too short.
    #[must_use]
    pub fn emit(&self, out: &mut [u8]) -> Option<usize> {
        if self.payload.len() > MAX_PAYLOAD {
            return None;
        }
        let [low, high] = self.sequence.to_le_bytes();
        let head = [self.channel as u8, low, high];
        let crc = crc32(&[&head, self.payload]);
        let mut encoder = CobsEncoder::new(out);
        for part in [&head, self.payload, &crc.to_le_bytes()] {
            encoder.push(part).ok()?;
        }
        let length = encoder.finalize();
        *out.get_mut(length)? = DELIMITER;
        Some(length + 1)
    }
}
