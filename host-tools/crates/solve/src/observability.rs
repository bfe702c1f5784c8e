//! Observability: which cells can be solved for, namely those that answer to their own light.
//!
//! A cell's own light is what it gives back more when the projector lights it
//! than when not, whatever the other cells do: the slope of its series over its
//! own random pattern. A black cell, or one that the projector does not reach,
//! has none, and no gain would make any.

use super::observed::{Observed, ObservedChannel};
use iltm_capture::Role;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// A cell has to give back this much of a typical cell's own light: a step of an
/// 8-bit code.
const LEAST_OWN: f64 = 1.0 / 255.0;
/// Standard errors by which own light has to differ from none.
const SIGNIFICANT: f64 = 3.5;
/// With fewer cells, one cell's own light is much of all cells' together.
const ENOUGH_CELLS: usize = 32;
/// With fewer random patterns than this, all patterns are used.
const RANDOM: usize = 8;

/// A cell that takes no part in the solve.
pub type LeftOut = iltm_capture::LeftOut<WhyLeftOut>;

/// Why a cell takes no part.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum WhyLeftOut {
    /// The camera could not measure it.
    Unseen,
    /// It is seen, by light from other cells, but the projector does not light
    /// it.
    Unlit,
    /// It gives back no light at all.
    Black,
    /// No pattern lights it: it lies below the frame of a projector that is lower than others.
    NoProjector,
}

/// All cells that cannot be solved for, in order.
///
/// `landed` is the light that falls on each cell, by channel `N x m`: the patterns, blurred
/// if the projector is.
pub(super) fn left_out(observed: &Observed<'_>, landed: &[Arc<DMatrix<f64>>]) -> Vec<LeftOut> {
    let cells = observed.grid.cells();
    let chosen = photographs(observed);
    let shown = |cell: usize| {
        let mut patterns = observed.channels.iter().map(|channel| channel.patterns);
        patterns.any(|patterns| patterns.row(cell).iter().any(|light| *light > 0.0))
    };
    let unseen = |(cell, live): (usize, &bool)| match live {
        true => None,
        false if shown(cell) => Some(WhyLeftOut::Unseen),
        false => Some(WhyLeftOut::NoProjector),
    };
    let mut why: Vec<Option<WhyLeftOut>> = (observed.live.iter().enumerate()).map(unseen).collect();
    for (channel, landed) in observed.channels.iter().zip(landed) {
        let total = total(channel, observed.live, &chosen);
        let own: Vec<Own> = (0..cells)
            .map(|cell| Own::new(landed, channel, cell, (&chosen, total.as_ref())))
            .collect();
        let seen = own.iter().zip(observed.live).filter(|(_, live)| **live);
        let mut slopes: Vec<f64> = seen.map(|(own, _)| own.slope).collect();
        slopes.sort_by(f64::total_cmp);
        let typical = slopes.get(slopes.len() / 2).copied().unwrap_or(0.0);
        for (why, own) in why.iter_mut().zip(&own) {
            if why.is_none() && !own.counts(typical) {
                *why = Some(if own.lit_by_others {
                    WhyLeftOut::Unlit
                } else {
                    WhyLeftOut::Black
                });
            }
        }
    }
    let why = why.into_iter().enumerate();
    why.filter_map(|(cell, why)| why.map(|why| LeftOut { cell, why }))
        .collect()
}

/// Random patterns if there are enough: stripes light a cell together with those
/// that shine on it.
fn photographs(observed: &Observed<'_>) -> Vec<usize> {
    let all = 0..observed.roles.len();
    let random: Vec<usize> = all
        .clone()
        .filter(|k| observed.roles[*k] == Role::Bernoulli)
        .collect();
    if random.len() >= RANDOM {
        random
    } else {
        all.collect()
    }
}

/// What a cell gives back of its own.
struct Own {
    slope: f64,
    /// Standard error of the slope; `None` if its pattern never changes.
    error: Option<f64>,
    mean: f64,
    lit_by_others: bool,
}

impl Own {
    /// `total` is the light of all cells together, by photograph: what follows
    /// it is not a cell's own.
    fn new(
        landed: &DMatrix<f64>,
        channel: &ObservedChannel<'_>,
        cell: usize,
        (chosen, total): (&[usize], Option<&DVector<f64>>),
    ) -> Self {
        let count = chosen.len() as f64;
        let of = |matrix: &DMatrix<f64>| -> Vec<f64> {
            chosen.iter().map(|k| matrix[(cell, *k)]).collect()
        };
        let (mut shown, mut seen) = (
            DVector::from_vec(of(landed)),
            DVector::from_vec(of(channel.light)),
        );
        let mean = seen.mean();
        let noise = channel.noise[cell].unlit;
        let lit_by_others = mean > 0.0 && mean > SIGNIFICANT * noise / count.sqrt();
        for series in [&mut shown, &mut seen] {
            let mean = series.mean();
            series.add_scalar_mut(-mean);
            if let Some(total) = total {
                *series -= total * (total.dot(series) / total.norm_squared());
            }
        }
        let spread = shown.norm_squared();
        let (slope, error) = if spread < 1e-9 {
            (mean, None)
        } else {
            let slope = shown.dot(&seen) / spread;
            let rest = (&seen - &shown * slope).norm_squared();
            let freedom = (count - 3.0).max(1.0);
            (slope, Some((rest / freedom / spread).sqrt()))
        };
        Self {
            slope,
            error,
            mean,
            lit_by_others,
        }
    }

    /// Whether there is no proof that the cell has hardly any light of its own.
    fn counts(&self, typical: f64) -> bool {
        // Written so that what is not a number does not count.
        let enough = self.slope > 0.0 && self.slope >= LEAST_OWN * typical && self.mean > 0.0;
        match self.error {
            Some(error) => {
                let unknown = self.slope + 2.0 * error > 0.5 * typical;
                self.mean > 0.0 && (unknown || enough && self.slope > SIGNIFICANT * error)
            }
            None => enough,
        }
    }
}

/// Light of all seen cells together in the photographs `chosen`, mean removed;
/// `None` if one cell's own would be much of it, or it never changes.
fn total(channel: &ObservedChannel<'_>, live: &[bool], chosen: &[usize]) -> Option<DVector<f64>> {
    let seen: Vec<usize> = (0..live.len()).filter(|cell| live[*cell]).collect();
    if seen.len() < ENOUGH_CELLS {
        return None;
    }
    let of = |k: &usize| seen.iter().map(|cell| channel.light[(*cell, *k)]).sum();
    let mut total = DVector::from_vec(chosen.iter().map(of).collect::<Vec<f64>>());
    let mean = total.mean();
    total.add_scalar_mut(-mean);
    (total.norm() > 1e-9 * mean.abs()).then_some(total)
}
