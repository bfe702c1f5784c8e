//! A moving picture to compensate.

use super::DemoError;
use crate::report::ReportError;
use crate::video::test_scene::TestScene;
use crate::video::y4m::{Frame, Header, Range, Sampling, Writer, Y4mError};
use crate::video::{Compensator, Settings, Summary, VideoError};
use iltm_picture::{LightPicture, Picture, Response, WholeFile, progress::Progress};
use iltm_runtime::{FrameSize, image::Table};
use std::io::BufWriter;
use std::path::Path;

/// Frames a second.
const RATE: u32 = 25;

/// Three seconds.
pub(super) const FRAMES: u64 = 75;

/// What the scene's motion and colours follow from.
const SEED: u64 = 1;

/// The frame that the report shows: in the middle of things.
const STILL: u64 = 40;

/// One frame of the video in another size, from one twice as large: that has less
/// of the grain, which would be most of a page with many pictures.
pub(super) fn still(size: FrameSize) -> Picture {
    let doubled = |side: usize| u16::try_from(2 * side).ok();
    let large = doubled(size.width()).zip(doubled(size.height()));
    let large = large.and_then(|(width, height)| FrameSize::new(width, height));
    let draw = |size| TestScene::new(size, RATE as f32, SEED).frame(STILL);
    large.map_or_else(
        || draw(size),
        |large| {
            LightPicture::decode(&draw(large), Response::Srgb)
                .halved()
                .for_display()
        },
    )
}

/// Writes the video, 4:2:0.
pub(super) fn write(
    path: &Path,
    size: FrameSize,
    progress: &dyn Progress,
) -> Result<(), DemoError> {
    let header = Header::new(size, (RATE, 1), Sampling::Chroma420, Range::Limited);
    let scene = TestScene::new(size, RATE as f32, SEED);
    let mut whole = WholeFile::create(path)?;
    let mut writer = Writer::new(BufWriter::new(whole.file()), &header).map_err(wrap)?;
    progress.begin("drawing the test video", FRAMES);
    for number in 0..FRAMES {
        let picture = scene.frame(number);
        // The scene is as large as the header says, and has the colours of 4:2:0.
        let frame = Frame::from_picture(&header, &picture).expect("a frame of the stream");
        writer.write_frame(&frame).map_err(wrap)?;
        progress.advance(1);
    }
    progress.end();
    writer.finish().map_err(wrap)?;
    whole.finish()?;
    Ok(())
}

fn wrap(error: Y4mError) -> DemoError {
    DemoError::Video(VideoError::Y4m(error))
}

/// Compensates one file into another with the top tier of a table image.
pub(super) fn compensate(
    image: &[u8],
    video: &Path,
    compensated: &Path,
    progress: &dyn Progress,
) -> Result<Summary, DemoError> {
    let table = Table::check(image).map_err(ReportError::Table)?;
    let compensator = Compensator::new(&table, Settings::default())?;
    Ok(compensator.file(video, compensated, progress)?)
}
