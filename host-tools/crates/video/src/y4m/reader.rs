//! Reader of a Y4M stream, one frame at a time.

use super::Y4mError;
use super::header::{Header, MAGIC, MAX_HEADER};
use std::io::{BufRead, BufReader, ErrorKind, Read};

/// Longest frame header in bytes, its newline included.
const MAX_FRAME_HEADER: usize = 1024;

/// First bytes of every frame.
pub(super) const FRAME: &[u8] = b"FRAME";

/// Bytes that are read at once. Planes are larger and do not pass through the
/// buffer.
const BUFFER: usize = 1 << 16;

/// One frame: its planes one after the other, luma first.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct YuvFrame {
    /// What its header says beyond `FRAME`, with the space before it.
    pub parameters: Vec<u8>,
    /// [`Header::frame_bytes`] bytes.
    pub samples: Vec<u8>,
}

/// Reads a stream.
#[derive(Debug)]
pub struct Reader<R> {
    input: BufReader<R>,
    header: Header,
    offset: u64,
    frames: u64,
}

impl<R: Read> Reader<R> {
    /// Reads the stream header.
    ///
    /// # Errors
    /// [`Y4mError`] if it is not the header of a stream that can be read.
    pub fn new(input: R) -> Result<Self, Y4mError> {
        let mut input = BufReader::with_capacity(BUFFER, input);
        let mut line = Vec::new();
        let ended = read_line(&mut input, MAX_HEADER, &mut line)
            .map_err(|source| Y4mError::Read { offset: 0, source })?;
        let given = line.len() as u64;
        if !line.starts_with(MAGIC) {
            return Err(Y4mError::NotY4m);
        }
        if !ended && line.len() == MAX_HEADER {
            return Err(Y4mError::LongLine {
                what: "stream header",
                offset: 0,
                limit: MAX_HEADER,
            });
        }
        if !ended {
            return Err(Y4mError::Truncated {
                place: "the stream header".to_owned(),
                offset: given,
                needed: given + 1,
                given,
            });
        }
        Ok(Self {
            input,
            header: Header::parse(&line)?,
            offset: given + 1,
            frames: 0,
        })
    }

    /// The stream header.
    #[must_use]
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// Reads the next frame into `frame`, whose memory is used again; `false` at
    /// the end of the stream.
    ///
    /// # Errors
    /// [`Y4mError`] if what follows is not a whole frame.
    ///
    /// # Fuzzing
    /// Total: any bytes give frames and then an end or an error.
    pub fn read_frame(&mut self, frame: &mut YuvFrame) -> Result<bool, Y4mError> {
        let (number, start) = (self.frames + 1, self.offset);
        frame.parameters.clear();
        let ended = read_line(&mut self.input, MAX_FRAME_HEADER, &mut frame.parameters);
        let ended = ended.map_err(|source| Y4mError::Read {
            offset: start,
            source,
        })?;
        let given = frame.parameters.len();
        if given == 0 && !ended {
            return Ok(false);
        }
        self.offset += (given + usize::from(ended)) as u64;
        let begins = frame.parameters.starts_with(FRAME);
        if !begins || !matches!(frame.parameters.get(FRAME.len()), None | Some(b' ')) {
            // A stream that ends within the word has been cut, not mistaken.
            if !ended && FRAME.starts_with(&frame.parameters) {
                return Err(self.truncated(number, FRAME.len() + 1, given));
            }
            return Err(Y4mError::NotAFrame {
                frame: number,
                offset: start,
            });
        }
        if !ended && given == MAX_FRAME_HEADER {
            return Err(Y4mError::LongLine {
                what: "frame header",
                offset: start,
                limit: MAX_FRAME_HEADER,
            });
        }
        if !ended {
            return Err(self.truncated(number, given + 1, given));
        }
        frame.parameters.drain(..FRAME.len());
        self.read_samples(number, &mut frame.samples)?;
        self.frames = number;
        Ok(true)
    }

    fn read_samples(&mut self, frame: u64, samples: &mut Vec<u8>) -> Result<(), Y4mError> {
        samples.resize(self.header.frame_bytes(), 0);
        let mut filled = 0;
        while filled < samples.len() {
            match self.input.read(&mut samples[filled..]) {
                Ok(0) => return Err(self.truncated(frame, samples.len(), filled)),
                Ok(count) => {
                    filled += count;
                    self.offset += count as u64;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(source) => {
                    return Err(Y4mError::Read {
                        offset: self.offset,
                        source,
                    });
                }
            }
        }
        Ok(())
    }

    fn truncated(&self, frame: u64, needed: usize, given: usize) -> Y4mError {
        Y4mError::Truncated {
            place: format!("frame {frame}"),
            offset: self.offset,
            needed: needed as u64,
            given: given as u64,
        }
    }
}

/// Reads up to a newline, which is left out, but at most `limit` bytes; says
/// whether the newline was there.
fn read_line(
    input: &mut impl BufRead,
    limit: usize,
    line: &mut Vec<u8>,
) -> Result<bool, std::io::Error> {
    input.take(limit as u64).read_until(b'\n', line)?;
    let ended = line.last() == Some(&b'\n');
    if ended {
        line.pop();
    }
    Ok(ended)
}
