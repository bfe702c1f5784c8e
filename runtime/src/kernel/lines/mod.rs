//! Values of cells to values of a row of pixels.

#[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
#[allow(unsafe_code, reason = "assembler; the file says why each use is sound")]
mod arm;

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

/// `before + fraction * (after - before)` for every element of `line`, rounded down;
/// `fraction` has 31 bits. `false`, and nothing done, if that has to be done the plain
/// way.
#[inline]
pub(crate) fn blend(before: &[i32], after: &[i32], fraction: u32, line: &mut [i32]) -> bool {
    #[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
    return arm::blend(before, after, fraction, line);
    #[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
    {
        let _ = (before, after, fraction, line);
        false
    }
}

/// Spreads `values` over the pixels from the first centre to the last; `pixels` has
/// room for them. `false`, and nothing done, if that has to be done the plain way.
#[inline]
pub(crate) fn expand(between: &Between, values: &[i32], pixels: &mut [i32]) -> bool {
    #[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
    return arm::expand(between, values, pixels);
    #[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
    {
        let _ = (between, values, pixels);
        false
    }
}
