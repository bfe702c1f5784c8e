//! Gate `superposition`: a pattern and its inverse together are as bright as white
//! and black together.

use super::super::sequence::Sequence;
use super::super::{ChannelMeasurements, Measurements};
use super::{Evidence, Gate, GateName, Verdict};

/// From here on it is worth a word: good rigs hold 1 to 1.8 %.
const WARN: f64 = 0.02;

/// Photographs of cameras with a curve that nobody declared are off by 14 to 24 %,
/// and a table errs by about as much as light does not add up.
const MOST: f64 = 0.05;

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

/// Judges how well light adds up.
pub(crate) fn judge(sequence: &Sequence, channels: &[ChannelMeasurements], live: &[bool]) -> Gate {
    let name = GateName::Superposition;
    let overall = median(excesses(sequence, channels));
    let cells = by_cell(sequence, channels, live);
    let (Some(overall), Some(cells)) = (overall, cells) else {
        let why = "no pattern was photographed together with its inverse";
        return Gate::not_judged(name, why);
    };
    let (mut squares, mut lights) = (0.0, 0.0);
    for (cell, excess) in cells.iter().enumerate().filter(|(_, e)| e.is_finite()) {
        let light: f64 = (channels.iter())
            .map(|c| c.observations[(cell, Measurements::WHITE)])
            .sum();
        squares += (excess * light).powi(2);
        lights += light * light;
    }
    let spread = (squares / lights).sqrt();
    let number = overall.abs().max(spread);
    let verdict = Verdict::of(number, WARN, MOST);
    let what = match verdict {
        Verdict::Pass => format!(
            "patterns and their inverses add up to white within {:.1} %",
            100.0 * number
        ),
        _ => format!(
            "light does not add up: patterns and their inverses together are {:+.1} % off white \
             and black together ({:.1} % from cell to cell)",
            100.0 * overall,
            100.0 * spread
        ),
    };
    Gate {
        name,
        verdict,
        number: 100.0 * number,
        limit: 100.0 * MOST,
        unit: "%",
        what,
        next_step: match verdict {
            Verdict::Pass => "",
            _ => {
                "Fix exposure and white balance, and state the camera's response in capture.toml \
                 ([camera] response = \"srgb\" for camera JPEGs)."
            }
        },
        evidence: Evidence::Cells {
            what: "pattern and inverse against white and black, %",
            rows: sequence.grid.rows(),
            cols: sequence.grid.cols(),
            values: cells.iter().map(|excess| 100.0 * excess).collect(),
        },
    }
}
