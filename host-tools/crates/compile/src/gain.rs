//! Gains in reference units: per cell, and finer than the cells.

use iltm_capture::FineFlood;
use iltm_runtime::{FrameSize, resample::interpolation::Axis};
use iltm_solve::InverseTransport;

/// Gains on a grid finer than the cells.
#[derive(Clone, Debug)]
pub struct FineGains {
    /// Size of the fine grid.
    pub size: FrameSize,
    /// `g` of every channel, row by row, drive per camera unit.
    pub channels: Vec<Vec<f64>>,
}

/// Darkest flood light, relative to its cell's, that still gets its own gain;
/// darker samples are treated as being that bright, since noise rules there.
const LEAST_FLOOD: f64 = 0.2;

/// The fine gain map from a flood photograph `b`: `g(x) = (1 + (U K A b)(x)) / b(x)`.
///
/// Where the inverse is exact, `1 + K b = g b` at the cells, `b` being what was observed of them;
/// taking `U (g b)` for the numerator makes the map agree with the solved gains where it is not
/// quite.
/// `None` if the flood map is not of the inverse's grid, or no finer than it.
#[must_use]
pub fn fine_gains(inverse: &InverseTransport, flood: &FineFlood) -> Option<FineGains> {
    let grid = inverse.grid;
    let factor = flood.rows / grid.rows();
    let fits = flood.rows == factor * grid.rows() && flood.cols == factor * grid.cols();
    if !fits || factor < 2 || flood.channels.len() != inverse.channels.len() {
        return None;
    }
    let size = FrameSize::new(flood.cols as u16, flood.rows as u16)?;
    let rows = Axis::new(grid.rows(), flood.rows)?;
    let cols = Axis::new(grid.cols(), flood.cols)?;
    let channels = flood.channels.iter().zip(&flood.observed);
    let channels = channels.zip(&inverse.channels);
    let channels = channels.map(|((flood_light, observed), channel)| {
        let cell_of = |index: usize| {
            let (row, col) = (index / flood.cols / factor, index % flood.cols / factor);
            row * grid.cols() + col
        };
        let mut cell_light = vec![0.0; grid.cells()];
        for (index, light) in flood_light.iter().enumerate() {
            cell_light[cell_of(index)] += f64::from(*light) / (factor * factor) as f64;
        }
        let numerator: Vec<f64> = (0..grid.cells())
            .map(|cell| channel.gain[cell] * observed[cell])
            .collect();
        let interpolate = |index: usize| {
            let (y, x) = (
                rows.place(index / flood.cols),
                cols.place(index % flood.cols),
            );
            let share = |fraction: u32| f64::from(fraction) / f64::from(1_u32 << 31);
            let (down, right) = (share(y.fraction), share(x.fraction));
            // Cells that took no part have no gain to interpolate with.
            let corners = [
                (y.before, x.before, (1.0 - down) * (1.0 - right)),
                (y.before, x.after, (1.0 - down) * right),
                (y.after, x.before, down * (1.0 - right)),
                (y.after, x.after, down * right),
            ];
            let (mut sum, mut weight) = (0.0, 0.0);
            for (row, col, share) in corners {
                let cell = row * grid.cols() + col;
                if inverse.live[cell] {
                    sum += share * numerator[cell];
                    weight += share;
                }
            }
            if weight > 0.0 { sum / weight } else { 0.0 }
        };
        (0..flood_light.len())
            .map(|index| {
                let cell = cell_of(index);
                if !inverse.live[cell] || cell_light[cell] <= 0.0 {
                    return 0.0;
                }
                let light = f64::from(flood_light[index]).max(LEAST_FLOOD * cell_light[cell]);
                interpolate(index) / light
            })
            .collect()
    });
    let channels = channels.collect();
    Some(FineGains { size, channels })
}
