//! From a described scene to the photographs that a camera would take of it.

pub mod description;
mod facets;
pub mod geometry;
mod patches;
mod projector_light;
mod sparse;
mod view;

pub use facets::Facets;
pub use patches::{Cut, Patch, Patches};
pub use projector_light::{Beam, ProjectorLight};
pub use sparse::Rows;
pub use view::{FramePlace, View};
