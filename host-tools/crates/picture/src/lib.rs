//! Pictures as codes and as light, how they are resampled, coloured and charted, and how
//! files and folders are written whole.
//!
//! | what | file |
//! |---|---|
//! | pictures as codes, and as PNG files | [`Picture`], [`png`] |
//! | pictures as linear light | [`LightPicture`] |
//! | response curves, declared and measured | [`Response`], [`Curve`] |
//! | how far a picture is from another | [`PictureError`] |
//! | between pixels and cells | [`Lattice`] |
//! | what one of several projectors shows of a wide frame | [`FramePart`] |
//! | numbers as colours, lines and words | [`ColourScale`], [`chart`], [`numbers`] |
//! | pictures and letters on one picture | [`ContactSheet`], [`canvas`] |
//! | medians and quantiles | [`statistics`] |
//! | HTML pages | [`html`] |
//! | arrays as `NumPy` files | [`npy`] |
//! | files of others, read up to a limit | [`foreign_file`] |
//! | files and folders that are there whole or not at all | [`WholeFile`], [`WholeFolder`] |
//! | temporary files, gone when the process is stopped | [`unfinished`] |
//! | how far long work is | [`progress`] |

pub mod canvas;
pub mod chart;
mod colour_scale;
mod contact_sheet;
mod curve;
pub mod foreign_file;
mod frame_part;
pub mod html;
mod lattice;
mod light_picture;
pub mod npy;
pub mod numbers;
mod picture;
mod picture_error;
pub mod png;
pub mod progress;
mod response;
pub mod statistics;
pub mod unfinished;
pub mod whole_file;
pub mod whole_folder;

pub use colour_scale::{ColourScale, Palette, SHADES, Spread, Tick};
pub use contact_sheet::{ContactSheet, Tile};
pub use curve::{Curve, DeviceResponse, ProjectorResponse, level};
pub use frame_part::FramePart;
pub use lattice::Lattice;
pub use light_picture::LightPicture;
pub use picture::{Picture, Samples};
pub use picture_error::PictureError;
pub use response::{Declared, Response};
pub use whole_file::{FileError, WholeFile};
pub use whole_folder::{FolderError, WholeFolder, check_free, check_own};

/// Most pixels of a picture: twice those of 8K video. A header that says more is
/// refused before any memory is taken.
pub const MAX_PIXELS: usize = 1 << 26;
