//! Hard case: what is hard about it, what must hold, and whether it does.

use super::closed_loop::{LoopErrors, errors};
use super::theory;
use crate::hard_cases::observations::Capture;
use iltm::scene::coaxial::CoaxialScene;
use iltm::solve::{Compensation, Method, SolveError, SolveOptions, gain_only};

/// One hard case.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// A few words; unique.
    pub name: &'static str,
    /// Why it is hard, physically.
    pub reason: &'static str,
    /// Which theory the bound is from.
    pub theory: &'static str,
    /// Runs it.
    pub run: fn(Trials) -> CaseOutcome,
}

/// The methods that every case is run through: the defaults for few cells and for many.
pub const METHODS: [Method; 2] = [Method::Joint, Method::Links];

/// How a case is run.
#[derive(Clone, Copy, Debug)]
pub struct Trials {
    /// How often, each time with other patterns and other noise.
    pub seeds: u64,
    /// How inverses are found.
    pub method: Method,
}

impl Trials {
    /// The same, no more often than this.
    pub(super) fn at_most(self, seeds: u64) -> Self {
        let seeds = self.seeds.min(seeds);
        Self { seeds, ..self }
    }

    /// Options of the solver.
    pub(super) fn options(self) -> SolveOptions {
        SolveOptions {
            method: Some(self.method),
            ..SolveOptions::default()
        }
    }
}

/// What came of a [`Case`].
#[derive(Clone, PartialEq, Debug)]
pub struct CaseOutcome {
    /// What must hold, with its number.
    pub bound: String,
    /// What was found.
    pub measured: String,
    /// What that compares with, which is the same for all methods.
    pub beside: String,
    /// Whether it does.
    pub holds: bool,
    /// Whether it holds because the input was refused.
    pub refused: bool,
}

impl CaseOutcome {
    /// Of a condition.
    pub fn new(holds: bool, bound: impl Into<String>, measured: impl Into<String>) -> Self {
        Self {
            bound: bound.into(),
            measured: measured.into(),
            beside: String::new(),
            holds,
            refused: false,
        }
    }

    /// Of input that must be refused with `words` in the diagnosis, which must
    /// have a number.
    pub fn refusal(result: Result<String, String>, words: &str) -> Self {
        let bound = format!("refused: \u{201c}{words}\u{201d}");
        match result {
            Ok(what) => Self::new(false, bound, what),
            Err(message) => Self {
                holds: message.contains(words) && message.contains(|c: char| c.is_ascii_digit()),
                refused: true,
                bound,
                measured: message,
                beside: String::new(),
            },
        }
    }

    /// `within bound`, `refused` or `FAILS`.
    pub const fn verdict(&self) -> &'static str {
        match (self.holds, self.refused) {
            (true, false) => "within bound",
            (true, true) => "refused",
            (false, _) => "FAILS",
        }
    }
}

/// What a closed loop is held to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Demand {
    /// Noise that the bound allows, relative to the light's root mean square.
    pub noise: f64,
    /// The least of this and the bound of [`theory`] is demanded.
    pub required: Option<f64>,
    /// Only not to be worse than gain alone and nothing: for what the model does
    /// not describe.
    pub no_harm_only: bool,
}

/// Solves several captures of a scene as `iltm solve` would, operator, gains
/// alone or refusal as predicted, and holds the closed loop against its bound.
/// What is chosen may never be worse than gain alone or nothing.
pub fn closed_loop(
    scene: &CoaxialScene,
    trials: Trials,
    demand: Demand,
    make: impl Fn(u64) -> Capture,
) -> CaseOutcome {
    let mut found: Vec<(f64, LoopErrors)> = Vec::new();
    let mut chosen = Vec::new();
    let (mut photographs, mut live) = (0, Vec::new());
    for seed in 0..trials.seeds {
        let capture = make(seed);
        match loop_of(scene, &capture, trials.method) {
            Ok((error, errors, compensation, cells)) => {
                found.push((error, errors));
                chosen.push(compensation);
                photographs = capture.patterns.ncols();
                live = cells;
            }
            Err(error) => {
                return CaseOutcome::new(false, "an inverse", format!("seed {seed}: {error}"));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (median, worst) = (found[found.len() / 2].0, found[found.len() - 1].0);
    let errors = found[found.len() - 1].1;
    // A tenth for the gains' own noise.
    let harmless = found.iter().all(|(error, errors)| {
        *error <= 1.1 * errors.gain_only + 1e-3 && *error <= 1.1 * errors.nothing + 1e-3
    });
    let theory = theory::bound(scene, &live, photographs, demand.noise, errors.perfect);
    let bound = demand.required.unwrap_or(f64::INFINITY).min(theory);
    let gain_alone = chosen
        .iter()
        .filter(|c| **c == Compensation::GainOnly)
        .count();
    let how = match gain_alone {
        _ if chosen.contains(&Compensation::Nothing) => ", no table".to_owned(),
        0 => String::new(),
        some if some == chosen.len() => ", with gains alone".to_owned(),
        some => format!(", {some} of {} with gains alone", chosen.len()),
    };
    let measured = format!("{median:.4}, worst of {} {worst:.4}{how}", trials.seeds);
    let beside = format!(
        "the true inverse {:.4}, gain alone {:.4}, nothing {:.4}",
        errors.perfect, errors.gain_only, errors.nothing
    );
    if demand.no_harm_only {
        let bound = "at most gain alone and nothing";
        return CaseOutcome {
            beside,
            ..CaseOutcome::new(harmless, bound, measured)
        };
    }
    let words = match demand.required {
        Some(required) => format!("{required:.4} asked for, {theory:.4} by theory"),
        None => format!("{theory:.4}"),
    };
    CaseOutcome {
        beside,
        ..CaseOutcome::new(harmless && worst <= bound, words, measured)
    }
}

/// Error of what `iltm solve` would write, all errors, what it is and the cells
/// that took part.
fn loop_of(
    scene: &CoaxialScene,
    capture: &Capture,
    method: Method,
) -> Result<(f64, LoopErrors, Compensation, Vec<bool>), SolveError> {
    let (inverse, report) = capture.solve(method)?;
    let inverse = match report.compensation {
        Compensation::Operator => inverse,
        Compensation::GainOnly => gain_only(&capture.observed(), &report)?,
        Compensation::Nothing => {
            let errors = errors(scene, &inverse);
            return Ok((errors.nothing, errors, Compensation::Nothing, inverse.live));
        }
    };
    let errors = errors(scene, &inverse);
    Ok((
        errors.compensated,
        errors,
        report.compensation,
        inverse.live,
    ))
}
