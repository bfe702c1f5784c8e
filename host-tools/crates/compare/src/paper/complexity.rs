//! Complexity: time against cells and photographs, and the exponents that fit it.

use super::scenes::{grid, panels};
use crate::acquisition::{patterns, solved};
use iltm_capture::columns;
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use iltm_solve::{CellNoise, Method, inverted};
use std::time::Instant;

/// Grids whose time is taken, with [`PHOTOGRAPHS`].
pub(super) const GRIDS: [(u16, u16); 6] =
    [(7, 11), (10, 14), (13, 21), (16, 26), (20, 32), (26, 42)];
/// Photographs at each grid.
pub(super) const PHOTOGRAPHS: usize = 150;
/// Photographs whose time is taken, on the paper's grid.
const COUNTS: [usize; 5] = [40, 80, 120, 170, 240];
/// Methods that are timed.
pub(super) const METHODS: [Method; 3] = [Method::Direct, Method::TwoStage, Method::Joint];
/// Each is timed so often, and the fastest counts: others disturb, none speed up.
const RUNS: usize = 3;

/// Time of one solve.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Timed {
    /// The method.
    pub(super) method: Method,
    /// Cells `N`.
    pub(super) cells: usize,
    /// Photographs `m`.
    pub(super) photographs: usize,
    /// Seconds of the solve itself, photographs held out not counted.
    pub(super) seconds: f64,
    /// Iterations that took; 1 for a method without any.
    pub(super) iterations: u32,
    /// Seconds of one exact inversion of the same size.
    pub(super) inversion: f64,
}

/// `seconds ~ N^a` and `seconds ~ m^b`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Exponents {
    /// The method.
    pub(super) method: Method,
    /// `a` of an iteration.
    pub(super) cells: f64,
    /// `b` of an iteration.
    pub(super) photographs: f64,
    /// `a` of a whole solve, iterations as many as it took.
    pub(super) cells_whole: f64,
}

/// Times everything.
#[must_use]
pub(super) fn run(progress: &dyn Progress) -> Vec<Timed> {
    let by_cells = GRIDS.map(|sides| (grid(sides), PHOTOGRAPHS));
    let by_photographs = COUNTS.map(|count| (grid((13, 21)), count));
    let work = [by_cells.as_slice(), &by_photographs].concat();
    progress.begin("timing the solvers", (work.len() * METHODS.len()) as u64);
    let mut timed = Vec::new();
    for (grid, photographs) in work {
        for method in METHODS {
            timed.extend(time(method, grid, photographs));
            progress.advance(1);
        }
    }
    progress.end();
    timed
}

fn time(method: Method, grid: Grid, photographs: usize) -> Option<Timed> {
    let scene = panels(grid);
    let transport = scene.transport();
    let taken = patterns(method, grid, photographs, 1);
    let (light, live) = (&transport * columns(&taken), scene.covered());
    let none = CellNoise {
        lit: 0.0,
        unlit: 0.0,
    };
    let mut best: Option<Timed> = None;
    for _ in 0..RUNS {
        let channel = (&light, vec![none; grid.cells()]);
        let (_, report) = solved(method, (grid, &live), &taken, channel).ok()?;
        let start = Instant::now();
        inverted(&transport, &live)?;
        let inversion = start.elapsed().as_secs_f64();
        let seconds = report.seconds.solve;
        let inversion = best.map_or(inversion, |best| best.inversion.min(inversion));
        let seconds = best.map_or(seconds, |best| best.seconds.min(seconds));
        best = Some(Timed {
            method,
            cells: grid.cells(),
            photographs: taken.len(),
            seconds,
            iterations: report.convergence.iterations.max(1),
            inversion,
        });
    }
    best
}

/// Fits the exponents of each method.
#[must_use]
pub(super) fn exponents(timed: &[Timed]) -> Vec<Exponents> {
    let of = |method: Method| {
        let own = || timed.iter().filter(move |timed| timed.method == method);
        let per_iteration = |timed: &Timed| timed.seconds / f64::from(timed.iterations);
        // Small grids end before the exponent shows.
        let grids = || own().filter(|t| t.photographs == PHOTOGRAPHS && t.cells >= 140);
        let counts = || own().filter(|t| t.cells == 13 * 21);
        Exponents {
            method,
            cells: slope(grids().map(|t| (t.cells as f64, per_iteration(t)))),
            photographs: slope(counts().map(|t| (t.photographs as f64, per_iteration(t)))),
            cells_whole: slope(grids().map(|t| (t.cells as f64, t.seconds))),
        }
    };
    METHODS.map(of).to_vec()
}

/// Exponent of the exact inversion alone.
#[must_use]
pub(super) fn inversion_exponent(timed: &[Timed]) -> f64 {
    let own = timed
        .iter()
        .filter(|t| t.method == METHODS[0] && t.cells >= 140);
    slope(own.map(|t| (t.cells as f64, t.inversion)))
}

/// Slope of a least-squares line through logarithms.
fn slope(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let points: Vec<(f64, f64)> = points.map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let both: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    both / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_is_the_exponent_of_a_power() {
        let points = [2.0_f64, 3.0, 7.0].map(|x| (x, 0.3 * x.powf(2.5)));
        assert!((slope(points.into_iter()) - 2.5).abs() < 1e-12);
    }
}
