//! Which cells can be solved for: those that answer to their own light.
//!
//! A cell's own light is what it gives back more when the projector lights it
//! than when not, whatever the other cells do: the slope of its series over its
//! own random pattern. A black cell, or one that the projector does not reach,
//! has none, and no gain would make any.

use super::observed::{Observed, ObservedChannel};
use crate::capture::Role;
use nalgebra::DMatrix;

/// A cell has to give back this much of a typical cell's own light: a step of an
/// 8-bit code.
const LEAST_OWN: f64 = 1.0 / 255.0;
/// Standard errors by which own light has to differ from none.
const SIGNIFICANT: f64 = 3.5;
/// With fewer random patterns than this, all patterns are used.
const RANDOM: usize = 8;

/// A cell that takes no part in the solve.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LeftOut {
    /// Its index, `row * cols + col`.
    pub cell: usize,
    /// Why.
    pub why: WhyLeftOut,
}

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
}

/// All cells that cannot be solved for, in order.
///
/// `landed` is the light that falls on each cell, `N x m`: the patterns, blurred if
/// the projector is.
pub(super) fn left_out(observed: &Observed<'_>, landed: &DMatrix<f64>) -> Vec<LeftOut> {
    let cells = observed.grid.cells();
    let chosen = photographs(observed);
    let mut why: Vec<Option<WhyLeftOut>> = observed
        .live
        .iter()
        .map(|live| (!live).then_some(WhyLeftOut::Unseen))
        .collect();
    for channel in &observed.channels {
        let own: Vec<Own> = (0..cells)
            .map(|cell| Own::new(landed, channel, cell, &chosen))
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
    fn new(
        landed: &DMatrix<f64>,
        channel: &ObservedChannel<'_>,
        cell: usize,
        chosen: &[usize],
    ) -> Self {
        let count = chosen.len() as f64;
        let pairs = || {
            let of = |k: &usize| (landed[(cell, *k)], channel.light[(cell, *k)]);
            chosen.iter().map(of)
        };
        let (shown, seen) = pairs().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0, sum.1 + pair.1));
        let (shown, seen) = (shown / count, seen / count);
        let (mut both, mut spread) = (0.0, 0.0);
        for (p, c) in pairs() {
            both += (p - shown) * (c - seen);
            spread += (p - shown).powi(2);
        }
        let noise = channel.noise[cell].unlit;
        let lit_by_others = seen > 0.0 && seen > SIGNIFICANT * noise / count.sqrt();
        if spread < 1e-9 {
            return Self {
                slope: seen,
                error: None,
                mean: seen,
                lit_by_others,
            };
        }
        let slope = both / spread;
        let rest: f64 = pairs()
            .map(|(p, c)| (c - seen - slope * (p - shown)).powi(2))
            .sum();
        let error = (rest / (count - 2.0).max(1.0) / spread).sqrt();
        Self {
            slope,
            error: Some(error),
            mean: seen,
            lit_by_others,
        }
    }

    fn counts(&self, typical: f64) -> bool {
        // Written so that what is not a number does not count.
        let enough = self.slope > 0.0 && self.slope >= LEAST_OWN * typical && self.mean > 0.0;
        enough
            && self
                .error
                .is_none_or(|error| self.slope > SIGNIFICANT * error)
    }
}
