//! Frame pipeline: from a wanted frame to the projector's input.
//!
//! ```text
//! codes -> light d -> d' = d - ambient -> Haar -> operator -> inverse Haar = K d'
//!                              |                                  |
//!                              +------ gain * d'  -  K d' --------+-> clip -> response -> codes
//! ```
//!
//! [`GridPipeline`] works on frames of one pixel a cell, [`FullPipeline`] on any
//! larger ones. Both run the stages that the table lists and no others: without
//! an ambient section nothing is subtracted, without an operator no transform is
//! made, without a response codes are proportional to drives. A build may have some
//! of the stages only ([`features`](crate::features)).
//!
//! All arithmetic is in integers and rounds in named places only
//! ([`Sample`], [`analyse`](crate::haar::analyse),
//! [`Operator::apply`](crate::operator::Operator::apply), [`stages::drive`],
//! [`resample`](crate::resample)), so a frame comes out the same, bit for bit, on
//! the device and on the host.

mod dispatch;
mod full;
mod full_frames;
mod grid;
mod light_curve;
mod pixels;
mod sample;
pub mod srgb;
pub mod stages;

pub use dispatch::{FrameJob, compensate_cells, compensate_pixels, prepare_pixels};
pub use full::{FullPipeline, RowBuffers};
pub use full_frames::FullMemory;
pub use grid::GridPipeline;
pub(crate) use light_curve::plain;
pub use light_curve::{LightCurve, raised, raised_curves};
pub use pixels::Pixels;
pub use sample::{Encoding, Sample};
pub use stages::Workspace;

use crate::features::Stage;
use crate::haar::ShortSlice;
use core::fmt;

/// Why a frame could not be worked on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FrameError {
    /// The table has another number of channels than the pipeline.
    Channels {
        /// Channels of the table.
        table: u8,
        /// Channels of the pipeline.
        pipeline: u8,
    },
    /// The frame is smaller than the grid.
    SmallerThanGrid {
        /// Width of the frame, pixels.
        width: u16,
        /// Height of the frame, pixels.
        height: u16,
    },
    /// The table has no such tier.
    NoSuchTier {
        /// The tier asked for.
        tier: u8,
        /// The table's top tier.
        top: u8,
    },
    /// A slice is too short.
    Short(ShortSlice),
    /// This build has no such stage.
    NotBuilt(Stage),
}

impl From<ShortSlice> for FrameError {
    fn from(short: ShortSlice) -> Self {
        Self::Short(short)
    }
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channels { table, pipeline } => write!(
                f,
                "the table has {table} channels and the frame has {pipeline}"
            ),
            Self::SmallerThanGrid { width, height } => write!(
                f,
                "the frame, {width} x {height} pixels, is smaller than the table's grid"
            ),
            Self::NoSuchTier { tier, top } => {
                write!(f, "the table has tiers 0 to {top}, not {tier}")
            }
            Self::Short(short) => short.fmt(f),
            Self::NotBuilt(stage) => write!(f, "the runtime was built without {stage}"),
        }
    }
}

impl core::error::Error for FrameError {}
