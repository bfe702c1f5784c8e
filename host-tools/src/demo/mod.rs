//! Demo of the whole job without hardware: photographs, table, compensated video, report.
//!
//! The photographs are real in all but one respect: a path tracer took them, with
//! a noisy camera. From there on nothing is prepared. The sample is written out,
//! read back and solved like any capture, the table compensates a video, and the
//! report says what came of it.

pub mod sample;
mod video;
mod words;

use crate::build_table::{BuildError, BuiltTable, TableOptions, build_table};
use crate::capture::CaptureOptions;
use crate::report::{Example, Report, ReportError, Wanted, stills};
use crate::solve::SolveOptions;
use crate::video::{FrameTotals, VideoError};
use iltm_picture::{FileError, FolderError, WholeFolder, progress::Progress};
use iltm_runtime::FrameSize;
use sample::{make_folder, write_bytes};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Width and height of the report's pictures: the sample's 24 x 16 cells, 16 x 16
/// pixels each.
const STILL: (u16, u16) = (384, 256);

/// Width and height of the video: 20 x 20 pixels a cell.
const VIDEO: (u16, u16) = (480, 320);

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// A folder could not be made.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file could not be written.
    #[error("{}: cannot be written: {}", .0.path.display(), .0.source)]
    Write(#[from] FileError),
    /// The sample did not become a table.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A file could not be put in its place, or the video not be compensated.
    #[error(transparent)]
    Video(#[from] VideoError),
    /// There is no report.
    #[error(transparent)]
    Report(#[from] ReportError),
}

/// Where everything is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Paths {
    /// The sample capture.
    pub capture: PathBuf,
    /// The table.
    pub table: PathBuf,
    /// The wanted video.
    pub video: PathBuf,
    /// The same, to be sent to the projector.
    pub compensated: PathBuf,
    /// The page.
    pub report: PathBuf,
    /// Folder with the report's pictures.
    pub pictures: PathBuf,
}

impl Paths {
    fn new(out: &Path) -> Self {
        Self {
            capture: out.join("capture"),
            table: out.join("table.iltm"),
            video: out.join("video.y4m"),
            compensated: out.join("compensated.y4m"),
            report: out.join("report.html"),
            pictures: out.join("pictures"),
        }
    }
}

/// What the demo has done.
#[derive(Clone, Debug)]
pub struct DemoOutcome {
    /// Where it is.
    pub paths: Paths,
    /// What was built from the sample.
    pub built: BuiltTable,
    /// Error of each of the report's images without compensation, with gain only
    /// and compensated, as predicted by the built transport.
    pub images: Vec<(&'static str, [f64; 3])>,
    /// The video: frames, and how many samples were clipped.
    pub video: FrameTotals,
    /// Bytes of the page.
    pub report_bytes: usize,
    /// Wall-clock seconds by step.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Does the whole job into `out`, which is made if it is not there. Files of an
/// earlier run are replaced when all are done; others are left alone.
///
/// # Errors
/// [`DemoError`]; nothing is left behind then.
pub fn run(out: &Path, progress: &dyn Progress) -> Result<DemoOutcome, DemoError> {
    if let Some(parent) = out.parent() {
        make_folder(parent)?;
    }
    let work = WholeFolder::beside(out)?;
    let paths = Paths::new(work.path());
    let mut clock = Clock::new();
    progress.begin("writing the sample capture", 0);
    sample::write(&paths.capture)?;
    progress.end();
    clock.lap("writing the sample");
    let (photographs, options) = (CaptureOptions::default(), SolveOptions::default());
    let built = build_table(
        &paths.capture,
        &photographs,
        &options,
        &TableOptions::default(),
        progress,
    )?;
    write_bytes(&paths.table, &built.compiled.image)?;
    clock.lap("from photographs to table");
    video::write(&paths.video, size(VIDEO), progress)?;
    clock.lap("drawing the video");
    let image = &built.compiled.image;
    let video = video::compensate(image, &paths.video, &paths.compensated, progress)?;
    clock.lap("compensating it");
    let report = Report::new(&built, wanted(), progress)?;
    clock.lap("predicting photographs");
    progress.begin("writing the report", 0);
    let page = report.html(&words::words(out, &clock.seconds));
    write_bytes(&paths.report, page.as_bytes())?;
    write_pictures(&report, &paths.pictures)?;
    progress.end();
    clock.lap("writing the report");
    work.finish_over()?;
    let errors = |example: &Example| {
        let mut errors = [0.0; 3];
        for (error, shown) in errors.iter_mut().zip(&example.shown) {
            *error = shown.comparison.error;
        }
        (example.wanted.name, errors)
    };
    let images = report.examples.iter().map(errors).collect();
    Ok(DemoOutcome {
        paths: Paths::new(out),
        images,
        video,
        report_bytes: page.len(),
        seconds: clock.seconds,
        built,
    })
}

/// The images of the report, the one of the summary first.
fn wanted() -> Vec<Wanted> {
    let size = size(STILL);
    let frame = Wanted {
        name: "frame",
        title: "A frame of the video".to_owned(),
        remark: "The table works on every frame by itself: nothing depends on the frames before."
            .to_owned(),
        picture: video::still(size),
    };
    vec![
        frame,
        stills::test_card(size),
        stills::bright_and_dark(size),
    ]
}

/// A frame size from constants of this module, none of which is zero.
fn size((width, height): (u16, u16)) -> FrameSize {
    FrameSize::new(width, height).expect("sides above zero")
}

fn write_pictures(report: &Report<'_>, folder: &Path) -> Result<(), DemoError> {
    make_folder(folder)?;
    for file in &report.files {
        write_bytes(&folder.join(&file.name).with_extension("png"), &file.png)?;
    }
    Ok(())
}

/// Seconds between laps, by what they were spent on.
struct Clock {
    last: Instant,
    seconds: Vec<(&'static str, f64)>,
}

impl Clock {
    fn new() -> Self {
        Self {
            last: Instant::now(),
            seconds: Vec::new(),
        }
    }

    fn lap(&mut self, what: &'static str) {
        self.seconds.push((what, self.last.elapsed().as_secs_f64()));
        self.last = Instant::now();
    }
}
