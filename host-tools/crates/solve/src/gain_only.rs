//! Gain only: the inverse without an operator, which corrects each cell's brightness.

use super::held_out;
use super::interreflection::Interreflection;
use super::observed::Observed;
use super::options::GainOnly;
use super::prepare::Prepared;
use super::solution::{ChannelInverse, InverseTransport};
use super::{SolveError, SolveReport};
use nalgebra::DVector;

/// The inverse without an operator that `report` found best, from the same
/// observations.
///
/// # Errors
/// Those of [`solve_observed`](super::solve_observed) for observations that are
/// not consistent.
pub fn gain_only(
    observed: &Observed<'_>,
    report: &SolveReport,
) -> Result<InverseTransport, SolveError> {
    let prepared = Prepared::new(observed)?;
    let all: Vec<usize> = (0..prepared.roles.len()).collect();
    let kind = report.prediction.gain_only_kind;
    let channels = observed.channels.iter().enumerate();
    let channels = channels.map(|(index, channel)| ChannelInverse {
        gain: (gains(&prepared, index, &all, kind) / prepared.unit)
            .iter()
            .copied()
            .collect(),
        scale: 1.0,
        deviation: None,
        ambient: channel.ambient.to_vec(),
    });
    Ok(InverseTransport {
        grid: observed.grid,
        live: prepared.live.clone(),
        shared: Interreflection::none(observed.grid),
        channels: channels.collect(),
    })
}

/// Gains of one channel from the photographs `chosen`, zero for cells without
/// light.
pub(super) fn gains(
    prepared: &Prepared,
    channel: usize,
    chosen: &[usize],
    kind: GainOnly,
) -> DVector<f64> {
    let light = &prepared.light[channel];
    let flood = match kind {
        GainOnly::Flood => flood(prepared, channel, chosen),
        GainOnly::Fitted => {
            let patterns = prepared.patterns[channel].select_columns(chosen);
            let seen = light.select_columns(chosen);
            DVector::from_fn(light.nrows(), |cell, _| {
                let shown = patterns.row(cell);
                seen.row(cell).dot(&shown) / shown.norm_squared()
            })
        }
    };
    DVector::from_fn(flood.len(), |cell, _| {
        let usable = prepared.live[cell] && flood[cell] > 0.0;
        if usable { flood[cell].recip() } else { 0.0 }
    })
}

/// Light under white: from photographs of white, and from those of a pattern and
/// its complement, whose sum shows the same with twice the variance.
fn flood(prepared: &Prepared, channel: usize, chosen: &[usize]) -> DVector<f64> {
    let light = &prepared.light[channel];
    let (mut sum, mut weight) = (DVector::zeros(light.nrows()), 0.0);
    for group in held_out::complements(prepared, chosen) {
        match group {
            (k, None) => {
                sum += light.column(k);
                weight += 1.0;
            }
            (k, Some(inverse)) => {
                sum += (light.column(k) + light.column(inverse)) * 0.5;
                weight += 0.5;
            }
        }
    }
    if weight > 0.0 {
        return sum / weight;
    }
    // As much light as all photographs together imply.
    let projected: f64 = chosen
        .iter()
        .map(|k| prepared.patterns[channel].column(*k).max())
        .sum();
    light.select_columns(chosen).column_sum() / projected.max(1.0)
}
