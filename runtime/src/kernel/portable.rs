//! Loops on processors for which there is no assembler: each does nothing and says so.

/// Products of an operator's entries with input coefficients.
pub(crate) mod gather {
    use crate::kernel::{GroupRows, Sums};
    use fixed::types::I2F30;

    /// Makes all values zero. `false`, and nothing done, if that has to be done the plain
    /// way.
    pub(crate) const fn clear(_values: &mut [i32]) -> bool {
        false
    }

    /// Adds rows to the sums of each scale's channel. `false`, and nothing done, if that
    /// has to be done the plain way ([`operator`](crate::operator)).
    ///
    /// `fresh` says that the sums are all zero: a row is then stored, not added. The rows
    /// are those of a segment that was checked against a grid of `sums.cells` cells and
    /// `sums.of_channel` inputs; sums and inputs have that many elements for each scale.
    pub(crate) fn gather<'a>(
        _rows: impl Iterator<Item = GroupRows<'a>>,
        _scales: &[I2F30],
        _fresh: bool,
        _sums: &mut Sums<'_>,
    ) -> bool {
        false
    }
}

/// One level of the Haar transform where all nodes have four equal quarters.
pub(crate) mod levels {
    use crate::kernel::Block;
    use crate::units::InputCoefficient;

    /// Merges a block of a level's `values`: the sum of each node to `sums`, its details,
    /// shifted right by `shift` to nearest, to `details`. `false`, and nothing done, if
    /// that has to be done the plain way ([`haar`](crate::haar)).
    #[inline]
    pub(crate) const fn merge(
        _values: &[i32],
        _block: Block,
        _shift: u32,
        _sums: &mut [i32],
        _details: &mut [[InputCoefficient; 3]],
    ) -> bool {
        false
    }

    /// Splits the `values` of a block into their quarters, which go to `to`, where the
    /// block begins. `false`, and nothing done, if that has to be done the plain way.
    #[inline]
    pub(crate) const fn split(
        _block: Block,
        _values: &[i32],
        _details: &[[i32; 3]],
        _to: &mut [i32],
    ) -> bool {
        false
    }
}

/// Values of cells along a row to values of pixels.
pub(crate) mod lines {
    use crate::kernel::Between;

    /// `before + fraction * (after - before)` for every element of `line`, rounded down;
    /// `fraction` has 31 bits. `false`, and nothing done, if that has to be done the plain
    /// way ([`resample`](crate::resample)).
    #[inline]
    pub(crate) const fn blend(
        _before: &[i32],
        _after: &[i32],
        _fraction: u32,
        _line: &mut [i32],
    ) -> bool {
        false
    }

    /// Spreads `values` over the pixels from the first centre to the last; `pixels` has
    /// room for them. `false`, and nothing done, if that has to be done the plain way.
    #[inline]
    pub(crate) const fn expand(_between: &Between, _values: &[i32], _pixels: &mut [i32]) -> bool {
        false
    }
}

/// 8-bit pixels to the finest level of the transforms, and corrections to 8-bit pixels.
pub(crate) mod pixels {
    use crate::kernel::{Block, Plane};
    use crate::response::CODES;
    use crate::units::{ClippedSamples, Halfword, InputCoefficient};

    /// Merges a block of the pixels of one channel: the sum of each node to `sums`, its
    /// details to `details`. `light` is by code. `false`, and nothing done, if that has to
    /// be done the plain way ([`pipeline`](crate::pipeline)).
    #[inline]
    pub(crate) const fn merge<const C: usize>(
        _plane: &Plane<'_, u8, C>,
        _light: &[Halfword; 256],
        _block: Block,
        _shift: u32,
        _sums: &mut [i32],
        _details: &mut [[InputCoefficient; 3]],
    ) -> bool {
        false
    }

    /// Gain, correction, clip and code of one channel of as many pixels as there are
    /// corrections; returns how many were clipped, or `None`, and nothing done, if that
    /// has to be done the plain way. `light` is by code, `codes` by drive, `None` if they
    /// are in proportion to it.
    #[inline]
    pub(crate) const fn finish<const C: usize>(
        _wanted: &Plane<'_, u8, C>,
        _light: &[Halfword; 256],
        _codes: Option<&[u8; CODES]>,
        _gain_fraction: u32,
        _gains: &[[Halfword; C]],
        _corrections: &[i32],
        _input: &mut [[u8; C]],
    ) -> Option<ClippedSamples> {
        None
    }

    /// Adds the light of one channel of as many pixels as there are columns, times
    /// `weight`, to the columns. `false`, and nothing done, if that has to be done the
    /// plain way.
    #[inline]
    pub(crate) const fn add_light<const C: usize>(
        _plane: &Plane<'_, u8, C>,
        _light: &[Halfword; 256],
        _weight: u32,
        _columns: &mut [u32],
    ) -> bool {
        false
    }
}
