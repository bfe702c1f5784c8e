//! [`Method::Links`](super::Method::Links): hierarchical inverse light transport, with cost that
//! grows as the number of cells.
//!
//! `K` is a set of links between blocks of a quadtree, as in hierarchical radiosity (Hanrahan,
//! Salzman, Aupperle, *A Rapid Hierarchical Radiosity Algorithm*, 1991), but found from
//! photographs. Receiving blocks are solved from the coarsest level down to the cells, each for
//! itself: its row is a small non-negative least-squares problem over source blocks
//! ([`row`]) that starts from the mean of the rows around it, one level above, and is pulled towards
//! that. A source block is split where that explains more than noise. Gains follow from the rows
//! after each level.

mod haar;
mod operator;
mod quadtree;
mod row;

pub use operator::Links;
pub(super) use row::Splits;

use super::convergence::Convergence;
use super::group::Processes;
use super::interreflection::Interreflection;
use super::joint::gain;
use super::prepare::Prepared;
use super::solution::{Channel, Solution};
use iltm_picture::progress::{Progress, Silent};
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector};
use operator::Link;
use quadtree::Quadtree;
use rayon::prelude::*;
use row::{Fit, Prior, Row, Target, axpy, dot, series};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Level with which the first sweep ends: gains of blocks of 2 x 2 cells are good enough for the
/// second one.
const FIRST_ENDS: usize = 1;
/// Levels above the cells from which rows are solved once more, with the gains of the first sweep.
/// From coarser ones on they fitted the errors of gains instead.
const SECOND_SWEEP: usize = 3;
/// Weight of a series' mean square beside that of its variance: errors of coarse blocks are much
/// alike in all photographs.
const MEAN_WEIGHT: f32 = 0.03;
/// Deviation of a value from where it starts, as a part of it.
const RELATIVE: f32 = 0.7;
/// The same of values that are zero, in those of a row that spreads all light evenly.
const ABSOLUTE: f32 = 0.1;
/// Deviation of a channel's value from the shared one.
const CHANNEL_RELATIVE: f32 = 0.3;
/// Noise below this part of the mean flood light is none that a solve could use.
const LEAST_NOISE: f64 = 1e-5;

/// Photographs to solve from, as series.
#[derive(Serialize, Deserialize)]
pub(super) struct Data {
    tree: Quadtree,
    photographs: usize,
    how: How,
    /// Cells that can be solved for.
    live: Vec<bool>,
    /// Whether each block's row is solved, in one sweep; `None` for all of them, in two.
    asked: Option<Vec<bool>>,
    /// Deviation of a lit cell's light, by channel and cell.
    noise: Vec<Vec<f32>>,
    /// Light of all blocks, a column each: channel after channel. Means are reduced.
    sources: DMatrix<f32>,
    /// Light of each cell, likewise.
    light: DMatrix<f32>,
    /// Patterns of each cell, likewise.
    patterns: DMatrix<f32>,
    /// Variance of each photograph's noise relative to that of one in which the cell is lit.
    variances: DMatrix<f32>,
}

/// The state of a solve.
struct State {
    rows: Vec<Row>,
    /// By channel and cell.
    gains: Vec<Vec<f32>>,
    scales: Vec<f32>,
}

/// How rows are solved.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct How {
    pub(super) splits: Splits,
    /// Whether each channel has rows of its own too. Bounced light is the same geometry in all
    /// channels, so that most scenes need none.
    pub(super) own_rows: bool,
}

/// Solves from the photographs `chosen`: with the rows that all channels share, and then with those
/// of each channel if asked for and there are several.
pub(super) fn links(
    prepared: &Prepared,
    grid: Grid,
    chosen: &[usize],
    how: How,
    processes: Processes,
    progress: &dyn Progress,
) -> Vec<Solution> {
    let data = Data::new(prepared, grid, chosen, how);
    found(data, prepared, chosen, processes, progress)
}

/// Solves from all photographs for the rows of some cells, in one sweep, with few splits and the rows
/// that all channels share; the other cells have no rows.
pub(super) fn rows_of_cells(
    cells: &[usize],
    prepared: &Prepared,
    grid: Grid,
    processes: Processes,
    progress: &dyn Progress,
) -> Solution {
    let how = How {
        splits: Splits::Few,
        own_rows: false,
    };
    let all = prepared.with_role(|_| true);
    let mut data = Data::new(prepared, grid, &all, how);
    data.asked = Some(data.tree.needed_for(cells));
    let mut found = found(data, prepared, &all, processes, progress);
    found.pop().expect("one answer at least")
}

fn found(
    data: Data,
    prepared: &Prepared,
    chosen: &[usize],
    processes: Processes,
    progress: &dyn Progress,
) -> Vec<Solution> {
    processes.ask(&data);
    let (state, own) = sweeps(&data, processes, progress);
    let tree = Arc::new(data.tree.clone());
    // Answers need the room.
    drop(data);
    let gain = |channel: usize, operator: &_| gain(prepared, chosen, channel, operator);
    let mut found = vec![state.solution(&tree, &[], gain)];
    if !own.is_empty() {
        found.push(state.solution(&tree, &own, gain));
    }
    found
}

/// Does a part of what another process solves.
pub(super) fn help(data: &Data, processes: Processes) {
    sweeps(data, processes, &Silent);
}

/// The state with the rows of all blocks, and the rows of each channel's cells if it has its own.
fn sweeps(data: &Data, processes: Processes, progress: &dyn Progress) -> (State, Vec<Vec<Row>>) {
    let sweep = Sweep {
        data,
        processes,
        progress,
    };
    let mut state = sweep.first_state();
    let top = data.tree.coarsest();
    for level in (FIRST_ENDS.min(top)..=top).rev() {
        sweep.solve_level(level, &mut state);
        sweep.fit_gains(level, &mut state);
    }
    // Gains of coarse rows are worse than those that the first sweep has ended with.
    let second = if data.asked.is_none() {
        SECOND_SWEEP
    } else {
        0
    };
    for level in (1..=second.min(top)).rev() {
        sweep.solve_level(level, &mut state);
    }
    let own = sweep.solve_cells(&mut state);
    sweep.fit_gains(0, &mut state);
    (state, own)
}

impl Data {
    fn new(prepared: &Prepared, grid: Grid, chosen: &[usize], how: How) -> Self {
        /// Cells whose series are filled together: some lines of a cache.
        const TOGETHER: usize = 64;
        let tree = Quadtree::new(grid);
        let (photographs, channels) = (chosen.len(), prepared.light.len());
        let length = photographs * channels;
        let cells = tree.cells();
        let fill = |columns: usize, of: &dyn Fn(usize) -> DMatrix<f64>| {
            let mut filled = DMatrix::zeros(length, columns);
            for channel in 0..channels {
                let matrix = of(channel);
                let part = 1.0 - MEAN_WEIGHT.sqrt();
                let means: Vec<f32> = matrix
                    .column_mean()
                    .iter()
                    .map(|mean| *mean as f32 * part)
                    .collect();
                let series = filled.as_mut_slice().par_chunks_mut(length * TOGETHER);
                series.enumerate().for_each(|(group, series)| {
                    for (k, light) in matrix.column_iter().enumerate() {
                        let cells = (group * TOGETHER..cells).zip(series.chunks_exact_mut(length));
                        for (cell, series) in cells {
                            series[channel * photographs + k] = light[cell] as f32 - means[cell];
                        }
                    }
                });
            }
            filled
        };
        let mut sources = fill(tree.blocks(), &|channel| prepared.sources(channel, chosen));
        row::sum_cells(&tree, &mut sources);
        let least: Vec<f64> = prepared.weights.row_iter().map(|row| row.min()).collect();
        let variances = DMatrix::from_fn(photographs, cells, |k, cell| {
            (least[cell] / prepared.weights[(cell, chosen[k])]) as f32
        });
        let noise = (prepared.noise.iter()).map(|cells| {
            cells
                .iter()
                .map(|noise| noise.lit.max(LEAST_NOISE) as f32)
                .collect()
        });
        Self {
            tree,
            photographs,
            how,
            live: prepared.live.clone(),
            asked: None,
            noise: noise.collect(),
            sources,
            light: fill(cells, &|channel| {
                prepared.light[channel].select_columns(chosen)
            }),
            patterns: fill(cells, &|channel| {
                prepared.patterns[channel].select_columns(chosen)
            }),
            variances,
        }
    }

    const fn channels(&self) -> usize {
        self.noise.len()
    }

    /// Whether the row of a block is solved.
    fn is_asked(&self, block: usize) -> bool {
        self.asked.as_ref().is_none_or(|asked| asked[block])
    }

    /// Whether each channel has rows of its own.
    const fn own_rows(&self) -> bool {
        self.how.own_rows && self.channels() > 1
    }

    fn segment(&self, channel: usize) -> std::ops::Range<usize> {
        channel * self.photographs..(channel + 1) * self.photographs
    }

    /// What the row of a block starts from: the mean of the rows of the blocks around it, one level
    /// above.
    fn start(&self, block: usize, rows: &[Row]) -> Row {
        let around: Vec<(&Row, f32)> = (self.tree.around(block).into_iter())
            .map(|(block, share)| (&rows[block], share))
            .filter(|(row, _)| !row.blocks.is_empty())
            .collect();
        Row::mean(&self.tree, &around).unwrap_or_else(|| self.dark())
    }

    /// A row without light, of the coarsest blocks.
    fn dark(&self) -> Row {
        let blocks: Vec<usize> = self.tree.level(self.tree.coarsest()).collect();
        Row {
            values: vec![0.0; blocks.len()],
            blocks,
        }
    }

    /// Sources by which all channels have the same operator.
    fn scaled_sources(&self, scales: &[f32]) -> DMatrix<f32> {
        let mut sources = self.sources.clone();
        for mut column in sources.column_iter_mut() {
            for (channel, scale) in scales.iter().enumerate() {
                let segment = self.segment(channel);
                for value in &mut column.as_mut_slice()[segment] {
                    *value *= scale;
                }
            }
        }
        sources
    }

    /// What the row of a block must make of the light: the mean over its cells,
    /// those with less noise counting more. `None` if no cell is live, or the row is not asked for.
    fn target<'t>(
        &'t self,
        block: usize,
        sources: &'t DMatrix<f32>,
        gains: &[Vec<f32>],
    ) -> Option<Target<'t>> {
        if !self.is_asked(block) {
            return None;
        }
        let cells = self.tree.cells_of(block);
        let live = |cell: &usize| self.live[*cell];
        let cells: Vec<usize> = cells.into_iter().filter(live).collect();
        if cells.is_empty() {
            return None;
        }
        let length = self.channels() * self.photographs;
        let mut target = Target {
            tree: &self.tree,
            photographs: self.photographs,
            sources,
            precision: Vec::with_capacity(length),
            wanted: Vec::with_capacity(length),
            own: Vec::new(),
            prior: Prior {
                relative: RELATIVE,
                absolute: ABSOLUTE / self.tree.cells() as f32,
            },
            splits: self.how.splits,
            apart: self.own_rows(),
        };
        for (channel, gains) in gains.iter().enumerate() {
            let segment = self.segment(channel);
            let mut wanted = vec![0.0; self.photographs];
            let mut own = vec![0.0; self.photographs];
            let mut variance = vec![0.0; self.photographs];
            let mut total = 0.0;
            for cell in &cells {
                let noise = self.noise[channel][*cell];
                let gain = gains[*cell];
                let share = (gain * noise).powi(2).recip();
                if !share.is_finite() {
                    continue;
                }
                let light = &series(&self.light, *cell)[segment.clone()];
                axpy(&mut own, share * gain, light);
                axpy(
                    &mut wanted,
                    -share,
                    &series(&self.patterns, *cell)[segment.clone()],
                );
                // (share * gain * noise)^2 is the share itself.
                axpy(&mut variance, share, series(&self.variances, *cell));
                total += share;
            }
            axpy(&mut wanted, 1.0, &own);
            let precision = variance.iter().map(|variance| total / variance.sqrt());
            target.precision.extend(precision);
            let precision = &target.precision[segment.clone()];
            let whiten = |series: &mut [f32]| {
                for (value, precision) in series.iter_mut().zip(precision) {
                    *value *= precision / total;
                }
            };
            whiten(&mut wanted);
            whiten(&mut own);
            target.wanted.extend(wanted);
            let norm = dot(&own, &own).sqrt();
            if norm > 0.0 {
                let mut unit = vec![0.0; length];
                axpy(&mut unit[segment], norm.recip(), &own);
                target.own.push(unit);
            }
        }
        Some(target)
    }
}

impl State {
    /// The answer, with each channel's deviation from the shared operator; `gain` finds the gains
    /// beside a channel's operator.
    fn solution(
        &self,
        tree: &Arc<Quadtree>,
        own: &[Vec<Row>],
        gain: impl Fn(usize, &Interreflection) -> DVector<f64>,
    ) -> Solution {
        let rows = &self.rows[..tree.cells()];
        let shared = operator(tree, rows);
        let channel = |channel: usize| {
            let scale = f64::from(self.scales[channel]);
            let even = &shared * scale;
            let own = own.get(channel).map(|rows| operator(tree, rows));
            Channel {
                gain: gain(channel, own.as_ref().unwrap_or(&even)),
                scale,
                deviation: own.map(|own| &own + &(&even * -1.0)),
            }
        };
        let links = |row: &Row| row.values.iter().filter(|value| **value != 0.0).count();
        Solution {
            channels: (0..self.scales.len()).map(channel).collect(),
            coefficients: rows.iter().map(links).sum(),
            shared,
            convergence: Convergence::best(),
        }
    }
}

/// An operator of these rows, zero on the diagonal.
fn operator(tree: &Arc<Quadtree>, rows: &[Row]) -> Interreflection {
    let rows = rows.iter().enumerate().map(|(cell, row)| {
        let links = row.blocks.iter().zip(&row.values);
        let links = links.filter(|(_, value)| **value != 0.0);
        let mut links: Vec<Link> = links
            .map(|(block, value)| Link {
                block: *block as u32,
                value: *value,
            })
            .collect();
        let holds = |link: &&Link| tree.holds(link.block as usize, cell);
        if let Some(link) = links.iter().find(holds) {
            // What a block sends to its own cell is taken away again.
            links.push(Link {
                block: cell as u32,
                value: -link.value,
            });
        }
        links
    });
    Interreflection::Links(Links::new(Arc::clone(tree), rows.collect()))
}

/// Work on the rows that processes share.
struct Sweep<'s> {
    data: &'s Data,
    processes: Processes,
    progress: &'s dyn Progress,
}

impl Sweep<'_> {
    fn first_state(&self) -> State {
        let mut state = State {
            rows: vec![Row::default(); self.data.tree.blocks()],
            gains: vec![vec![0.0; self.data.tree.cells()]; self.data.channels()],
            scales: vec![1.0; self.data.channels()],
        };
        self.fit_gains(0, &mut state);
        state
    }

    /// Solves the rows of one level's blocks.
    fn solve_level(&self, level: usize, state: &mut State) {
        let found = self.fit_level(level, state, |fit| fit.row().merged(&self.data.tree));
        for (block, row) in self.data.tree.level(level).zip(found) {
            state.rows[block] = row.unwrap_or_default();
        }
    }

    /// Solves the rows of the cells. The rows of each channel's own, if any, are what is returned.
    fn solve_cells(&self, state: &mut State) -> Vec<Vec<Row>> {
        let own_rows = self.data.own_rows();
        let found = self.fit_level(0, state, |fit| {
            let merged = |row: Row| row.merged(&self.data.tree);
            let own = own_rows.then(|| fit.of_channels(CHANNEL_RELATIVE));
            let own = own.into_iter().flatten().map(merged);
            (merged(fit.row()), own.collect::<Vec<Row>>())
        });
        let nothing = vec![Row::default(); self.data.tree.cells()];
        let mut rows = vec![nothing; if own_rows { self.data.channels() } else { 0 }];
        for (cell, found) in found.into_iter().enumerate() {
            let (shared, own) = found.unwrap_or_default();
            state.rows[cell] = shared;
            for ((rows, mut own), scale) in rows.iter_mut().zip(own).zip(&state.scales) {
                own.values.iter_mut().for_each(|value| *value *= scale);
                rows[cell] = own;
            }
        }
        rows
    }

    /// What is made of the fit of each block of a level; `None` if it has no [`target`](Data::target).
    fn fit_level<T: Serialize + DeserializeOwned + Send>(
        &self,
        level: usize,
        state: &State,
        of: impl Fn(Fit<'_>) -> T + Send + Sync,
    ) -> Vec<Option<T>> {
        let sources = self.data.scaled_sources(&state.scales);
        self.processes.map(self.data.tree.level(level), |block| {
            let target = self.data.target(block, &sources, &state.gains)?;
            let found = of(target.fit(&self.data.start(block, &state.rows)));
            self.progress.advance(1);
            Some(found)
        })
    }

    /// Gains, and the channels' scales, with which the rows of a level explain the light best.
    fn fit_gains(&self, level: usize, state: &mut State) {
        let cells = 0..self.data.tree.cells();
        let fitted: Vec<Vec<(f32, f32, f32)>> = self.processes.map(cells, |cell| {
            if !self.data.live[cell] {
                return vec![(0.0, 0.0, 0.0); self.data.channels()];
            }
            let block = self.data.tree.ancestor(cell, level);
            if !self.data.is_asked(block) {
                // What a coarser row gave stays.
                let gains = state.gains.iter().map(|gains| gains[cell]);
                return gains.map(|gain| (gain, 0.0, 0.0)).collect();
            }
            let mut reflected = vec![0.0; self.data.sources.nrows()];
            let row = &state.rows[block];
            row.add_light(&self.data.sources, &mut reflected);
            let channel = |channel: usize| {
                let segment = self.data.segment(channel);
                let light = &series(&self.data.light, cell)[segment.clone()];
                let pattern = &series(&self.data.patterns, cell)[segment.clone()];
                let reflected = &reflected[segment];
                let square = dot(light, light);
                if square <= 0.0 {
                    return (0.0, 0.0, 0.0);
                }
                let along = dot(light, reflected) / square;
                let gain = dot(light, pattern) / square + state.scales[channel] * along;
                let both = along * dot(light, pattern) - dot(reflected, pattern);
                let norm = dot(reflected, reflected) - along * along * square;
                (gain, both, norm)
            };
            (0..self.data.channels()).map(channel).collect()
        });
        for channel in 0..self.data.channels() {
            for (cell, fitted) in fitted.iter().enumerate() {
                state.gains[channel][cell] = fitted[channel].0;
            }
        }
        if self.data.channels() == 1 {
            return;
        }
        let scale = |channel: usize| {
            let both: f32 = fitted.iter().map(|fitted| fitted[channel].1).sum();
            let norm: f32 = fitted.iter().map(|fitted| fitted[channel].2).sum();
            both / norm
        };
        let scales: Vec<f32> = (0..self.data.channels()).map(scale).collect();
        if scales.iter().all(|scale| *scale > 0.0 && scale.is_finite()) {
            let mean = scales.iter().map(|scale| scale.ln()).sum::<f32>() / scales.len() as f32;
            state.scales = scales.iter().map(|scale| scale / mean.exp()).collect();
        }
    }
}
