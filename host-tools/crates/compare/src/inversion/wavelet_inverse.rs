//! Wavelet sparse approximate inverses.
//!
//! Least squares in a wavelet basis is Chan, Tang and Wan's; the pattern from the largest
//! elements is that of Chow, *A Priori Sparsity Patterns for Parallel Sparse Approximate
//! Inverse Preconditioners*, SIAM Journal on Scientific Computing 2000.

use super::live::{LiveTransport, finite};
use super::{Inversion, Inverted, KnownTransport};
use crate::rig::clear_dead;
use crate::{Citation, Description, Unfit};
use iltm_solve::Haar;
use nalgebra::{DMatrix, DVector};

/// The sparse matrix `M` in Haar that brings `T^ M` nearest to the identity, column by
/// column, with its pattern taken from the largest elements of `T^ = W^T T W`.
#[derive(Clone, Copy, Debug)]
pub struct WaveletInverse {
    /// Elements of the pattern for each cell, on average, beside the diagonal.
    pub entries: usize,
}

impl Inversion for WaveletInverse {
    fn description(&self) -> Description {
        Description {
            name: format!(
                "wavelet sparse approximate inverse, {} a cell",
                self.entries
            ),
            source: Citation {
                authors: "Chan, Tang, Wan; Chow (A Priori Sparsity Patterns, SISC 2000)",
                title: "Wavelet Sparse Approximate Inverse Preconditioners",
                venue: "BIT Numerical Mathematics",
                year: 1997,
            },
            how: "The transport is transformed to Haar; where its largest elements are, those of \
                the inverse are looked for, each column by least squares. Texture spreads elements \
                over all of the transform, so that it costs accuracy.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let haar = Haar::new(known.grid);
        let transformed = haar.analyse_operator(&filled(&known, &live));
        let patterns = patterns(&transformed, self.entries);
        let stored: usize = patterns.iter().map(Vec::len).sum();
        let sparse = fitted(&transformed, &patterns)?;
        let off = &transformed * &sparse - DMatrix::identity(sparse.nrows(), sparse.ncols());
        let mut inverse = haar.synthesise_operator(&sparse);
        clear_dead(&mut inverse, known.live);
        Ok(Inverted::matrix(
            finite(inverse)?,
            stored as f64 + haar_multiplications(known.live.len()),
            format!(
                "{:.1} elements a cell; |T M - I| {:.3} a cell",
                stored as f64 / live.len() as f64,
                off.norm() / (off.nrows() as f64).sqrt()
            ),
        ))
    }
}

/// Multiplications of a transform to Haar and one back: each merges twice as many values
/// as it has merges, by a rotation of four multiplications.
pub(super) fn haar_multiplications(cells: usize) -> f64 {
    8.0 * (cells as f64 - 1.0)
}

/// `T` with the mean of its diagonal for cells that are not live, so that it can be
/// inverted.
fn filled(known: &KnownTransport<'_>, live: &LiveTransport) -> DMatrix<f64> {
    let mean = live.transport.trace() / live.len() as f64;
    let mut transport = live.whole(&live.transport);
    for cell in (0..known.live.len()).filter(|cell| !known.live[*cell]) {
        transport[(cell, cell)] = mean;
    }
    transport
}

/// Rows of each column's pattern, ascending: the diagonal, and the largest elements of
/// all columns together.
fn patterns(transformed: &DMatrix<f64>, entries: usize) -> Vec<Vec<usize>> {
    let n = transformed.nrows();
    let off_diagonal = |place: &usize| place % n != place / n;
    let mut places: Vec<usize> = (0..n * n).filter(off_diagonal).collect();
    let value = |place: usize| transformed.as_slice()[place].abs();
    places.sort_by(|a, b| value(*b).total_cmp(&value(*a)).then(a.cmp(b)));
    places.truncate(entries * n);
    let mut patterns: Vec<Vec<usize>> = (0..n).map(|cell| vec![cell]).collect();
    for place in places.into_iter().filter(|place| value(*place) > 0.0) {
        patterns[place / n].push(place % n);
    }
    for pattern in &mut patterns {
        pattern.sort_unstable();
    }
    patterns
}

/// Column `j` minimises `||T^ m - e_j||` over the `m` with pattern `j`, by normal
/// equations; what they lose in digits a few elements a column do not need.
fn fitted(transformed: &DMatrix<f64>, patterns: &[Vec<usize>]) -> Result<DMatrix<f64>, Unfit> {
    let gram = transformed.tr_mul(transformed);
    let mut sparse = DMatrix::zeros(gram.nrows(), gram.ncols());
    for (j, pattern) in patterns.iter().enumerate() {
        let part = gram.select_rows(pattern).select_columns(pattern);
        let right = DVector::from_fn(pattern.len(), |k, _| transformed[(j, pattern[k])]);
        let factor = part.cholesky().ok_or(Unfit::Singular)?;
        for (row, value) in pattern.iter().zip(factor.solve(&right).iter()) {
            sparse[(*row, j)] = *value;
        }
    }
    Ok(sparse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;

    #[test]
    fn a_full_pattern_is_the_inverse() {
        let before = KnownScene::textured(4, 8);
        assert!(before.error(&WaveletInverse { entries: 31 }) < 1e-9);
    }

    #[test]
    fn more_elements_bring_it_nearer() {
        let before = KnownScene::panels(7, 9);
        let errors = [0, 4, 16, 62].map(|entries| before.error(&WaveletInverse { entries }));
        assert!(
            errors.windows(2).all(|pair| pair[1] < pair[0]),
            "{errors:?}"
        );
    }

    /// In Haar a sphere's transport is diagonal: only the constant image differs.
    #[test]
    fn a_spheres_transport_needs_the_diagonal_alone() {
        let before = KnownScene::sphere(4, 8, 0.8);
        assert!(before.error(&WaveletInverse { entries: 0 }) < 1e-12);
    }
}
