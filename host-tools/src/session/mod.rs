//! A session at the wall: from a grid and a projector's size to a folder of
//! pictures to show, and from there to a photograph of each.
//!
//! ```text
//! order    what is shown, in which order: white, black, ramps, probes, stripes, chance
//! ramp     even light of many levels; probe: a few lit cells, far from each other
//! layout   one pixel a cell -> the projector's own pixels
//! folder   the capture folder with its lists, pictures, settings and rules
//! ```
//!
//! The folder is what passes from one step to the next: whoever stops in the middle
//! goes on with what is there, and a solve can be repeated without a new photograph.

mod error;
mod folder;
mod layout;
mod order;
mod probe;
mod ramp;

pub use error::PatternsError;
pub use folder::{Made, SLIDES_FOLDER, slide_name, write};
pub use layout::Layout;
pub use order::{OrderOptions, Purpose, Slide, order};
pub use ramp::ramp_levels;
