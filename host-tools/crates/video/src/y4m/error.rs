//! Errors of a Y4M stream, and what to do about each.

use iltm_picture::MAX_PIXELS;

/// Why a Y4M stream could not be read or written. Offsets are bytes from its
/// start; the first frame is 1.
#[derive(Debug, thiserror::Error)]
pub enum Y4mError {
    /// The first bytes are not those of a Y4M stream.
    #[error("the input does not begin with YUV4MPEG2, so it is not a Y4M stream")]
    NotY4m,
    /// A header line does not end where every header ends.
    #[error("the {what} at byte {offset} is longer than {limit} bytes")]
    LongLine {
        /// "stream header" or "frame header".
        what: &'static str,
        /// Where the line begins.
        offset: u64,
        /// Most bytes it may have.
        limit: usize,
    },
    /// A tag of the stream header does not mean anything.
    #[error("the tag {tag:?} at byte {offset} {reason}")]
    Tag {
        /// The tag.
        tag: String,
        /// Where it begins.
        offset: u64,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The stream header does not say how large frames are.
    #[error("the stream header has no {tag} tag")]
    NoSize {
        /// `W` or `H`.
        tag: char,
    },
    /// Frames are larger than any that are worked on.
    #[error(
        "the stream header says {width} x {height} pixels; \
         at most 65535 a side and {MAX_PIXELS} together are read"
    )]
    TooLarge {
        /// Width in pixels.
        width: u64,
        /// Height in pixels.
        height: u64,
    },
    /// Samples are laid out in a way that is not read.
    #[error(
        "the colour space {tag:?} at byte {offset} is not supported; \
         420, 420jpeg, 420mpeg2, 420paldv, 422, 444 and mono are, and 420, 422, 444 and mono \
         with 10 or 12 bits"
    )]
    Colour {
        /// The tag.
        tag: String,
        /// Where it begins.
        offset: u64,
    },
    /// Frames are made of two fields.
    #[error("the tag {tag:?} at byte {offset} says that the video is interlaced")]
    Interlaced {
        /// The tag.
        tag: String,
        /// Where it begins.
        offset: u64,
    },
    /// What stands where a frame should begin is something else.
    #[error("frame {frame} at byte {offset} does not begin with FRAME")]
    NotAFrame {
        /// The frame.
        frame: u64,
        /// Where it begins.
        offset: u64,
    },
    /// The stream ends before it should.
    #[error("the stream ends in {place} at byte {offset}: {given} of {needed} bytes are there")]
    Truncated {
        /// "the stream header" or "frame 7".
        place: String,
        /// Where the stream ends.
        offset: u64,
        /// Bytes that the part must have; for a header, the least it can have.
        needed: u64,
        /// Bytes that it has.
        given: u64,
    },
    /// The operating system could not read.
    #[error("reading at byte {offset}: {source}")]
    Read {
        /// How far reading had come.
        offset: u64,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The operating system could not write.
    #[error("writing frame {frame}: {source}")]
    Write {
        /// The frame, 0 for the stream header.
        frame: u64,
        /// What the operating system says.
        source: std::io::Error,
    },
}

impl Y4mError {
    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::NotY4m => {
                "Give a Y4M stream, for example from `ffmpeg -i VIDEO -f yuv4mpegpipe -`."
            }
            Self::LongLine { .. } | Self::Tag { .. } | Self::NoSize { .. } => {
                "Write the stream again with the program that made it; its header is damaged."
            }
            Self::NotAFrame { .. } | Self::Truncated { .. } => {
                "Make the stream again: what wrote it stopped early, or its header states another \
                 frame size."
            }
            Self::TooLarge { .. } => "Scale the video down to the projector's own size.",
            Self::Colour { .. } => "Convert it with `ffmpeg -i VIDEO -pix_fmt yuv420p OUT.y4m`.",
            Self::Interlaced { .. } => {
                "Make it progressive first, for example with `ffmpeg -i VIDEO -vf yadif OUT.y4m`."
            }
            Self::Read { .. } => "Check that the input can be read to its end.",
            Self::Write { .. } => {
                "Check that the disk has room, or that the program that reads the pipe still runs."
            }
        }
    }
}
