//! Gray code: which cell lights each camera pixel.
//!
//! A first guess: light from other cells can outweigh a pixel's own and flip a
//! bit, so [`registration`](super::registration) corrects it where there are
//! enough Bernoulli photographs.

use super::cell_map::{CellLabels, NO_CELL};
use crate::format::code::binary;
use crate::format::error::CaptureError;
use crate::format::role::CodeAxis;
use crate::format::sequence::Sequence;
use crate::photographs::linearise::LinearPhotographs;
use crate::photographs::{Photographs, channel_sum};
use iltm_picture::progress::Progress;

/// Decodes the Gray code.
///
/// A bit is read from the sign of pattern minus inverse, summed over the
/// channels; where one of the two was not photographed, from the other against
/// the middle of white and black.
///
/// # Errors
/// [`CaptureError::NoLight`] if flood and black are the same, or a photograph's
/// own error.
pub(crate) fn decode(
    sequence: &Sequence,
    linear: &mut LinearPhotographs<'_>,
    progress: &dyn Progress,
) -> Result<CellLabels, CaptureError> {
    let flood = linear.enough_flood_light(sequence)?;
    let lit = flood.lit();
    let middle = linear.middle();
    let photographs = &mut linear.photographs;
    let mut margin = vec![f32::INFINITY; middle.len()];
    let mut codes = [vec![0_u32; middle.len()], vec![0_u32; middle.len()]];
    for (axis, code) in [CodeAxis::Column, CodeAxis::Row]
        .into_iter()
        .zip(&mut codes)
    {
        for bit in 0..sequence.codes[axis as usize].bits {
            let difference = bit_difference(sequence, photographs, axis, bit, &middle, progress)?;
            for &pixel in &lit {
                let d = difference[pixel];
                code[pixel] = code[pixel] << 1 | u32::from(d > 0.0);
                margin[pixel] = margin[pixel].min(d.abs() / flood.pixels[pixel]);
            }
        }
    }
    let (rows, cols) = (sequence.grid.rows(), sequence.grid.cols());
    let mut cell = vec![NO_CELL; middle.len()];
    for &pixel in &lit {
        let at = |axis: usize| {
            let number = binary(codes[axis][pixel]) as usize;
            number.checked_sub(sequence.codes[axis].offset)
        };
        if let (Some(col), Some(row)) = (at(0), at(1))
            && row < rows
            && col < cols
        {
            cell[pixel] = (row * cols + col) as u32;
        }
    }
    Ok(CellLabels {
        cell,
        margin,
        light: flood.pixels,
        lit: lit.len(),
    })
}

/// Pattern minus inverse of one bit in every pixel, summed over the channels.
fn bit_difference(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    axis: CodeAxis,
    bit: u8,
    middle: &[f32],
    progress: &dyn Progress,
) -> Result<Vec<f32>, CaptureError> {
    let mut photo = |inverse| -> Result<Option<Vec<f32>>, CaptureError> {
        let Some(view) = sequence.view(axis.stripe(bit, inverse)) else {
            return Ok(None);
        };
        let (planes, _) = photographs.mean(&view.shots, progress)?;
        Ok(Some(channel_sum(&planes)))
    };
    let (pattern, inverse) = (photo(false)?, photo(true)?);
    let found = difference(pattern.as_deref(), inverse.as_deref(), middle);
    // `Sequence` has checked that each bit was photographed.
    Ok(found.unwrap_or_else(|| vec![0.0; middle.len()]))
}

/// Pattern minus inverse in every pixel; where one of the two is missing, twice the other against
/// the middle of white and black. `None` without both.
pub(super) fn difference(
    pattern: Option<&[f32]>,
    inverse: Option<&[f32]>,
    middle: &[f32],
) -> Option<Vec<f32>> {
    let (more, less, times) = match (pattern, inverse) {
        (Some(pattern), Some(inverse)) => (pattern, inverse, 1.0),
        (Some(pattern), None) => (pattern, middle, 2.0),
        (None, Some(inverse)) => (middle, inverse, 2.0),
        (None, None) => return None,
    };
    let pairs = more.iter().zip(less);
    Some(pairs.map(|(more, less)| times * (more - less)).collect())
}
