//! What a Haar rotation works on: one number, or sixteen images side by side.
//!
//! The iterations transform every row and every column of an `N x N` matrix.
//! Done sixteen at a time, each rotation is a handful of vector instructions
//! and its two indices are read once for sixteen numbers.

use super::haar::Rotation;

/// Images that a [`Pack`] holds.
pub(super) const LANES: usize = 16;

/// One pixel of [`LANES`] images: a cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(super) struct Pack(pub(super) [f32; LANES]);

impl Pack {
    pub(super) const ZERO: Self = Self([0.0; LANES]);
}

/// A value that a plane rotation can be applied to.
pub(super) trait Lane: Copy {
    /// `(cos a + sin b, sin a - cos b)`; its own inverse.
    fn rotate(a: Self, b: Self, by: &Rotation) -> (Self, Self);
}

impl Lane for f64 {
    #[inline]
    fn rotate(a: Self, b: Self, by: &Rotation) -> (Self, Self) {
        (by.cos * a + by.sin * b, by.sin * a - by.cos * b)
    }
}

impl Lane for Pack {
    #[inline]
    fn rotate(a: Self, b: Self, by: &Rotation) -> (Self, Self) {
        let (cos, sin) = (by.cos as f32, by.sin as f32);
        let (mut sum, mut detail) = (a, b);
        for lane in 0..LANES {
            sum.0[lane] = cos * a.0[lane] + sin * b.0[lane];
            detail.0[lane] = sin * a.0[lane] - cos * b.0[lane];
        }
        (sum, detail)
    }
}

/// Exchanges images and pixels of a square tile.
#[inline]
pub(super) fn transpose(tile: &[Pack; LANES]) -> [Pack; LANES] {
    let mut turned = [Pack::ZERO; LANES];
    for (row, pack) in tile.iter().enumerate() {
        for (col, value) in pack.0.iter().enumerate() {
            turned[col].0[row] = *value;
        }
    }
    turned
}
