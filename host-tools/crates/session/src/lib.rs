//! Session at the wall: from a grid and a projector's size to a folder of
//! pictures to show, and from there to a photograph of each.
//!
//! ```text
//! order    what is shown, in which order: white, black, ramps, probes, stripes, chance
//! calibration_pictures   even light of many levels; a few lit cells, far from each other
//! stills   a folder's pictures as images to show
//! layout   one pixel a cell -> the projector's own pixels
//! folder   the capture folder with its lists, pictures, settings and rules
//!
//! plan     what is to be photographed, what is missing
//! screen   shows a slide: by a command, or in a window on a display
//! camera   takes a photograph: by a command, or from a folder that fills
//! latency  how long a change takes to be seen
//! shoot    all of it, slide by slide
//! ```
//!
//! The folder is what passes from one step to the next: whoever stops in the middle
//! goes on with what is there, and a solve can be repeated without a new photograph.

mod calibration_pictures;
mod camera;
mod error;
mod folder;
mod latency;
mod layout;
mod order;
mod plan;
mod screen;
mod shell;
mod shoot;
mod stills;
#[cfg(all(test, unix))]
mod tests;
pub mod verify;

pub use calibration_pictures::ramp_levels;
pub use camera::{CameraDriver, CommandCamera, WatchedFolder};
pub use error::{PatternsError, SessionError};
pub use folder::{Made, SLIDES_FOLDER, slide_name, write};
pub use latency::{Latency, measure};
pub use layout::Layout;
pub(crate) use order::fine_stripes;
pub use order::{OrderOptions, Purpose, Slide, order};
pub use plan::{Planned, State, planned, ranges, states};
pub use screen::{CommandScreen, DisplaySpan, Displays, Screen, Windows, with_windows};
pub use shoot::{CaptureSession, SessionOptions, ShootEvent, Summary};
pub use stills::stills;
