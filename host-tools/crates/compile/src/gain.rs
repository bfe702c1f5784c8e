//! Gains in reference units: per cell, and finer than the cells.

use iltm_capture::FineFlood;
use iltm_runtime::{FrameSize, resample::interpolation::Axis};
use iltm_solve::{InverseTransport, LeftOut, WhyLeftOut};
use nalgebra::DVector;

/// Gains on a grid finer than the cells.
#[derive(Clone, Debug)]
pub struct FineGains {
    /// Size of the fine grid.
    pub size: FrameSize,
    /// `g` of every channel, row by row, drive per camera unit.
    pub channels: Vec<Vec<f64>>,
}

/// The same inverse with one gain for all channels and cells, that of their mean light: a table
/// that leaves pictures as they are. Also where no camera pixel looks; not where there is no light.
pub(crate) fn even(mut inverse: InverseTransport, left_out: &[LeftOut]) -> InverseTransport {
    let gains = inverse.channels.iter().flat_map(|channel| &channel.gain);
    let lit = gains.filter(|gain| **gain > 0.0);
    let (light, count) = lit.fold((0.0, 0.0), |(light, count), gain| {
        (light + 1.0 / gain, count + 1.0)
    });
    for channel in &mut inverse.channels {
        channel.gain.fill(count / light);
        for out in left_out.iter().filter(|out| out.why != WhyLeftOut::Unseen) {
            channel.gain[out.cell] = 0.0;
        }
    }
    inverse
}

/// Darkest flood light, relative to its cell's, that still gets its own gain;
/// darker samples are treated as being that bright, since noise rules there.
const LEAST_FLOOD: f64 = 0.2;

/// The fine gain map from a flood photograph `b`: `g(x) = (1 + (U K A b)(x)) / b(x)`.
///
/// `K b` is that of the cells' observations. Without an operator, what bounces is in the solved
/// gains, and `U (g b)` stands for the numerator; so it does without a projector map, where a
/// cell's samples have its observation for their mean, and agreeing with the solved gains is
/// worth more.
/// `None` if the flood map is not of the inverse's grid, or no finer than it.
#[must_use]
pub fn fine_gains(inverse: &InverseTransport, flood: &FineFlood) -> Option<FineGains> {
    let grid = inverse.grid;
    let [wide, tall] = flood.factor;
    let fits = flood.rows == tall * grid.rows() && flood.cols == wide * grid.cols();
    if !fits || wide * tall < 2 || flood.channels.len() != inverse.channels.len() {
        return None;
    }
    let size = FrameSize::new(flood.cols as u16, flood.rows as u16)?;
    let rows = Axis::new(grid.rows(), flood.rows)?;
    let cols = Axis::new(grid.cols(), flood.cols)?;
    let channels = flood.channels.iter().zip(&flood.observed);
    let channels = channels.zip(&inverse.channels);
    let channels = channels
        .enumerate()
        .map(|(index, ((flood_light, observed), channel))| {
            let cell_of = |index: usize| {
                let (row, col) = (index / flood.cols / tall, index % flood.cols / wide);
                row * grid.cols() + col
            };
            let mut cell_light = vec![0.0; grid.cells()];
            for (index, light) in flood_light.iter().enumerate() {
                cell_light[cell_of(index)] += f64::from(*light) / (wide * tall) as f64;
            }
            let operator = inverse.channel(index).operator;
            let numerator: Vec<f64> = if !flood.mapped || operator.is_none() {
                let lit = channel.gain.iter().zip(observed);
                lit.map(|(gain, light)| gain * light).collect()
            } else {
                let bounced = &operator * &DVector::from_column_slice(observed);
                bounced.iter().map(|bounced| 1.0 + bounced).collect()
            };
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
