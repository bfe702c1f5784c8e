//! From an [`InverseTransport`](iltm_solve::InverseTransport) to a table image.
//!
//! | step | file |
//! |---|---|
//! | all of it, from a capture folder | [`build_table`] |
//! | light of reference white: the brightest even grey, or as asked for | [`reference_white`] |
//! | how bright that is against the scene without a table | [`brightness`] |
//! | from which white on the user's own content is cut | [`clip_thresholds`] |
//! | what video looks like, for choosing and predicting | [`iltm_solve::natural_images`] |
//! | `K` in the Haar domain, most useful entries first, cut into tiers | [`ladder`] |
//! | `i16` entries with a power of two a row | [`quantise`] |
//! | gains, also finer than the cells | [`gain`] |
//! | projector codes by drive | [`response`] |
//! | bytes | [`image`] |
//! | the operator of a table, read back from the bytes | [`haar_entries`] |
//! | a table as a shader, for players | [`shader`] |
//! | what a viewer would see of natural images | [`ViewerError`] |
//! | what a frame takes on the board | [`cost`] |
//! | the same table with other gains | [`refined_table()`] |
//! | a table for each of several projectors | [`split_table`] |
//! | the seal behind them | [`sign`] |
//!
//! The image is checked by the runtime's own reader before it is returned, so
//! what leaves here is known to load.

pub mod brightness;
pub mod build_table;
pub mod clip_thresholds;
pub mod cost;
pub mod gain;
pub mod haar_entries;
pub mod image;
pub mod ladder;
mod provenance;
pub mod quantise;
pub mod reference_white;
mod refined_table;
pub mod response;
pub mod shader;
pub mod sign;
mod split;
mod table;
#[cfg(test)]
mod test_scene;
mod viewer_error;

pub use brightness::Brightness;
pub use gain::FineGains;
pub use ladder::Ladder;
pub use provenance::{Photographs, PredictedError, Provenance, Refinement};
pub use refined_table::{RefinedParts, refined_table};
pub use split::{NEIGHBOURS_FACTOR, SplitError, SplitTable, SplitTableError, split_table};
pub use table::{CompileError, CompileOptions, Compiled, compile};
pub use viewer_error::ViewerError;
