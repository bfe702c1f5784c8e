//! Camera samples: the values of some pixels, of which sums must come out as nothing.

use super::balance::Balance;
use super::{CameraFit, CameraSource};
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::photographs::Photographs;
use crate::photographs::linearise::LinearPhotographs;
use iltm_picture::{DeviceResponse, progress::Silent};

/// Pixels that a pair of photographs is compared in.
const PIXELS: usize = 4096;

/// Brackets that are compared.
const BRACKETS: usize = 6;

/// Pixels that the projector lights and that white does not saturate.
pub(super) fn used_pixels(linear: &LinearPhotographs<'_>) -> Vec<usize> {
    let lit = linear.flood_light().lit().into_iter();
    lit.filter(|&at| !linear.saturated[at]).collect()
}

/// Adds up what must come out as nothing: brackets if there are any, else pairs of
/// the Gray code. `None` if there is neither.
///
/// # Errors
/// A photograph's own error.
pub(super) fn fit(
    sequence: &Sequence,
    linear: &mut LinearPhotographs<'_>,
) -> Result<Option<CameraFit>, CaptureError> {
    let used = used_pixels(linear);
    let step = used.len().div_ceil(PIXELS).max(1);
    let pixels: Vec<usize> = used.into_iter().step_by(step).collect();
    let photographs = &mut linear.photographs;
    let response = &photographs.format.reading.response.clone();
    let (balances, source) = if photographs.bracketed() {
        let (balances, pairs) = brackets(sequence, photographs, &pixels, response)?;
        (balances, CameraSource::Brackets { pairs })
    } else {
        let (balances, pairs) = code_pairs(sequence, photographs, &pixels, response)?;
        (balances, CameraSource::Pairs { pairs })
    };
    Ok(CameraFit::new(&balances, source, response))
}

/// Each pattern and its inverse against white and black.
fn code_pairs(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    pixels: &[usize],
    response: &DeviceResponse,
) -> Result<(Vec<Balance>, usize), CaptureError> {
    let first = |view: usize| sequence.views[view].shots[0];
    let mut values = |bracket: usize| values(photographs, bracket, pixels, response);
    let (white, black) = (
        values(sequence.white().shots[0])?,
        values(sequence.black[0])?,
    );
    let pairs = sequence.code_pairs();
    let mut balances = Vec::new();
    for &(pattern, inverse) in &pairs {
        let (a, b) = (values(first(pattern))?, values(first(inverse))?);
        let all = a.iter().zip(&b).zip(white.iter().zip(&black));
        balances.extend(all.map(|((a, b), (white, black))| Balance {
            values: [*a, *b, *white, *black],
            weights: [1.0, 1.0, -1.0, -1.0],
        }));
    }
    balances.retain(|balance| balance.values.iter().all(|value| *value < 1.0));
    Ok((balances, pairs.len()))
}

/// Values of some pixels in all channels, as they stand in the file.
fn values(
    photographs: &mut Photographs<'_>,
    bracket: usize,
    pixels: &[usize],
    response: &DeviceResponse,
) -> Result<Vec<f32>, CaptureError> {
    let mut values = Vec::new();
    photographs.for_batches(&[bracket], &Silent, |photos| {
        for (_, photo) in photos {
            for plane in &photo.planes {
                let light = pixels.iter().map(|&at| plane[at]);
                values.extend(light.map(|light| response.value(f64::from(light)) as f32));
            }
        }
    })?;
    Ok(values)
}

/// Two exposures of one pattern against their times.
fn brackets(
    sequence: &Sequence,
    photographs: &Photographs<'_>,
    pixels: &[usize],
    response: &DeviceResponse,
) -> Result<(Vec<Balance>, usize), CaptureError> {
    let several = |bracket: &&usize| sequence.brackets[**bracket].shots.len() > 1;
    let lit = sequence.views.iter().flat_map(|view| &view.shots);
    let (mut balances, mut pairs) = (Vec::new(), 0);
    for &bracket in lit.filter(several).take(BRACKETS) {
        let photos = photographs.each_of(bracket)?;
        let times = &sequence.brackets[bracket].times;
        for (two, times) in photos.windows(2).zip(times.windows(2)) {
            pairs += 1;
            for (long, short) in two[0].planes.iter().zip(&two[1].planes) {
                let value = |plane: &[f32], at: usize| response.value(f64::from(plane[at])) as f32;
                balances.extend(pixels.iter().map(|&at| Balance {
                    values: [value(long, at), value(short, at), 0.0, 0.0],
                    weights: [1.0, -(times[0] / times[1]) as f32, 0.0, 0.0],
                }));
            }
        }
    }
    balances.retain(|balance| balance.values.iter().all(|value| *value < 1.0));
    Ok((balances, pairs))
}
