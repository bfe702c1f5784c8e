//! Errors of the demo.

use crate::learn::LearnError;
use crate::report::ReportError;
use crate::video::VideoError;
use iltm_picture::FileError;
use std::path::PathBuf;

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// A folder could not be made.
    #[error("{}: cannot be made: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// A file could not be written.
    #[error("{}: cannot be written: {}", .0.path.display(), .0.source)]
    Write(#[from] FileError),
    /// The sample did not become a table.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A file could not be put in its place, or the video not be compensated.
    #[error(transparent)]
    Video(#[from] VideoError),
    /// There is no report.
    #[error(transparent)]
    Report(#[from] ReportError),
}
