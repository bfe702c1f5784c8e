//! Gate `superposition`: a pattern and its inverse together are as bright as white
//! and black together.

use super::super::sequence::Sequence;
use super::super::{ChannelMeasurements, Measurements};
use super::cause::Cause;
use super::{Evidence, Gate, GateName, Verdict};

/// From here on it is worth a word.
const WARN: f64 = 0.015;

/// A table errs by about as much as light does not add up. Photographs of cameras
/// with a curve that nobody declared are off by 14 to 24 %.
const MOST: f64 = 0.03;

/// How much more single cells may be off than all together: good rigs hold 1 to
/// 1.8 % in blocks of 16 x 16 pixels.
const CELLS: f64 = 1.7;

/// How far each Gray code pattern and its inverse together exceed white, summed
/// over all cells and relative to white, one number a pair and channel.
pub(crate) fn excesses(sequence: &Sequence, channels: &[ChannelMeasurements]) -> Vec<f64> {
    let pairs = sequence.code_pairs();
    let excess = |channel: &ChannelMeasurements, (a, b): (usize, usize)| {
        let total = |view: usize| channel.observations.column(view).sum();
        let white = total(Measurements::WHITE);
        (total(a) + total(b) - white) / white
    };
    channels
        .iter()
        .flat_map(|channel| pairs.iter().map(move |&pair| excess(channel, pair)))
        .filter(|excess| excess.is_finite())
        .collect()
}

/// The middle one of some numbers; `None` of none.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// How far pairs exceed white in each cell: the median over all pairs, relative to
/// the cell's light under white, all channels together. `None` without inverses.
pub(crate) fn by_cell(
    sequence: &Sequence,
    channels: &[ChannelMeasurements],
    live: &[bool],
) -> Option<Vec<f64>> {
    let pairs = sequence.code_pairs();
    if pairs.is_empty() {
        return None;
    }
    let light = |cell: usize, view: usize| -> f64 {
        channels.iter().map(|c| c.observations[(cell, view)]).sum()
    };
    let of_cell = |cell: usize| {
        if !live[cell] {
            return f64::NAN;
        }
        let white = light(cell, Measurements::WHITE);
        let excess = |&(a, b): &(usize, usize)| light(cell, a) + light(cell, b) - white;
        let excess = median(pairs.iter().map(excess).collect()).unwrap_or(f64::NAN);
        excess / white
    };
    Some((0..live.len()).map(of_cell).collect())
}

/// How well light adds up.
pub(crate) struct Sums {
    /// The middle excess of all pairs, relative to white.
    overall: f64,
    /// The same in each cell; NaN where there is none.
    cells: Vec<f64>,
    /// Root mean square over the cells, without noise.
    spread: f64,
}

impl Sums {
    /// Measures it; `None` without inverses.
    pub(crate) fn new(
        sequence: &Sequence,
        channels: &[ChannelMeasurements],
        live: &[bool],
    ) -> Option<Self> {
        let overall = median(excesses(sequence, channels))?;
        let cells = by_cell(sequence, channels, live)?;
        // White's noise is in all pairs, and a median of n has 1.57 / n of one's.
        let pairs = sequence.code_pairs().len() as f64;
        let share = 1.0 + 2.0 * 1.57 / pairs;
        let (mut squares, mut lights) = (0.0, 0.0);
        for (cell, excess) in cells.iter().enumerate().filter(|(_, e)| e.is_finite()) {
            let light: f64 = (channels.iter())
                .map(|c| c.observations[(cell, Measurements::WHITE)])
                .sum();
            let noise: f64 = channels.iter().map(|c| c.noise[cell].powi(2)).sum();
            squares += (excess * light).powi(2) - share * noise;
            lights += light * light;
        }
        let spread = (squares.max(0.0) / lights).sqrt();
        Some(Self {
            overall,
            cells,
            spread,
        })
    }

    /// What is compared with the limit.
    fn number(&self) -> f64 {
        self.overall.abs().max(self.spread / CELLS)
    }

    /// Whether it is worth looking for a cause.
    pub(crate) fn fail(&self) -> bool {
        Verdict::of(self.number(), WARN, MOST) != Verdict::Pass
    }
}

/// Judges how well light adds up, and why not.
///
/// Without inverses there is only `excess`: how much brighter other photographs are
/// than white lets expect.
pub(crate) fn judge(
    sequence: &Sequence,
    sums: Option<&Sums>,
    cause: Option<Cause>,
    excess: Option<f64>,
) -> Gate {
    let name = GateName::Superposition;
    let Some(sums) = sums else {
        return without_inverses(excess);
    };
    let number = sums.number();
    let verdict = Verdict::of(number, WARN, MOST);
    let what = match verdict {
        Verdict::Pass => format!(
            "patterns and their inverses add up to white within {:.1} %",
            100.0 * number
        ),
        _ => format!(
            "light does not add up: patterns and their inverses together are {:+.1} % off white \
             and black together ({:.1} % from cell to cell): {}",
            100.0 * sums.overall,
            100.0 * sums.spread,
            words(cause)
        ),
    };
    let values = sums.cells.iter().map(|excess| 100.0 * excess);
    Gate {
        name,
        verdict,
        number: 100.0 * number,
        limit: 100.0 * MOST,
        unit: "%",
        what,
        next_step: match verdict {
            Verdict::Pass => "",
            _ => next_step(cause),
        },
        evidence: Evidence::Cells {
            what: "pattern and inverse against white and black, %",
            rows: sequence.grid.rows(),
            cols: sequence.grid.cols(),
            values: values.collect(),
        },
    }
}

/// The gate of a capture without inverses.
fn without_inverses(excess: Option<f64>) -> Gate {
    let name = GateName::Superposition;
    let Some(excess) = excess else {
        let why = "no pattern was photographed together with its inverse";
        return Gate::not_judged(name, why);
    };
    let verdict = Verdict::of(excess.abs(), WARN, MOST);
    Gate {
        name,
        verdict,
        number: 100.0 * excess.abs(),
        limit: 100.0 * MOST,
        unit: "%",
        what: format!(
            "patterns are {:+.1} % brighter than white lets expect (there are no inverses to add up)",
            100.0 * excess
        ),
        next_step: match verdict {
            Verdict::Pass => "",
            _ => next_step(None),
        },
        evidence: Evidence::None,
    }
}

/// The likely cause in words.
fn words(cause: Option<Cause>) -> String {
    match cause {
        Some(Cause::Curve { gamma }) => format!(
            "they would add up if the light were raised to the power {gamma:.2}, so that the \
             camera's gamma is not the declared one"
        ),
        Some(Cause::Exposure) => "all cells and ambient light by the same factor, so that the \
             camera's automatic exposure follows the picture"
            .to_owned(),
        Some(Cause::Projector) => {
            "all cells by the same factor and ambient light not, so that the \
             projector's dynamic contrast, iris or \"vivid\" mode follows the picture"
                .to_owned()
        }
        Some(Cause::Either) => "all cells by the same factor, so that the camera's automatic \
             exposure or the projector's \"vivid\" mode or dynamic contrast follows the picture"
            .to_owned(),
        Some(Cause::Unknown) | None => {
            "no one gamma and no one exposure explains it; the light changes in other ways"
                .to_owned()
        }
    }
}

fn next_step(cause: Option<Cause>) -> &'static str {
    match cause {
        Some(Cause::Curve { .. }) => {
            "State the camera's response in capture.toml ([camera] response = \"srgb\" for camera \
             JPEGs, a gamma number, or \"measure\") and check again; no new photographs are needed."
        }
        Some(Cause::Exposure) => {
            "Set exposure, gain (ISO) and white balance by hand, and take the capture again."
        }
        Some(Cause::Projector) => {
            "Choose the projector's sRGB, film or photo mode, switch off dynamic contrast, iris and \
             eco modes, and take the capture again."
        }
        _ => {
            "Set exposure, gain (ISO) and white balance by hand, switch off the projector's dynamic \
             modes, keep other light out, and take the capture again; if the camera's values are \
             curved, state [camera] response in capture.toml."
        }
    }
}
