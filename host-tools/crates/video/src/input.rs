//! Inputs, told apart by their first bytes: PNG pictures and Y4M streams.

use super::VideoError;
use super::y4m::{MAGIC, Reader, YuvFrame};
use iltm_picture::{Picture, foreign_file, png};
use std::fs::File;
use std::io::{Chain, Cursor, Read};
use std::path::Path;

/// An input, from its beginning.
#[derive(Debug)]
pub enum Input<R> {
    /// It begins like a PNG picture.
    Png(Whole<R>),
    /// It begins like a Y4M stream.
    Y4m(Whole<R>),
}

/// The bytes that were looked at, then the rest.
type Whole<R> = Chain<Cursor<Vec<u8>>, R>;

impl Input<File> {
    /// A file.
    ///
    /// # Errors
    /// [`VideoError::Open`] if it cannot be opened, and those of [`of`](Self::of).
    pub fn open(path: &Path) -> Result<Self, VideoError> {
        let file = foreign_file::open(path).map_err(|source| VideoError::Open {
            path: path.to_owned(),
            source,
        })?;
        Self::of(file)
    }
}

impl<R> Input<R> {
    /// Whether it is a picture.
    #[must_use]
    pub const fn is_png(&self) -> bool {
        matches!(self, Self::Png(_))
    }
}

impl<R: Read> Input<R> {
    /// What `input` begins like.
    ///
    /// # Errors
    /// [`VideoError::UnknownFormat`], or [`VideoError::Read`].
    pub fn of(mut input: R) -> Result<Self, VideoError> {
        let mut first = Vec::new();
        let mut head = input.by_ref().take(png::SIGNATURE.len() as u64);
        let read = head.read_to_end(&mut first);
        read.map_err(|source| VideoError::Read { source })?;
        let is_png = first.starts_with(&png::SIGNATURE);
        let is_y4m = first.starts_with(&MAGIC[..png::SIGNATURE.len()]);
        let whole = Cursor::new(first).chain(input);
        match (is_png, is_y4m) {
            (true, _) => Ok(Self::Png(whole)),
            (_, true) => Ok(Self::Y4m(whole)),
            _ => Err(VideoError::UnknownFormat),
        }
    }
}

/// The picture of a PNG file, or at least `most / 2` and at most `most` frames of a Y4M
/// file (all, if it has no more), spread evenly over its length. The file is read once
/// from beginning to end, and no more than `most` frames are held.
///
/// # Errors
/// [`VideoError`] if the file cannot be read.
pub fn sampled_frames(path: &Path, most: usize) -> Result<Vec<Picture>, VideoError> {
    let whole = match Input::open(path)? {
        Input::Png(file) => return Ok(vec![png::read(file)?]),
        Input::Y4m(file) => file,
    };
    let most = most.max(2);
    let mut reader = Reader::new(whole)?;
    let header = reader.header().clone();
    let (mut frame, mut frames) = (YuvFrame::default(), Vec::new());
    let (mut number, mut step) = (0_usize, 1_usize);
    while reader.read_frame(&mut frame)? {
        if number.is_multiple_of(step) {
            if frames.len() == most {
                // From now on every second one of those so far.
                let mut keep = false;
                frames.retain(|_| {
                    keep = !keep;
                    keep
                });
                step *= 2;
            }
            if number.is_multiple_of(step) {
                frames.extend(frame.to_picture(&header));
            }
        }
        number += 1;
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Samples;

    /// Grey frames, each of its own brightness.
    fn video(frames: u8) -> Vec<u8> {
        let mut bytes = b"YUV4MPEG2 W2 H2 Cmono XCOLORRANGE=FULL\n".to_vec();
        for frame in 0..frames {
            bytes.extend(b"FRAME\n");
            bytes.extend([frame; 4]);
        }
        bytes
    }

    #[test]
    fn frames_are_spread_evenly_over_a_video_of_any_length() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.y4m");
        for (frames, expected) in [
            (3, vec![0, 1, 2]),
            (4, vec![0, 1, 2, 3]),
            (5, vec![0, 2, 4]),
            (9, vec![0, 4, 8]),
            (200, vec![0, 64, 128, 192]),
        ] {
            std::fs::write(&path, video(frames)).unwrap();
            let pictures = sampled_frames(&path, 4).unwrap();
            let brightness: Vec<u8> = pictures
                .iter()
                .map(|picture| match picture.samples() {
                    Samples::Eight(samples) => samples[0],
                    Samples::Sixteen(_) => panic!("8 bits"),
                })
                .collect();
            assert_eq!(brightness, expected, "{frames} frames");
        }
    }
}
