//! Haar transform: the exact integer two-dimensional one, on a grid of any size.
//!
//! The basis is the non-standard (quad-tree) one: at every level, adjacent pairs
//! of rows and of columns merge into nodes twice as wide and high; an odd last
//! row or column passes on unmerged. It needs no padding, so a 13 x 21 grid has
//! exactly 273 coefficients.
//!
//! Let a pair have `a` and `b` cells and let `a'`, `b'` be those counts divided
//! by their greatest common divisor. Its detail function is `+b'` on the first
//! half and `-a'` on the second: orthogonal to the constant, and integer. With
//! `S` the matrix of all these functions (`N x N`, one column each),
//!
//! - [`analyse`] computes `S^T x`, exactly;
//! - [`synthesise`] computes `S z`, exactly;
//! - [`reconstruct`] computes the `x` that has a given `S^T x`, exactly.
//!
//! `S^T S` is diagonal ([`Basis::squared_norm`]), so the orthonormal Haar matrix
//! of the paper is `W = S (S^T S)^-1/2`. The two diagonal factors are left to the
//! table, which absorbs them into its values: on the device no coefficient is
//! ever multiplied by a scale.
//!
//! Coefficients are numbered in the order in which [`analyse`] finds them: finest
//! level first, node by node along the rows; in a node the split of the columns
//! (left against right), then of the rows (top against bottom), then of both;
//! the sum of all cells last. [`Basis::functions`] lists them in that order.

mod analysis;
mod basis;
mod level;
mod reconstruction;
mod source;
mod synthesis;

pub use crate::kernel::Block;
pub use analysis::{Coefficient, analyse};
pub use basis::{Basis, Function, Functions, Split};
pub use reconstruction::reconstruct;
pub use source::{CellRow, CellSource, Cells};
pub use synthesis::synthesise;

#[cfg(test)]
mod tests;

/// A slice that a transform was given is too short for its grid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShortSlice {
    /// Which slice.
    pub what: &'static str,
    /// Elements it needs.
    pub needed: usize,
    /// Elements it has.
    pub given: usize,
}

impl ShortSlice {
    /// An error if fewer elements are given than needed.
    pub(crate) const fn check(what: &'static str, needed: usize, given: usize) -> Result<(), Self> {
        if given < needed {
            return Err(Self {
                what,
                needed,
                given,
            });
        }
        Ok(())
    }
}

impl core::fmt::Display for ShortSlice {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "the {} slice has {} elements and needs {}",
            self.what, self.given, self.needed
        )
    }
}

impl core::error::Error for ShortSlice {}

/// The first `needed` elements of `slice`.
fn front<'s, T>(
    slice: &'s mut [T],
    needed: usize,
    what: &'static str,
) -> Result<&'s mut [T], ShortSlice> {
    let given = slice.len();
    slice.get_mut(..needed).ok_or(ShortSlice {
        what,
        needed,
        given,
    })
}
