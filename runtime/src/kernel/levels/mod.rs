//! One level of the transforms where all nodes have four equal quarters.

#[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
#[allow(unsafe_code, reason = "assembler; the file says why each use is sound")]
pub(super) mod arm;

use crate::haar::Block;
use crate::units::InputCoefficient;

/// Merges a block of a level's `values`: the sum of each node to `sums`, its details,
/// shifted right by `shift` to nearest, to `details`. `false`, and nothing done, if that has to be done the plain way
/// ([`haar`](crate::haar)).
#[inline]
pub(crate) fn merge(
    values: &[i32],
    block: Block,
    shift: u32,
    sums: &mut [i32],
    details: &mut [[InputCoefficient; 3]],
) -> bool {
    #[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
    return arm::merge(values, block, shift, sums, details);
    #[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
    {
        let _ = (values, block, shift, sums, details);
        false
    }
}

/// Splits the `values` of a block into their quarters, which go to `to`, where the
/// block begins. `false`, and nothing done, if that has to be done the plain way.
#[inline]
pub(crate) fn split(block: Block, values: &[i32], details: &[[i32; 3]], to: &mut [i32]) -> bool {
    #[cfg(all(target_arch = "arm", not(feature = "reference-kernel")))]
    return arm::split(block, values, details, to);
    #[cfg(not(all(target_arch = "arm", not(feature = "reference-kernel"))))]
    {
        let _ = (block, values, details, to);
        false
    }
}
