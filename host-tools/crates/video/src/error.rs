//! Errors of reading, compensating and writing frames, and what to do about each.

use super::y4m::Y4mError;
use iltm_picture::{FileError, png::PngError};
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid, image::ImageError, pipeline::FrameError};
use std::path::PathBuf;

/// Why frames could not be compensated. Every case carries its place;
/// [`VideoError::next_step`] says what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    /// Frames are not those of all projectors side by side.
    #[error(
        "the table is for one of {projectors} projectors, and frames of {size} are not those of all of them side by side"
    )]
    NotWide {
        /// How many there are.
        projectors: usize,
        /// Size of the frames.
        size: FrameSize,
    },
    /// A file could not be opened or put in its place.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// An input file could not be opened.
    #[error("{}: cannot be read: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The input could not be read.
    #[error("reading the input: {source}")]
    Read {
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The input is of no kind that is read here.
    #[error("the input begins neither like a PNG picture nor like a Y4M stream")]
    UnknownFormat,
    /// A Y4M stream is at fault.
    #[error(transparent)]
    Y4m(#[from] Y4mError),
    /// A PNG picture is at fault.
    #[error(transparent)]
    Png(#[from] PngError),
    /// The frame has fewer pixels than the table has cells, along a side.
    #[error("the frame, {frame}, is smaller than the table's grid of {} x {} cells",
        grid.cols(), grid.rows())]
    SmallerThanGrid {
        /// Size of the frame.
        frame: FrameSize,
        /// Grid of the table: rows, then columns.
        grid: Grid,
    },
    /// The frame has another aspect than the projector that the table was made with.
    #[error("the frame, {frame}, has another aspect than the projector that the table was \
        made with, {}{}", projector.size(), border(*projector))]
    Aspect {
        /// Size of the frame.
        frame: FrameSize,
        /// The projector.
        projector: ProjectorPixels,
    },
    /// The table does not know a projector to fit frames to.
    #[error("the table does not say how large its projector is, so there is nothing to fit to")]
    NothingToFit,
    /// A newer table would put the frames elsewhere on the projector.
    #[error("it is for another projector or border, and frames would change their size")]
    Elsewhere,
    /// A stream ends before its first frame.
    #[error("the stream has a header and no frame")]
    NoFrames,
    /// A colour table gives grey light a coloured input, which a grey frame has
    /// no room for.
    #[error(
        "the frame is grey, but the table drives three colours, which a grey frame cannot hold"
    )]
    GreyFrame,
    /// The table has no such tier.
    #[error("the table has tiers 0 to {top}, not {tier}")]
    NoSuchTier {
        /// The tier asked for.
        tier: u8,
        /// The table's top tier.
        top: u8,
    },
    /// The threads that work on the rows could not be started.
    #[error("starting {threads} threads: {reason}")]
    Threads {
        /// Threads asked for, 0 for one a core.
        threads: usize,
        /// What the operating system says.
        reason: String,
    },
    /// There is no graphics processor, or it failed.
    #[error("the graphics processor: {reason}")]
    Gpu {
        /// What its driver says.
        reason: String,
    },
    /// A graphics processor was asked for, and this build has no part for it.
    #[error("this iltm was built without the feature `gpu`")]
    WithoutGpu,
    /// The bytes of a table's file are no table.
    #[error("the table cannot be used: {0}")]
    Table(ImageError),
    /// The input is a picture, and what was asked for is for video.
    #[error("the input is a still picture: it has no frames between which anything changes")]
    Still,
    /// The runtime refuses the frame.
    #[error("the runtime refuses the frame: {0}")]
    Runtime(FrameError),
}

/// What an error about an aspect says of a border.
fn border(projector: ProjectorPixels) -> String {
    match projector.border() {
        0 => String::new(),
        border => format!(" with a border of {border}"),
    }
}

impl From<FileError> for VideoError {
    fn from(FileError { path, source }: FileError) -> Self {
        Self::File { path, source }
    }
}

impl VideoError {
    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::File { .. } => {
                "Check that the file and its folder exist, may be used, and that the disk has room."
            }
            Self::Open { .. } => "Check that the file is there and may be read.",
            Self::Read { .. } => "Check that the input can be read to its end.",
            Self::UnknownFormat => {
                "Convert it: `ffmpeg -i VIDEO -pix_fmt yuv420p OUT.y4m`, or save the picture as PNG."
            }
            Self::Y4m(error) => error.next_step(),
            Self::Png(error) => error.next_step(),
            Self::SmallerThanGrid { .. } => {
                "Scale the frames up to the projector's own size, or at least to one pixel a cell."
            }
            Self::Aspect { .. } => {
                "Say how it is to be shown: --fit letterbox (black bars), crop (edges cut off) or \
                 stretch; or make it in the projector's aspect."
            }
            Self::NotWide { .. } => {
                "Give frames of all projectors side by side, from left to right."
            }
            Self::NothingToFit => "Leave --fit away.",
            Self::Elsewhere => "Start again with the new table.",
            Self::NoFrames => {
                "Look at what the program that makes the stream says: it stopped before its first \
                 frame."
            }
            Self::GreyFrame => {
                "Convert it to colour: `ffmpeg -i VIDEO -pix_fmt yuv420p OUT.y4m`, or save the \
                 picture as RGB."
            }
            Self::NoSuchTier { .. } => {
                "Ask for a tier that `iltm inspect` lists, or for none, to use the top one."
            }
            Self::Threads { .. } => "Ask for fewer threads.",
            Self::Gpu { .. } => {
                "Leave --gpu away: the processor makes the same frames. Or look at the computer's \
                 graphics driver (`vulkaninfo --summary`)."
            }
            Self::WithoutGpu => {
                "Leave --gpu away: the processor makes the same frames. Or build it anew: \
                 `cargo build --release --features gpu`."
            }
            Self::Table(_) => "Copy the table again, or make it anew with `iltm solve`.",
            Self::Still => "Leave --watch and --budget away.",
            Self::Runtime(_) => {
                "Please report this with the table and the first frame: it should never get here."
            }
        }
    }
}
