//! Bounds from below: supports that are looked at, each of which proves one.
//!
//! The largest and smallest eigenvalues of any principal submatrix of a Gram matrix
//! bound those of all sparse vectors from inside. Supports are drawn at random, and
//! grown greedily to the largest and smallest eigenvalue that one more coefficient can
//! bring, from the most promising starts.

use super::sensing::Sensing;
use fastrand::Rng;
use nalgebra::{Cholesky, DMatrix};
use rayon::prelude::*;

/// Coefficients of the supports that are looked at, at most: eigenvalues of larger ones
/// take too long.
const LARGEST: usize = 32;

/// How supports are looked for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sampling {
    /// Supports drawn at random, at most: fewer of large ones.
    pub random: usize,
    /// Starts of each greedy search.
    pub starts: usize,
    /// Repeats the random ones.
    pub seed: u64,
    /// Multiplications after which no more random supports are drawn.
    pub work: f64,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            random: 300,
            starts: 6,
            seed: 1,
            work: 1.5e7,
        }
    }
}

/// Largest and smallest quotient found.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Extremes {
    pub(super) most: f64,
    pub(super) least: f64,
}

impl Extremes {
    const NONE: Self = Self {
        most: 0.0,
        least: f64::INFINITY,
    };

    fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let values = values.into_iter();
        values.fold(Self::NONE, |e, value| Self {
            most: e.most.max(value),
            // Rounding makes a zero eigenvalue slightly negative.
            least: e.least.min(value.max(0.0)),
        })
    }

    fn and(self, other: Self) -> Self {
        Self {
            most: self.most.max(other.most),
            least: self.least.min(other.least),
        }
    }
}

/// Quotients over all supports that were looked at.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Found {
    /// `||T^T W h||^2 / ||h||^2`.
    pub(super) forward: Extremes,
    /// `||C^T W h||^2 / ||h||^2`.
    pub(super) sensed: Extremes,
    /// `||C^T W h||^2 / ||T^T W h||^2`.
    pub(super) pencil: Extremes,
}

impl Found {
    const NONE: Self = Self {
        forward: Extremes::NONE,
        sensed: Extremes::NONE,
        pencil: Extremes::NONE,
    };

    fn and(self, other: Self) -> Self {
        Self {
            forward: self.forward.and(other.forward),
            sensed: self.sensed.and(other.sensed),
            pencil: self.pencil.and(other.pencil),
        }
    }
}

/// What supports of `size` coefficients prove, and how many there were.
pub(super) fn search(sensing: &Sensing, size: usize, sampling: Sampling) -> (Found, usize) {
    let pool = sensing.forward.nrows();
    // A part of a support proves as much as a bound from below needs.
    let size = size.min(pool).min(LARGEST);
    let mut supports: Vec<Vec<usize>> = [&sensing.forward, &sensing.sensed]
        .into_iter()
        .flat_map(|gram| [(gram, Toward::Most), (gram, Toward::Least)])
        .collect::<Vec<_>>()
        .into_par_iter()
        .flat_map_iter(|(gram, toward)| {
            let starts = toward.starts(gram, sampling.starts);
            starts
                .into_iter()
                .map(move |start| toward.grow(gram, start, size))
        })
        .collect();
    supports.sort();
    supports.dedup();
    // Three eigenproblems and a factorisation, about 10 n^3 together.
    let each = 10.0 * (size as f64).powi(3);
    let random = sampling.random.min((sampling.work / each) as usize);
    let mut rng = Rng::with_seed(sampling.seed);
    supports.extend((0..random).map(|_| rng.choose_multiple(0..pool, size)));
    let found = supports
        .par_iter()
        .map(|support| quotients(sensing, support));
    (found.reduce(|| Found::NONE, Found::and), supports.len())
}

/// Extreme quotients of vectors with this support.
fn quotients(sensing: &Sensing, support: &[usize]) -> Found {
    let of = |gram: &DMatrix<f64>| {
        DMatrix::from_fn(support.len(), support.len(), |i, j| {
            gram[(support[i], support[j])]
        })
    };
    let (forward, sensed) = (of(&sensing.forward), of(&sensing.sensed));
    let eigenvalues =
        |matrix: DMatrix<f64>| Extremes::of(matrix.symmetric_eigenvalues().iter().copied());
    let pencil = pencil(&forward, &sensed).map_or(Extremes::NONE, eigenvalues);
    Found {
        forward: eigenvalues(forward),
        sensed: eigenvalues(sensed),
        pencil,
    }
}

/// `R^-1 B R^-T` with `G = R R^T`: its eigenvalues are the quotients of `B` and `G`.
/// `None` if `G` is singular.
fn pencil(forward: &DMatrix<f64>, sensed: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let factor = Cholesky::new(forward.clone())?.unpack();
    let left = factor.solve_lower_triangular(sensed)?;
    let both = factor.solve_lower_triangular(&left.transpose())?;
    // Symmetric but for rounding.
    Some((&both + both.transpose()) / 2.0)
}

/// Which eigenvalue a greedy search is after.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Toward {
    Most,
    Least,
}

impl Toward {
    /// Whether one value is better than another.
    fn better(self, a: f64, b: f64) -> bool {
        match self {
            Self::Most => a > b,
            Self::Least => a < b,
        }
    }

    /// The coefficients to start from: those of extreme length, best first.
    fn starts(self, gram: &DMatrix<f64>, count: usize) -> Vec<usize> {
        let mut all: Vec<usize> = (0..gram.nrows()).collect();
        all.sort_by(|a, b| {
            let order = gram[(*a, *a)].total_cmp(&gram[(*b, *b)]);
            if self == Self::Most {
                order.reverse()
            } else {
                order
            }
        });
        // Half of them by length, half spread over all the others.
        let spread = (all.len() / count.max(1)).max(1);
        let half = count.div_ceil(2).min(all.len());
        let rest = all[half..]
            .iter()
            .step_by(spread)
            .take(count - half.min(count));
        all[..half].iter().chain(rest).copied().collect()
    }

    /// Adds one coefficient after the other, each time the one that moves the quotient
    /// furthest within the plane of the vector so far and itself.
    fn grow(self, gram: &DMatrix<f64>, start: usize, size: usize) -> Vec<usize> {
        let mut support = vec![start];
        let mut inside = vec![false; gram.nrows()];
        inside[start] = true;
        // gram * h of the unit vector h so far, and its quotient.
        let mut image = gram.column(start).into_owned();
        let mut quotient = gram[(start, start)];
        while support.len() < size {
            let mut best: Option<(usize, f64, f64)> = None;
            for (index, cross) in image.iter().enumerate() {
                if inside[index] {
                    continue;
                }
                let own = gram[(index, index)];
                let (value, angle) = self.plane(quotient, *cross, own);
                if best.is_none_or(|(_, other, _)| self.better(value, other)) {
                    best = Some((index, value, angle));
                }
            }
            let Some((index, value, angle)) = best else {
                break;
            };
            let (sin, cos) = angle.sin_cos();
            image = image * cos + gram.column(index) * sin;
            quotient = value;
            inside[index] = true;
            support.push(index);
        }
        support.sort_unstable();
        support
    }

    /// The eigenvalue of `[[a, c], [c, b]]` and the angle of its eigenvector.
    fn plane(self, a: f64, c: f64, b: f64) -> (f64, f64) {
        let largest = 0.5 * (2.0 * c).atan2(a - b);
        let angle = match self {
            Self::Most => largest,
            Self::Least => largest + std::f64::consts::FRAC_PI_2,
        };
        let (sin, cos) = angle.sin_cos();
        (a * cos * cos + 2.0 * c * sin * cos + b * sin * sin, angle)
    }
}
