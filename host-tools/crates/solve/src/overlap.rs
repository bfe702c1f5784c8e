//! Overlap of projectors: light that several of them throw on one place.
//!
//! A cell's row of the inverse says what light its own projector must throw on the place that the
//! cell lights: `g c - K c`. Where another projector shows on that place as well, the row gives
//! the light of both: of the own one, and `b` of each cell `j` of the other that lights it,
//! relative to white of the own. So the right side of the row is `p + sum_j b_j p_j`, and the
//! solve is that of one projector. First `b` is found from the cell's light alone, as how strongly
//! it follows each of these cells; then, as bounces are known better, from what the rows give.

use super::forward::scale_rows;
use super::links;
use super::prepare::Prepared;
use super::solution::Channel;
use super::{SolveError, SolveOptions, Solved, solve};
use iltm_capture::{OneOfSeveral, SeveralCaptures};
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use nalgebra::{Cholesky, DMatrix, DVector};
use std::ops::Range;

/// Times that the overlap is found from rows: more changed an error of .0111 by .0002.
const ROUNDS: usize = 3;

/// Part of the mean diagonal that keeps a fit from following noise.
const RIDGE: f64 = 1e-6;

/// Solves the captures of several projectors for the inverse of the wide frame. Where they overlap,
/// each row gives the light of all together; shares divide it.
///
/// # Errors
/// Those of [`solve`].
pub fn solve_several(
    several: &mut SeveralCaptures,
    options: &SolveOptions,
    progress: &dyn Progress,
) -> Result<Solved, SolveError> {
    if !several.is_overlapping() {
        return solve(&several.all, options, progress);
    }
    let overlapping = overlapping(several);
    for channel in 0..several.all.channels.len() {
        by_light(several, &overlapping, channel);
    }
    for _ in 0..ROUNDS {
        let given = given_by_rows(several, &overlapping, options, progress)?;
        for (channel, given) in given.iter().enumerate() {
            by_rows(several, &overlapping, (channel, given));
        }
    }
    solve(&several.all, options, progress)
}

/// What the rows of the cells that others light give in all photographs, by channel; other rows
/// mean nothing.
fn given_by_rows(
    several: &SeveralCaptures,
    overlapping: &[Overlapping],
    options: &SolveOptions,
    progress: &dyn Progress,
) -> Result<Vec<DMatrix<f64>>, SolveError> {
    let prepared = Prepared::new(&(&several.all).into())?;
    let cells: Vec<usize> = overlapping.iter().map(|of| of.cell).collect();
    let (grid, processes) = (several.all.grid, options.processes);
    progress.begin("finding what each projector throws where they overlap", 0);
    let rows = links::rows_of_cells(&cells, &prepared, grid, processes, progress);
    progress.end();
    let all = prepared.with_role(|_| true);
    let of_channel = |(index, channel): (usize, &Channel)| {
        let bounced = &(&rows.shared * channel.scale) * &prepared.sources(index, &all);
        let mut given = prepared.light[index].clone();
        scale_rows(&mut given, &channel.gain);
        given - bounced
    };
    let channels = rows.channels.iter().enumerate();
    Ok(channels.map(of_channel).collect())
}

/// A cell that others light too.
struct Overlapping {
    cell: usize,
    /// By projector that is not its own, the cells.
    others: Vec<(usize, Vec<usize>)>,
}

fn overlapping(several: &SeveralCaptures) -> Vec<Overlapping> {
    let projectors = 0..several.projectors.len();
    let of_cell = |(cell, all): (usize, &Vec<usize>)| {
        let of = |projector: usize| {
            let cells = all.iter().copied();
            let cells = cells.filter(|other| several.projector_of(*other) == Some(projector));
            (projector, cells.collect::<Vec<_>>())
        };
        let others = projectors.clone().map(of);
        let others: Vec<_> = others.filter(|(_, cells)| !cells.is_empty()).collect();
        let live = several.all.live[cell] && !others.is_empty();
        live.then_some(Overlapping { cell, others })
    };
    let cells = several.overlaps.iter().enumerate();
    cells.filter_map(of_cell).collect()
}

/// Sets the right sides of one channel by the light of the cells.
fn by_light(several: &mut SeveralCaptures, overlapping: &[Overlapping], channel: usize) {
    let measured = &several.all.channels[channel];
    let (patterns, light) = (&measured.patterns, &measured.observations);
    // What bounces follows how much of the picture is lit.
    let lit = patterns.row_sum_tr() / patterns.nrows() as f64;
    let follows = |cell: usize, of: &OneOfSeveral, cells: &[usize]| {
        let views = of.views.clone();
        let mut columns = rows(patterns, cells, &views);
        columns.push(lit.rows_range(views.clone()).into_owned());
        fit(&columns, &row(light, cell, &views))
    };
    let mut found = Vec::new();
    for &Overlapping { cell, ref others } in overlapping {
        let Some(own) = several.projector_of(cell) else {
            continue;
        };
        let own = &several.projectors[own];
        let near = around(several.all.grid, own, cell);
        // Cells beside it light some of its pixels as well.
        let direct: f64 = follows(cell, own, &near)[..near.len()].iter().sum();
        for &(projector, ref cells) in others {
            let of = follows(cell, &several.projectors[projector], cells);
            let parts = of.iter().zip(cells);
            let parts: Vec<_> = parts
                .map(|(part, other)| (*other, relative(*part, direct)))
                .collect();
            found.push((cell, projector, parts));
        }
    }
    set(several, channel, &found);
}

/// Sets the right sides of one channel by what the rows of an inverse give.
fn by_rows(
    several: &mut SeveralCaptures,
    overlapping: &[Overlapping],
    (channel, given): (usize, &DMatrix<f64>),
) {
    let measured = &several.all.channels[channel];
    let mut found = Vec::new();
    for &Overlapping { cell, ref others } in overlapping {
        for &(projector, ref cells) in others {
            let views = several.projectors[projector].views.clone();
            let columns = rows(&measured.patterns, cells, &views);
            let before = row(&measured.patterns, cell, &views);
            // The rows follow half of a change, so that twice the difference is nearly all of it.
            let of = fit(&columns, &(2.0 * row(given, cell, &views) - before));
            let parts = of.iter().zip(cells);
            let parts: Vec<_> = parts.map(|(part, other)| (*other, part.max(0.0))).collect();
            found.push((cell, projector, parts));
        }
    }
    set(several, channel, &found);
}

/// A cell's row of a matrix in some views.
fn row(of: &DMatrix<f64>, cell: usize, views: &Range<usize>) -> DVector<f64> {
    of.row(cell).columns_range(views.clone()).transpose()
}

fn rows(of: &DMatrix<f64>, cells: &[usize], views: &Range<usize>) -> Vec<DVector<f64>> {
    cells.iter().map(|cell| row(of, *cell, views)).collect()
}

/// Light of another projector relative to that of a cell's own; 0 where its own is not seen.
fn relative(light: f64, own: f64) -> f64 {
    if own > 0.0 {
        (light / own).max(0.0)
    } else {
        0.0
    }
}

/// What a cell gets from each of some cells of another projector, which comes second.
type Found = (usize, usize, Vec<(usize, f64)>);

/// Sets the right sides of the cells, in the photographs of other projectors. Own patterns of
/// others stay: they are read from the views in which their own projector shows.
fn set(several: &mut SeveralCaptures, channel: usize, found: &[Found]) {
    let patterns = &mut several.all.channels[channel].patterns;
    for (cell, projector, parts) in found {
        for view in several.projectors[*projector].views.clone() {
            let light = parts
                .iter()
                .map(|(other, part)| part * patterns[(*other, view)]);
            patterns[(*cell, view)] = light.sum();
        }
    }
}

/// A cell of a projector and those around it, by the wide frame.
fn around(grid: Grid, own: &OneOfSeveral, cell: usize) -> Vec<usize> {
    let (row, col) = (cell / grid.cols(), cell % grid.cols());
    let mut cells = vec![cell];
    for row in row.saturating_sub(1)..(row + 2).min(grid.rows()) {
        for col in col.saturating_sub(1)..col + 2 {
            let other = row * grid.cols() + col;
            if own.part.own(grid.cols(), other).is_some() && other != cell {
                cells.push(other);
            }
        }
    }
    cells
}

/// Factors of the columns that come nearest to a target, by least squares; zeros where they do not
/// tell.
fn fit(columns: &[DVector<f64>], target: &DVector<f64>) -> Vec<f64> {
    let columns = DMatrix::from_columns(columns);
    let mut normal = columns.tr_mul(&columns);
    let ridge = RIDGE * normal.trace() / normal.nrows() as f64;
    for at in 0..normal.nrows() {
        normal[(at, at)] += ridge;
    }
    let right = columns.tr_mul(target);
    Cholesky::new(normal).map_or_else(
        || vec![0.0; right.len()],
        |factors| factors.solve(&right).iter().copied().collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_finds_the_factors_and_none_of_what_is_not_there() {
        let mut random = fastrand::Rng::with_seed(4);
        let column = |random: &mut fastrand::Rng| {
            DVector::from_fn(60, |_, _| f64::from(u8::from(random.bool())))
        };
        let columns = [
            column(&mut random),
            column(&mut random),
            column(&mut random),
        ];
        let target = 0.7 * &columns[0] + 0.2 * &columns[2];
        let found = fit(&columns, &target);
        for (found, expected) in found.iter().zip([0.7, 0.0, 0.2]) {
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
        assert!(relative(0.4, 0.0).max(relative(-0.1, 1.0)) <= 0.0);
        let dark = [DVector::zeros(5)];
        assert_eq!(fit(&dark, &DVector::from_element(5, 1.0)), [0.0]);
    }
}
