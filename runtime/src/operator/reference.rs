//! Plain operator loop: products of entries with input coefficients, by definition.

use super::{Group, Row};
use crate::kernel::Sums;
use crate::units::InputCoefficient;
use fixed::types::I2F30;

/// Adds the rows of a group to the sums of `C` channels, which are long enough.
#[inline(never)]
pub(super) fn add<const C: usize>(group: &Group<'_>, scales: &[I2F30; C], sums: &mut Sums<'_>) {
    let mut inputs = [&[][..]; C];
    for (channel, of_channel) in inputs
        .iter_mut()
        .zip(sums.inputs.chunks_exact(sums.of_channel.max(1)))
    {
        *channel = of_channel;
    }
    for row in group.rows() {
        let totals = products(&row, &inputs);
        let of_row = sums.outputs.iter_mut().skip(usize::from(row.index));
        let of_row = of_row.step_by(sums.cells.max(1));
        for ((sum, total), scale) in of_row.zip(totals).zip(scales) {
            *sum = sum.wrapping_add(scaled(total, *scale, row.shift));
        }
    }
}

/// Sum of the products of a row's entries with the inputs of each channel.
#[inline]
fn products<const C: usize>(row: &Row<'_>, inputs: &[&[InputCoefficient]; C]) -> [i32; C] {
    row.fold([0_i32; C], |mut totals, pair| {
        let (at, [first, second]) = (usize::from(pair.index), pair.values.map(i32::from));
        for (total, inputs) in totals.iter_mut().zip(inputs) {
            if let Some(&[a, b]) = inputs.get(at..at + 2) {
                let products = first.wrapping_mul(a.into());
                let products = products.wrapping_add(second.wrapping_mul(b.into()));
                *total = total.wrapping_add(products);
            }
        }
        totals
    })
}

/// `sum * scale / 2^shift`, rounded down, in two steps: the high word of the
/// product with a scale of 30 fraction bits has two bits of the shift already.
fn scaled(sum: i32, scale: I2F30, shift: u16) -> i32 {
    let product = i64::from(sum).wrapping_mul(i64::from(scale.to_bits()));
    let high = (product >> 32) as i32;
    high.wrapping_shr(u32::from(shift).wrapping_sub(2))
}
