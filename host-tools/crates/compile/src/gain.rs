//! Gains in reference units: per cell, and finer than the cells.

use iltm_capture::{EvenFlood, FineFlood, Measurements, SeveralCaptures};
use iltm_runtime::{FrameSize, resample::interpolation::Axis};
use iltm_solve::{ChannelInverse, InverseTransport, LeftOut, WhyLeftOut};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

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
        let dark = |out: &&LeftOut| matches!(out.why, WhyLeftOut::Unlit | WhyLeftOut::Black);
        for out in left_out.iter().filter(dark) {
            channel.gain[out.cell] = 0.0;
        }
    }
    inverse
}

/// Values of live cells, interpolated between their centres at the samples of a finer grid.
struct BetweenCells<'i> {
    live: &'i [bool],
    /// Of cells and of samples.
    cols: [usize; 2],
    across: Axis,
    down: Axis,
}

impl<'i> BetweenCells<'i> {
    fn new(inverse: &'i InverseTransport, flood: &FineFlood) -> Option<Self> {
        let grid = inverse.grid;
        Some(Self {
            live: &inverse.live,
            cols: [grid.cols(), flood.cols],
            across: Axis::new(grid.cols(), flood.cols)?,
            down: Axis::new(grid.rows(), flood.rows)?,
        })
    }

    /// At one sample; 0 among cells that took no part.
    fn of(&self, cells: &[f64], sample: usize) -> f64 {
        let [cols, fine] = self.cols;
        let (y, x) = (
            self.down.place(sample / fine),
            self.across.place(sample % fine),
        );
        let share = |fraction: u32| f64::from(fraction) / f64::from(1_u32 << 31);
        let (down, right) = (share(y.fraction), share(x.fraction));
        // Cells that took no part have no value to interpolate with.
        let corners = [
            (y.before, x.before, (1.0 - down) * (1.0 - right)),
            (y.before, x.after, (1.0 - down) * right),
            (y.after, x.before, down * (1.0 - right)),
            (y.after, x.after, down * right),
        ];
        let (mut sum, mut weight) = (0.0, 0.0);
        for (row, col, share) in corners {
            let cell = row * cols + col;
            if self.live[cell] {
                sum += share * cells[cell];
                weight += share;
            }
        }
        if weight > 0.0 { sum / weight } else { 0.0 }
    }
}

/// Darkest flood light, relative to its cell's, that still gets its own gain;
/// darker samples are treated as being that bright, since noise rules there.
const LEAST_FLOOD: f64 = 0.2;

/// Most by which an even light changes a gain, as a share of it.
const MOST_BEYOND: f64 = 0.3;

/// The fine gain map of a table: gains that make an even light right, where photographs of patterns
/// tell it, and else the photograph of white.
#[must_use]
pub fn fine_gains(inverse: &InverseTransport, flood: &FineFlood) -> Option<FineGains> {
    Some(for_even_light(white_gains(inverse, flood)?, inverse, flood))
}

/// Makes an even light right by gains that make the photograph of white right, where photographs of
/// patterns tell it.
pub(crate) fn for_even_light(
    mut gains_of_white: FineGains,
    inverse: &InverseTransport,
    flood: &FineFlood,
) -> FineGains {
    for (channel, gains) in gains_of_white.channels.iter_mut().enumerate() {
        let Some(beyond) = beyond_even(inverse, flood, channel) else {
            continue;
        };
        for (gain, beyond) in gains.iter_mut().zip(beyond) {
            *gain *= 1.0 - beyond;
        }
    }
    gains_of_white
}

/// The fine gain map from a flood photograph `b`: `g(x) = (1 + (U K A b)(x)) / b(x)`.
///
/// `K b` is that of the cells' observations. Without an operator, what bounces is in the solved
/// gains, and `U (g b)` stands for the numerator; so it does without a projector map, where a
/// cell's samples have its observation for their mean, and agreeing with the solved gains is
/// worth more.
/// `None` if the flood map is not of the inverse's grid, or no finer than it.
#[must_use]
pub(crate) fn white_gains(inverse: &InverseTransport, flood: &FineFlood) -> Option<FineGains> {
    let grid = inverse.grid;
    let [wide, tall] = flood.factor;
    let fits = flood.rows == tall * grid.rows() && flood.cols == wide * grid.cols();
    if !fits || wide * tall < 2 || flood.channels.len() != inverse.channels.len() {
        return None;
    }
    let size = FrameSize::new(flood.cols as u16, flood.rows as u16)?;
    let between = BetweenCells::new(inverse, flood)?;
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
            (0..flood_light.len())
                .map(|index| {
                    let cell = cell_of(index);
                    if !inverse.live[cell] || cell_light[cell] <= 0.0 {
                        return 0.0;
                    }
                    let light = f64::from(flood_light[index]).max(LEAST_FLOOD * cell_light[cell]);
                    between.of(&numerator, index) / light
                })
                .collect()
        });
    let channels = channels.collect();
    Some(FineGains { size, channels })
}

/// How much brighter each sample would be under an even light than wanted, with gains that make
/// the photograph of white right, as a share of it. `None` without photographs of patterns that
/// tell it, or without an operator.
///
/// With the weights `a` of a cell, `P a` is the drive of an even light there. By the inverse its
/// photograph is `((P a)(x) + (U K A Y a)(x)) / g(x)`; what the sum `(Y a)(x)` of the photographs
/// has beyond that, an even light has too.
fn beyond_even(inverse: &InverseTransport, flood: &FineFlood, channel: usize) -> Option<Vec<f64>> {
    let EvenFlood {
        patterns,
        observations,
        weights,
        beyond,
    } = flood.even.get(channel)?;
    let operator = inverse.channel(channel).operator;
    if operator.is_none() {
        return None;
    }
    let grid = inverse.grid;
    let [wide, tall] = flood.factor;
    let between = BetweenCells::new(inverse, flood)?;
    let of_white = &operator * &DVector::from_column_slice(&flood.observed[channel]);
    let of_patterns: DMatrix<f64> = &operator * observations;
    let weights = weights.map(f64::from);
    let light = &flood.channels[channel];
    let of_cell = |cell: usize| -> Vec<(usize, f64)> {
        let weight = weights.row(cell);
        let drive = weight.dot(&patterns.row(cell));
        // What the cells around receive, for samples between their centres.
        let mut received = vec![0.0; grid.cells()];
        let (row, col) = (cell / grid.cols(), cell % grid.cols());
        for near in row.saturating_sub(1)..(row + 2).min(grid.rows()) {
            for across in col.saturating_sub(1)..(col + 2).min(grid.cols()) {
                let near = near * grid.cols() + across;
                received[near] = weight.dot(&of_patterns.row(near));
            }
        }
        let samples = (0..wide * tall).filter_map(|at| {
            let sample = (row * tall + at / wide) * flood.cols + col * wide + at % wide;
            let beyond = f64::from(beyond[sample]?);
            let white = between.of(of_white.as_slice(), sample);
            let bounced = (drive * white - between.of(&received, sample)) / (1.0 + white);
            let beyond = f64::from(light[sample]) * (beyond + bounced);
            Some((sample, beyond.clamp(-MOST_BEYOND, MOST_BEYOND)))
        });
        samples.collect()
    };
    let live = (0..grid.cells())
        .into_par_iter()
        .filter(|cell| inverse.live[*cell]);
    let told: Vec<(usize, f64)> = live.flat_map_iter(of_cell).collect();
    let mut samples = vec![0.0; light.len()];
    for (sample, beyond) in told {
        samples[sample] = beyond;
    }
    Some(samples)
}

/// The fine gain map of several projectors, each from its own flood photograph `b` while the others
/// were dark, for a share `s` of the light: `g(x) = s(x) (1 - (U K 1 / g)(x)) / e(x) + (U s K 1)(x)`,
/// with the light straight from the projector `e(x) = b(x) - (U K A b / g)(x)`.
///
/// Even white of all together is right then. [`fine_gains`] makes white of a projector alone right,
/// and here it is far from the light that is wanted: half of what bounces is missing. Light that
/// bounces, not drive, is interpolated: it goes on across a crease, where drive has a step.
pub(crate) fn fine_gains_of_several(
    inverse: &InverseTransport,
    flood: &FineFlood,
    several: &SeveralCaptures,
) -> Option<FineGains> {
    let shares = [several.shares(flood.factor), several.shares_of_cells()];
    shared_gains(inverse, (flood, several), shares)
}

/// The same of projectors that each show all of the light.
pub(crate) fn unshared_gains_of_several(
    inverse: &InverseTransport,
    flood: &FineFlood,
    several: &SeveralCaptures,
) -> Option<FineGains> {
    let shares = [flood.rows * flood.cols, inverse.grid.cells()].map(|count| vec![1.0; count]);
    shared_gains(inverse, (flood, several), shares)
}

/// The same for these shares of samples and of cells.
fn shared_gains(
    inverse: &InverseTransport,
    (flood, several): (&FineFlood, &SeveralCaptures),
    [shares, shares_of_cells]: [Vec<f64>; 2],
) -> Option<FineGains> {
    let grid = inverse.grid;
    let by_operator = inverse.channels.len() == flood.channels.len()
        && flood.mapped
        && (0..inverse.channels.len()).all(|channel| !inverse.channel(channel).operator.is_none());
    if !by_operator {
        let mut fine = fine_gains(inverse, flood)?;
        for gains in &mut fine.channels {
            let gains = gains.iter_mut().zip(&shares);
            gains.for_each(|(gain, share)| *gain *= share);
        }
        return Some(fine);
    }
    let size = FrameSize::new(flood.cols as u16, flood.rows as u16)?;
    let between = BetweenCells::new(inverse, flood)?;
    let even = inverse.live.iter().map(|live| f64::from(u8::from(*live)));
    let even = DVector::from_iterator(grid.cells(), even);
    let of_channel = |(index, channel): (usize, &ChannelInverse)| {
        let operator = inverse.channel(index).operator;
        let as_light = |drive: &[f64]| -> Vec<f64> {
            let cells = drive.iter().zip(&channel.gain);
            cells
                .map(|(drive, gain)| if *gain > 0.0 { drive / gain } else { 0.0 })
                .collect()
        };
        let drive = (&operator * &even).as_slice().to_vec();
        let bounced = as_light(&drive);
        let shared = drive.iter().zip(&shares_of_cells);
        let shared: Vec<f64> = shared.map(|(drive, share)| share * drive).collect();
        // What bounces to each cell while its own projector shows white.
        let mut of_white = vec![0.0; grid.cells()];
        for one in &several.projectors {
            let white = one.views.start + Measurements::WHITE;
            let observed = several.all.channels[index].observations.column(white);
            let got = as_light((&operator * &observed.into_owned()).as_slice());
            for cell in one.part.places(grid.cols()) {
                of_white[cell] = got[cell];
            }
        }
        let gain = |(sample, light): (usize, &f32)| {
            let light = f64::from(*light);
            if light <= 0.0 {
                return 0.0;
            }
            let straight = light - between.of(&of_white, sample);
            let straight = straight.max(LEAST_FLOOD * light);
            let own = shares[sample] * (1.0 - between.of(&bounced, sample)) / straight;
            own + between.of(&shared, sample)
        };
        flood.channels[index].iter().enumerate().map(gain).collect()
    };
    let channels = inverse.channels.iter().enumerate().map(of_channel);
    Some(FineGains {
        size,
        channels: channels.collect(),
    })
}
