//! A few frames of a picture or a video, evenly spread over its length.

use super::y4m::{Frame, Reader};
use super::{VideoError, compensate::first_bytes};
use iltm_picture::{Picture, png};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The picture of a PNG file, or at least `most / 2` and at most `most` frames of a Y4M
/// file (all, if it has no more), by the file's first bytes. The file is read once from
/// beginning to end, and no more than `most` frames are held.
///
/// # Errors
/// [`VideoError`] if the file cannot be read.
pub fn sampled_frames(path: &Path, most: usize) -> Result<Vec<Picture>, VideoError> {
    let mut file = File::open(path).map_err(|source| VideoError::File {
        path: path.to_owned(),
        source,
    })?;
    let first = first_bytes(&mut file).map_err(|source| VideoError::Read { source })?;
    let whole = first.as_slice().chain(file);
    if first.starts_with(&png::SIGNATURE) {
        return Ok(vec![png::read(whole)?]);
    }
    if !first.starts_with(b"YUV4MPEG") {
        return Err(VideoError::UnknownFormat);
    }
    let most = most.max(2);
    let mut reader = Reader::new(whole)?;
    let header = reader.header().clone();
    let (mut frame, mut frames) = (Frame::default(), Vec::new());
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
