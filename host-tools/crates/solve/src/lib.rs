//! Inverse light transport: from [`Measurements`] to [`InverseTransport`].
//!
//! The inverse of a scene's light transport is `T^-1 = diag(g) - K`: texture is
//! in the gains `g` alone, and `K` is geometry, one bounce, smooth and
//! non-negative. [`Method::Joint`] looks for exactly that, over all channels and
//! all photographs at once; [`Method::Links`] looks for it as links between blocks
//! of cells, which takes less time for many cells; [`Method::Direct`] is the method
//! of Chu, Ng, Pahwa, Quek, Huang, *Compressive Inverse Light Transport* (BMVC
//! 2011), for comparison.
//!
//! ```text
//! observed, prepare     what is solved from, checked and scaled
//! observability         which cells can be solved for
//! blur                  where a projector out of focus throws its light
//! haar                  the sparse basis, sixteen images at a time
//! joint                 lambda, scales of the channels, solve, gains, deviations
//!   admm                the iteration, over data_term, row_block and column_block
//! links                 the same answer from blocks of a quadtree, for many cells
//! group                 processes that share the work of links
//! interreflection       the operator that is found, dense or as links
//! by_rows               the paper's method and others, over basis_pursuit
//! forward, held_out     light from an inverse; the photographs it is judged by
//! clipped_projection    what clipping makes of natural images
//! flux                  what of a gain is the projector's, where reciprocity tells
//! deblur                undoes the projector's blur as well
//! overlap               several projectors whose light meets on one place
//! restricted_isometry   whether the paper's theorem promises anything here
//! gain_only             what it is judged against, and what remains if it loses
//! ```
//!
//! # Cost
//!
//! An iteration of [`Method::Joint`] takes `O(N^2 min(N, m))` multiplications for
//! `N` cells and `m` photographs, memory grows as `N^2 + N m`. [`Method::Links`] and what
//! follows it work with links and never with all `N^2` elements, but for a projector out of
//! focus and for light that hardly fades. `docs/measured.md` has measured
//! times and memory; `cargo bench -p iltm --bench solve` repeats them.

mod admm;
mod basis_pursuit;
mod blur;
mod by_rows;
mod clipped_projection;
mod column_block;
mod convergence;
mod data_term;
mod deblur;
mod error;
mod flux;
mod forward;
mod gain_only;
mod group;
mod haar;
mod held_out;
mod interreflection;
mod joint;
mod links;
mod natural_images;
mod observability;
mod observed;
mod options;
mod overlap;
mod prepare;
mod report;
pub mod restricted_isometry;
mod row_block;
mod solution;
#[cfg(test)]
mod test_linear_program;
#[cfg(test)]
mod test_reference;
#[cfg(test)]
#[allow(missing_docs, unreachable_pub)]
mod test_scene;
#[cfg(test)]
mod tests;

pub use blur::blur;
pub use by_rows::inverted;
pub use convergence::Convergence;
pub use error::SolveError;
pub use flux::Flux;
pub use forward::Inverse;
pub use gain_only::gain_only;
pub use group::{Group, Processes};
pub use haar::Haar;
pub use interreflection::{Coefficient, Interreflection};
pub use links::Links;
pub use natural_images::{
    DARKEST_SHOWN, DARKEST_WANTED, IMAGES, SUPERSAMPLING, fine_natural_images, natural_images,
    wanted_images,
};
pub use observability::{LeftOut, WhyLeftOut};
pub use observed::{CellNoise, Observed, ObservedChannel};
pub use options::{GainOnly, Method, SolveOptions, UnknownMethod};
pub use overlap::solve_several;
pub use report::{
    Clipped, Compensation, LambdaTrial, PhotographCounts, Prediction, Seconds, SolveReport,
};
pub use restricted_isometry::Recovery;
pub use solution::{ChannelInverse, InverseTransport, Solved, Trial};

use clipped_projection::ClippedProjection;
use convergence::Stop;
use deblur::{Deblurred, deblur};
use held_out::{Judged, Split, predict};
use iltm_capture::{Measurements, Role};
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use joint::Solver;
use links::{How, Splits, links};
use options::{MANY_CELLS, MOST_INVERTED_CELLS};
use prepare::Prepared;
use solution::{Candidate, Solution, drop_dead};
use std::time::Instant;

/// A solve that ends with a residual above this is no answer.
const HOPELESS: f64 = 0.05;
/// A predicted error above this means that patterns and photographs do not belong
/// together: random patterns that have nothing to do with the light are off by
/// 0.5 to 0.7.
const UNPREDICTABLE: f64 = 0.4;
/// Predicted error up to which no other method is tried.
const GOOD: f64 = 0.01;
/// Another method's predicted error, relative to the first one's, from which it is taken.
const BETTER: f64 = 0.8;
/// Predicted error with rows of each channel's own, relative to that without, from which they are
/// taken: they make a table larger and its frames slower.
const MUCH_BETTER: f64 = 0.9;
/// Photographs below which no scene of more cells can be told.
const LEAST_PHOTOGRAPHS: usize = 8;

/// Solves `measurements` for the inverse light transport.
///
/// The same measurements and options give the same bits, whatever the number of
/// threads.
///
/// # Errors
/// [`SolveError`] if the measurements are inconsistent, not finite or too few,
/// if the iteration does not come near an answer, or if the answer cannot be the
/// inverse of a real scene.
pub fn solve(
    measurements: &Measurements,
    options: &SolveOptions,
    progress: &dyn Progress,
) -> Result<Solved, SolveError> {
    solve_judged(&measurements.into(), options, progress)
}

/// [`solve`] for observations that are not from photographs.
///
/// # Errors
/// Those of [`solve`].
pub fn solve_observed(
    observed: &Observed<'_>,
    options: &SolveOptions,
    progress: &dyn Progress,
) -> Result<(InverseTransport, SolveReport), SolveError> {
    let solved = solve_judged(observed, options, progress)?;
    Ok((solved.inverse, solved.report))
}

fn solve_judged(
    observed: &Observed<'_>,
    options: &SolveOptions,
    progress: &dyn Progress,
) -> Result<Solved, SolveError> {
    let mut clock = Clock::new();
    options.check()?;
    let prepared = Prepared::new(observed)?;
    let method = options.method_for(prepared.live_cells(), prepared.roles.len());
    check_count(&prepared, method)?;
    let haar = Haar::new(observed.grid);
    let splits = Split::all(&prepared);
    let mut seconds = Seconds {
        prepare: clock.lap(),
        ..Seconds::default()
    };
    let stop = Stop {
        tolerance: options.tolerance,
        iterations: options.iterations,
    };
    let task = Task {
        prepared: &prepared,
        haar: &haar,
        grid: observed.grid,
        splits: &splits,
        stop,
        processes: options.processes,
        progress,
    };
    let outcome = match method {
        Method::Joint => {
            let joint = task.joint(options.lambda, &mut seconds, &mut clock);
            let chosen = if options.may_choose(prepared.live_cells()) {
                task.or_links(joint, &mut seconds, &mut clock)
            } else {
                joint
            };
            task.or_two_stage(chosen, &mut seconds, &mut clock)
        }
        Method::Links => {
            let links = task.links(&mut seconds, &mut clock)?;
            task.or_two_stage(links, &mut seconds, &mut clock)
        }
        other => task.by_rows(other, &mut seconds, &mut clock)?,
    };
    let candidates = outcome.solution.candidates(&prepared.live);
    check_answer(&outcome.solution, &candidates, &prepared, options)?;
    let condition = |candidate: &Candidate| candidate.inverse.condition(&prepared.live);
    let condition = candidates.iter().map(condition).fold(1.0, f64::max);
    let prediction = predict(&prepared, &outcome.judged);
    check_prediction(&prediction)?;
    let (clipped, deblurred) = clip(observed.grid, &prepared, &candidates, &prediction);
    seconds.finish = clock.lap();
    let recovery = recovery(&prepared, &haar, &candidates);
    seconds.recovery = clock.lap();
    let report = SolveReport {
        method: outcome.method,
        photographs: count(&prepared, outcome.method, &splits),
        left_out: prepared.left_out.clone(),
        live_cells: prepared.live_cells(),
        cells: prepared.shown_cells(),
        lambda: outcome.lambda,
        lambda_path: outcome.trials,
        convergence: outcome.solution.convergence,
        iterations: outcome.iterations,
        coefficients: outcome.solution.coefficients,
        condition,
        compensation: prediction.best(clipped),
        prediction,
        clipped,
        recovery,
        seconds,
    };
    let trial = |judged: Judged<'_>| judged.trial(observed, &prepared);
    Ok(Solved {
        trials: outcome.judged.into_iter().map(trial).collect(),
        inverse: outcome
            .solution
            .in_camera_units(observed, &prepared, deblurred.map(|s| s.parts)),
        report,
    })
}

/// What clipping makes of natural images, and the inverse that undoes the projector's blur
/// as well where there is one.
fn clip(
    grid: Grid,
    prepared: &Prepared,
    candidates: &[Candidate],
    prediction: &Prediction,
) -> (Clipped, Option<Deblurred>) {
    let blur = prepared.blur.clone().map(|mut blur| {
        drop_dead(&mut blur, &prepared.live);
        blur
    });
    let content = ClippedProjection::new(grid, prepared, candidates, blur.as_ref());
    let deblurred = blur
        .as_ref()
        .and_then(|blur| deblur(blur, &prepared.live, candidates, &content));
    let with_operator = deblurred.as_ref().map_or_else(
        || {
            let inverses: Vec<_> = candidates.iter().map(|c| &c.inverse).collect();
            content.operator(&inverses).0
        },
        |deblurred| deblurred.error,
    );
    let clipped = Clipped {
        uncompensated: content.nothing(),
        gain_only: content.gain_only(prediction),
        compensated: with_operator,
    };
    (clipped, deblurred)
}

/// What all methods need.
struct Task<'t> {
    prepared: &'t Prepared,
    haar: &'t Haar,
    grid: Grid,
    splits: &'t [Split],
    stop: Stop,
    processes: Processes,
    progress: &'t dyn Progress,
}

/// What a method returns beside its answer.
struct Outcome<'t> {
    method: Method,
    solution: Solution,
    lambda: f64,
    trials: Vec<LambdaTrial>,
    iterations: u32,
    /// Inverses that have not seen the held-out photographs.
    judged: Vec<Judged<'t>>,
}

impl<'t> Task<'t> {
    fn joint(&self, lambda: Option<f64>, seconds: &mut Seconds, clock: &mut Clock) -> Outcome<'t> {
        let mut solver = Solver::new(self.prepared, self.haar, self.stop);
        let choice = solver.choose(self.splits, lambda, self.progress);
        seconds.choose = clock.lap();
        let lambda = choice.lambda;
        let solution = solver.solve(lambda, self.progress);
        seconds.solve = clock.lap();
        let iterations = solver.iterations();
        Outcome {
            method: Method::Joint,
            solution,
            lambda,
            trials: choice.trials,
            iterations,
            judged: choice.judged,
        }
    }

    /// Links with the splits by which the held-out photographs are predicted best, and with rows of
    /// each channel's own only where those predict them much better. Of many cells splits are always
    /// few: more only made the errors larger there, and take longer.
    fn links(&self, seconds: &mut Seconds, clock: &mut Clock) -> Result<Outcome<'t>, SolveError> {
        let solve = |how| {
            let (prepared, grid, processes) = (self.prepared, self.grid, self.processes);
            move |chosen: &[usize]| {
                let progress = self.progress;
                Ok(links(prepared, grid, chosen, how, processes, progress))
            }
        };
        let tried: &[Splits] = if self.prepared.live_cells() < MANY_CELLS {
            &[Splits::Few, Splits::Many]
        } else {
            &[Splits::Few]
        };
        let error = |tried: &Tried<'_>| predict(self.prepared, &tried.judged).compensated;
        let mut best: Option<(f64, How, Tried<'t>)> = None;
        for splits in tried {
            let how = |own_rows| How {
                splits: *splits,
                own_rows,
            };
            let mut found = self.judge(Method::Links, solve(how(true)))?;
            let errors: Vec<f64> = found.iter().map(error).collect();
            let own_rows = matches!(errors[..], [shared, own] if own < MUCH_BETTER * shared);
            let chosen = usize::from(own_rows);
            if best
                .as_ref()
                .is_none_or(|(least, ..)| errors[chosen] < *least)
            {
                best = Some((errors[chosen], how(own_rows), found.swap_remove(chosen)));
            }
        }
        let (_, how, tried) = best.expect("one at least is tried");
        seconds.choose = clock.lap();
        let outcome = self.finish(Method::Links, tried, solve(how));
        seconds.solve = clock.lap();
        outcome
    }

    /// The answer by links where held-out photographs say that it errs less.
    fn or_links(
        &self,
        joint: Outcome<'t>,
        seconds: &mut Seconds,
        clock: &mut Clock,
    ) -> Outcome<'t> {
        let links = seconds.and_those_of(|seconds| self.links(seconds, clock));
        let error = |outcome: &Outcome<'_>| predict(self.prepared, &outcome.judged).compensated;
        match links {
            Ok(links) if self.is_sound(&links) && error(&links) < error(&joint) => links,
            _ => joint,
        }
    }

    /// Whether an answer has converged and can be the inverse of a real scene.
    fn is_sound(&self, outcome: &Outcome<'_>) -> bool {
        let live = &self.prepared.live;
        let candidates = outcome.solution.candidates(live);
        let near = outcome.solution.convergence.residual() <= HOPELESS;
        near && candidates.iter().all(|c| c.inverse.flaw(live).is_none())
    }

    /// The two-stage answer where held-out photographs say that the first one errs and that the
    /// other errs less: where cells differ much in light, or each lights several places, `K`
    /// is not smooth, and the transport itself is easier to find.
    fn or_two_stage(
        &self,
        first: Outcome<'t>,
        seconds: &mut Seconds,
        clock: &mut Clock,
    ) -> Outcome<'t> {
        let error = predict(self.prepared, &first.judged).compensated;
        // Written so that what is not a number asks for another answer.
        let good = error <= GOOD;
        // Few photographs are held out in turns, which takes as many solves; and to invert the
        // transport of more cells takes minutes.
        if good || self.splits.len() > 1 || self.prepared.live_cells() > MOST_INVERTED_CELLS {
            return first;
        }
        let other = seconds.and_those_of(|seconds| self.by_rows(Method::TwoStage, seconds, clock));
        match other {
            Ok(other) if self.is_sound(&other) => {
                let instead = predict(self.prepared, &other.judged).compensated;
                if instead < BETTER * error {
                    other
                } else {
                    first
                }
            }
            _ => first,
        }
    }

    /// Any method that takes each row for itself.
    fn by_rows(
        &self,
        method: Method,
        seconds: &mut Seconds,
        clock: &mut Clock,
    ) -> Result<Outcome<'t>, SolveError> {
        let solve = |chosen: &[usize]| {
            let (prepared, haar, stop) = (self.prepared, self.haar, self.stop);
            let found = match method {
                Method::TwoStage => by_rows::two_stage(prepared, haar, chosen, stop, self.progress),
                Method::BruteForce => by_rows::brute_force(prepared, chosen),
                Method::Direct | Method::Joint | Method::Links => {
                    Ok(by_rows::direct(prepared, haar, chosen, stop, self.progress))
                }
            };
            Ok(vec![found?])
        };
        let tried = self.judge(method, solve)?.pop().unwrap_or_default();
        seconds.choose = clock.lap();
        let outcome = self.finish(method, tried, solve);
        seconds.solve = clock.lap();
        outcome
    }

    /// What `solve` finds without the held-out photographs of each split: one or several answers.
    fn judge(
        &self,
        method: Method,
        solve: impl Fn(&[usize]) -> Result<Vec<Solution>, SolveError>,
    ) -> Result<Vec<Tried<'t>>, SolveError> {
        let usable = self.prepared.with_role(|role| uses(method, role));
        let mut tried: Vec<Tried<'t>> = Vec::new();
        for split in self.splits {
            let kept = |k: &usize| !split.held_out.contains(k);
            let chosen: Vec<usize> = usable.iter().copied().filter(kept).collect();
            self.progress
                .begin("solving without the held-out photographs", 0);
            let found = solve(&chosen)?;
            self.progress.end();
            tried.resize_with(found.len(), Tried::default);
            for (tried, found) in tried.iter_mut().zip(found) {
                tried.iterations += found.convergence.iterations;
                let judged = Judged::new(split, found, &self.prepared.live);
                tried.judged.push(judged);
            }
        }
        Ok(tried)
    }

    /// What `solve` finds of all photographs: the last of its answers.
    fn finish(
        &self,
        method: Method,
        tried: Tried<'t>,
        solve: impl Fn(&[usize]) -> Result<Vec<Solution>, SolveError>,
    ) -> Result<Outcome<'t>, SolveError> {
        self.progress.begin("solving", 0);
        let mut found = solve(&self.prepared.with_role(|role| uses(method, role)))?;
        self.progress.end();
        let solution = found.pop().expect("one answer at least");
        Ok(Outcome {
            method,
            lambda: 0.0,
            trials: Vec::new(),
            iterations: tried.iterations + solution.convergence.iterations,
            judged: tried.judged,
            solution,
        })
    }
}

/// Inverses that have not seen the held-out photographs, and the iterations that they took.
#[derive(Default)]
struct Tried<'t> {
    judged: Vec<Judged<'t>>,
    iterations: u32,
}

/// Whether a method uses a photograph.
fn uses(method: Method, role: Role) -> bool {
    match method {
        Method::Joint | Method::Links | Method::BruteForce => true,
        // As the paper does.
        Method::Direct | Method::TwoStage => role == Role::White || role.is_content(),
    }
}

fn check_count(prepared: &Prepared, method: Method) -> Result<(), SolveError> {
    let given = prepared.with_role(|role| uses(method, role)).len();
    // One cell needs a second photograph too: the first one's judge.
    let least = (prepared.live_cells() + 1).min(LEAST_PHOTOGRAPHS);
    if given < least {
        return Err(SolveError::TooFewPhotographs {
            method,
            given,
            least,
        });
    }
    Ok(())
}

fn check_answer(
    solution: &Solution,
    candidates: &[Candidate],
    prepared: &Prepared,
    options: &SolveOptions,
) -> Result<(), SolveError> {
    let residual = solution.convergence.residual();
    // Written so that a residual that is not a number is refused too.
    let near = residual <= HOPELESS.max(options.tolerance);
    if !near {
        return Err(SolveError::DidNotConverge {
            iterations: solution.convergence.iterations,
            residual,
            tolerance: options.tolerance,
        });
    }
    for (channel, candidate) in candidates.iter().enumerate() {
        if let Some(why) = candidate.inverse.flaw(&prepared.live) {
            return Err(SolveError::NotPhysical { channel, why });
        }
    }
    Ok(())
}

/// Refuses photographs that do not follow from their patterns.
fn check_prediction(prediction: &Prediction) -> Result<(), SolveError> {
    let least = prediction.compensated.min(prediction.gain_only);
    // Written so that what is not a number is refused too.
    let usable = least <= UNPREDICTABLE;
    if usable {
        return Ok(());
    }
    Err(SolveError::Unpredictable {
        percent: 100.0 * least,
        limit: 100.0 * UNPREDICTABLE,
    })
}

/// What the paper's theorem says of its method on these photographs; `None` without a
/// photograph of white, or if the inverse has no transport.
fn recovery(prepared: &Prepared, haar: &Haar, candidates: &[Candidate]) -> Option<Recovery> {
    let white = *prepared.with_role(|role| role == Role::White).first()?;
    // The theorem is one of random patterns, which are the same in all channels.
    let chosen = prepared.with_role(|role| matches!(role, Role::White | Role::Bernoulli));
    if chosen.len() == 1 {
        return None;
    }
    let patterns = prepared.patterns[0].select_columns(&chosen);
    let inverses: Vec<&Inverse> = candidates.iter().map(|c| &c.inverse).collect();
    let flood = prepared.patterns[0].column(white).into_owned();
    restricted_isometry::of_direct(&inverses, haar, &patterns, &flood)
}

fn count(prepared: &Prepared, method: Method, splits: &[Split]) -> PhotographCounts {
    let gray = |role| matches!(role, Role::Column { .. } | Role::Row { .. });
    PhotographCounts {
        white: prepared.with_role(|role| role == Role::White).len(),
        gray_code: prepared
            .with_role(|role| gray(role) && uses(method, role))
            .len(),
        bernoulli: prepared.with_role(|role| role == Role::Bernoulli).len(),
        images: prepared.with_role(|role| role == Role::Image).len(),
        held_out: splits.iter().map(|split| split.held_out.len()).sum(),
    }
}

/// Seconds between laps.
struct Clock(Instant);

impl Clock {
    fn new() -> Self {
        Self(Instant::now())
    }

    fn lap(&mut self) -> f64 {
        let seconds = self.0.elapsed().as_secs_f64();
        self.0 = Instant::now();
        seconds
    }
}
