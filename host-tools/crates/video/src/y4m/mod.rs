//! YUV4MPEG2, the uncompressed video that pipes carry.
//!
//! A stream is a line of tags, then frames: a line `FRAME`, the luma plane, the
//! two chroma planes, one byte a sample, or two of more than 8 bits, the lower one first. What a tag means follows
//! `yuv4mpeg(5)` of mjpegtools and, for `XCOLORRANGE`, `FFmpeg`.
//!
//! | read | what it must be |
//! |---|---|
//! | `W`, `H` | 1 to 65,535 each, at most [`MAX_PIXELS`](iltm_picture::MAX_PIXELS) together |
//! | `C` | `420`, `420jpeg`, `420mpeg2`, `420paldv`, `422`, `444`, `mono`, and as `FFmpeg` has them with 10 or 12 bits `420p10`, `422p10`, `444p10`, `mono10` and so on; `420` if absent |
//! | `I` | `p`, `?` or absent: rows of one field have nothing between them to average with |
//! | `XCOLORRANGE` | `LIMITED` or `FULL`; if absent limited, and full for `mono`, as `FFmpeg` has it |
//! | `F` | frames a second as a fraction; unknown if absent or malformed |
//! | all else | kept and written out again, byte for byte |
//!
//! Reading a frame needs memory for that frame, however long the stream is.
//!
//! The crate `y4m` (0.8.0) was looked at first: it reports a stream that ends
//! within a frame as its regular end, multiplies width and height without a
//! check, and writes headers of its own, without interlacing and comments.

mod error;
mod header;
mod reader;
mod writer;

pub use error::Y4mError;
pub(crate) use header::MAGIC;
pub use header::{ChromaSampling, CodeRange, Header};
pub use reader::{Reader, YuvFrame};
pub use writer::Writer;

#[cfg(test)]
mod tests;
