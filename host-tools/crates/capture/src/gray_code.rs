//! Which cell lights each camera pixel, by the Gray code.
//!
//! A first guess: light from other cells can outweigh a pixel's own and flip a
//! bit, so [`registration`](super::registration) corrects it where there are
//! enough Bernoulli photographs.

use super::photographs::Photographs;
use super::registration::NO_CELL;
use super::sequence::Sequence;
use super::{CaptureError, Role};
use iltm_picture::progress::Progress;

/// Flood light of a pixel, as a share of the 95th percentile of all pixels,
/// below which it is not looked at: it only sees light from elsewhere.
const LIT_SHARE: f32 = 0.05;

/// Flood light, of full scale, that an 8-bit camera could just tell from black.
const LEAST_LIGHT: f32 = 1.0 / 255.0;

/// The Gray code as every camera pixel sees it.
#[derive(Clone, Debug)]
pub(super) struct GrayLabels {
    /// Cell of each pixel, or [`NO_CELL`].
    pub(super) cell: Vec<u32>,
    /// Smallest difference between a bit's pattern and its inverse over all
    /// bits, relative to the pixel's flood light: 1 where nothing but the
    /// pixel's own cell lights it, about 0 where the bit is a guess.
    pub(super) margin: Vec<f32>,
    /// Flood light of each pixel, summed over the channels, black removed.
    pub(super) light: Vec<f32>,
    /// Camera pixels that the projector lights.
    pub(super) lit: usize,
}

/// Decodes the Gray code. `flood` is the flood photograph and `black` the black
/// one, one plane a channel.
///
/// A bit is read from the sign of pattern minus inverse, summed over the
/// channels; where one of the two was not photographed, from the other against
/// the middle of white and black.
///
/// # Errors
/// [`CaptureError::NoLight`] if flood and black are the same, or a photograph's
/// own error.
pub(super) fn decode(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    flood: &[Vec<f32>],
    black: &[Vec<f32>],
    progress: &dyn Progress,
) -> Result<GrayLabels, CaptureError> {
    let (white, black) = (channel_sum(flood), channel_sum(black));
    let light: Vec<f32> = white.iter().zip(&black).map(|(w, b)| w - b).collect();
    let bright = percentile(&light, 0.95);
    if bright < LEAST_LIGHT {
        return Err(CaptureError::NoLight {
            path: photographs.path(sequence.white().shots[0]),
        });
    }
    let lit: Vec<bool> = light.iter().map(|&l| l > LIT_SHARE * bright).collect();
    let middle: Vec<f32> = white
        .iter()
        .zip(&black)
        .map(|(w, b)| 0.5 * (w + b))
        .collect();

    let mut margin = vec![f32::INFINITY; light.len()];
    let mut code = [vec![0_u32; light.len()], vec![0_u32; light.len()]];
    for (axis, code) in code.iter_mut().enumerate() {
        for bit in 0..sequence.codes[axis].bits {
            let difference = bit_difference(sequence, photographs, axis, bit, &middle, progress)?;
            for (pixel, (code, &d)) in code.iter_mut().zip(&difference).enumerate() {
                *code = *code << 1 | u32::from(d > 0.0);
                if lit[pixel] {
                    margin[pixel] = margin[pixel].min(d.abs() / light[pixel]);
                }
            }
        }
    }
    let (rows, cols) = (sequence.grid.rows(), sequence.grid.cols());
    let [column, row] = code;
    let cell = column
        .iter()
        .zip(&row)
        .zip(&lit)
        .map(|((&col, &row), &lit)| {
            let at = |axis: usize, gray: u32| {
                (binary(gray) as usize).checked_sub(sequence.codes[axis].offset)
            };
            match (at(0, col), at(1, row)) {
                (Some(col), Some(row)) if lit && row < rows && col < cols => {
                    (row * cols + col) as u32
                }
                _ => NO_CELL,
            }
        });
    Ok(GrayLabels {
        cell: cell.collect(),
        margin,
        light,
        lit: lit.iter().filter(|&&lit| lit).count(),
    })
}

/// Pattern minus inverse of one bit in every pixel, summed over the channels.
fn bit_difference(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    axis: usize,
    bit: u8,
    middle: &[f32],
    progress: &dyn Progress,
) -> Result<Vec<f32>, CaptureError> {
    let mut photo = |inverse| -> Result<Option<Vec<f32>>, CaptureError> {
        let role = match axis {
            0 => Role::Column { bit, inverse },
            _ => Role::Row { bit, inverse },
        };
        let Some(view) = sequence.view(role) else {
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

/// The number that a Gray code word stands for.
pub(super) fn binary(gray: u32) -> u32 {
    let mut number = gray;
    for shift in [1, 2, 4, 8, 16] {
        number ^= number >> shift;
    }
    number
}

/// Sum over the channels of each pixel.
pub(super) fn channel_sum(planes: &[Vec<f32>]) -> Vec<f32> {
    let mut sum = planes[0].clone();
    for plane in &planes[1..] {
        for (sum, value) in sum.iter_mut().zip(plane) {
            *sum += value;
        }
    }
    sum
}

/// The value that a share of `values` stays below; 0 of none.
pub(super) fn percentile(values: &[f32], share: f64) -> f32 {
    let mut sorted = values.to_vec();
    let at = ((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1));
    if sorted.is_empty() {
        return 0.0;
    }
    *sorted.select_nth_unstable_by(at, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn binary_undoes_the_gray_code() {
        for number in 0..5000_u32 {
            assert_eq!(binary(number ^ (number >> 1)), number);
        }
    }

    #[test]
    fn a_percentile_is_a_value_that_occurs() {
        assert!((percentile(&[5.0, 1.0, 4.0, 2.0, 3.0], 0.5) - 3.0).abs() < 1e-9);
        assert!((percentile(&[5.0, 1.0], 1.0) - 5.0).abs() < 1e-9);
        assert!(percentile(&[], 0.5).abs() < 1e-9);
    }
}
