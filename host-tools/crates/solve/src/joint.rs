//! [`Method::Joint`](super::Method::Joint): gains and one operator for all
//! channels, from every photograph.
//!
//! 1. `lambda`, by held-out photographs, from strong to weak, each solve starting
//!    from the last one's answer.
//! 2. The solve of all photographs.
//! 3. The gains once more by least squares, free of the l1 term's pull.
//! 4. With three channels, each one's deviation from the shared operator: cells
//!    that straddle two albedos reflect a colour that no gain describes.

use super::admm::Consensus;
use super::convergence::{Convergence, Stop};
use super::data_term::DataTerm;
use super::forward::product;
use super::haar::Haar;
use super::held_out::{Judged, Split, squared_light, squared_misfit};
use super::interreflection::Interreflection;
use super::prepare::Prepared;
use super::report::LambdaTrial;
use super::solution::{Channel, Solution, drop_dead_rows};
use iltm_picture::progress::Progress;
use nalgebra::{DMatrix, DVector};

/// Penalty ratio of one level to the next coarser one.
const WEIGHT_BASE: f64 = 1.3;
/// First weight tried; halved until the held-out misfit has risen.
const STRONGEST: f64 = 0.032;
/// Most weights tried.
const MOST_TRIALS: i32 = 8;
/// `lambda` while the channels' scales are looked for.
const FALLBACK_LAMBDA: f64 = 0.008;
/// Solves on the way to `lambda` need not be closer than this.
const TRIAL: Stop = Stop {
    tolerance: 4e-3,
    iterations: 60,
};
/// A misfit that exceeds the least one by this factor ends the search.
const ENOUGH: f64 = 1.01;
/// `lambda` of a channel's deviation, in those of the shared operator.
const DEVIATION_RATIO: f64 = 4.0;
/// Rounds of fitting the channels' scales at most.
const MOST_SCALE_ROUNDS: usize = 8;
/// Relative change of a scale that is not worth another round.
const SCALE_TOLERANCE: f64 = 0.005;

/// The method's state over its solves.
#[derive(Debug)]
pub(super) struct Solver<'p> {
    prepared: &'p Prepared,
    stop: Stop,
    weights: Vec<f64>,
    haar: &'p Haar,
    consensus: Consensus<'p>,
    /// What the shared operator is multiplied by in each channel.
    scales: Vec<f64>,
    iterations: u32,
}

/// What the search for `lambda` found.
pub(super) struct Choice<'s> {
    pub(super) lambda: f64,
    pub(super) trials: Vec<LambdaTrial>,
    /// The best inverses found without held-out photographs, one entry a split;
    /// none if no solve gave any.
    pub(super) judged: Vec<Judged<'s>>,
}

/// The search with one part of the photographs held out.
struct Fold<'h, 's> {
    split: &'s Split,
    photographs: Photographs,
    data: DataTerm,
    consensus: Consensus<'h>,
    best: Option<Solution>,
}

impl<'p> Solver<'p> {
    pub(super) fn new(prepared: &'p Prepared, haar: &'p Haar, stop: Stop) -> Self {
        let weight = |fineness: &f64| WEIGHT_BASE.powf(fineness / 2.0);
        let weights: Vec<f64> = haar.fineness().iter().map(weight).collect();
        Self {
            prepared,
            stop,
            consensus: Consensus::new(haar, &weights, &prepared.live, None),
            weights,
            haar,
            scales: vec![1.0; prepared.light.len()],
            iterations: 0,
        }
    }

    /// Finds `lambda` by the held-out photographs of all `splits`, or judges the
    /// one that is given.
    pub(super) fn choose<'s>(
        &mut self,
        splits: &'s [Split],
        given: Option<f64>,
        progress: &dyn Progress,
    ) -> Choice<'s> {
        progress.begin("choosing lambda", 0);
        let mut folds: Vec<Fold<'p, 's>> = Vec::new();
        for split in splits {
            let photographs = Photographs::new(self.prepared, &split.solved);
            if folds.is_empty() {
                self.settle_scales(&photographs, progress);
            }
            folds.push(Fold {
                split,
                data: self.data(&photographs),
                photographs,
                consensus: Consensus::new(self.haar, &self.weights, &self.prepared.live, None),
                best: None,
            });
        }
        if let Some(first) = folds.first_mut() {
            std::mem::swap(&mut first.consensus, &mut self.consensus);
        }
        let path = match given {
            Some(lambda) => vec![lambda],
            None => (0..MOST_TRIALS)
                .map(|k| STRONGEST / f64::from(1 << k))
                .collect(),
        };
        let total: f64 = splits
            .iter()
            .map(|s| squared_light(self.prepared, &s.held_out))
            .sum();
        let mut choice = Choice {
            lambda: path[0],
            trials: Vec::new(),
            judged: Vec::new(),
        };
        let mut least = f64::INFINITY;
        for lambda in path {
            let tried: Vec<(Solution, f64)> = folds
                .iter_mut()
                .map(|fold| self.try_on(fold, lambda, progress))
                .collect();
            let squared: f64 = tried.iter().map(|(_, squared)| squared).sum();
            // Without light to predict, or without forward transport, nothing is told.
            let misfit = Some((squared / total).sqrt()).filter(|misfit| misfit.is_finite());
            let misfit = misfit.unwrap_or(f64::INFINITY);
            choice.trials.push(LambdaTrial { lambda, misfit });
            if misfit < least || choice.trials.len() == 1 {
                least = misfit;
                choice.lambda = lambda;
                for (fold, (solution, _)) in folds.iter_mut().zip(tried) {
                    fold.best = Some(solution);
                }
            } else if misfit > ENOUGH * least {
                break;
            }
        }
        for fold in &mut folds {
            if let Some(mut best) = fold.best.take() {
                self.add_deviations(&mut best, &fold.photographs, choice.lambda, TRIAL, progress);
                let live = &self.prepared.live;
                choice.judged.push(Judged::new(fold.split, best, live));
            }
        }
        // The solve of all photographs starts from here.
        if let Some(first) = folds.first_mut() {
            std::mem::swap(&mut first.consensus, &mut self.consensus);
        }
        progress.end();
        choice
    }

    /// Solves one fold for a `lambda`; with the squared misfit of what it held out.
    fn try_on(
        &mut self,
        fold: &mut Fold<'p, '_>,
        lambda: f64,
        progress: &dyn Progress,
    ) -> (Solution, f64) {
        std::mem::swap(&mut fold.consensus, &mut self.consensus);
        self.run(&fold.data, lambda, TRIAL, progress);
        let solution = self.found(&fold.photographs);
        std::mem::swap(&mut fold.consensus, &mut self.consensus);
        let candidates = solution.candidates(&self.prepared.live);
        let squared = squared_misfit(self.prepared, &candidates, &fold.split.held_out);
        (solution, squared)
    }

    /// Iterations of all solves so far.
    pub(super) fn iterations(&self) -> u32 {
        self.iterations
    }

    /// Solves for all photographs.
    pub(super) fn solve(&mut self, lambda: f64, progress: &dyn Progress) -> Solution {
        let all: Vec<usize> = (0..self.prepared.roles.len()).collect();
        let photographs = Photographs::new(self.prepared, &all);
        progress.begin("solving", 0);
        self.settle_scales(&photographs, progress);
        let data = self.data(&photographs);
        let convergence = self.run(&data, lambda, self.stop, progress);
        let mut found = self.found(&photographs);
        found.convergence = convergence;
        self.add_deviations(&mut found, &photographs, lambda, self.stop, progress);
        progress.end();
        found
    }

    /// The data term of the joint solve: light scaled so that all channels have
    /// the same operator.
    fn data(&self, photographs: &Photographs) -> DataTerm {
        let light = photographs.sources.iter().zip(&self.scales);
        DataTerm::new(
            light.map(|(c, scale)| c * *scale).collect(),
            photographs.patterns.clone(),
            &photographs.weights,
        )
    }

    fn run(
        &mut self,
        data: &DataTerm,
        lambda: f64,
        stop: Stop,
        progress: &dyn Progress,
    ) -> Convergence {
        let lambda = lambda * data.channels() as f64;
        let end = self
            .consensus
            .run(data, lambda, stop, &|| progress.advance(1));
        self.iterations += end.iterations;
        end
    }

    /// The consensus' operator with gains fitted to `photographs`.
    fn found(&self, photographs: &Photographs) -> Solution {
        let mut shared = self.consensus.operator();
        shared.apply(|value| *value = value.max(0.0));
        shared.fill_diagonal(0.0);
        drop_dead_rows(&mut shared, &self.prepared.live);
        let shared = Interreflection::Dense(shared);
        let channels = photographs.channels().zip(&self.scales);
        let channels = channels
            .map(|((channel, sources), scale)| Channel {
                gain: photographs.fitted_gain(channel, &(&shared * sources * *scale)),
                scale: *scale,
                deviation: None,
            })
            .collect();
        Solution {
            shared,
            channels,
            coefficients: self.consensus.coefficients(),
            convergence: Convergence::none(),
        }
    }

    /// Finds the projector's gain in each channel, up to a common factor: that
    /// with which the shared operator explains the channel's photographs best.
    fn settle_scales(&mut self, photographs: &Photographs, progress: &dyn Progress) {
        if self.scales.len() < 2 {
            return;
        }
        for _ in 0..MOST_SCALE_ROUNDS {
            let data = self.data(photographs);
            self.run(&data, FALLBACK_LAMBDA, TRIAL, progress);
            let shared = self.found(photographs).shared;
            let fitted: Vec<f64> = photographs
                .channels()
                .map(|(channel, sources)| {
                    let light = &photographs.light[channel];
                    let patterns = &photographs.patterns[channel];
                    fitted_scale(light, &(&shared * sources), patterns)
                })
                .collect();
            // Where the light tells nothing (no interreflection) nothing is told.
            if fitted
                .iter()
                .any(|scale| !(*scale > 0.0 && scale.is_finite()))
            {
                return;
            }
            let mean = fitted.iter().map(|s| s.ln()).sum::<f64>() / fitted.len() as f64;
            let mut change = 0.0_f64;
            for (scale, fitted) in self.scales.iter_mut().zip(fitted) {
                let next = fitted / mean.exp();
                change = change.max((next / *scale - 1.0).abs());
                *scale = next;
            }
            if change < SCALE_TOLERANCE {
                return;
            }
        }
    }

    /// Each channel's own part, and the gains that go with it.
    fn add_deviations(
        &mut self,
        found: &mut Solution,
        photographs: &Photographs,
        lambda: f64,
        stop: Stop,
        progress: &dyn Progress,
    ) {
        if found.channels.len() < 2 {
            return;
        }
        for (channel, (index, sources)) in found.channels.iter_mut().zip(photographs.channels()) {
            let own = found.shared.dense() * channel.scale;
            let target = &photographs.patterns[index] + product(&own, sources);
            let data = DataTerm::new(vec![sources.clone()], vec![target], &photographs.weights);
            let floor = -&own;
            let mut consensus =
                Consensus::new(self.haar, &self.weights, &self.prepared.live, Some(&floor));
            let end = consensus.run(&data, DEVIATION_RATIO * lambda, stop, &|| {
                progress.advance(1);
            });
            self.iterations += end.iterations;
            let mut deviation = consensus.operator().zip_map(&floor, f64::max);
            deviation.fill_diagonal(0.0);
            drop_dead_rows(&mut deviation, &self.prepared.live);
            let reflected = product(&(&own + &deviation), sources);
            channel.gain = photographs.fitted_gain(index, &reflected);
            channel.deviation = Some(Interreflection::Dense(deviation));
        }
    }
}

/// Photographs chosen for one solve, `N x m` each, by channel.
#[derive(Debug)]
pub(super) struct Photographs {
    patterns: Vec<DMatrix<f64>>,
    /// Those of all channels.
    weights: DMatrix<f64>,
    light: Vec<DMatrix<f64>>,
    /// [`Prepared::sources`].
    sources: Vec<DMatrix<f64>>,
}

impl Photographs {
    pub(super) fn new(prepared: &Prepared, chosen: &[usize]) -> Self {
        let channels = 0..prepared.light.len();
        let patterns = prepared.patterns.iter();
        let light = prepared.light.iter();
        Self {
            sources: channels.map(|c| prepared.sources(c, chosen)).collect(),
            patterns: patterns.map(|c| c.select_columns(chosen)).collect(),
            weights: prepared.weights.select_columns(chosen),
            light: light.map(|c| c.select_columns(chosen)).collect(),
        }
    }

    /// Number and sources of each channel.
    fn channels(&self) -> impl Iterator<Item = (usize, &DMatrix<f64>)> {
        self.sources.iter().enumerate()
    }

    /// [`fitted_gain`] of these photographs.
    fn fitted_gain(&self, channel: usize, reflected: &DMatrix<f64>) -> DVector<f64> {
        let all: Vec<usize> = (0..reflected.ncols()).collect();
        let (light, patterns) = (&self.light[channel], &self.patterns[channel]);
        fitted_gain([light, patterns, &self.weights], &all, reflected)
    }
}

/// Gains that explain a channel's light in the photographs `chosen` best, beside its operator.
pub(super) fn gain(
    prepared: &Prepared,
    chosen: &[usize],
    channel: usize,
    operator: &Interreflection,
) -> DVector<f64> {
    let reflected = operator * &prepared.sources(channel, chosen);
    let (light, patterns) = (&prepared.light[channel], &prepared.patterns[channel]);
    fitted_gain([light, patterns, &prepared.weights], chosen, &reflected)
}

/// Gains that explain a channel's light best in the columns `chosen` of `light`, `patterns` and
/// `weights`, given the light that the operator takes away in these; zero for a cell without light.
fn fitted_gain(
    [light, patterns, weights]: [&DMatrix<f64>; 3],
    chosen: &[usize],
    reflected: &DMatrix<f64>,
) -> DVector<f64> {
    DVector::from_fn(light.nrows(), |cell, _| {
        let (mut both, mut norm) = (0.0, 0.0);
        for (k, photograph) in chosen.iter().enumerate() {
            let at = (cell, *photograph);
            let (seen, weight) = (light[at], weights[at]);
            both += weight * seen * (reflected[(cell, k)] + patterns[at]);
            norm += weight * seen * seen;
        }
        if norm > 0.0 { both / norm } else { 0.0 }
    })
}

/// The factor on `reflected = K C` with which the photographs are explained best,
/// whatever the gains: both sides lose their part along the cell's own light.
fn fitted_scale(light: &DMatrix<f64>, reflected: &DMatrix<f64>, patterns: &DMatrix<f64>) -> f64 {
    let (mut both, mut norm) = (0.0, 0.0);
    for cell in 0..light.nrows() {
        let (seen, reflected) = (light.row(cell), reflected.row(cell));
        let own = seen.norm_squared();
        if own > 0.0 {
            let along = reflected.dot(&seen) / own;
            let pattern = patterns.row(cell);
            both -= reflected.dot(&pattern) - along * seen.dot(&pattern);
            norm += reflected.norm_squared() - along * along * own;
        }
    }
    both / norm
}
