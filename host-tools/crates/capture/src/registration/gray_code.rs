//! Gray code: which cell lights each camera pixel.
//!
//! A first guess: light from other cells can outweigh a pixel's own and flip a
//! bit, so [`registration`](super::registration) corrects it where there are
//! enough Bernoulli photographs.

use super::cell_map::NO_CELL;
use crate::format::code::binary;
use crate::format::error::CaptureError;
use crate::format::role::CodeAxis;
use crate::format::sequence::Sequence;
use crate::photographs::linearise::LinearPhotographs;
use crate::photographs::{Photographs, channel_sum};
use iltm_picture::progress::Progress;

/// Flood light, of full scale, that an 8-bit camera could just tell from black.
const LEAST_LIGHT: f32 = 1.0 / 255.0;

/// The Gray code as every camera pixel sees it.
#[derive(Clone, Debug)]
pub(crate) struct GrayLabels {
    /// Cell of each pixel, or [`NO_CELL`].
    pub(crate) cell: Vec<u32>,
    /// Smallest difference between a bit's pattern and its inverse over all
    /// bits, relative to the pixel's flood light: 1 where nothing but the
    /// pixel's own cell lights it, about 0 where the bit is a guess.
    pub(crate) margin: Vec<f32>,
    /// Flood light of each pixel, summed over the channels, black removed.
    pub(crate) light: Vec<f32>,
    /// Camera pixels that the projector lights.
    pub(crate) lit: usize,
}

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
) -> Result<GrayLabels, CaptureError> {
    let flood = linear.flood_light();
    let photographs = &mut linear.photographs;
    if flood.bright < LEAST_LIGHT {
        return Err(CaptureError::NoLight {
            path: photographs.path(sequence.white().shots[0]),
        });
    }
    let lit = flood.lit();
    let (white, black) = (channel_sum(&linear.flood), channel_sum(&linear.black));
    let middle = white.iter().zip(&black).map(|(w, b)| 0.5 * (w + b));
    let middle: Vec<f32> = middle.collect();
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
    Ok(GrayLabels {
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
    let subtract = |a: &[f32], b: &[f32], times: f32| -> Vec<f32> {
        a.iter().zip(b).map(|(a, b)| times * (a - b)).collect()
    };
    Ok(match (photo(false)?, photo(true)?) {
        (Some(pattern), Some(inverse)) => subtract(&pattern, &inverse, 1.0),
        (Some(pattern), None) => subtract(&pattern, middle, 2.0),
        (None, Some(inverse)) => subtract(middle, &inverse, 2.0),
        // `Sequence` has checked that each bit was photographed.
        (None, None) => vec![0.0; middle.len()],
    })
}
