//! Errors of making a folder of pictures to show, and of photographing them.

use iltm_capture::{CaptureError, FileFormat, MIN_BERNOULLI};
use iltm_picture::{FolderError, MAX_PIXELS};
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
    /// There is no picture to be shown in a folder of images.
    #[error("{}: no picture; images are {}", folder.display(), FileFormat::NAMES)]
    NoImages {
        /// The folder.
        folder: PathBuf,
    },
    /// A folder of images cannot be read.
    #[error("{}: {source}", folder.display())]
    Images {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// An image cannot be shown.
    #[error(transparent)]
    Image(#[from] CaptureError),
    /// Fewer Bernoulli patterns and images than a solve needs.
    #[error(
        "{given} Bernoulli patterns and images together; a solve needs at least {MIN_BERNOULLI}"
    )]
    TooFew {
        /// Asked for.
        given: usize,
    },
    /// The folder could not be made.
    #[error(transparent)]
    Folder(#[from] FolderError),
}

impl PatternsError {
    /// What to do about it, one sentence.
    #[must_use]
    pub fn next_step(&self) -> &'static str {
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
            Self::NoImages { .. } => "Name a folder that has pictures in it.",
            Self::Images { .. } => "Check the folder's name and permissions.",
            Self::Image(error) => error.next_step(),
            Self::TooFew { .. } => {
                "Ask for more with --photos, or name a folder with more --images."
            }
            Self::Folder(_) => "Choose another folder, or move that one away.",
        }
    }
}

/// Why photographing stopped.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The folder's lists cannot be read.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// Two lists claim one place in the order of showing.
    #[error("{}: index {index} stands in {} and in {}", folder.display(), lists[0], lists[1])]
    IndexTwice {
        /// The capture.
        folder: PathBuf,
        /// The place.
        index: u32,
        /// The lists.
        lists: [String; 2],
    },
    /// A photograph was asked for that no list has.
    #[error("{}: nothing is shown at index {index}; the last one is {last}", folder.display())]
    NoIndex {
        /// The capture.
        folder: PathBuf,
        /// Asked for.
        index: u32,
        /// The largest there is.
        last: u32,
    },
    /// There is nothing to show.
    #[error("{}: the slide is not there", path.display())]
    NoSlide {
        /// The first one that is missing.
        path: PathBuf,
    },
    /// Slides cannot be shown.
    #[error("the slide cannot be shown: {reason}")]
    Display {
        /// Why.
        reason: String,
    },
    /// There is no such display.
    #[error("there is no display {asked}; there {}", displays(found))]
    NoDisplay {
        /// Asked for.
        asked: usize,
        /// What there is, each in words.
        found: Vec<String>,
    },
    /// Displays have not the pixels that slides are drawn for.
    #[error("{}, the slides have {} x {}", sizes(found), slides.0, slides.1)]
    DisplaySize {
        /// Width and height of each display, from left to right.
        found: Vec<(usize, (u32, u32))>,
        /// Width and height of the slides.
        slides: (u32, u32),
    },
    /// The camera gave no photograph, or none that can be used.
    #[error("photograph {index}: {reason}")]
    Camera {
        /// Place in the order of showing.
        index: u32,
        /// What went wrong.
        reason: String,
    },
    /// The camera does not see the projector, or not in time.
    #[error("the projector's latency cannot be measured: {reason}")]
    Latency {
        /// Why.
        reason: String,
    },
    /// A photograph could not be put in its place.
    #[error("{}: {source}", path.display())]
    Write {
        /// The place.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The user wants an end.
    #[error("stopped")]
    Stopped,
}

/// How many there are, and which.
fn displays(found: &[String]) -> String {
    match found {
        [] => "is none".to_owned(),
        [one] => format!("is one: {one}"),
        several => format!("are {}: {}", several.len(), several.join("; ")),
    }
}

fn sizes(displays: &[(usize, (u32, u32))]) -> String {
    let words = displays
        .iter()
        .map(|(number, (width, height))| format!("display {number} has {width} x {height} pixels"));
    words.collect::<Vec<_>>().join(", ")
}

impl SessionError {
    /// What to do about it, one sentence.
    #[must_use]
    pub fn next_step(&self) -> &'static str {
        match self {
            Self::Capture(error) => error.next_step(),
            Self::IndexTwice { .. } => {
                "Give every line an index of its own, in all lists together."
            }
            Self::NoIndex { .. } => {
                "Choose from the first column of capture.csv and calibration.csv."
            }
            Self::NoSlide { .. } => {
                "Make the folder again with the same rows, columns and seed, and copy its slides."
            }
            Self::Display { .. } => {
                "Check that a desktop is running and the projector is part of it, or show slides by \
                 a command of your own with --show."
            }
            Self::NoDisplay { .. } => {
                "Choose one of these, switch the projector on and extend the desktop to it, or show \
                 slides by a command of your own with --show."
            }
            Self::DisplaySize { found, .. } if found.len() > 1 => {
                "Set the displays to the projectors' own resolutions, whose widths add up to the \
                 slides' and the highest of which is as high, without scaling, or make the folder with \
                 `iltm patterns --projector WxH`."
            }
            Self::DisplaySize { .. } => {
                "Set the display to the projector's own resolution, without scaling, or make the \
                 folder with `iltm patterns --projector WxH`. Wide slides need all their displays: \
                 --display 1,2."
            }
            Self::Camera { .. } => {
                "Try the command by itself, look at the camera's battery, card and cable, and run \
                 this again: it goes on where it stopped."
            }
            Self::Latency { .. } => {
                "Check that the camera sees the projection and that its exposure is manual, or say \
                 how long to wait with --latency MS."
            }
            Self::Write { .. } => "Check that the disk has room and the folder may be written to.",
            Self::Stopped => "Run it again: it goes on where it stopped.",
        }
    }
}
