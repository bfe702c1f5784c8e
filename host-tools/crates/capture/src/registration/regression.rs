//! Regression: how much light each cell sends straight to a camera pixel.
//!
//! A pixel's series over all photographs is regressed on the 3 x 3 cells around
//! its cell, a constant and the lit share of the pattern. The normal equations
//! depend on the cell only, so each is inverted once for all of its pixels, and
//! the photographs pass by one at a time.

use super::cell_map::{Candidate, NO_CELL, cell_beside};
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::photographs::Photographs;
use crate::photographs::photo::Photo;
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use nalgebra::SMatrix;
use rayon::prelude::*;

/// Moves to a neighbouring cell that a pixel may make after the Gray code.
const ROUNDS: usize = 2;

/// Cells of the neighbourhood, the constant and the lit share.
const UNKNOWNS: usize = 11;

/// Room for [`UNKNOWNS`] that fills whole vector registers.
const LANES: usize = 12;

/// Pixels that one thread works on at a time.
const CHUNK: usize = 2048;

/// Fits the neighbourhood of every candidate, moves it to the cell with the
/// largest weights and fits again, until it stays or [`ROUNDS`] are over.
pub(crate) fn regress(
    sequence: &Sequence,
    photographs: &mut Photographs<'_>,
    candidates: &mut [Candidate],
    progress: &dyn Progress,
) -> Result<(), CaptureError> {
    let fit = Fit::new(sequence);
    let mut restless: Vec<usize> = (0..candidates.len()).collect();
    for round in 0..=ROUNDS {
        let at: Vec<(u32, u32)> = restless
            .iter()
            .map(|&c| (candidates[c].pixel, candidates[c].cell))
            .collect();
        let weights = fit.weights(photographs, &at, progress)?;
        let mut moved = Vec::new();
        for (&c, &weights) in restless.iter().zip(&weights) {
            let candidate = &mut candidates[c];
            candidate.weights = weights;
            let (rows, cols) = axis_sums(&weights);
            let place = largest(rows) * 3 + largest(cols);
            let cell = fit.neighbours[candidate.cell as usize][place];
            if round < ROUNDS && cell != NO_CELL && cell != candidate.cell {
                candidate.cell = cell;
                moved.push(c);
            }
        }
        if moved.is_empty() {
            break;
        }
        restless = moved;
    }
    Ok(())
}

/// Sums of the 3 x 3 weights over columns (one a row) and over rows.
pub(crate) fn axis_sums(w: &[f32; 9]) -> ([f32; 3], [f32; 3]) {
    let row = |r: usize| w[3 * r] + w[3 * r + 1] + w[3 * r + 2];
    let col = |c: usize| w[c] + w[3 + c] + w[6 + c];
    ([row(0), row(1), row(2)], [col(0), col(1), col(2)])
}

/// Place of the largest of three; the middle one where it is among them.
fn largest(w: [f32; 3]) -> usize {
    if w[1] >= w[0] && w[1] >= w[2] {
        1
    } else if w[0] > w[2] {
        0
    } else {
        2
    }
}

/// The regression of one capture: what depends on cells and patterns only.
///
/// Lit cells count as 1/2 and dark ones as -1/2. The weights are the same as with
/// 1 and 0 (the constant takes the difference), and the normal equations are so
/// well conditioned that sums in `f32` are enough.
struct Fit {
    /// Cells around each cell, row by row; [`NO_CELL`] beyond the grid.
    neighbours: Vec<[u32; 9]>,
    /// The photographs, other than black.
    shots: Vec<usize>,
    /// For each of them and each cell, which of the nine cells are lit.
    lit: Vec<Vec<u16>>,
    /// For each of them, the lit share of all cells.
    share: Vec<f32>,
    /// Inverse of each cell's normal equations.
    inverse: Vec<SMatrix<f32, UNKNOWNS, UNKNOWNS>>,
}

impl Fit {
    fn new(sequence: &Sequence) -> Self {
        let grid = sequence.grid;
        let neighbours: Vec<[u32; 9]> = (0..grid.cells()).map(|c| neighbours(grid, c)).collect();
        let shown: Vec<(usize, &[bool])> = sequence
            .views
            .iter()
            .flat_map(|view| view.shots.iter().map(|&shot| (shot, view.lit.as_slice())))
            .collect();
        let lit: Vec<Vec<u16>> = shown
            .par_iter()
            .map(|(_, lit)| neighbours.iter().map(|cells| mask(lit, cells)).collect())
            .collect();
        let share: Vec<f32> = shown
            .iter()
            .map(|(_, lit)| lit.iter().filter(|&&lit| lit).count() as f32 / lit.len() as f32)
            .collect();
        let inverse = neighbours
            .par_iter()
            .enumerate()
            .map(|(cell, around)| inverse(around, lit.iter().map(|lit| lit[cell]).zip(&share)))
            .collect();
        Self {
            neighbours,
            shots: shown.into_iter().map(|(shot, _)| shot).collect(),
            lit,
            share,
            inverse,
        }
    }

    /// Weights of the 3 x 3 cells around each `(pixel, cell)`.
    fn weights(
        &self,
        photographs: &mut Photographs<'_>,
        at: &[(u32, u32)],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 9]>, CaptureError> {
        let mut sums = vec![[0.0_f32; LANES]; at.len()];
        let mut seen = 0;
        photographs.for_batches(&self.shots, progress, |photos| {
            let batch = seen..seen + photos.len();
            seen = batch.end;
            let shown: Vec<Shown<'_>> = (photos.iter().zip(batch))
                .map(|((_, photo), at)| Shown {
                    photo,
                    lit: &self.lit[at],
                    regressors: regressors(self.share[at]),
                })
                .collect();
            sums.par_chunks_mut(CHUNK)
                .zip(at.par_chunks(CHUNK))
                .for_each(|(sums, at)| {
                    for shown in &shown {
                        shown.correlate(sums, at);
                    }
                });
        })?;
        let solve = |(sums, &(_, cell)): (&[f32; LANES], &(u32, u32))| {
            let right = SMatrix::<f32, UNKNOWNS, 1>::from_column_slice(&sums[..UNKNOWNS]);
            let weights = self.inverse[cell as usize] * right;
            std::array::from_fn(|k| weights[k])
        };
        Ok(sums.iter().zip(at).map(solve).collect())
    }
}

/// Cells around a cell, row by row, itself in the middle.
fn neighbours(grid: Grid, cell: usize) -> [u32; 9] {
    std::array::from_fn(|k| {
        let beside = cell_beside(grid, cell, k as isize / 3 - 1, k as isize % 3 - 1);
        beside.map_or(NO_CELL, |beside| beside as u32)
    })
}

/// Which of nine cells are lit, one bit each; a cell beyond the grid is not.
fn mask(lit: &[bool], cells: &[u32; 9]) -> u16 {
    (0..9).fold(0, |mask, bit| {
        mask | u16::from(lit.get(cells[bit] as usize) == Some(&true)) << bit
    })
}

/// One row of the regression: the nine cells, the constant, the lit share and
/// padding.
fn regressor(mask: u16, share: f32) -> [f32; LANES] {
    std::array::from_fn(|k| match k {
        0..9 => f32::from(mask >> k & 1) - 0.5,
        9 => 1.0,
        10 => share - 0.5,
        _ => 0.0,
    })
}

/// The rows of one photograph for every mask of lit cells.
fn regressors(share: f32) -> Vec<[f32; LANES]> {
    (0..512).map(|mask| regressor(mask, share)).collect()
}

/// Inverse of the normal equations of one cell, given its neighbours and, for
/// each photograph, which of them are lit and the lit share.
fn inverse<'a>(
    around: &[u32; 9],
    shown: impl Iterator<Item = (u16, &'a f32)>,
) -> SMatrix<f32, UNKNOWNS, UNKNOWNS> {
    let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    for (mask, &share) in shown {
        let row = regressor(mask, share);
        for a in 0..UNKNOWNS {
            for b in 0..UNKNOWNS {
                normal[(a, b)] += f64::from(row[a]) * f64::from(row[b]);
            }
        }
    }
    let beyond = |k: &usize| around.get(*k) == Some(&NO_CELL);
    for k in (0..UNKNOWNS).filter(beyond) {
        normal.row_mut(k).fill(0.0);
        normal.column_mut(k).fill(0.0);
    }
    // Against the tens of photographs the ridge changes nothing, but it decides
    // where cells were always lit together, as with the Gray code alone.
    for k in 0..UNKNOWNS {
        normal[(k, k)] += 1e-2;
    }
    // Positive definite by the ridge; a zero inverse would only drop the pixels.
    let mut inverse = normal.cholesky().map(|c| c.inverse()).unwrap_or_default();
    for k in (0..UNKNOWNS).filter(beyond) {
        inverse[(k, k)] = 0.0;
    }
    inverse.cast()
}

/// One photograph and what was shown for it.
struct Shown<'a> {
    photo: &'a Photo,
    /// For each cell, which of its nine cells are lit.
    lit: &'a [u16],
    /// Rows of the regression by mask of lit cells.
    regressors: Vec<[f32; LANES]>,
}

impl Shown<'_> {
    /// Adds the photograph to the right-hand sides of the normal equations of
    /// each `(pixel, cell)`.
    fn correlate(&self, sums: &mut [[f32; LANES]], at: &[(u32, u32)]) {
        let planes = &self.photo.planes;
        for (sum, &(pixel, cell)) in sums.iter_mut().zip(at) {
            let light: f32 = planes.iter().map(|plane| plane[pixel as usize]).sum();
            let row = &self.regressors[usize::from(self.lit[cell as usize])];
            for (sum, regressor) in sum.iter_mut().zip(row) {
                *sum += light * regressor;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::sequence::Selection;
    use crate::test_capture::TestCapture;
    use crate::{CaptureOptions, Manifest};
    use iltm_picture::{Response, progress::Silent};

    #[test]
    fn weights_are_the_light_of_each_cell_and_wrong_cells_are_corrected() {
        let scene = TestCapture {
            noise: 0.0,
            ..TestCapture::default()
        };
        let folder = tempfile::tempdir().unwrap();
        scene.write(folder.path());
        let shots = Manifest::read(folder.path()).unwrap().shots;
        let chosen = Selection::new(folder.path(), &shots, &CaptureOptions::default()).unwrap();
        let sequence = Sequence::read(folder.path(), chosen).unwrap();
        let mut photographs =
            Photographs::new(folder.path(), &sequence.shots, &Response::Linear.into()).unwrap();
        let (width, height) = scene.camera();
        let own = |pixel: usize, cell: usize| {
            scene.overlap(pixel / width, cell / scene.cols)
                * scene.overlap(pixel % width, cell % scene.cols)
        };
        // Every pixel inside a cell, given to the cell one up and one right of it.
        let mut truth = Vec::new();
        let mut candidates = Vec::new();
        for pixel in 0..width * height {
            let cell = (0..30).find(|&cell| own(pixel, cell) > 0.999);
            let Some(cell) = cell.filter(|cell| cell / 6 > 0 && cell % 6 < 5) else {
                continue;
            };
            truth.push(cell as u32);
            candidates.push(Candidate::new(pixel as u32, cell as u32 - 5));
        }
        assert!(truth.len() >= 20 * 25);
        regress(&sequence, &mut photographs, &mut candidates, &Silent).unwrap();
        for (candidate, truth) in candidates.iter().zip(truth) {
            assert_eq!(candidate.cell, truth);
            for (k, &weight) in candidate.weights.iter().enumerate() {
                // Far light is the same from all cells, so the lit share takes it.
                let expected = if k == 4 {
                    scene.direct - scene.bounced
                } else {
                    0.0
                };
                let beyond = neighbours(scene.grid(), truth as usize)[k] == NO_CELL;
                let limit = if beyond { 1e-9 } else { 2e-3 };
                assert!(
                    (f64::from(weight) - expected).abs() < limit,
                    "{k}: {weight}"
                );
            }
        }
    }
}
