//! Frame buffers that a device shares with the hardware that fills and shows
//! them.
//!
//! The frame memory is one region that both sides see: a real board's DMA
//! buffers, the emulated board's PSRAM, which the host maps as a file. Two input
//! buffers carry wanted frames to the device, two output buffers carry projector
//! input back. Each has a descriptor with an OWN bit, as DMA engines have:
//!
//! ```text
//! source                        device                         display
//! [`Source`] --- input 0, 1 --> [`Receiver`]
//!                               [`Presenter`] -- output 0, 1 --> [`Display`]
//! ```
//!
//! Whoever owns a buffer, and nobody else, touches its pixels and its other
//! words; it hands the buffer over by a store to the owner word. One side stores
//! to a word at any time, so plain loads and stores are enough: no side needs
//! compare-and-swap, which DMA engines do not have, and which a single-core
//! emulator does not carry out atomically for its host.
//!
//! Against hardware that breaks this rule, every frame carries its sequence
//! number before and after its pixels. [`Receiver::release`] looks at both again
//! when the device has finished with the frame; what was made from a torn, short
//! or stale frame is never handed to the display, which keeps the last good one.
//!
//! The pixels themselves do not go through this module: [`Layout`] says where
//! they are, and whoever has the memory makes slices of it. Words are
//! little-endian, reached through [`ControlWords`]; no length in them is trusted.

mod input;
mod lateness;
pub mod layout;
mod output;
pub mod psram;
#[cfg(test)]
mod tests;

pub use input::{AttachError, Broken, Claim, Filling, InputCounts, Receiver, Source};
pub use lateness::Lateness;
pub use layout::{ControlWords, Format, Layout, NativeWords, RegionError};
pub use output::{Display, Presenter, Shown};
