//! Why a folder of pictures to show could not be made.

use crate::scene::folder::FolderError;
use crate::video::MAX_PIXELS;
use iltm_runtime::{FrameSize, Grid, GridError};
use std::io;
use std::path::PathBuf;

/// Why a folder of pictures to show could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PatternsError {
    /// There are no cells, or more than a table can hold.
    #[error("{0}")]
    Grid(#[from] GridError),
    /// There are more cells along a side than the projector has pixels there.
    #[error(
        "{grid} cells (rows x columns) on the {} x {} pixels that a border of {border} leaves of \
         the projector's {projector}",
        projector.width().saturating_sub(2 * usize::from(*border)),
        projector.height().saturating_sub(2 * usize::from(*border))
    )]
    Cells {
        /// The cells.
        grid: Grid,
        /// The projector's size.
        projector: FrameSize,
        /// Pixels left black on every side.
        border: u16,
    },
    /// The projector has more pixels than any.
    #[error("a projector of {projector}; at most {MAX_PIXELS} pixels are drawn")]
    Projector {
        /// The projector's size.
        projector: FrameSize,
    },
    /// A picture of cells is none of this grid's.
    #[error("a picture of {found} with 8 bits or more, where the grid has {grid} cells of 8 bits")]
    NotCells {
        /// Its size.
        found: FrameSize,
        /// The grid.
        grid: Grid,
    },
    /// The folder could not be made.
    #[error(transparent)]
    Folder(#[from] FolderError),
}

impl PatternsError {
    /// A file that could not be written.
    pub(super) fn io(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Folder(FolderError::Io { path, source })
    }

    /// What to do about it, one sentence.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Grid(_) => {
                "Choose fewer rows and columns: 13 x 21 to 64 x 64 is what most walls call for."
            }
            Self::Cells { .. } => {
                "Choose fewer rows and columns or a smaller border, or state the projector's own \
                 resolution with --projector."
            }
            Self::Projector { .. } => "State the projector's own resolution, as 1920x1080.",
            Self::NotCells { .. } => "Draw one pixel of 8 bits a cell.",
            Self::Folder(_) => "Choose another folder, or move that one away.",
        }
    }
}
