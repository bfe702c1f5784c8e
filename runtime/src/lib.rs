//! Runtime of iltm, which runs on the device: table image, Haar-domain operator, frame
//! pipeline, serial link and table store.
//!
//! The principles of this crate:
//!
//! - It has no heap, never panics, and trusts no length: whatever bytes it is
//!   given, it returns a value or an error.
//! - It is deterministic: integers only, rounding in named places, so that a host
//!   that uses this crate previews bit for bit what the device shows.
//! - What host and device must agree on is here and nowhere else.
//! - Simple code over clever code; a faster way must have a measurement beside it
//!   and a plain reference to be tested against.
//!
//! | module | what lives there |
//! |---|---|
//! | [`units`] | fixed-point types of light, drive and correction |
//! | [`features`] | the stages that a build has |
//! | [`response`] | from drive to projector codes |
//! | [`haar`] | the exact integer Haar transform on any grid |
//! | [`operator`] | the sparse operator and the proof that it cannot overflow |
//! | [`image`] | the `.iltm` image: layout, check, accessors |
//! | [`placement`] | which pixels of a frame the cells cover |
//! | [`resample`] | between pixels and cells |
//! | [`pipeline`] | frames in, projector input out |
//! | [`frame_buffers`] | frame buffers shared with the hardware that fills and shows them |
//! | [`governor`] | the tier that fits the frame budget |
//! | [`link`] | the serial line: frames, channels, messages |
//! | [`trust`] | who signed a table, and whether it may run here |
//! | [`store`] | two slots in NOR flash: updates that may be cut anywhere |
//! | [`ring`] | bytes between an interrupt and the loop |
#![no_std]
#![warn(
    clippy::indexing_slicing,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::unreachable,
    clippy::todo,
    clippy::string_slice
)]
#![cfg_attr(
    test,
    allow(
        clippy::indexing_slicing,
        clippy::expect_used,
        clippy::unwrap_used,
        clippy::panic
    )
)]

#[cfg(test)]
extern crate std;

#[cfg(test)]
mod display_tests;
pub mod features;
pub mod frame_buffers;
pub mod governor;
pub mod haar;
pub mod image;
mod kernel;
pub mod link;
pub mod operator;
pub mod pipeline;
pub mod placement;
pub mod resample;
pub mod response;
pub mod ring;
mod size;
pub mod store;
pub mod trust;
pub mod units;
mod yield_budget;

pub use size::{FrameSize, Grid, GridError};
