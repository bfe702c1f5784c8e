//! Gate `noise`: how much of the result will be the camera's noise.
//!
//! What a table errs by from noise is about the relative noise of one observation,
//! a cell in one photograph: at 40 dB the simulated solves of the project's first
//! figures erred by .008, at 50 dB by .003 to .004, at 60 dB by .0015. Photographs
//! average each other's noise, and the inverse amplifies it by as much.

use crate::cells::measurements::{ChannelMeasurements, Measurements};
use crate::gate::{Evidence, Gate, GateName, Verdict};
use iltm_runtime::Grid;

/// Step of an 8-bit display, of its white: errors below are not seen.
const GOAL: f64 = 1.0 / 255.0;

/// Error that makes a capture useless: gains alone would do as well.
const MOST: f64 = 0.05;

/// Judges the noise of the observations under white, `repeats` photographs of it.
pub(super) fn judge(
    grid: Grid,
    channels: &[ChannelMeasurements],
    live: &[bool],
    pixels: &[u32],
) -> Gate {
    let mut values = vec![0.0_f64; grid.cells()];
    let (mut noise, mut light) = (0.0, 0.0);
    for channel in channels {
        for cell in (0..grid.cells()).filter(|&cell| live[cell]) {
            let white = channel.observations[(cell, Measurements::WHITE)];
            let deviation = channel.deviation(cell, Measurements::WHITE, pixels[cell], 1);
            noise += deviation * deviation;
            light += white * white;
            values[cell] = values[cell].max(100.0 * deviation / white.max(f64::MIN_POSITIVE));
        }
    }
    for (value, live) in values.iter_mut().zip(live) {
        if !live {
            *value = f64::NAN;
        }
    }
    let error = (noise / light.max(f64::MIN_POSITIVE)).sqrt();
    let verdict = Verdict::of(error, GOAL, MOST);
    let repeats = (error / GOAL).powi(2).ceil().max(1.0);
    let what = match verdict {
        Verdict::Pass => format!(
            "noise alone makes an error of about {error:.4} of the light, below an 8-bit step \
             ({GOAL:.4})"
        ),
        _ => format!(
            "noise alone makes an error of about {error:.4} of the light; {repeats:.0} photographs \
             of each pattern would reach an 8-bit step ({GOAL:.4})"
        ),
    };
    let next_step = "Expose longer or open the aperture until white reaches 80 % of full scale, \
         lower the camera's gain (ISO), or photograph each pattern several times.";
    let of = "noise of one observation under white, % of its light";
    Gate {
        what,
        evidence: Evidence::cells(of, grid, values, 100.0 * MOST),
        ..Gate::of_share(GateName::Noise, verdict, (error, MOST), next_step)
    }
}
