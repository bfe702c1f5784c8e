//! Mains banding: bands over the rows of a photograph. A shutter that rolls down the picture while
//! a lamp goes bright and dark draws the lamp's wave on it.
//!
//! Every photograph has the same number of bands, at another height. The light of
//! its lit cells, against what the other photographs predict, is compared with sines
//! down the picture, and the power is summed over the photographs.

use super::leave_one_out::LeaveOneOut;
use crate::registration::cell_map::Registration;
use iltm_picture::statistics::median;
use rayon::prelude::*;

/// Steps of the number of bands that are tried.
const STEP: f64 = 0.25;

/// Waves from the top of the picture to its bottom at most; fewer on small grids.
const MOST_CYCLES: f64 = 24.0;

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

/// Finds the bands of a capture; `None` if cells lie on fewer than four heights.
pub(crate) fn find(registration: &Registration, models: &[LeaveOneOut]) -> Option<MainsBanding> {
    let model = models.first()?;
    let height = registration.camera.1 as f64;
    let place = |&cell: &usize| registration.centre[cell].map(|centre| centre[1] / height);
    let places: Vec<Option<f64>> = model.cells.iter().map(place).collect();
    let mut heights: Vec<f64> = places.iter().flatten().copied().collect();
    heights.sort_by(f64::total_cmp);
    let (first, last) = (*heights.first()?, *heights.last()?);
    // A cell averages over its height: shorter waves than three cells are not seen.
    let cell = (registration.camera.0 as f64 * height / heights.len() as f64).sqrt() / height;
    let most = (1.0 / (3.0 * cell)).min(MOST_CYCLES);
    let least = 0.75 / (last - first).max(1e-6);
    let tried: Vec<f64> = (1..)
        .map(|k| STEP * f64::from(k))
        .skip_while(|cycles| *cycles < least)
        .take_while(|cycles| *cycles <= most)
        .collect();
    let residuals = residuals(&places, models);
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
