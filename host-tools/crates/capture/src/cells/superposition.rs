//! Superposition: how far a pattern and its inverse together are from white and black
//! together.

use super::measurements::{ChannelMeasurements, Measurements};
use crate::format::sequence::Sequence;
use iltm_picture::statistics::median;

/// From here on it is worth a word, and a search for the cause.
pub(crate) const NOTABLE: f64 = 0.015;

/// How much more single cells may be off than all together: good rigs hold 1 to
/// 1.8 % in blocks of 16 x 16 pixels.
pub(crate) const CELLS: f64 = 1.7;

/// How far each Gray code pattern and its inverse together exceed white, summed
/// over all cells and relative to white, one number a pair and channel.
fn excesses(sequence: &Sequence, channels: &[ChannelMeasurements]) -> Vec<f64> {
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

/// How far pairs exceed white in each cell: the median over all pairs, relative to
/// the cell's light under white, all channels together. `None` without inverses.
fn by_cell(
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
    pub(crate) overall: f64,
    /// The same in each cell; NaN where there is none.
    pub(crate) cells: Vec<f64>,
    /// Root mean square over the cells, without noise.
    pub(crate) spread: f64,
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
    pub(crate) fn number(&self) -> f64 {
        self.overall.abs().max(self.spread / CELLS)
    }

    /// Whether it is worth looking for a cause.
    pub(crate) fn off(&self) -> bool {
        // What is not a number is never good.
        self.number().is_nan() || self.number() > NOTABLE
    }
}
