//! Even light, by image-based relighting: the photograph of all cells equally bright, which was not
//! taken, as a weighted sum of photographs of patterns.
//!
//! The photograph of white shows a wall as bright as its paint: much light bounces from what is
//! bright, little from what is dark. A compensated picture of an even white is lit otherwise, and
//! near a fold, where what bounces changes within a cell, a gain that makes the photograph right
//! leaves a line in the picture. Photographs `Y` of patterns `P` tell the light there: those weights
//! `a` for which the drive `P a` near a cell is that of an even light make `Y a` its photograph.
//!
//! The weights are a ridge regression. Each cell's answer to light of another is off by an unknown
//! share, which falls with the square of the distance, and its answer to its own light by another;
//! the weights expect the least square of what is left of both and of noise. They need no
//! inverse, so that one pass over the photographs does. How large these shares are taken to be matters
//! little: .02 or .1 instead of .05 change the error on two painted scenes by less than 2 %.

use super::drift::Drift;
use super::measurements::{ChannelMeasurements, Measurements};
use super::pixel_views::{PixelView, PixelViews};
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::photographs::linearise::LinearPhotographs;
use crate::photographs::photo::Photo;
use crate::registration::cell_map::NO_CELL;
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Photographs of random patterns that are added up at most.
const MOST_VIEWS: usize = 40;

/// Fewer than these tell little.
const LEAST_VIEWS: usize = 10;

/// Cells in each direction whose light may be off.
const REACH: usize = 3;

/// Share by which the light that a cell throws on the one beside it is off; of white's light of
/// a cell of usual brightness.
const OFF_BESIDE: f64 = 0.05;

/// Share by which a cell's answer to its own light is off.
const OFF_OWN: f64 = 0.05;

/// Share of a cell's light that nothing explains, beside noise.
const UNEXPLAINED: f64 = 0.01;

/// The photograph of an even light.
#[derive(Clone, PartialEq, Debug)]
pub struct EvenLight {
    /// The views that were added up: columns of [`ChannelMeasurements::patterns`].
    pub views: Vec<usize>,
    /// One entry a channel.
    pub channels: Vec<EvenChannel>,
}

/// One channel of it.
#[derive(Clone, PartialEq, Debug)]
pub struct EvenChannel {
    /// Weights of the views for each cell: `N x views`, per camera unit. Together they light it and the
    /// cells near it to 1.
    pub weights: DMatrix<f32>,
    /// By camera pixel, per camera unit: its own light, divided by its light under white, less its
    /// drive. NaN where a pixel's place is not known.
    pub beyond: Vec<f32>,
}

impl EvenLight {
    /// Adds photographs up. `None` without a projector map, of a blurred projector, whose patterns light
    /// cells beside theirs, or if there are too few.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(crate) fn add_up(
        measurements: &Measurements,
        (sequence, linear, drift): (&Sequence, &mut LinearPhotographs<'_>, &Drift),
        progress: &dyn Progress,
    ) -> Result<Option<Self>, CaptureError> {
        let Measurements {
            grid,
            live,
            flood,
            registration,
            ..
        } = measurements;
        let Some(Ok(map)) = &measurements.map else {
            return Ok(None);
        };
        let views: Vec<usize> = sequence.bernoulli().take(MOST_VIEWS).collect();
        if views.len() < LEAST_VIEWS || measurements.devices.blur > 0.0 {
            return Ok(None);
        }
        let cells = &PixelViews::new(map, *grid, [1; 2], registration);
        let lit: Vec<&[bool]> = views.iter().map(|v| &sequence.views[*v].lit[..]).collect();
        let weigh = |channel: &ChannelMeasurements| weights(*grid, live, channel, &lit);
        let weights: Vec<DMatrix<f32>> = measurements.channels.iter().map(weigh).collect();
        // By shot, with the column of its view.
        let shots = views.iter().enumerate().flat_map(|(column, view)| {
            let shots = sequence.views[*view].shots.iter();
            shots.map(move |shot| (*shot, column))
        });
        let mut shots: Vec<(usize, usize)> = shots.collect();
        shots.sort_unstable();
        let repeats = |column: usize| sequence.views[views[column]].shots.len() as f32;
        let mut own = vec![NO_CELL; flood.first().map_or(0, Vec::len)];
        for view in cells.pixels() {
            own[view.pixel as usize] = own_cell(cells, view) as u32;
        }
        let mut sums: Vec<Vec<f32>> = flood.iter().map(|p| vec![0.0; p.len()]).collect();
        let order: Vec<usize> = shots.iter().map(|(shot, _)| *shot).collect();
        let mut columns = shots.iter().map(|(_, column)| *column);
        progress.begin("adding up even light", order.len() as u64);
        let LinearPhotographs {
            photographs, black, ..
        } = linear;
        photographs.for_batches(&order, progress, |photos: &[(usize, &Photo)]| {
            let columns: Vec<usize> = columns.by_ref().take(photos.len()).collect();
            for (channel, sums) in sums.iter_mut().enumerate() {
                let (weights, black) = (&weights[channel], &black[channel]);
                for ((shot, photo), &column) in photos.iter().zip(&columns) {
                    let gain = drift.gain(channel, *shot) as f32 * repeats(column);
                    let dark = drift.dark(channel, *shot) as f32;
                    let light = photo.planes[channel].par_iter().zip(black).zip(&own);
                    sums.par_iter_mut()
                        .zip(light)
                        .for_each(|(sum, ((light, black), own))| {
                            if *own != NO_CELL {
                                let weight = weights[(*own as usize, column)];
                                *sum += weight * (light - dark * black) / gain;
                            }
                        });
                }
            }
        })?;
        progress.end();
        let channels = sums.into_iter().zip(weights).zip(flood);
        let channels = channels.map(|((sums, weights), flood)| EvenChannel {
            beyond: beyond_drive(cells, (&sums, flood), (&weights, &lit)),
            weights,
        });
        Ok(Some(Self {
            views,
            channels: channels.collect(),
        }))
    }
}

/// The cell that a pixel's place lies in.
fn own_cell(cells: &PixelViews, view: &PixelView) -> usize {
    let [cols, rows] = cells.size();
    let [col, row] = view.place.map(|at| at.max(0.0) as usize);
    row.min(rows - 1) * cols + col.min(cols - 1)
}

/// Light of the pixels, divided by their light under white, less their drive.
fn beyond_drive(
    cells: &PixelViews,
    (sums, flood): (&[f32], &[f32]),
    (weights, lit): (&DMatrix<f32>, &[&[bool]]),
) -> Vec<f32> {
    let beyond = |view: &PixelView| {
        let pixel = view.pixel as usize;
        let own = own_cell(cells, view);
        let drive = |cell: usize| -> f32 {
            let views = lit.iter().enumerate().filter(|(_, lit)| lit[cell]);
            views.map(|(column, _)| weights[(own, column)]).sum()
        };
        let (drive, whole) = cells
            .seen(view)
            .fold((0.0, 0.0), |(sum, whole), (cell, share)| {
                (sum + share * drive(cell), whole + share)
            });
        let light = flood[pixel];
        let told = light > 0.0 && whole > 0.0;
        told.then(|| (pixel, sums[pixel] / light - drive / whole))
    };
    let told: Vec<(usize, f32)> = cells.pixels().par_iter().filter_map(beyond).collect();
    let mut pixels = vec![f32::NAN; sums.len()];
    for (pixel, beyond) in told {
        pixels[pixel] = beyond;
    }
    pixels
}

/// Weights of views for each cell, `N x views`, 0 of cells that are not live.
fn weights(
    grid: Grid,
    live: &[bool],
    channel: &ChannelMeasurements,
    lit: &[&[bool]],
) -> DMatrix<f32> {
    let white = channel.observations.column(Measurements::WHITE);
    let known = |cell: usize| live[cell] && white[cell] > 0.0;
    let bright: Vec<f64> = (0..grid.cells())
        .filter(|c| known(*c))
        .map(|c| white[c])
        .collect();
    let usual = bright.iter().sum::<f64>() / bright.len().max(1) as f64;
    let of_cell = |cell: usize| {
        let mut weights = vec![0.0; lit.len()];
        if !known(cell) {
            return weights;
        }
        let noise = channel
            .noise_model
            .variance(0.5 * white[cell] + channel.ambient[cell]);
        let left = UNEXPLAINED.powi(2) + noise / white[cell].powi(2);
        let mut square = DMatrix::from_diagonal_element(lit.len(), lit.len(), left);
        let mut wanted = DVector::zeros(lit.len());
        let near = cells_near(grid, cell).filter(|(near, _)| known(*near));
        for (near, distance) in near {
            let off = if near == cell {
                OFF_OWN
            } else {
                OFF_BESIDE * white[near] / (usual * distance)
            };
            let drive = 1.0 / white[near];
            let column = |view: usize| f64::from(u8::from(lit[view][near]));
            let pattern = DVector::from_fn(lit.len(), |view, _| off * column(view));
            square.ger(1.0, &pattern, &pattern, 1.0);
            wanted.axpy(off * drive, &pattern, 1.0);
        }
        if let Some(square) = square.cholesky() {
            weights.copy_from_slice(square.solve(&wanted).as_slice());
        }
        weights
    };
    let cells: Vec<Vec<f64>> = (0..grid.cells()).into_par_iter().map(of_cell).collect();
    DMatrix::from_fn(grid.cells(), lit.len(), |cell, view| {
        cells[cell][view] as f32
    })
}

/// A cell and those within [`REACH`] of it, with the squares of their distances.
fn cells_near(grid: Grid, cell: usize) -> impl Iterator<Item = (usize, f64)> {
    let (row, col) = (cell / grid.cols(), cell % grid.cols());
    let rows = row.saturating_sub(REACH)..(row + REACH + 1).min(grid.rows());
    rows.flat_map(move |other| {
        let cols = col.saturating_sub(REACH)..(col + REACH + 1).min(grid.cols());
        cols.map(move |across| {
            let (down, right) = (other.abs_diff(row), across.abs_diff(col));
            (
                other * grid.cols() + across,
                (down * down + right * right) as f64,
            )
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::noise::NoiseModel;
    use super::*;

    /// Twenty patterns, without an order that a grid could have.
    fn patterns(grid: Grid) -> Vec<Vec<bool>> {
        let lit = |view: usize, cell: usize| {
            let mixed = (view * grid.cells() + cell + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40 & 1 == 1
        };
        let pattern = |view: usize| (0..grid.cells()).map(|cell| lit(view, cell)).collect();
        (0..20).map(pattern).collect()
    }

    /// Two paints, side by side.
    fn painted(grid: Grid) -> ChannelMeasurements {
        let light = |cell: usize| if cell % grid.cols() < 4 { 0.6 } else { 0.2 };
        ChannelMeasurements {
            patterns: DMatrix::zeros(grid.cells(), 1),
            observations: DMatrix::from_fn(grid.cells(), 1, |cell, _| light(cell)),
            ambient: vec![0.0; grid.cells()],
            noise: vec![0.0; grid.cells()],
            noise_model: NoiseModel::default(),
        }
    }

    #[test]
    fn patterns_add_up_to_an_even_light_near_a_cell() {
        let grid = Grid::new(6, 8).unwrap();
        let (patterns, channel) = (patterns(grid), painted(grid));
        let lit: Vec<&[bool]> = patterns.iter().map(Vec::as_slice).collect();
        let mut live = vec![true; grid.cells()];
        live[9] = false;
        let weights = weights(grid, &live, &channel, &lit);
        assert!(weights.row(9).iter().all(|weight| *weight == 0.0));
        for cell in (0..grid.cells()).filter(|cell| live[*cell]) {
            for (near, distance) in cells_near(grid, cell).filter(|(near, _)| live[*near]) {
                let views = lit.iter().enumerate().filter(|(_, lit)| lit[near]);
                let drive: f32 = views.map(|(view, _)| weights[(cell, view)]).sum();
                let light = f64::from(drive) * channel.observations[(near, 0)];
                let bound = if near == cell { 0.1 } else { 0.4 };
                if distance <= 1.0 {
                    assert!((light - 1.0).abs() < bound, "{cell} {near}: {light}");
                }
            }
        }
    }

    #[test]
    fn what_a_pixel_gets_of_both_cells_that_it_sees_is_not_beyond_their_drive() {
        let grid = Grid::new(6, 8).unwrap();
        let (patterns, channel) = (patterns(grid), painted(grid));
        let lit: Vec<&[bool]> = patterns.iter().map(Vec::as_slice).collect();
        let weights = weights(grid, &vec![true; grid.cells()], &channel, &lit);
        // Beside the border of two paints, and in the middle of a cell.
        let places = [[3.95, 2.5], [4.02, 2.5], [1.5, 1.5]];
        let cells = PixelViews::of_places([8, 6], [0.2, 0.2], (0..).zip(places));
        let flood = [0.5, 0.3, 0.6];
        let light = |view: &PixelView, pattern: &[bool]| -> f32 {
            let seen = cells.seen(view).filter(|(cell, _)| pattern[*cell]);
            flood[view.pixel as usize] * seen.map(|(_, share)| share).sum::<f32>()
        };
        let sums = cells.pixels().iter().map(|view| {
            let views = lit.iter().enumerate();
            let own = own_cell(&cells, view);
            let light = views.map(|(at, lit)| weights[(own, at)] * light(view, lit));
            light.sum::<f32>()
        });
        let mut sums: Vec<f32> = sums.collect();
        let none = beyond_drive(&cells, (&sums, &flood), (&weights, &lit));
        assert!(none.iter().all(|beyond| beyond.abs() < 1e-4), "{none:?}");
        sums[1] += 0.03;
        let some = beyond_drive(&cells, (&sums, &flood), (&weights, &lit));
        assert!((some[1] - none[1] - 0.1).abs() < 1e-4, "{some:?}");
    }
}
