//! Sources of frames for a board: the test scene, a picture, or a video over and over.

use iltm_picture::{Picture, Samples, png};
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::{FrameSize, Grid};
use iltm_video::{
    FrameSplitter, Input, OwnFrame, VideoError,
    test_scene::TestScene,
    y4m::{CodeRange, Reader, Y4mError, YuvFrame},
    yuv::{Conversion, Standard},
};
use std::fs::File;
use std::io::{Chain, Cursor};
use std::path::{Path, PathBuf};

/// Frames without an end.
#[derive(Debug)]
pub struct FrameFeed {
    kind: Kind,
    size: FrameSize,
    channels: u8,
    rate: f64,
    /// Where the device is one of several projectors'.
    wide: Option<FrameSplitter>,
}

#[derive(Debug)]
enum Kind {
    Scene {
        scene: TestScene,
        next: u64,
    },
    Still(Picture),
    Video {
        path: PathBuf,
        reader: Reader<Chain<Cursor<Vec<u8>>, File>>,
        frame: YuvFrame,
    },
}

impl FrameFeed {
    /// The moving test scene, `rate` frames a second, each of `channels` (1 or 3)
    /// samples a pixel.
    #[must_use]
    pub fn scene(size: FrameSize, channels: u8, rate: f64) -> Self {
        let scene = TestScene::new(size, rate as f32);
        Self {
            kind: Kind::Scene { scene, next: 0 },
            size,
            channels,
            rate,
            wide: None,
        }
    }

    /// The frames of a PNG or Y4M file, by its first bytes; after the last one
    /// comes the first again. `rate` frames a second, or the video's own, or 25.
    /// Without `channels` as many as the file has.
    ///
    /// # Errors
    /// [`VideoError`] if the file cannot be read.
    pub fn file(path: &Path, channels: Option<u8>, rate: Option<f64>) -> Result<Self, VideoError> {
        let reader = match Input::open(path)? {
            Input::Png(file) => {
                let picture = png::read(file)?;
                return Ok(Self {
                    size: picture.size(),
                    channels: channels.unwrap_or(picture.channels() as u8),
                    rate: rate.unwrap_or(25.0),
                    kind: Kind::Still(picture),
                    wide: None,
                });
            }
            Input::Y4m(file) => Reader::new(file)?,
        };
        let header = reader.header();
        let colours = header.colours() as u8;
        Ok(Self {
            size: header.size(),
            channels: channels.unwrap_or(colours),
            rate: rate.or(header.rate()).unwrap_or(25.0),
            kind: Kind::Video {
                path: path.to_owned(),
                reader,
                frame: YuvFrame::default(),
            },
            wide: None,
        })
    }

    /// The same for a device that has this table: its own part of them and its neighbours' light, if
    /// it is one of several projectors', whose frames have these rows and columns of cells
    /// ([`FrameSplitter::new`]).
    ///
    /// # Errors
    /// [`VideoError::NotWide`] if the frames are not those of all projectors side by side.
    pub fn for_table(mut self, table: &Table<'_>, frames: &[[u16; 2]]) -> Result<Self, VideoError> {
        let Some(neighbours) = table.neighbours() else {
            return Ok(self);
        };
        let wide = FrameSplitter::new((table, frames), self.size, Encoding::Display);
        let [before, after] = neighbours.around();
        let wide = wide.ok_or(VideoError::NotWide {
            projectors: before + 1 + after,
            size: self.size,
        })?;
        self.wide = Some(wide);
        Ok(self)
    }

    /// Pixels of a frame of the device.
    #[must_use]
    pub fn size(&self) -> FrameSize {
        self.wide.as_ref().map_or(self.size, FrameSplitter::own)
    }

    /// The neighbours' cells whose light comes with each.
    #[must_use]
    pub fn neighbours(&self) -> Option<Grid> {
        self.wide.as_ref().map(FrameSplitter::cells)
    }

    /// Samples of a pixel.
    #[must_use]
    pub const fn channels(&self) -> u8 {
        self.channels
    }

    /// Frames a second.
    #[must_use]
    pub const fn rate(&self) -> f64 {
        self.rate
    }

    /// The next frame: 8-bit samples, the channels of a pixel side by side, and the neighbours' light;
    /// none where there are no neighbours.
    ///
    /// # Errors
    /// [`VideoError`] if the file does not go on.
    pub fn next_frame(&mut self) -> Result<OwnFrame, VideoError> {
        let picture = match &mut self.kind {
            Kind::Scene { scene, next } => {
                *next += 1;
                scene.frame(*next - 1)
            }
            Kind::Still(picture) => picture.clone(),
            Kind::Video {
                path,
                reader,
                frame,
            } => {
                let mut is_read = reader.read_frame(frame)?;
                if !is_read {
                    let Input::Y4m(file) = Input::open(path)? else {
                        return Err(VideoError::Still);
                    };
                    *reader = Reader::new(file)?;
                    is_read = reader.read_frame(frame)?;
                }
                let header = reader.header();
                let picture = frame.to_picture(header).filter(|_| is_read);
                picture.ok_or_else(|| Y4mError::Truncated {
                    place: "the first frame".to_owned(),
                    offset: header.line().len() as u64 + 1,
                    needed: header.frame_bytes() as u64,
                    given: 0,
                })?
            }
        };
        let pixels = samples(&picture, self.channels);
        Ok(match &self.wide {
            Some(wide) => wide.of_frame(&pixels),
            None => OwnFrame {
                pixels,
                light: Vec::new(),
            },
        })
    }
}

/// The samples of a picture in 8 bits and this many channels. Grey of a colour is
/// its luma by BT.601.
fn samples(picture: &Picture, channels: u8) -> Vec<u8> {
    let eight = match picture.samples() {
        Samples::Eight(samples) => samples.clone(),
        Samples::Sixteen(samples) => samples.iter().map(|code| (code >> 8) as u8).collect(),
    };
    match (picture.channels(), channels) {
        (1, 3) => eight.iter().flat_map(|grey| [*grey; 3]).collect(),
        (3, 1) => {
            let (pixels, _) = eight.as_chunks::<3>();
            let conversion = Conversion::new(Standard::Bt601, CodeRange::Full);
            pixels.iter().map(|pixel| conversion.luma(*pixel)).collect()
        }
        _ => eight,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("writable");
        (folder, path)
    }

    #[test]
    fn a_video_begins_again_after_its_last_frame_and_keeps_its_rate() {
        let mut stream = b"YUV4MPEG2 W2 H1 F30000:1001 Cmono\n".to_vec();
        for code in [16, 235] {
            stream.extend(b"FRAME\n");
            stream.extend([code; 2]);
        }
        let (_folder, path) = in_file("v.y4m", &stream);
        let mut frames = FrameFeed::file(&path, None, None).expect("a good video");
        assert_eq!((frames.size().width(), frames.channels()), (2, 1));
        assert!((frames.rate() - 29.97).abs() < 0.001);
        let got: Vec<_> = (0..5)
            .map(|_| frames.next_frame().expect("a frame").pixels[0])
            .collect();
        assert_eq!(got, [16, 235, 16, 235, 16]);
    }

    #[test]
    fn a_video_without_frames_is_an_error_and_no_endless_loop() {
        let (_folder, path) = in_file("v.y4m", b"YUV4MPEG2 W2 H1 F25:1 Cmono\n");
        let mut frames = FrameFeed::file(&path, None, None).expect("a header");
        assert!(frames.next_frame().is_err());
    }

    #[test]
    fn the_test_scene_moves_from_its_first_frame_on() {
        let size = FrameSize::new(16, 8).expect("small");
        let scene = TestScene::new(size, 25.0);
        let mut frames = FrameFeed::scene(size, 3, 25.0);
        for number in 0..3 {
            let got = frames.next_frame().expect("a frame").pixels;
            assert_eq!(got, samples(&scene.frame(number), 3), "frame {number}");
        }
    }

    #[test]
    fn grey_and_colour_become_each_other() {
        let size = FrameSize::new(1, 1).expect("a pixel");
        let grey = Picture::new(size, Samples::Sixteen(vec![0xABCD])).expect("grey");
        assert_eq!(samples(&grey, 3), [0xAB; 3]);
        let colour = Picture::new(size, Samples::Eight(vec![255, 255, 255])).expect("colour");
        assert_eq!(samples(&colour, 1), [255]);
        let red = Picture::new(size, Samples::Eight(vec![255, 0, 0])).expect("colour");
        // 0.299 * 255 = 76.2.
        assert_eq!(samples(&red, 1), [76]);
    }

    #[test]
    fn the_scene_moves() {
        let size = FrameSize::new(16, 12).expect("small");
        let mut frames = FrameFeed::scene(size, 3, 25.0);
        let first = frames.next_frame().expect("a frame");
        assert!(first.light.is_empty(), "no neighbours");
        assert_eq!(first.pixels.len(), 16 * 12 * 3);
        let mut later = (1..100).map(|_| frames.next_frame().expect("a frame"));
        assert!(later.all(|frame| frame != first));
    }
}
