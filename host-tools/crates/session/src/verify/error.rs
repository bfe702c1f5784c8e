//! Errors of a verification: why there is no verdict.

use super::Cause;
use crate::PatternsError;
use iltm_capture::{CaptureError, MapError};
use iltm_compile::CompileError;
use iltm_picture::FolderError;
use iltm_video::VideoError;
use std::path::PathBuf;

/// Photographs or slides that are named before the rest is only counted.
const NAMED: usize = 8;

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The folder could not be written.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The table cannot compensate the test images, or one of them cannot be read.
    #[error(transparent)]
    Video(#[from] VideoError),
    /// Cells and projector do not fit together.
    #[error(transparent)]
    Slides(#[from] PatternsError),
    /// A file of the folder cannot be used.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// There is no such folder, or it was not made by `iltm verify`.
    #[error("{}: there is no verify.csv", path.display())]
    NoManifest {
        /// The folder.
        path: PathBuf,
    },
    /// Photographs that `verify.csv` names are not there.
    #[error("{}: {} missing: {}", folder.display(), count(missing.len()), listed(missing, |path| path.display().to_string()))]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// All of them, relative to it.
        missing: Vec<PathBuf>,
    },
    /// The folder has photographs already.
    #[error("{}: there are photographs already", path.display())]
    Photographed {
        /// Where photographs go.
        path: PathBuf,
    },
    /// No photograph of a film shows a card of this table's.
    #[error("{}: none of its {photographs} pictures shows a card of this table's film{}", folder.display(), of_another(other.as_deref()))]
    NoCards {
        /// The folder of photographs.
        folder: PathBuf,
        /// Pictures in it.
        photographs: usize,
        /// Id of another table whose cards they show.
        other: Option<String>,
    },
    /// It is not clear which photographs show some of the slides.
    #[error("{}: {}", folder.display(), unrecognised(unseen, unclear))]
    Unrecognised {
        /// The folder of photographs.
        folder: PathBuf,
        /// Slides whose card no photograph shows.
        unseen: Vec<u32>,
        /// Slides whose card is there, but no photograph, or several that differ, after it.
        unclear: Vec<u32>,
    },
    /// A test image is not there both plain and compensated.
    #[error("{}: test image {image} has no {what} picture", path.display())]
    Unpaired {
        /// The manifest.
        path: PathBuf,
        /// Its number.
        image: u8,
        /// Which one it lacks.
        what: &'static str,
    },
    /// There is nothing to judge by.
    #[error("{}: it names no test image", path.display())]
    NoImages {
        /// The manifest.
        path: PathBuf,
    },
    /// The file that says what the captures showed is not what `iltm verify` wrote.
    #[error("{}: it does not say the light of white for each cell of the table", path.display())]
    Before {
        /// The file.
        path: PathBuf,
    },
    /// A picture has another size, depth or number of colours than the table's cells ask
    /// for.
    #[error("{}: it is no 8-bit picture of one pixel a cell with the table's {channels} channel(s)", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// Channels of the table.
        channels: u8,
    },
    /// The folder was made with another table, or by another version of the tools.
    #[error("{}: it is not what this table makes of test image {image}: the folder was made with another table, or by another version of iltm", path.display())]
    OtherTable {
        /// The compensated picture.
        path: PathBuf,
        /// Number of the test image.
        image: u8,
    },
    /// A folder of wanted images was made for another table.
    #[error("{}: the folder was not made for this table, whose id is {own}", path.display())]
    NotOfTable {
        /// The file that names the table.
        path: PathBuf,
        /// The id of the table that was given.
        own: String,
    },
    /// The table does not tell what light comes of an input, so that a chain that compensates
    /// cannot be told from one that does not.
    #[error("{}: the table does not tell what light comes of an input, so that nothing says what a chain did", path.display())]
    Untold {
        /// The manifest.
        path: PathBuf,
    },
    /// The folder was made for another grid.
    #[error("{}: its pictures are of {found} cells, the table is for {expected}", path.display())]
    Grid {
        /// The folder.
        path: PathBuf,
        /// Cells of the pictures, rows by columns.
        found: String,
        /// Cells of the table.
        expected: String,
    },
    /// Photographs are grey and the table has colours, or the other way round.
    #[error("{}: the photographs have {photographs} channel(s), the table has {table}", path.display())]
    Channels {
        /// The folder.
        path: PathBuf,
        /// Channels of the photographs.
        photographs: usize,
        /// Channels of the table.
        table: usize,
    },
    /// A folder has no images and stripes of the projector's own pixels.
    #[error(
        "the folder has no fine stripes, or fewer than three images of the projector's own pixels: nothing says where the camera's pixels look"
    )]
    NotFine,
    /// The stripes do not tell where the camera's pixels look.
    #[error("{0}")]
    Map(MapError),
    /// Photographs are not fit to be fed back into a table.
    #[error("the photographs cannot be fed back into a table: {what}")]
    Refused {
        /// Why.
        cause: Cause,
        /// What a gate found.
        what: String,
    },
    /// The refined gains cannot be stored.
    #[error(transparent)]
    Compile(#[from] CompileError),
    /// A photograph fits another picture much better than its own.
    #[error(
        "{}: it shows the picture of {shows}, not its own, {own}: photographs were exchanged, or one is missing and all later ones moved up",
        path.display()
    )]
    Order {
        /// The photograph.
        path: PathBuf,
        /// Role of the picture that it fits.
        shows: String,
        /// Role that its line has.
        own: String,
    },
    /// Too few of the table's cells were found, because white is overexposed.
    #[error("{}: {what}", path.display())]
    Overexposed {
        /// The folder.
        path: PathBuf,
        /// What the gate says.
        what: String,
    },
    /// Too few of the table's cells were found.
    #[error("{}: only {found} of the {live} cells that the table knows were found", path.display())]
    TooFewCells {
        /// The folder.
        path: PathBuf,
        /// Cells that were found.
        found: usize,
        /// Cells that the table has gains for.
        live: usize,
    },
}

impl VerifyError {
    /// What to do next.
    #[must_use]
    pub fn next_step(&self) -> String {
        match self {
            Self::Folder(FolderError::Taken { .. }) => {
                "Choose another folder, or move that one away.".to_owned()
            }
            Self::Folder(_) => "Check the folder and run the command again.".to_owned(),
            Self::Video(error) => error.next_step().to_owned(),
            Self::Slides(error) => error.next_step().to_owned(),
            Self::Capture(error) => error.next_step().to_owned(),
            Self::NoManifest { path } => format!(
                "Make the folder first: `iltm verify TABLE.iltm -o {}`, then photograph its slides.",
                path.display()
            ),
            Self::Missing { folder, .. } => format!(
                "Take them: `iltm capture {}` goes on where it stopped; or copy them into photos/.",
                folder.display()
            ),
            Self::Photographed { .. } => {
                "Leave --photographs away to judge those, or move them away first.".to_owned()
            }
            Self::NoCards { other: Some(_), .. } => {
                "Verify with the table that the film was made for, or photograph the film in \
                 film/ of this folder."
                    .to_owned()
            }
            Self::NoCards { other: None, .. } => {
                "Play film/ of a folder made with --wanted and photograph it sharp and large: each \
                 card, then its slide."
                    .to_owned()
            }
            Self::Unrecognised { folder, .. } => format!(
                "Photograph these slides again, each after its card, put the photographs into {} \
                 under names that come after the others, and run the command again.",
                folder.display()
            ),
            Self::Unpaired { .. }
            | Self::NoImages { .. }
            | Self::Before { .. }
            | Self::Picture { .. } => {
                "Make the folder anew with `iltm verify TABLE.iltm -o FOLDER`.".to_owned()
            }
            Self::Untold { .. } => {
                "Verify without --wanted: the table's own slides are compared with the wall.".to_owned()
            }
            Self::OtherTable { .. } | Self::NotOfTable { .. } | Self::Grid { .. } => {
                "Verify with the table that the folder was made with, or make a folder with this \
                 one and photograph it."
                    .to_owned()
            }
            Self::Channels { .. } => {
                "Photograph in colour for a colour table and in grey for a grey one, as the table's \
                 own photographs were."
                    .to_owned()
            }
            Self::Order { .. } => {
                "Put the photographs in the order of verify.csv, or take them again.".to_owned()
            }
            Self::Overexposed { .. } => Cause::Clipped.next_step().to_owned(),
            Self::NotFine => {
                "Make the folder with `iltm verify TABLE.iltm -o FOLDER`, without --wanted and \
                 --no-dense, for a projector with at least four pixels along a cell's sides, and \
                 photograph it."
                    .to_owned()
            }
            Self::Map(error) => error.next_step().to_owned(),
            Self::Refused { cause, .. } => cause.next_step().to_owned(),
            Self::Compile(error) => error.next_step().to_owned(),
            Self::TooFewCells { .. } => {
                "Point the camera so that it sees the whole projection, in focus.".to_owned()
            }
        }
    }
}

fn of_another(table: Option<&str>) -> String {
    let words = |table| format!("; they show cards of table {table}");
    table.map(words).unwrap_or_default()
}

fn unrecognised(unseen: &[u32], unclear: &[u32]) -> String {
    let of = |slides: &[u32], what: &str| {
        let word = if slides.len() == 1 { "slide" } else { "slides" };
        (!slides.is_empty()).then(|| format!("{what} {word} {}", listed(slides, u32::to_string)))
    };
    let unseen = of(unseen, "no card was read of");
    let unclear = of(unclear, "no photograph after the card is surely of");
    let parts: Vec<String> = [unseen, unclear].into_iter().flatten().collect();
    parts.join("; ")
}

fn count(missing: usize) -> String {
    match missing {
        1 => "1 photograph is".to_owned(),
        more => format!("{more} photographs are"),
    }
}

/// The first of some things, and how many more there are.
fn listed<T>(things: &[T], name: impl Fn(&T) -> String) -> String {
    let mut names: Vec<String> = things.iter().take(NAMED).map(name).collect();
    if things.len() > NAMED {
        names.push(format!("and {} more", things.len() - NAMED));
    }
    names.join(", ")
}
