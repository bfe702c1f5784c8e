//! Assembler loops that a frame's time goes into, and the only unsafe code of this crate.
//!
//! Each does what plain code elsewhere defines, faster, on Arm processors with the DSP
//! extension (Cortex-M4, M7 and up), and says whether it did. Hosts have the plain code
//! only; `tests/tests/device/firmware.rs` compares whole frames of the two. With the
//! feature `reference-kernel` an Arm target has no others either, to measure what
//! the loops bring (`docs/firmware.md`).
//!
//! | loop | what it does | defined in |
//! |---|---|---|
//! | [`gather`] | products of an operator's entries with input coefficients | [`operator`](crate::operator) |
//! | [`levels`] | one level of the Haar transform | [`haar`](crate::haar) |
//! | [`lines`] | values of cells along a row to values of pixels | [`resample`](crate::resample) |
//! | [`pixels`] | 8-bit pixels to the finest level, and corrections to 8-bit pixels | [`pipeline`](crate::pipeline) |
//!
//! What they work on is here; this module needs nothing of those that call it.

#[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
#[allow(
    unsafe_code,
    reason = "assembler; each file says why each use is sound"
)]
mod arm;
#[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
mod portable;

#[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
pub(crate) use arm::{gather, levels, lines, pixels};
#[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
pub(crate) use portable::{gather, levels, lines, pixels};

use crate::units::{Halfword, InputCoefficient};

/// Whether there are no assembler loops.
pub(crate) const IS_PLAIN: bool = cfg!(not(all(
    target_arch = "arm",
    not(feature = "reference-kernel")
)));

/// Whether words lie where the loops can read them: the assembler's `ldm` wants
/// multiples of four, as tables in flash have.
pub(crate) fn takes(words: &[[u8; 4]]) -> bool {
    IS_PLAIN || words.as_ptr().addr().is_multiple_of(4)
}

/// Coefficients of some channels, one channel after the other.
pub(crate) struct Sums<'s> {
    /// Coefficients of a channel, `N`.
    pub(crate) cells: usize,
    /// Input coefficients of a channel, `N` or more.
    pub(crate) of_channel: usize,
    /// So many input coefficients for each channel.
    pub(crate) inputs: &'s [InputCoefficient],
    /// `N` sums for each channel that rows are added to.
    pub(crate) outputs: &'s mut [i32],
}

/// Rows of an operator with one number of pairs of entries.
#[cfg_attr(
    not(target_arch = "arm"),
    allow(dead_code, reason = "read by the assembler")
)]
pub(crate) struct GroupRows<'a> {
    /// Pairs of each row; 0 if every row says how many it has.
    pub(crate) pairs: u16,
    /// The rows as they lie in the table, at least one.
    pub(crate) words: &'a [[u8; 4]],
}

/// Some nodes of two by two cells: all of some rows, or the first of one row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Block {
    /// First row of cells.
    pub row: usize,
    /// Columns of the grid.
    pub cols: usize,
    /// Nodes of each row of nodes.
    pub nodes: usize,
    /// Rows of nodes.
    pub rows: usize,
}

/// The part of a row between the first and the last cell's centre. The fields are
/// those of [`Axis`](crate::resample::interpolation::Axis).
#[derive(Clone, Copy)]
#[repr(C)]
#[cfg_attr(
    not(target_arch = "arm"),
    allow(dead_code, reason = "read by the assembler")
)]
pub(crate) struct Between {
    /// `2^32 cells / length`, below `2^32`.
    pub(crate) step: u32,
    /// `2^32 / (2 cells)`.
    pub(crate) half_cell: u32,
    /// How far the first pixel lies after the first centre, below `2 cells`.
    pub(crate) past: u32,
    /// `2 (length % cells)`.
    pub(crate) part: u32,
    /// `length / cells`.
    pub(crate) whole: u32,
    /// `2 cells`.
    pub(crate) cell: u32,
}

/// One channel of pixels of `C` samples, and its ambient light.
#[derive(Clone, Copy, Debug)]
pub struct Plane<'f, S, const C: usize> {
    /// The codes of all channels.
    pub codes: &'f [[S; C]],
    /// Ambient light of all channels; `None` in a dark room.
    pub ambient: Option<&'f [[Halfword; C]]>,
    /// Pixels of a row.
    pub cols: usize,
    /// The channel.
    pub channel: usize,
}

impl<S, const C: usize> Plane<'_, S, C> {
    /// The pixels from an index on.
    #[cfg_attr(
        not(target_arch = "arm"),
        allow(dead_code, reason = "used beside the assembler")
    )]
    #[inline]
    pub(crate) fn from(&self, start: usize) -> Self {
        let ambient = self
            .ambient
            .map(|cells| cells.get(start..).unwrap_or_default());
        Self {
            codes: self.codes.get(start..).unwrap_or_default(),
            ambient,
            cols: self.cols,
            channel: self.channel,
        }
    }
}
