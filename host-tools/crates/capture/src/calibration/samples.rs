//! Which pixels of a capture are looked at to judge the camera, and what they say.

use super::balance::Balance;
use super::{CameraFit, CameraSource};
use crate::photo::Reading;
use crate::photographs::Photographs;
use crate::sequence::Sequence;
use crate::{CaptureError, gray_code};
use iltm_picture::{DeviceResponse, progress::Silent};

/// Pixels that a pair of photographs is compared in.
const PIXELS: usize = 4096;

/// Brackets that are compared.
const BRACKETS: usize = 6;

/// Flood light, relative to its 95th percentile, from which a pixel is lit.
const LIT: f32 = 0.05;

/// Pixels that the projector lights and that white does not saturate.
pub(crate) fn used_pixels(
    flood: &[Vec<f32>],
    black: &[Vec<f32>],
    saturated: &[bool],
) -> Vec<usize> {
    let (flood, black) = (gray_code::channel_sum(flood), gray_code::channel_sum(black));
    let light: Vec<f32> = flood.iter().zip(&black).map(|(f, b)| f - b).collect();
    let least = LIT * gray_code::percentile(&light, 0.95);
    let used = |&at: &usize| light[at] > least && !saturated[at];
    (0..light.len()).filter(used).collect()
}

/// Adds up what must come out as nothing: brackets if there are any, else pairs of
/// the Gray code. `None` if there is neither.
///
/// # Errors
/// A photograph's own error.
pub(crate) fn fit(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    used: &[usize],
    reading: &Reading,
) -> Result<Option<CameraFit>, CaptureError> {
    let step = used.len().div_ceil(PIXELS).max(1);
    let pixels: Vec<usize> = used.iter().copied().step_by(step).collect();
    let (balances, source) = if photographs.bracketed() {
        let (balances, pairs) = brackets(sequence, photographs, &pixels, &reading.response)?;
        (balances, CameraSource::Brackets { pairs })
    } else {
        let (balances, pairs) = code_pairs(sequence, photographs, &pixels, &reading.response)?;
        (balances, CameraSource::Pairs { pairs })
    };
    Ok(CameraFit::new(balances, source, &reading.response))
}

/// Each pattern and its inverse against white and black.
fn code_pairs(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    pixels: &[usize],
    response: &DeviceResponse,
) -> Result<(Vec<Balance>, usize), CaptureError> {
    let first = |view: usize| sequence.views[view].shots[0];
    let mut values = |frame: usize| values(photographs, frame, pixels, response);
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
    frame: usize,
    pixels: &[usize],
    response: &DeviceResponse,
) -> Result<Vec<f32>, CaptureError> {
    let mut values = Vec::new();
    photographs.for_batches(&[frame], &Silent, |photos| {
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
    let several = |frame: &&usize| sequence.frames[**frame].shots.len() > 1;
    let lit = sequence.views.iter().flat_map(|view| &view.shots);
    let (mut balances, mut pairs) = (Vec::new(), 0);
    for &frame in lit.filter(several).take(BRACKETS) {
        let photos = photographs.each_of(frame)?;
        let times = &sequence.frames[frame].times;
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
