//! Clipping: pixels that white saturates, at the camera's full scale or below that of
//! whatever came between sensor and file.

use super::linearise::LinearPhotographs;
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use iltm_picture::progress::Progress;

/// Share of the lit pixels that have the highest value when it is a ceiling.
const CEILING_SHARE: f64 = 0.004;

/// How much more often a ceiling occurs than the values just below it.
const CEILING_RATIO: f64 = 5.0;

/// Values below the highest that are compared with it.
const BELOW: usize = 8;

/// Excess of pattern and inverse over white, from which a highest value has cut
/// light off.
const CUT_OFF: f64 = 0.002;

/// What the flood photograph shows of clipping.
pub(crate) struct Clipped {
    /// Pixels that the projector lights.
    pub(crate) lit: usize,
    /// Those of them that are clipped.
    pub(crate) count: usize,
    /// Highest value, of full scale, if light is cut off below full scale.
    pub(crate) ceiling: Option<f32>,
}

/// Marks pixels whose light is cut off below the camera's full scale as saturated, beside
/// those at full scale that are marked already, and counts.
///
/// # Errors
/// A photograph's own error.
pub(crate) fn find(
    sequence: &Sequence,
    linear: &mut LinearPhotographs<'_>,
    progress: &dyn Progress,
) -> Result<Clipped, CaptureError> {
    // A lamp in view is saturated under black too and says nothing about white.
    let lit = linear.flood_light().lit();
    let (photographs, saturated) = (&mut linear.photographs, &mut linear.saturated);
    let mut ceiling = None;
    if let Some(&(a, b)) = sequence.code_pairs().first() {
        let first = sequence.white().shots[0];
        let (planes, _) = photographs.mean(&[first], progress)?;
        for (channel, plane) in planes.iter().enumerate() {
            let Some(highest) = ceiling_of(plane, &lit, saturated) else {
                continue;
            };
            let (one, _) = photographs.mean(&sequence.views[a].shots, progress)?;
            let (other, _) = photographs.mean(&sequence.views[b].shots, progress)?;
            let black = &linear.black[channel];
            let sum = |at: usize| one[channel][at] + other[channel][at] - black[at];
            if cuts_off(plane, &lit, saturated, highest, sum) {
                ceiling = Some(ceiling.map_or(highest, |known: f32| known.max(highest)));
                for &at in &lit {
                    saturated[at] |= plane[at] >= highest;
                }
            }
        }
    }
    Ok(Clipped {
        lit: lit.len(),
        count: lit.iter().filter(|&&at| saturated[at]).count(),
        ceiling,
    })
}

/// The highest value below saturation, if it occurs far more often than those below.
fn ceiling_of(plane: &[f32], lit: &[usize], saturated: &[bool]) -> Option<f32> {
    let mut values: Vec<f32> = (lit.iter().filter(|&&at| !saturated[at]))
        .map(|&at| plane[at])
        .collect();
    values.sort_by(|a, b| b.total_cmp(a));
    let mut counts = values.chunk_by(|a, b| a.total_cmp(b).is_eq());
    let top = counts.next()?;
    let below: Vec<usize> = counts.take(BELOW).map(<[f32]>::len).collect();
    let usual = below.iter().sum::<usize>() as f64 / below.len().max(1) as f64;
    let often = top.len() as f64;
    let stands_out = often > CEILING_SHARE * lit.len() as f64 && often > CEILING_RATIO * usual;
    (below.len() == BELOW && stands_out).then(|| top[0])
}

/// Whether a pattern and its inverse exceed white where it has its `highest` value
/// by more than elsewhere. Chance alone would make them fall short there.
fn cuts_off(
    white: &[f32],
    lit: &[usize],
    saturated: &[bool],
    highest: f32,
    sum: impl Fn(usize) -> f32,
) -> bool {
    let excess = |at_top: bool| {
        let (mut excess, mut all) = (0.0, 0.0);
        let pixels = lit.iter().filter(|&&at| !saturated[at]);
        for &at in pixels.filter(|&&at| (white[at] >= highest) == at_top) {
            excess += f64::from(sum(at) - white[at]);
            all += f64::from(white[at]);
        }
        if all > 0.0 { excess / all } else { 0.0 }
    };
    excess(true) > excess(false) + CUT_OFF
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ceiling of a plane whose values are these, each so many times; the last ones are
    /// saturated.
    fn ceiling(values: &[(f32, usize)], saturated: usize) -> Option<f32> {
        let plane: Vec<f32> = (values.iter())
            .flat_map(|&(value, count)| vec![value; count])
            .collect();
        let lit: Vec<usize> = (0..plane.len()).collect();
        let from = plane.len() - saturated;
        let known: Vec<bool> = lit.iter().map(|at| *at >= from).collect();
        ceiling_of(&plane, &lit, &known)
    }

    #[test]
    fn a_ceiling_is_a_highest_value_that_is_far_more_frequent_than_those_below() {
        let below: Vec<(f32, usize)> = (0..20).map(|k| (0.02 * k as f32, 10)).collect();
        let with = |top: &[(f32, usize)]| [&below, top].concat();
        assert_eq!(ceiling(&with(&[(0.5, 60)]), 0), Some(0.5));
        assert_eq!(ceiling(&with(&[(0.5, 49)]), 0), None);
        // What is saturated anyway is not looked at.
        assert_eq!(ceiling(&with(&[(0.5, 60), (0.98, 300)]), 300), Some(0.5));
        // Too few values below say nothing.
        assert_eq!(ceiling(&[&below[..7], &[(0.5, 60)]].concat(), 0), None);
    }
}
