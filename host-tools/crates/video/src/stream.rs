//! Pipeline of three threads: reading, working and writing at the same time.
//!
//! Three threads pass a fixed number of frames round: one reads into them, the
//! caller's works on them in place, one writes them out. So a pipe that is slow
//! for a moment stops nobody, and memory does not depend on the stream's length.

use super::VideoError;
use super::y4m::{Header, Reader, Writer, Y4mError, YuvFrame};
use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

/// Frames that go round: one with each thread, and one waiting between them.
const FRAMES: usize = 5;

/// The frames of a stream, one after the other.
pub(super) struct FrameQueue {
    read: Receiver<YuvFrame>,
    finished: SyncSender<YuvFrame>,
    /// Read and not yet worked on.
    next: Option<YuvFrame>,
}

impl FrameQueue {
    /// Waits for the next frame; `false` if there is none any more.
    pub(super) fn wait(&mut self) -> bool {
        if self.next.is_none() {
            self.next = self.read.recv().ok();
        }
        self.next.is_some()
    }

    /// Works on the next frame in place and hands it on; what `work` returns, or `None`
    /// if there is no frame, or nobody takes any.
    ///
    /// # Errors
    /// What `work` returns; the frame is not handed on then.
    pub(super) fn work<T>(
        &mut self,
        work: impl FnOnce(&mut YuvFrame) -> Result<T, VideoError>,
    ) -> Result<Option<T>, VideoError> {
        self.wait();
        let Some(mut frame) = self.next.take() else {
            return Ok(None);
        };
        let worked = work(&mut frame)?;
        Ok(self.finished.send(frame).is_ok().then_some(worked))
    }
}

/// Sends the frames of `reader` through `work`, which takes them one after the other, to
/// `output`, where they are those of `header`.
///
/// Says whether all frames were taken: a reader of the output that has ended is no error.
///
/// # Errors
/// What reading, `work` or writing returns. What came before it has been written.
pub(super) fn run<R: Read + Send, W: Write + Send>(
    reader: Reader<R>,
    header: Header,
    output: W,
    work: impl FnOnce(&mut FrameQueue) -> Result<(), VideoError>,
) -> Result<bool, VideoError> {
    let (free, empty) = sync_channel(FRAMES);
    let (filled, read) = sync_channel(FRAMES);
    let (finished, done) = sync_channel(FRAMES);
    for _ in 0..FRAMES {
        // The channel has room for all, and its other end is here.
        let _ = free.send(YuvFrame::default());
    }
    thread::scope(|scope| {
        let reading = scope.spawn(move || read_all(reader, &empty, &filled));
        let writing = scope.spawn(move || write_all(output, &header, &done, &free));
        let mut frames = FrameQueue {
            read,
            finished,
            next: None,
        };
        let worked = work(&mut frames);
        // Both threads end when nobody is at the other end.
        drop(frames);
        let taken = match finish(writing.join()) {
            Err(Y4mError::Write { source, .. }) if source.kind() == ErrorKind::BrokenPipe => false,
            written => written.map(|()| true)?,
        };
        finish(reading.join())?;
        worked.map(|()| taken)
    })
}

fn finish(result: thread::Result<Result<(), Y4mError>>) -> Result<(), Y4mError> {
    result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Reads until the end, an error, or nobody takes frames any more.
fn read_all<R: Read>(
    mut reader: Reader<R>,
    empty: &Receiver<YuvFrame>,
    filled: &SyncSender<YuvFrame>,
) -> Result<(), Y4mError> {
    for mut frame in empty {
        if !reader.read_frame(&mut frame)? || filled.send(frame).is_err() {
            break;
        }
    }
    Ok(())
}

/// Writes until there are no more frames, or an error.
fn write_all<W: Write>(
    output: W,
    header: &Header,
    done: &Receiver<YuvFrame>,
    free: &SyncSender<YuvFrame>,
) -> Result<(), Y4mError> {
    let mut writer = Writer::new(output, header)?;
    for frame in done {
        writer.write_frame(&frame)?;
        // The reader may have come to the end and need no more.
        let _ = free.send(frame);
    }
    writer.finish().map(drop)
}
