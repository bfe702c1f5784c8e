//! Gate `saturation`: white is below the camera's limit, and below that of
//! whatever came between sensor and file.

use super::super::gray_code::{channel_sum, percentile};
use super::super::photographs::Photographs;
use super::super::sequence::Sequence;
use super::super::{CaptureError, LeftOut, Why};
use super::{Evidence, Gate, GateName, Verdict};
use iltm_picture::progress::Progress;

/// Share of the lit pixels or of the cells from which clipping is worth a word.
const WARN: f64 = 0.01;

/// Share of the lit pixels that may be clipped.
const MOST_PIXELS: f64 = 0.1;

/// Share of the cells that may be clipped.
const MOST_CELLS: f64 = 0.05;

/// Flood light of a pixel, as a share of the brightest ones', from which it counts
/// as lit.
const LIT_SHARE: f32 = 0.05;

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
    lit: usize,
    /// Those of them that are clipped.
    count: usize,
    /// Highest value, of full scale, if light is cut off below full scale.
    ceiling: Option<f32>,
}

/// Marks pixels whose light is cut off below the camera's full scale in
/// `saturated`, beside those at full scale that are marked already, and counts.
///
/// # Errors
/// A photograph's own error.
pub(crate) fn find(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    flood: &[Vec<f32>],
    black: &[Vec<f32>],
    saturated: &mut [bool],
    progress: &dyn Progress,
) -> Result<Clipped, CaptureError> {
    let (white, dark) = (channel_sum(flood), channel_sum(black));
    let light: Vec<f32> = white.iter().zip(&dark).map(|(w, b)| w - b).collect();
    let least = LIT_SHARE * percentile(&light, 0.95);
    // A lamp in view is saturated under black too and says nothing about white.
    let lit: Vec<usize> = (0..light.len()).filter(|&at| light[at] > least).collect();
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
            let sum = |at: usize| one[channel][at] + other[channel][at] - black[channel][at];
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

/// Judges what was found, and the cells that were lost by it.
pub(crate) fn judge(clipped: &Clipped, left_out: &[LeftOut], live: usize) -> Gate {
    let is_saturated = |out: &&LeftOut| matches!(out.why, Why::Saturated { .. });
    let lost = left_out.iter().filter(is_saturated).count();
    let pixels = clipped.count as f64 / clipped.lit.max(1) as f64;
    let cells = lost as f64 / (live + lost).max(1) as f64;
    let verdict = Verdict::of(pixels, WARN, MOST_PIXELS).max(Verdict::of(cells, WARN, MOST_CELLS));
    let ceiling = clipped.ceiling.map_or_else(
        || "the camera's full scale".to_owned(),
        |value| {
            format!(
                "a ceiling at {:.0} % of full scale, above which light is cut off",
                100.0 * value
            )
        },
    );
    let what = if clipped.count == 0 {
        "white is clipped nowhere".to_owned()
    } else {
        format!(
            "white is overexposed: {} of {} lit pixels are clipped at {ceiling}, and {lost} of {} \
             cells are lost by it",
            clipped.count,
            clipped.lit,
            live + lost
        )
    };
    // Whichever is closer to its limit.
    let (number, limit) = if cells / MOST_CELLS > pixels / MOST_PIXELS {
        (cells, MOST_CELLS)
    } else {
        (pixels, MOST_PIXELS)
    };
    Gate {
        name: GateName::Saturation,
        verdict,
        number: 100.0 * number,
        limit: 100.0 * limit,
        unit: "%",
        what,
        next_step: match verdict {
            Verdict::Pass => "",
            _ => {
                "Take the capture again with a shorter exposure: white at about 80 % of full scale."
            }
        },
        evidence: Evidence::None,
    }
}
