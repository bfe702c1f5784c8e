//! Screen: what an emulated board receives and what it sends to its projector, side by side in a
//! window of mpv; and a video file of what it sends.

use super::super::args::Emulate;
use super::super::failure::Failure;
use super::super::mpv::{mpv, start};
use crate::video::VideoError;
use crate::video::y4m::{ChromaSampling, CodeRange, Header, Writer, YuvFrame};
use iltm_picture::{Picture, Samples, WholeFile};
use iltm_runtime::FrameSize;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread;

/// Black pixels between the two pictures.
const GAP: usize = 8;

/// What frames are: their size, samples of a pixel, and frames a second.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct PictureKind {
    pub(super) size: FrameSize,
    pub(super) channels: u8,
    pub(super) rate: f64,
}

/// Shows and keeps frames, as far as it was asked for.
#[derive(Default)]
pub(super) struct BoardScreen {
    window: Option<MpvWindow>,
    video: Option<Video>,
}

impl BoardScreen {
    pub(super) fn new(arguments: &Emulate, kind: PictureKind) -> Result<Self, Failure> {
        let window = arguments
            .window
            .then(|| MpvWindow::open(kind))
            .transpose()?;
        let video = arguments.save.as_deref();
        let video = video.map(|path| Video::create(path, kind)).transpose()?;
        Ok(Self { window, video })
    }

    /// Takes a frame that the board has sent, and the newest one that it was given.
    pub(super) fn take(
        &mut self,
        kind: PictureKind,
        given: &[u8],
        sent: &[u8],
    ) -> Result<(), Failure> {
        if let Some(window) = &mut self.window {
            if window.kind != kind {
                *window = MpvWindow::open(kind)?;
            }
            if !window.show(given, sent) {
                // It was closed, and nothing else ends by that.
                self.window = None;
            }
        }
        match &mut self.video {
            Some(video) => video.keep(kind, sent),
            None => Ok(()),
        }
    }

    /// Ends the video. How many frames it has, if there is one.
    pub(super) fn finish(&mut self) -> Result<Option<u64>, Failure> {
        self.window = None;
        self.video.take().map(Video::finish).transpose()
    }
}

/// A window of mpv, gone when it is dropped.
struct MpvWindow {
    kind: PictureKind,
    player: Child,
    frames: SyncSender<Vec<u8>>,
}

impl MpvWindow {
    fn open(kind: PictureKind) -> Result<Self, Failure> {
        let (width, height) = (2 * kind.size.width() + GAP, kind.size.height());
        let mut command = mpv();
        command
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .args(["--demuxer=rawvideo", "--demuxer-rawvideo-mp-format=rgb24"])
            .arg(format!("--demuxer-rawvideo-w={width}"))
            .arg(format!("--demuxer-rawvideo-h={height}"))
            .arg(format!("--demuxer-rawvideo-fps={:.3}", kind.rate))
            .arg("--profile=low-latency")
            .args(["--scale=nearest", "--autofit-smaller=60%x40%"])
            .arg("--title=iltm emulate: received, and sent to the projector")
            .arg("-");
        let mut player = start(&mut command)?;
        let mut pipe = player.stdin.take().expect("it is piped");
        // The board does not wait for a window: frames that this has no time for are left out.
        let (frames, shown) = sync_channel::<Vec<u8>>(2);
        thread::spawn(move || {
            while let Ok(frame) = shown.recv() {
                if pipe.write_all(&frame).is_err() {
                    break;
                }
            }
        });
        Ok(Self {
            kind,
            player,
            frames,
        })
    }

    /// Whether it is still there.
    fn show(&self, given: &[u8], sent: &[u8]) -> bool {
        let channels = usize::from(self.kind.channels);
        let line = self.kind.size.width() * channels;
        let mut both = Vec::new();
        for (given, sent) in given.chunks_exact(line).zip(sent.chunks_exact(line)) {
            both.extend(coloured(given, channels));
            both.extend([0; 3 * GAP]);
            both.extend(coloured(sent, channels));
        }
        !matches!(
            self.frames.try_send(both),
            Err(TrySendError::Disconnected(_))
        )
    }
}

impl Drop for MpvWindow {
    fn drop(&mut self) {
        let _ = self.player.kill();
        let _ = self.player.wait();
    }
}

/// Three samples for each pixel of one or three.
fn coloured(samples: &[u8], channels: usize) -> impl Iterator<Item = u8> {
    let pixels = samples.chunks_exact(channels);
    pixels.flat_map(move |pixel| [0, 1, 2].map(|channel: usize| pixel[channel.min(channels - 1)]))
}

/// A video that is written while the board runs, whole when it ends.
struct Video {
    kind: PictureKind,
    header: Header,
    whole: WholeFile,
    writer: Writer<BufWriter<File>>,
    frames: u64,
}

impl Video {
    fn create(path: &Path, kind: PictureKind) -> Result<Self, Failure> {
        let sampling = match kind.channels {
            1 => ChromaSampling::Mono,
            _ => ChromaSampling::Chroma444,
        };
        let rate = ((1000.0 * kind.rate).round() as u32, 1000);
        let header = Header::new(kind.size, rate, sampling, CodeRange::Full);
        let mut whole = WholeFile::create(path).map_err(VideoError::from)?;
        let file = whole.file().try_clone();
        let file = file.map_err(|error| super::cannot_write(path, &error))?;
        let writer = Writer::new(BufWriter::new(file), &header).map_err(VideoError::from)?;
        Ok(Self {
            kind,
            header,
            whole,
            writer,
            frames: 0,
        })
    }

    /// Frames of another kind, as a table of another size asks for, have no place in it.
    fn keep(&mut self, kind: PictureKind, sent: &[u8]) -> Result<(), Failure> {
        if kind != self.kind {
            return Ok(());
        }
        let picture = Picture::new(kind.size, Samples::Eight(sent.to_vec()));
        let frame = picture.and_then(|picture| YuvFrame::from_picture(&self.header, &picture));
        if let Some(frame) = frame {
            self.writer.write_frame(&frame).map_err(VideoError::from)?;
            self.frames += 1;
        }
        Ok(())
    }

    fn finish(self) -> Result<u64, Failure> {
        self.writer.finish().map_err(VideoError::from)?;
        self.whole.finish().map_err(VideoError::from)?;
        Ok(self.frames)
    }
}
