//! Writer of a Y4M stream, one frame at a time.

use super::reader::FRAME;
use super::{Header, Y4mError, YuvFrame};
use std::io::Write;

/// Writes a stream.
#[derive(Debug)]
pub struct Writer<W> {
    output: W,
    frames: u64,
    line: Vec<u8>,
}

impl<W: Write> Writer<W> {
    /// Writes the stream header.
    ///
    /// # Errors
    /// [`Y4mError::Write`].
    pub fn new(mut output: W, header: &Header) -> Result<Self, Y4mError> {
        let mut line = header.line().to_vec();
        line.push(b'\n');
        output
            .write_all(&line)
            .map_err(|source| Y4mError::Write { frame: 0, source })?;
        Ok(Self {
            output,
            frames: 0,
            line,
        })
    }

    /// Writes a frame, whose samples must be as many as the header says.
    ///
    /// # Errors
    /// [`Y4mError::Write`].
    pub fn write_frame(&mut self, frame: &YuvFrame) -> Result<(), Y4mError> {
        self.frames += 1;
        self.line.clear();
        self.line.extend_from_slice(FRAME);
        self.line.extend_from_slice(&frame.parameters);
        self.line.push(b'\n');
        let written = self.output.write_all(&self.line);
        written
            .and_then(|()| self.output.write_all(&frame.samples))
            .map_err(|source| self.error(source))
    }

    /// Flushes the output and gives it back.
    ///
    /// # Errors
    /// [`Y4mError::Write`].
    pub fn finish(mut self) -> Result<W, Y4mError> {
        match self.output.flush() {
            Ok(()) => Ok(self.output),
            Err(source) => Err(self.error(source)),
        }
    }

    fn error(&self, source: std::io::Error) -> Y4mError {
        Y4mError::Write {
            frame: self.frames,
            source,
        }
    }
}
