//! Held-out photographs: those that a solve does not see, to judge it by.
//!
//! The misfit is in observed light: how far the photograph that an inverse
//! predicts, `T p`, is from the one taken. Misfit in projected light would weigh
//! the noise by the inverse's own gains.
//!
//! With many random patterns one in five is held out, once. With few, every
//! pattern takes its turn: the solve is repeated with another part held out until
//! each has been. A pattern and its complement, or the same pattern taken twice,
//! are held out together: the one would tell the other.

use super::gain_only::gains;
use super::observed::Observed;
use super::options::GainOnly;
use super::prepare::Prepared;
use super::report::Prediction;
use super::solution::{Candidate, Solution, Trial};
use iltm_capture::Role;
use nalgebra::{DMatrix, DVector};
use std::collections::HashMap;

/// One random pattern in so many is held out.
const EVERY: usize = 5;
/// With fewer random patterns than this, every pattern is held out once.
const ENOUGH: usize = 20;
/// Solves at most for this.
const MOST_FOLDS: usize = 4;

/// Which photographs to hold out and which to solve from, by index.
#[derive(Clone, Debug)]
pub(super) struct Split {
    pub(super) held_out: Vec<usize>,
    pub(super) solved: Vec<usize>,
}

impl Split {
    /// One or more splits; no photograph is held out twice.
    pub(super) fn all(prepared: &Prepared) -> Vec<Self> {
        let groups = groups(prepared);
        let is_random =
            |group: &&Vec<usize>| group.iter().any(|k| prepared.roles[*k] == Role::Bernoulli);
        let random: Vec<&Vec<usize>> = groups.iter().filter(is_random).collect();
        if random.len() >= ENOUGH {
            let held_out = random.into_iter().skip(EVERY / 2).step_by(EVERY);
            return vec![Self::new(prepared, held_out)];
        }
        let folds = groups.len().min(MOST_FOLDS);
        (0..folds)
            .map(|fold| Self::new(prepared, groups.iter().skip(fold).step_by(folds)))
            .collect()
    }

    fn new<'g>(prepared: &Prepared, groups: impl Iterator<Item = &'g Vec<usize>>) -> Self {
        let mut held_out: Vec<usize> = groups.flatten().copied().collect();
        held_out.sort_unstable();
        let solved = (0..prepared.roles.len())
            .filter(|k| held_out.binary_search(k).is_err())
            .collect();
        Self { held_out, solved }
    }
}

/// Photographs of the same pattern or its complement, or of the same picture, in the order
/// they were taken. All-white ones are told by nothing else and stay together, apart only
/// if there are no others.
fn groups(prepared: &Prepared) -> Vec<Vec<usize>> {
    let mut known: HashMap<Vec<bool>, usize> = HashMap::new();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut uniform = Vec::new();
    let same = |a: usize, b: usize| {
        let mut channels = prepared.shown.iter();
        channels.all(|shown| shown.column(a) == shown.column(b))
    };
    for (k, role) in prepared.roles.iter().enumerate() {
        if *role == Role::Image {
            let again = |group: &&mut Vec<usize>| {
                prepared.roles[group[0]] == Role::Image && same(group[0], k)
            };
            match groups.iter_mut().find(again) {
                Some(group) => group.push(k),
                None => groups.push(vec![k]),
            }
            continue;
        }
        let lit = prepared.shown[0].column(k);
        let first = lit.iter().next().is_some_and(|share| *share > 0.5);
        let key: Vec<bool> = lit.iter().map(|share| (*share > 0.5) == first).collect();
        if !key.contains(&false) {
            uniform.push(k);
            continue;
        }
        let next = groups.len();
        let group = *known.entry(key).or_insert(next);
        if group == next {
            groups.push(Vec::new());
        }
        groups[group].push(k);
    }
    if groups.is_empty() {
        return uniform.into_iter().map(|k| vec![k]).collect();
    }
    groups
}

/// Inverses, one a channel, with the photographs they have not seen.
pub(super) struct Judged<'j> {
    pub(super) split: &'j Split,
    solution: Solution,
    pub(super) candidates: Vec<Candidate>,
}

impl<'j> Judged<'j> {
    pub(super) fn new(split: &'j Split, solution: Solution, live: &[bool]) -> Self {
        Self {
            split,
            candidates: solution.candidates(live),
            solution,
        }
    }

    /// The same in camera units, for who judges more than cells.
    pub(super) fn trial(self, observed: &Observed<'_>, prepared: &Prepared) -> Trial {
        let all: Vec<usize> = (0..prepared.roles.len()).collect();
        let candidates = self.candidates.iter().enumerate();
        let thrown = candidates.map(|(channel, own)| own.thrown(prepared, channel, &all));
        Trial {
            thrown: thrown.collect(),
            inverse: self.solution.in_camera_units(observed, prepared, None),
            held_out: self.split.held_out.clone(),
        }
    }
}

/// Squared misfit `||T p - c||^2` over all channels of the photographs `chosen`;
/// infinite if an inverse has no forward transport.
pub(super) fn squared_misfit(
    prepared: &Prepared,
    candidates: &[Candidate],
    chosen: &[usize],
) -> f64 {
    let mut difference = 0.0;
    for (channel, light) in prepared.light.iter().enumerate() {
        let observed = light.select_columns(chosen);
        let Some(predicted) = candidates[channel].light(prepared, channel, chosen) else {
            return f64::INFINITY;
        };
        difference += (predicted - &observed).norm_squared();
    }
    difference
}

/// Squared norm of the light in the photographs `chosen`.
pub(super) fn squared_light(prepared: &Prepared, chosen: &[usize]) -> f64 {
    let of_channel = |light: &DMatrix<f64>| light.select_columns(chosen).norm_squared();
    prepared.light.iter().map(of_channel).sum()
}

/// What the held-out photographs say of projecting with the inverses, with gains
/// alone, and with nothing.
pub(super) fn predict(prepared: &Prepared, judged: &[Judged<'_>]) -> Prediction {
    let nothing = wanted(prepared, judged, |_, _, patterns| Some(patterns.clone()));
    let of_gain = |kind: GainOnly| {
        wanted(prepared, judged, |judged, channel, patterns| {
            let gain = gains(prepared, channel, &judged.split.solved, kind);
            Some(lit_alone(&gain, patterns))
        })
    };
    let compensated = wanted(prepared, judged, |judged, channel, _| {
        judged.candidates[channel].light(prepared, channel, &judged.split.held_out)
    });
    let candidates = GainOnly::ALL.map(|kind| (kind, of_gain(kind)));
    let [flood, fitted] = candidates;
    let (gain_only_kind, gain_only) = if fitted.1.error < flood.1.error {
        fitted
    } else {
        flood
    };
    Prediction {
        uncompensated: nothing.error,
        gain_only: gain_only.error,
        compensated: compensated.error,
        noise: noise(prepared, judged),
        confidence: confidence(&gain_only, &compensated),
        photographs: compensated.squares.len(),
        gain_only_kind,
    }
}

/// Noise of the held-out photographs, relative to their light.
fn noise(prepared: &Prepared, judged: &[Judged<'_>]) -> f64 {
    let (mut noise, mut light) = (0.0, 0.0);
    for judged in judged {
        let held_out = &judged.split.held_out;
        light += squared_light(prepared, held_out);
        for cells in &prepared.noise {
            let cells = cells.iter().zip(&prepared.live);
            let live = cells.filter(|(_, live)| **live);
            let squares = live.map(|(noise, _)| noise.lit.powi(2)).sum::<f64>();
            noise += held_out.len() as f64 * squares;
        }
    }
    (noise / light.max(f64::MIN_POSITIVE)).sqrt()
}

/// Error of one way to project, over all held-out photographs.
struct Error {
    error: f64,
    /// Its square by photograph, relative to the light wanted in all of them.
    squares: Vec<f64>,
}

/// `||s c - d|| / ||d||` with the best scale `s`, one for all channels: a
/// projector too dim or too bright overall is not an error of compensation.
fn wanted(
    prepared: &Prepared,
    judged: &[Judged<'_>],
    wanted: impl Fn(&Judged<'_>, usize, &DMatrix<f64>) -> Option<DMatrix<f64>>,
) -> Error {
    let mut pairs = Vec::new();
    for judged in judged {
        for (channel, light) in prepared.light.iter().enumerate() {
            let patterns = prepared.patterns[channel].select_columns(&judged.split.held_out);
            let Some(wanted) = wanted(judged, channel, &patterns) else {
                return Error {
                    error: f64::INFINITY,
                    squares: Vec::new(),
                };
            };
            let observed = light.select_columns(&judged.split.held_out);
            pairs.push((observed, wanted));
        }
    }
    let sum = |of: fn(&(DMatrix<f64>, DMatrix<f64>)) -> f64| pairs.iter().map(of).sum::<f64>();
    let both = sum(|(observed, wanted)| observed.dot(wanted));
    let (seen, asked) = (
        sum(|pair| pair.0.norm_squared()),
        sum(|pair| pair.1.norm_squared()),
    );
    // Written so that light without any wanted is an error of 1, not NaN.
    let scale = if seen > 0.0 { both / seen } else { 0.0 };
    let mut squares = Vec::new();
    for channels in pairs.chunks(prepared.light.len()) {
        for k in 0..channels[0].0.ncols() {
            let square = |(observed, wanted): &(DMatrix<f64>, DMatrix<f64>)| {
                (observed.column(k) * scale - wanted.column(k)).norm_squared()
            };
            squares.push(channels.iter().map(square).sum::<f64>() / asked.max(f64::MIN_POSITIVE));
        }
    }
    Error {
        error: squares.iter().sum::<f64>().sqrt(),
        squares,
    }
}

/// By how many standard errors the second is better than the first, photograph
/// by photograph; nothing can be said of fewer than two.
fn confidence(first: &Error, second: &Error) -> f64 {
    let differences = first
        .squares
        .iter()
        .zip(&second.squares)
        .map(|(a, b)| a - b);
    let differences = DVector::from_vec(differences.collect());
    let count = differences.len() as f64;
    if count < 2.0 {
        return 0.0;
    }
    let mean = differences.mean();
    let spread = differences.add_scalar(-mean).norm_squared() / (count - 1.0);
    let deviation = (spread / count).sqrt();
    if mean == 0.0 {
        0.0
    } else {
        mean / deviation.max(f64::MIN_POSITIVE)
    }
}

/// What a pattern would show if every cell only dimmed its own light.
fn lit_alone(gain: &DVector<f64>, patterns: &DMatrix<f64>) -> DMatrix<f64> {
    let light = gain.map(|gain| if gain > 0.0 { gain.recip() } else { 0.0 });
    let mut lit = patterns.clone();
    for mut column in lit.column_iter_mut() {
        column.component_mul_assign(&light);
    }
    lit
}

/// Photographs of white, and pairs of photographs whose patterns together are
/// white.
pub(super) fn complements(prepared: &Prepared, chosen: &[usize]) -> Vec<(usize, Option<usize>)> {
    let lit = |k: usize| -> Vec<bool> {
        prepared.shown[0]
            .column(k)
            .iter()
            .zip(&prepared.live)
            .map(|(share, live)| *share > 0.5 || !live)
            .collect()
    };
    let dark = |k: usize| -> Vec<bool> {
        prepared.shown[0]
            .column(k)
            .iter()
            .zip(&prepared.live)
            .map(|(share, live)| *share < 0.5 || !live)
            .collect()
    };
    let mut found = Vec::new();
    let mut waiting: HashMap<Vec<bool>, Vec<usize>> = HashMap::new();
    let patterns = chosen.iter().filter(|k| prepared.roles[**k] != Role::Image);
    for &k in patterns {
        let pattern = lit(k);
        if !pattern.contains(&false) {
            found.push((k, None));
        } else if let Some(other) = waiting.get_mut(&pattern).and_then(Vec::pop) {
            found.push((other, Some(k)));
        } else {
            waiting.entry(dark(k)).or_default().push(k);
        }
    }
    found
}
