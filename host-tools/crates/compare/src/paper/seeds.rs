//! Repeated draws: the paper's comparison, direct against two-stage, over many draws of patterns,
//! noise and texture.

use super::scenes::Condition;
use crate::Answer;
use crate::acquisition::{Acquisition, Sparse};
use iltm_picture::progress::Progress;
use iltm_solve::Method;

/// Draws of everything that is random.
pub const SEEDS: u64 = 20;

/// Student's t for a 95 % interval of a mean of [`SEEDS`] values.
const STUDENT: f64 = 2.093;

/// A method and how many photographs it gets, white among them, black not.
pub const ENTRIES: [(Method, usize); 9] = [
    (Method::TwoStage, 120),
    (Method::Direct, 120),
    (Method::TwoStage, 150),
    (Method::Direct, 150),
    (Method::Joint, 40),
    (Method::Joint, 50),
    (Method::Joint, 70),
    (Method::Joint, 120),
    (Method::Joint, 150),
];

/// Errors of one method in one condition, by seed; those that were refused are left
/// out and counted.
#[derive(Clone, PartialEq, Debug)]
pub struct DrawErrors {
    /// Light and camera.
    pub condition: Condition,
    /// The method.
    pub method: Method,
    /// Photographs.
    pub photographs: usize,
    /// Seed, error of the second bounce under white, error of compensation.
    pub errors: Vec<(u64, f64, f64)>,
    /// Seeds whose answer no scene can have.
    pub refused: usize,
}

/// Mean and its 95 % interval.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// Half the width of the interval.
    pub half: f64,
}

impl Mean {
    /// Of values that are drawn independently.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        Self {
            mean,
            half: STUDENT * (squares / (count - 1.0).max(1.0) / count).sqrt(),
        }
    }
}

impl DrawErrors {
    /// Second-bounce errors.
    #[must_use]
    pub fn second_bounce(&self) -> Vec<f64> {
        self.errors.iter().map(|(_, error, _)| *error).collect()
    }

    /// Compensation errors.
    #[must_use]
    pub fn compensation(&self) -> Vec<f64> {
        self.errors.iter().map(|(.., error)| *error).collect()
    }

    /// Seeds in which this one's second bounce is better than another's, of those that
    /// both answered.
    #[must_use]
    pub fn wins(&self, other: &Self) -> (usize, usize) {
        let pairs = self.errors.iter().filter_map(|(seed, error, _)| {
            let other = other.errors.iter().find(|(s, ..)| s == seed)?;
            Some(*error < other.1)
        });
        pairs.fold((0, 0), |(wins, all), won| {
            (wins + usize::from(won), all + 1)
        })
    }
}

/// Runs methods, with so many photographs each, in all conditions over `seeds` draws.
#[must_use]
pub fn run(seeds: u64, entries: &[(Method, usize)], progress: &dyn Progress) -> Vec<DrawErrors> {
    let total = Condition::ALL.len() as u64 * seeds;
    progress.begin("the paper's comparison", total);
    let mut samples: Vec<DrawErrors> = Condition::ALL
        .iter()
        .flat_map(|condition| {
            entries.iter().map(|(method, photographs)| DrawErrors {
                condition: *condition,
                method: *method,
                photographs: *photographs,
                errors: Vec::new(),
                refused: 0,
            })
        })
        .collect();
    for condition in Condition::ALL {
        for seed in 1..=seeds {
            let mut own = samples.iter_mut().filter(|s| s.condition == condition);
            one(condition, seed, &mut own);
            progress.advance(1);
        }
    }
    progress.end();
    samples
}

fn one(condition: Condition, seed: u64, samples: &mut dyn Iterator<Item = &mut DrawErrors>) {
    let Some((truth, rig)) = condition.world(seed) else {
        return;
    };
    for sample in samples {
        let method = Sparse::new(sample.method, sample.photographs, seed);
        let found = method.acquire(&mut rig.clone());
        match found.ok().and_then(|found| found.inverse(&truth.live)) {
            Some(inverse) => {
                let errors = truth.judge(&Answer::Inverse(inverse));
                let second = errors.second_bounce.unwrap_or(f64::INFINITY);
                sample.errors.push((seed, second, errors.compensation));
            }
            None => sample.refused += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five values with a standard deviation of the square root of 2.5: but the factor
    /// is that of twenty.
    #[test]
    fn an_interval_is_students() {
        let mean = Mean::of(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!((mean.mean - 3.0).abs() < 1e-15);
        assert!((mean.half - 2.093 * (0.5_f64).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn wins_are_counted_seed_by_seed() {
        let sample = |errors: &[(u64, f64, f64)]| DrawErrors {
            condition: Condition::ALL[0],
            method: Method::Direct,
            photographs: 1,
            errors: errors.to_vec(),
            refused: 0,
        };
        let one = sample(&[(1, 0.1, 0.0), (2, 0.3, 0.0), (3, 0.1, 0.0)]);
        let other = sample(&[(2, 0.2, 0.0), (1, 0.2, 0.0)]);
        assert_eq!(one.wins(&other), (1, 2));
    }
}
