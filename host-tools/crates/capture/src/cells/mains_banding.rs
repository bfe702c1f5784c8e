//! Mains banding: bands over the rows of a photograph. A shutter that rolls down the picture while
//! a lamp goes bright and dark draws the lamp's wave on it.
//!
//! Every photograph has the same number of bands, at another height. The light of
//! its lit cells, against what the other photographs predict, is compared with sines
//! down the picture, and the power is summed over the photographs. With too few photographs to
//! predict one by the others, a pattern of the Gray code is compared with white less its inverse.

use super::leave_one_out::LeaveOneOut;
use crate::format::sequence::Sequence;
use crate::registration::cell_map::Registration;
use iltm_picture::statistics::median;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Steps of the number of bands that are tried.
const STEP: f64 = 0.25;

/// Waves from the top of the picture to its bottom at most; fewer on small grids.
const MOST_CYCLES: f64 = 24.0;

/// Photographs that bands must be looked for in.
const LEAST_PHOTOGRAPHS: usize = 8;

/// The bands that fit best.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct MainsBanding {
    /// Waves from the top of the photograph to its bottom.
    pub(crate) cycles: f64,
    /// Amplitude of the wave, of the light.
    pub(crate) amplitude: f64,
    /// Amplitude of every number of waves that was tried.
    pub(crate) tried: Vec<(f64, f64)>,
}

impl MainsBanding {
    /// The same with amplitudes so many times as large.
    pub(crate) fn scaled(mut self, times: f64) -> Self {
        self.amplitude *= times;
        for (_, amplitude) in &mut self.tried {
            *amplitude *= times;
        }
        self
    }
}

/// Finds the bands of a capture, by the models of its channels or, without any, by the pairs of
/// the Gray code in `light` (`N x shots` a channel); `None` if there are too few of these.
pub(crate) fn find(
    sequence: &Sequence,
    registration: &Registration,
    live: &[bool],
    models: &[LeaveOneOut],
    light: &[DMatrix<f64>],
) -> Option<MainsBanding> {
    let height = registration.camera.1 as f64;
    let place = |cell: usize| registration.centre[cell].map(|centre| centre[1] / height);
    let found = || (0..live.len()).filter(|&cell| live[cell]).collect();
    let cells: Vec<usize> = models
        .first()
        .map_or_else(found, |model| model.cells.clone());
    let places: Vec<Option<f64>> = cells.iter().map(|cell| place(*cell)).collect();
    let mut heights: Vec<f64> = places.iter().flatten().copied().collect();
    heights.sort_by(f64::total_cmp);
    let (first, last) = (*heights.first()?, *heights.last()?);
    // A cell averages over its height: shorter waves than three cells are not seen.
    let cell = registration.cell_side() / height;
    let most = (1.0 / (3.0 * cell)).min(MOST_CYCLES);
    let least = 0.75 / (last - first).max(1e-6);
    let tried: Vec<f64> = (1..)
        .map(|k| STEP * f64::from(k))
        .skip_while(|cycles| *cycles < least)
        .take_while(|cycles| *cycles <= most)
        .collect();
    let residuals = if models.is_empty() {
        residuals_of_pairs(sequence, &cells, &places, light)
    } else {
        residuals(&places, models)
    };
    if residuals.len() < LEAST_PHOTOGRAPHS {
        return None;
    }
    let amplitude = |&cycles: &f64| (cycles, power(&residuals, cycles).max(0.0).sqrt());
    let tried: Vec<(f64, f64)> = tried.par_iter().map(amplitude).collect();
    let (cycles, amplitude) = (tried.iter().copied()).max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(MainsBanding {
        cycles,
        amplitude,
        tried,
    })
}

/// Height and relative residual of every lit cell, for each photograph and channel.
fn residuals(places: &[Option<f64>], models: &[LeaveOneOut]) -> Vec<Vec<(f64, f64)>> {
    let of_photograph = |model: &LeaveOneOut, at: usize| -> Vec<(f64, f64)> {
        let gain = model.gains[at];
        let of_cell = |cell: usize| {
            let ratio = model.light[(cell, at)] / (gain * model.predicted[(cell, at)]) - 1.0;
            // Shadows and highlights that the model misses have no part in bands.
            places[cell].map(|place| (place, ratio.clamp(-0.2, 0.2)))
        };
        model.lit(at).filter_map(of_cell).collect()
    };
    models
        .iter()
        .flat_map(|model| (0..model.shots.len()).map(move |at| of_photograph(model, at)))
        .filter(|cells| cells.len() >= 8)
        .collect()
}

/// The same of the photographs of Gray code patterns and their inverses: what a pattern adds to
/// its lit cells, against what white adds and the inverse does not.
fn residuals_of_pairs(
    sequence: &Sequence,
    cells: &[usize],
    places: &[Option<f64>],
    light: &[DMatrix<f64>],
) -> Vec<Vec<(f64, f64)>> {
    let mut all = Vec::new();
    for light in light {
        let mean = |shots: &[usize], cell: usize| {
            shots.iter().map(|&shot| light[(cell, shot)]).sum::<f64>() / shots.len().max(1) as f64
        };
        let of = |view: usize, cell: usize| mean(&sequence.views[view].shots, cell);
        let pairs = sequence.code_pairs().into_iter();
        for (own, inverse) in pairs.flat_map(|(a, b)| [(a, b), (b, a)]) {
            let lit = &sequence.views[own].lit;
            let ratio = |(&cell, place): (&usize, &Option<f64>)| {
                let black = mean(&sequence.black, cell);
                let added = of(own, cell) - black;
                let wanted = mean(&sequence.white().shots, cell) - of(inverse, cell);
                let found = place.filter(|_| lit[cell] && wanted > 0.0)?;
                Some((found, added / wanted))
            };
            let ratios: Vec<(f64, f64)> = cells.iter().zip(places).filter_map(ratio).collect();
            let middle = median(ratios.iter().map(|r| r.1).collect()).unwrap_or(1.0);
            let off = |(place, ratio): (f64, f64)| (place, (ratio / middle - 1.0).clamp(-0.2, 0.2));
            all.push(ratios.into_iter().map(off).collect());
        }
    }
    all.retain(|cells: &Vec<(f64, f64)>| cells.len() >= 8);
    all
}

/// Mean square of the amplitude of a sine with so many waves down the photographs,
/// without what scatter alone would have; the middle one of all photographs.
fn power(photographs: &[Vec<(f64, f64)>], cycles: f64) -> f64 {
    let of = |cells: &Vec<(f64, f64)>| {
        let count = cells.len() as f64;
        let mean = cells.iter().map(|c| c.1).sum::<f64>() / count;
        let (mut sine, mut cosine, mut square) = (0.0, 0.0, 0.0);
        for (place, ratio) in cells {
            let (s, c) = (std::f64::consts::TAU * cycles * place).sin_cos();
            sine += (ratio - mean) * s;
            cosine += (ratio - mean) * c;
            square += (ratio - mean).powi(2);
        }
        let amplitude = 4.0 * (sine * sine + cosine * cosine) / (count * count);
        amplitude - 4.0 * square / (count * count)
    };
    let all: Vec<f64> = photographs.iter().map(of).collect();
    median(all).unwrap_or(0.0)
}
