//! Balances: sums of photographs that must come out as nothing, whatever the scene, from
//! which a camera's response is recovered.
//!
//! A pattern and its inverse are together white and black, in every pixel; two
//! exposures of one pattern are in proportion to their times. Both hold for light
//! and not for the values of a curved camera. Averages over pixels of similar
//! values tell curvature from noise.

use iltm_picture::DeviceResponse;

/// Values of one pixel and the weights with which their light adds up to nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Balance {
    pub(crate) values: [f32; 4],
    pub(crate) weights: [f32; 4],
}

/// Balances of many pixels, in groups of similar ones.
pub(crate) struct Balances {
    balances: Vec<Balance>,
    /// Where each group ends in `balances`.
    ends: Vec<usize>,
}

/// Groups along each of two keys.
const GROUPS: usize = 8;

/// Fewest balances that are worth averaging.
const FEWEST: usize = 64;

/// Points at which a response is tabulated.
const POINTS: usize = 2048;

/// A response as a table, for millions of look-ups.
pub(crate) struct Lookup(Vec<f64>);

impl Lookup {
    pub(crate) fn new(light: impl Fn(f64) -> f64) -> Self {
        Self(
            (0..=POINTS)
                .map(|k| light(k as f64 / POINTS as f64))
                .collect(),
        )
    }

    fn light(&self, value: f32) -> f64 {
        let place = f64::from(value.clamp(0.0, 1.0)) * POINTS as f64;
        let below = (place as usize).min(POINTS - 1);
        let part = place - below as f64;
        self.0[below] + part * (self.0[below + 1] - self.0[below])
    }
}

impl Balances {
    /// Groups the balances by how bright they are and, among equals, by how far
    /// what is added is apart; `None` if there are too few.
    ///
    /// Balances stand in the order of the pixels. Both keys of one are those of its two
    /// neighbours, whose noise is not its own: groups by its own values would collect those
    /// whose noise is high, and noise that grows with the light would pass for a curve.
    pub(crate) fn new(balances: &[Balance]) -> Option<Self> {
        if balances.len() < FEWEST {
            return None;
        }
        let brightness = |b: &Balance| {
            let terms = b.values.iter().zip(b.weights).filter(|term| term.1 != 0.0);
            terms
                .map(|(value, weight)| value / weight.abs())
                .sum::<f32>()
        };
        let apart = |b: &Balance| {
            if b.weights[1] > 0.0 {
                (b.values[0] - b.values[1]).abs()
            } else {
                0.0
            }
        };
        let last = balances.len() - 1;
        let around = |at: usize, key: &dyn Fn(&Balance) -> f32| {
            let (before, after) = (at.checked_sub(1).unwrap_or(1), (at + 1).min(last));
            let after = if after == at { at - 1 } else { after };
            key(&balances[before]) + key(&balances[after])
        };
        let mut keyed: Vec<(f32, f32, Balance)> = (balances.iter().enumerate())
            .map(|(at, balance)| (around(at, &brightness), around(at, &apart), *balance))
            .collect();
        keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let size = keyed.len().div_ceil(GROUPS);
        let mut ends = Vec::new();
        let mut begin = 0;
        for group in keyed.chunks_mut(size) {
            group.sort_by(|a, b| a.1.total_cmp(&b.1));
            let size = group.len().div_ceil(GROUPS);
            let inner = group.chunks(size).scan(begin, |end, part| {
                *end += part.len();
                Some(*end)
            });
            ends.extend(inner);
            begin += group.len();
        }
        let balances = keyed.into_iter().map(|(_, _, balance)| balance).collect();
        Some(Self { balances, ends })
    }

    fn groups(&self) -> impl Iterator<Item = &[Balance]> {
        let begins = std::iter::once(&0).chain(&self.ends);
        begins
            .zip(&self.ends)
            .map(|(from, to)| &self.balances[*from..*to])
    }

    /// Mean sum of each group under a response.
    pub(crate) fn sums(&self, response: &Lookup) -> Vec<f64> {
        let sum = |b: &Balance| -> f64 {
            let terms = b.values.iter().zip(b.weights);
            terms
                .map(|(value, weight)| f64::from(weight) * response.light(*value))
                .sum()
        };
        self.groups()
            .map(|group| group.iter().map(sum).sum::<f64>() / group.len() as f64)
            .collect()
    }

    /// Mean light of each group: half of all that is added and subtracted.
    pub(crate) fn light(&self, response: &Lookup) -> Vec<f64> {
        let half = |b: &Balance| -> f64 {
            let terms = b.values.iter().zip(b.weights);
            let light = terms.map(|(v, weight)| f64::from(weight.abs()) * response.light(*v));
            0.5 * light.sum::<f64>()
        };
        self.groups()
            .map(|group| group.iter().map(half).sum::<f64>() / group.len() as f64)
            .collect()
    }

    /// Mean light of each group in white, the third of the values; 0 where there is none.
    pub(crate) fn white(&self, response: &Lookup) -> Vec<f64> {
        let white = |b: &Balance| f64::from(b.weights[2].abs()) * response.light(b.values[2]);
        self.groups()
            .map(|group| group.iter().map(white).sum::<f64>() / group.len() as f64)
            .collect()
    }

    /// How far the groups are from nothing under a response, relative to their
    /// light: root mean square over groups.
    ///
    /// White may be brighter or darker than it should be, by one factor in all groups: a lamp
    /// that loses light, or an exposure that follows the picture, says nothing about the
    /// camera's curve.
    pub(crate) fn misfit(&self, response: &Lookup) -> f64 {
        let (sums, light) = (self.sums(response), self.light(response));
        let white = self.white(response);
        let relative: Vec<(f64, f64)> = (sums.iter().zip(&white).zip(&light))
            .filter(|(_, light)| **light > 0.0)
            .map(|((sum, white), light)| (sum / light, white / light))
            .collect();
        let dot = |of: fn(&(f64, f64)) -> f64| relative.iter().map(of).sum::<f64>();
        let factor = dot(|(sum, white)| sum * white) / dot(|(_, white)| white * white).max(1e-9);
        let squares = relative
            .iter()
            .map(|(sum, white)| (sum - factor * white).powi(2));
        (squares.sum::<f64>() / relative.len().max(1) as f64).sqrt()
    }

    pub(crate) fn misfit_of(&self, response: &DeviceResponse) -> f64 {
        self.misfit(&Lookup::new(|value| response.light(value)))
    }
}
