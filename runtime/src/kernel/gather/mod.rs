//! The innermost loop: products of a segment's entries with input coefficients.

#[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
#[allow(unsafe_code, reason = "assembler; the file says why each use is sound")]
mod arm;
mod reference;

use crate::operator::Segment;
use crate::units::InputCoefficient;
use fixed::types::I2F30;

/// Coefficients of `C` channels, one channel after the other.
pub(crate) struct Sums<'s> {
    /// Coefficients of a channel, `N`.
    pub(crate) cells: usize,
    /// `C * N` input coefficients.
    pub(crate) inputs: &'s [InputCoefficient],
    /// `C * N` sums that the segment is added to.
    pub(crate) outputs: &'s mut [i32],
}

/// Adds a segment, scaled by channel, to the sums of `C` channels. The segment was
/// checked against a grid of `sums.cells` cells; too short slices stay as they are.
///
/// `fresh` says that the sums are all zero: a row is then stored, not added.
pub(crate) fn gather<const C: usize>(
    segment: &Segment<'_>,
    scales: [I2F30; C],
    fresh: bool,
    sums: &mut Sums<'_>,
) {
    #[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
    let _ = fresh;
    let needed = C.saturating_mul(sums.cells);
    if sums.inputs.len() < needed || sums.outputs.len() < needed {
        return;
    }
    #[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
    if arm::gather(segment, &scales, fresh, sums) {
        return;
    }
    for group in segment.groups() {
        reference::gather(&group, &scales, sums);
    }
}
