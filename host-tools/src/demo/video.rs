//! Video of the demo: the test scene, and its compensation.

use super::DemoError;
use crate::report::ReportError;
use crate::video::test_scene::TestScene;
use crate::video::y4m::{ChromaSampling, CodeRange, Header, Writer, Y4mError, YuvFrame};
use crate::video::{CompensateOptions, Compensator, FrameTotals, VideoError};
use iltm_picture::{Picture, WholeFile, progress::Progress};
use iltm_runtime::{FrameSize, image::Table};
use std::io::BufWriter;
use std::path::Path;

/// Frames a second.
const RATE: u32 = 25;

/// Three seconds.
pub(super) const FRAMES: u64 = 75;

/// The frame that the report shows.
const STILL: u64 = 40;

/// One frame of the video, in another size.
pub(super) fn still(size: FrameSize) -> Picture {
    TestScene::new(size, RATE as f32).frame(STILL)
}

/// Writes the video, 4:2:0.
pub(super) fn write(
    path: &Path,
    size: FrameSize,
    progress: &dyn Progress,
) -> Result<(), DemoError> {
    let header = Header::new(
        size,
        (RATE, 1),
        ChromaSampling::Chroma420,
        CodeRange::Limited,
    );
    let scene = TestScene::new(size, RATE as f32);
    let mut whole = WholeFile::create(path)?;
    let mut writer = Writer::new(BufWriter::new(whole.file()), &header).map_err(wrap)?;
    progress.begin("drawing the test video", FRAMES);
    for number in 0..FRAMES {
        let picture = scene.frame(number);
        // The scene is as large as the header says, and has the colours of 4:2:0.
        let frame = YuvFrame::from_picture(&header, &picture).expect("a frame of the stream");
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
) -> Result<FrameTotals, DemoError> {
    let table = Table::check(image).map_err(ReportError::Table)?;
    let compensator = Compensator::new(&table, CompensateOptions::default())?;
    Ok(compensator.file(video, compensated, progress)?)
}
